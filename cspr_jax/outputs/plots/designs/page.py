"""Page of a design: its picture, its robots, what holds their parameters, and derivatives, in one file."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from importlib.resources import files

from cspr_jax import __version__
from cspr_jax.outputs.designs.report import design_lines, number, question_words, state_words, unit_of
from cspr_jax.schema.quantities import ARRANGEMENT
from cspr_jax.synthesis.results import DesignSearch

_STYLE = (
    "table.numbers { border-collapse: collapse; margin: 0 0 1.4rem; font-variant-numeric: tabular-nums; }"
    "table.numbers :is(th, td) { padding: 0.2rem 0.7rem; border-bottom: 1px solid var(--line); text-align: right; }"
    "table.numbers :is(th, td):first-child { text-align: left; } .wide { overflow-x: auto; }"
    "figure { margin: 0; background: #ffffff; } figure svg { width: 100%; height: auto; max-width: 1000px; }"
    "main { display: block; max-width: 1100px; }"
)


def design_page(search: DesignSearch, picture: str) -> str:
    """HTML text of the page, with the text of the picture's SVG."""
    name = search.evaluator.space.robot_file.full.name
    goals = " and ".join(question_words(search, one) for one in search.evaluator.objectives)
    title = html.escape(f"{name}: {goals}")
    css = (files("cspr_jax.outputs.plots.pages") / "page.css").read_text("utf-8")
    lines = "".join(f"<li>{html.escape(line)}</li>" for line in design_lines(search))
    parts = [
        f"<ul>{lines}</ul>",
        f"<figure>{picture[picture.index('<svg') :]}</figure>",
        "<h2>Robots</h2>",
        _table(*_robots(search)),
        "<h2>Derivatives at the first robot</h2>",
        "<p>Change of each number with a unit of each parameter; of feasible, that of its smallest margin.</p>",
        _table(*_derivatives(search)),
    ]
    if search.settings:
        parts += ["<h2>Settings for tasks</h2>", _table(*_settings(search))]
    if any(robot.sensitivities.holdings for robot in search.robots):
        parts += ["<h2>What holds the parameters</h2>", _table(*_holdings(search))]
    body = "\n".join(parts)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{title}</title>\n<style>{css}{_STYLE}</style>\n</head>\n<body>\n"
        f"<header><div><h1>{title}</h1></div></header>\n<main>\n{body}\n</main>\n"
        f"<footer>cspr_jax {html.escape(__version__)}, from {html.escape(search.file.name)}</footer>\n"
        "</body>\n</html>\n"
    )


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    head = "".join(f"<th>{html.escape(word)}</th>" for word in heads)
    body = "".join("<tr>" + "".join(f"<td>{html.escape(word)}</td>" for word in row) + "</tr>\n" for row in rows)
    return f'<div class="wide"><table class="numbers"><tr>{head}</tr>\n{body}</table></div>'


def _with_unit(name: str, unit: str) -> str:
    return name if unit in ("", "1") else f"{name} ({unit})"


def _robots(search: DesignSearch) -> tuple[list[str], list[list[str]]]:
    space = search.evaluator.space
    has_arrangements = len(space.arrangements) > 1
    heads = ["robot", *(_with_unit(one.name, one.unit) for one in space.variables)]
    heads += [ARRANGEMENT] if has_arrangements else []
    heads += [_with_unit(one.name, unit_of(search, one)) for one in search.questions]
    rows = []
    for robot in search.robots:
        words = [robot.name, *map(number, robot.parameters.values())]
        words += [str(robot.arrangement)] if has_arrangements else []
        rows.append([*words, *map(number, robot.values), state_words(robot)])
    return [*heads, "requirements"], rows


def _derivatives(search: DesignSearch) -> tuple[list[str], list[list[str]]]:
    heads = ["number", *(one.name for one in search.evaluator.space.variables)]
    derivatives = search.best.sensitivities.derivatives
    rows = [
        [_with_unit(question.name, unit_of(search, question)), *("jumps" if math.isnan(x) else number(x) for x in row)]
        for question, row in zip(search.questions, derivatives.tolist(), strict=True)
    ]
    return heads, rows


def _settings(search: DesignSearch) -> tuple[list[str], list[list[str]]]:
    goal = search.questions[0]
    heads = ["setting", "tasks", *search.settings[0].parameters, _with_unit(goal.name, unit_of(search, goal))]
    rows = [
        [one.name, " and ".join(one.tasks), *map(number, one.parameters.values()), number(one.value)]
        for one in (*search.settings, *search.alone)
    ]
    return heads, rows


def _holdings(search: DesignSearch) -> tuple[list[str], list[list[str]]]:
    goal = search.evaluator.objectives[0].name
    rows = [
        [robot.name, one.parameter, one.by, number(one.price)]
        for robot in search.robots
        for one in robot.sensitivities.holdings
    ]
    return ["robot", "parameter", "is held by", f"change of {goal} per unit"], rows
