"""A design from its file to its robots, in a directory in which it is resumed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from cspr_jax import __version__
from cspr_jax.config.design import DesignFile
from cspr_jax.config.robot import RobotFile
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.schema.identity import digest
from cspr_jax.synthesis.evaluations import Evaluator
from cspr_jax.synthesis.problem import DesignProblem
from cspr_jax.synthesis.reconfiguration import Division, reconfigured
from cspr_jax.synthesis.record import opened
from cspr_jax.synthesis.results import DesignedRobot, DesignSearch, Setting
from cspr_jax.synthesis.search import Chosen, Progress, searched
from cspr_jax.synthesis.sensitivities import sensitivities_of

# Version of what is searched, and how: results of another one are not mixed.
METHOD = 1
# Largest number of characters of a robot's name.
LONGEST_NAME = 200


def run_design(
    design: DesignFile,
    content: Mapping[str, Any],
    file: Path,
    directory: Path,
    progress: Progress,
    write: Callable[[DesignSearch], None],
) -> DesignSearch:
    """Search, from what an earlier process left in the directory on, and write what was found there."""
    with double_precision():
        problem = DesignProblem(design, content, file)
        with opened(directory, identity_of(content, problem), file) as record:

            def prepare(evaluator: Evaluator, groups: str = "") -> None:
                count = record.take_up(evaluator, groups, progress.stopped)
                if count:
                    progress.tell(f"{count} evaluations of an earlier run are taken up")

            result = _searched(problem, progress, prepare)
            write(result)
    return result


def identity_of(content: Mapping[str, Any], problem: DesignProblem) -> str:
    """Hash of all that determines what a design finds."""
    robot = problem.space.robot_file.full.model_dump(mode="json", exclude_none=True)
    plain = {key: value for key, value in content.items() if key not in ("robot", "files")}
    return digest({"method": METHOD, "version": __version__, "robot": robot, "design": plain})


def _searched(problem: DesignProblem, progress: Progress, prepare: Callable[..., None]) -> DesignSearch:
    if problem.design.reconfigure is not None:
        return _reconfigured(problem, progress, prepare)
    evaluator = problem.evaluator()
    prepare(evaluator)
    chosen = searched(evaluator, problem.design.search, progress)
    names = ["best"] if len(chosen) == 1 else [f"front_{i + 1}" for i in range(len(chosen))]
    robots = tuple(designed(evaluator, one, name) for one, name in zip(chosen, names, strict=True))
    return DesignSearch(problem.file, problem.design, evaluator, robots, not progress.stopped())


def _reconfigured(problem: DesignProblem, progress: Progress, prepare: Callable[..., None]) -> DesignSearch:
    best, alone = reconfigured(problem, progress, prepare)
    robots = (designed(best.evaluator, best.chosen, "best"),)
    settings = _settings(best, [f"setting_{k + 1}" for k in range(len(best.space.groups))])
    tasks = [one for division in alone for one in _settings(division, [f"alone_{division.space.groups[0][0]}"])]
    return DesignSearch(
        problem.file, problem.design, best.evaluator, robots, not progress.stopped(), tuple(settings), tuple(tasks)
    )


def _settings(division: Division, names: list[str]) -> list[Setting]:
    space, evaluation = division.space, division.chosen.evaluation
    settings = []
    for k, (tasks, name) in enumerate(zip(space.groups, names, strict=True)):
        point = space.of_group(evaluation.point, k)
        robot_file = space.base.robot_at(point)
        settings.append(
            Setting(
                name,
                tasks,
                _named(robot_file, name),
                space.base.parameters(point),
                evaluation.values[0],
            )
        )
    return settings


def _named(robot_file: RobotFile, name: str) -> RobotFile:
    ending = f"-{name.replace('_', '-')}"
    return robot_file.model_copy(update={"name": robot_file.name[: LONGEST_NAME - len(ending)] + ending})


def designed(evaluator: Evaluator, chosen: Chosen, name: str) -> DesignedRobot:
    """The robot of a point, with what holds it."""
    evaluation = chosen.evaluation
    careful = evaluator.with_requirements(chosen.requirements or evaluator.requirements)
    robot_file = evaluator.space.robot_at(evaluation.point)
    return DesignedRobot(
        name=name,
        robot_file=_named(robot_file, name),
        parameters=evaluator.space.parameters(evaluation.point),
        arrangement=evaluation.point.arrangement,
        values=evaluation.values,
        missed=evaluation.missed,
        proofs=chosen.proofs,
        sensitivities=sensitivities_of(careful, evaluation.point),
        problem=evaluation.problem,
    )
