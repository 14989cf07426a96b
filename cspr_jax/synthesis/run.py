"""A design from its file to its robots, in a directory in which it is resumed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from cspr_jax import __version__
from cspr_jax.config.design import DesignFile
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.schema.identity import digest
from cspr_jax.synthesis.evaluations import Evaluator
from cspr_jax.synthesis.problem import evaluator_of
from cspr_jax.synthesis.record import opened
from cspr_jax.synthesis.results import DesignedRobot, DesignSearch, parameters_at
from cspr_jax.synthesis.search import Chosen, Progress, searched
from cspr_jax.synthesis.sensitivities import sensitivities_of

# Version of what is searched, and how: results of another one are not mixed.
METHOD = 1


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
        evaluator = evaluator_of(design, content, file)
        with opened(directory, identity_of(content, evaluator), file) as record:
            count = record.take_up(evaluator)
            if count:
                progress.tell(f"{count} evaluations of an earlier run are taken up")
            evaluator.on_new = record.add
            result = _searched(evaluator, design, file, progress)
            write(result)
    return result


def identity_of(content: Mapping[str, Any], evaluator: Evaluator) -> str:
    """Hash of all that determines what a design finds."""
    robot = evaluator.space.robot_file.full.model_dump(mode="json", exclude_none=True)
    plain = {key: value for key, value in content.items() if key not in ("robot", "files")}
    return digest({"method": METHOD, "version": __version__, "robot": robot, "design": plain})


def _searched(evaluator: Evaluator, design: DesignFile, file: Path, progress: Progress) -> DesignSearch:
    chosen = searched(evaluator, design.search, progress)
    names = ["best"] if len(chosen) == 1 else [f"front_{i + 1}" for i in range(len(chosen))]
    robots = tuple(designed(evaluator, one, name) for one, name in zip(chosen, names, strict=True))
    return DesignSearch(file, evaluator, robots, not progress.stopped())


def designed(evaluator: Evaluator, chosen: Chosen, name: str) -> DesignedRobot:
    """The robot of a point, with what holds it."""
    evaluation = chosen.evaluation
    careful = evaluator.with_requirements(chosen.requirements or evaluator.requirements)
    robot_file = evaluator.space.robot_at(evaluation.point)
    file_name = f"{robot_file.name}-{name.replace('_', '-')}"
    return DesignedRobot(
        name=name,
        robot_file=robot_file.model_copy(update={"name": file_name}),
        parameters=parameters_at(evaluator, evaluation.point),
        arrangement=evaluation.point.arrangement,
        values=evaluation.values,
        missed=evaluation.missed,
        proofs=chosen.proofs,
        sensitivities=sensitivities_of(careful, evaluation.point),
        problem=evaluation.problem,
    )
