"""A design as plain values and as a table for a terminal."""

from __future__ import annotations

import math
from typing import Any

from cspr_jax.outputs.plan_report import finite
from cspr_jax.runtime.terminal import cell
from cspr_jax.schema.plan_fields import SEGMENT
from cspr_jax.schema.quantities import ARRANGEMENT, QUANTITIES
from cspr_jax.synthesis.measures.maps import MapMeasure
from cspr_jax.synthesis.questions import Question
from cspr_jax.synthesis.results import DesignedRobot, DesignSearch, Setting

SCHEMA = 1
# Units of sizes of frames; digits in tables.
_UNITS = {"extent_x": "m", "extent_y": "m", "extent_z": "m", "volume": "m^3"}
DIGITS = 6


def unit_of(search: DesignSearch, question: Question) -> str:
    """Unit of a question's number; empty where it is a pure number or not known."""
    of_parameters = {variable.name: variable.unit for variable in search.evaluator.space.variables}
    of_maps = {name: row.units for name, row in QUANTITIES.items()}
    of_plans = {name: unit for name, (unit, _) in SEGMENT.items()}
    by_table = {"frame": _UNITS, "parameters": of_parameters, "hall": {"clearance": "m"}, "robot": {}}
    units = by_table.get(
        question.of, of_plans | of_maps if isinstance(question.measure, MapMeasure) else of_maps | of_plans
    )
    unit = units.get(question.quantity, "")
    return "" if unit == "1" else unit.replace(" s-1", "/s").replace(" s-2", "/s^2")


def design_object(search: DesignSearch) -> dict[str, Any]:
    """The design as plain values for JSON."""
    space, evaluator = search.evaluator.space, search.evaluator
    return finite(
        {
            "schema": SCHEMA,
            "design": str(search.file),
            "robot": space.robot_file.full.name,
            "complete": search.is_complete,
            "evaluations": len(search.evaluations),
            "parameters": [
                {"name": one.name, "unit": one.unit, "lower": one.lower, "upper": one.upper, "value": one.value}
                for one in space.variables
            ],
            "arrangements": len(space.arrangements),
            "objectives": [_question_object(search, one) for one in evaluator.objectives],
            "requirements": [_question_object(search, one) for one in evaluator.requirements],
            "robots": [robot_object(search, one) for one in search.robots],
            **({"settings": list(map(_setting_object, search.settings))} if search.settings else {}),
            **({"alone": list(map(_setting_object, search.alone))} if search.alone else {}),
        }
    )


def _question_object(search: DesignSearch, question: Question) -> dict[str, Any]:
    fields: dict[str, Any] = {
        "key": question.key,
        "of": question.of,
        "quantity": question.quantity,
        "reduce": question.reduction,
        "unit": unit_of(search, question) or None,
    }
    if question.sense:
        return fields | {"goal": "largest" if question.sense > 0 else "smallest"}
    return fields | {"lower": question.low, "upper": question.high, "prove": question.prove}


def _setting_object(setting: Setting) -> dict[str, Any]:
    return {
        "name": setting.name,
        "tasks": list(setting.tasks),
        "parameters": setting.parameters,
        "objective": setting.value,
    }


def robot_object(search: DesignSearch, robot: DesignedRobot) -> dict[str, Any]:
    """A robot of a design as plain values."""
    names, question_keys = search.evaluator.space.names, [question.key for question in search.questions]
    derivatives = robot.sensitivities.derivatives.tolist()
    return {
        "name": robot.name,
        "feasible": robot.is_feasible,
        "missed": robot.missed,
        "parameters": robot.parameters,
        ARRANGEMENT: robot.arrangement,
        "values": dict(zip(question_keys, robot.values, strict=True)),
        "proofs": [{"key": one.key, "cells": one.cells, "proved": one.proved} for one in robot.proofs],
        "holds": [
            {"parameter": one.parameter, "by": one.by, "price": one.price} for one in robot.sensitivities.holdings
        ],
        "unexplained": robot.sensitivities.residual,
        "derivatives": {
            key: dict(zip(names, row, strict=True)) for key, row in zip(question_keys, derivatives, strict=True)
        },
        "problem": robot.problem or None,
    }


