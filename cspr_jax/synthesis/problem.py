"""A design file as a problem: robots, measures, objectives and requirements."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from cspr_jax.config.design import FRAME, HALL, PARAMETERS, ROBOT, DesignFile, QuantityKeys
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.maps.grid_map import RobotsApartError
from cspr_jax.synthesis.evaluations import Evaluator
from cspr_jax.synthesis.measures.frames import FrameMeasure, HallMeasure, ParametersMeasure, RobotMeasure
from cspr_jax.synthesis.measures.maps import MapMeasure
from cspr_jax.synthesis.measures.measure import Measure
from cspr_jax.synthesis.measures.plans import PlanMeasure
from cspr_jax.synthesis.measures.workspaces import WorkspaceMeasure
from cspr_jax.synthesis.questions import Question, question_of
from cspr_jax.synthesis.space import RobotSpace, space_of


def evaluator_of(design: DesignFile, content: Mapping[str, Any], file: Path) -> Evaluator:
    """The evaluator of a checked design file.

    Raises:
        ConfigError: a mistake in the robot, a map or a plan, or a quantity that is not there.
    """
    space = space_of(design, content, file)
    tables: list[tuple[str, QuantityKeys]] = [(f"objective[{i}]", one) for i, one in enumerate(design.objective)]
    tables += [(f"requirement[{i}]", one) for i, one in enumerate(design.requirement)]
    quantities: dict[str, list[str]] = {}
    for _, one in tables:
        quantities.setdefault(one.of, []).append(one.quantity)
    questions, measures = list[Question](), dict[tuple[str, bool], Measure]()
    for key, one in tables:
        proves = bool(getattr(one, "prove", False))
        if proves and one.of not in design.maps:
            raise ConfigError(file, f"{key}.prove: must be absent: {one.of} is no map of a workspace")
        try:
            if (one.of, proves) not in measures:
                path = _file_of(design, content, one.of, file)
                measures[one.of, proves] = _measure(design, space, one.of, quantities[one.of], path, proves=proves)
            measures[one.of, proves].check(one.quantity)
        except InputError as error:
            raise ConfigError(file, f"{key}.{error}") from error
        questions.append(question_of(one, key, measures[one.of, proves], of_plan=one.of in design.plans))
    count = len(design.objective)
    return Evaluator(space, questions[:count], questions[count:])


def _measure(
    design: DesignFile, space: RobotSpace, name: str, quantities: list[str], path: Path, *, proves: bool
) -> Measure:
    if name in design.plans:
        return PlanMeasure(space, name, path)
    if name in design.maps:
        # A full cell holds its corners, so that they must be feasible, too, where full cells are to be proved.
        try:
            return WorkspaceMeasure(space, name, quantities, path, has_corners=proves)
        except RobotsApartError:
            return MapMeasure(space, name, quantities, path, has_corners=proves)
    if name == HALL and design.hall is not None:
        return HallMeasure(space, design.hall)
    of_robot: dict[str, Callable[[RobotSpace], Measure]] = {
        FRAME: FrameMeasure,
        ROBOT: RobotMeasure,
        PARAMETERS: ParametersMeasure,
    }
    return of_robot[name](space)


def _file_of(design: DesignFile, content: Mapping[str, Any], name: str, file: Path) -> Path:
    # Errors about keys of a table of the design name it.
    table = "plans" if name in design.plans else "maps"
    return Path(content["files"].get(f"{table}.{name}", f"{file}: {table}.{name}"))