def design_lines(search: DesignSearch) -> list[str]:
    """Results of a design, in lines for people."""
    lines = [f"{len(search.evaluations)} robots evaluated" + ("" if search.is_complete else "; stopped before its end")]
    best = search.best
    if not math.isfinite(best.missed):
        return [*lines, f"no robot has an answer to all questions: {best.problem}"]
    values = zip(search.questions, best.values, strict=True)
    without = [question.name for question, value in values if question.sense and math.isnan(value)]
    if without:
        lines.append(f"{' and '.join(without)}: no robot was found that has one; the nearest one:")
    elif best.missed > 0.0:
        lines.append("no robot meets all requirements; the one that misses them least:")
    lines += [
        f"{question_words(search, question)}: {number(value)} {unit_of(search, question)}".rstrip()
        for question, value in zip(search.questions, best.values, strict=True)
    ]
    for proof in best.proofs:
        state = "proved in all" if proof.is_whole else f"proved in {proof.proved} of"
        lines.append(f"{proof.name}: {state} {proof.cells} full cells")
    lines += held_lines(best)
    if search.settings:
        changes = len(search.settings) - 1
        lines.append(f"fewest changes between tasks: {changes}")
        lines += [f"{one.name}, for {' and '.join(one.tasks)}: {values_words(one)}" for one in search.settings]
        lines += [
            f"{one.tasks[0]} alone: {values_words(one)}, {search.questions[0].name} {number(one.value)}"
            for one in search.alone
        ]
    return lines


def held_lines(robot: DesignedRobot) -> list[str]:
    """Lines about what holds the parameters of a robot."""
    parameters: dict[str, list[str]] = {}
    for one in robot.sensitivities.holdings:
        parameters.setdefault(one.by, []).append(one.parameter)
    lines = []
    for by, (*others, last) in parameters.items():
        lines.append(f"{', '.join(others)} and {last} are held by {by}" if others else f"{last} is held by {by}")
    return lines


def question_words(search: DesignSearch, question: Question) -> str:
    """A question in words."""
    if question.sense:
        return f"{'largest' if question.sense > 0 else 'smallest'} {question.name}"
    if question.quantity == "feasible":
        return f"required {question.name}"
    bounds = [f">= {number(question.low)}"] if math.isfinite(question.low) else []
    bounds += [f"<= {number(question.high)}"] if math.isfinite(question.high) else []
    return f"required {question.name} {' and '.join(bounds)}"


def values_words(setting: Setting) -> str:
    """Values of the parameters of a setting, in words."""
    return ", ".join(f"{name} {number(value)}" for name, value in setting.parameters.items())


def number(value: float) -> str:
    """A number with as many digits as tables show."""
    return f"{value + 0.0:.{DIGITS}g}"


def design_table(search: DesignSearch) -> Any:
    """The robots of a design as a table for a terminal."""
    from rich.table import Table  # only a terminal needs it

    space = search.evaluator.space
    goals = " and ".join(question_words(search, one) for one in search.evaluator.objectives)
    title = f"{space.robot_file.full.name}: {goals}"
    table = Table(title=cell(title, style="table.title"), title_justify="left", caption_justify="left")
    table.caption = cell(*design_lines(search), style="table.caption")
    table.add_column("robot")
    for variable in space.variables:
        unit = "" if variable.unit == "1" else f" ({variable.unit})"
        table.add_column(f"{variable.name}{unit}", justify="right")
    if len(space.arrangements) > 1:
        table.add_column(ARRANGEMENT, justify="right")
    for question in search.evaluator.objectives:
        unit = unit_of(search, question)
        table.add_column(question.name + (f" ({unit})" if unit else ""), justify="right")
    table.add_column("requirements")
    for robot in search.robots:
        words = [number(value) for value in robot.parameters.values()]
        words += [str(robot.arrangement)] if len(space.arrangements) > 1 else []
        words += [number(value) for value in robot.values[: len(search.evaluator.objectives)]]
        table.add_row(robot.name, *words, state_words(robot))
    return table


def state_words(robot: DesignedRobot) -> str:
    """State of the requirements of a robot, in words."""
    if robot.is_feasible:
        return "met, proved" if robot.proofs else "met"
    return "met, not proved" if robot.missed == 0.0 else "missed"
