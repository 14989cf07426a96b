"""Files of a design in its directory: robots, and all numbers as JSON."""

from __future__ import annotations

import json
from pathlib import Path

from cspr_jax import __version__
from cspr_jax.config.formats.writing import robot_text
from cspr_jax.errors import printable
from cspr_jax.outputs.designs.report import design_object, number, question_words, state_words, unit_of
from cspr_jax.store.files.disk import Disk
from cspr_jax.store.files.publishing import publish
from cspr_jax.synthesis.results import DesignedRobot, DesignSearch

NUMBERS = "design.json"


def write_design(search: DesignSearch, directory: Path) -> list[Path]:
    """Write the robots and the numbers of a design; robots of an earlier state of it are removed."""
    disk = Disk()
    paths = [directory / f"{robot.name}.toml" for robot in search.robots]
    for old in sorted([*directory.glob("front_*.toml"), *directory.glob("best.toml")]):
        if old not in paths:
            disk.unlink(old)
    for robot, path in zip(search.robots, paths, strict=True):
        publish(disk, path, designed_text(search, robot).encode())
    numbers = directory / NUMBERS
    publish(disk, numbers, (json.dumps(design_object(search), indent=1, allow_nan=False) + "\n").encode())
    return [*paths, numbers]


def designed_text(search: DesignSearch, robot: DesignedRobot) -> str:
    """Text of a designed robot's file, with its numbers in comments."""
    head = [f"designed by cspr_jax {__version__} from {search.file.name}: requirements {state_words(robot)}"]
    head += [
        f"{question_words(search, question)}: {number(value)} {unit_of(search, question)}".rstrip()
        for question, value in zip(search.questions, robot.values, strict=True)
    ]
    head += [f"{one.parameter} is held by {one.by}" for one in robot.sensitivities.holdings]
    spec = robot.robot_file.model_dump(mode="json", exclude_none=True)
    return "".join(f"# {printable(line)}\n" for line in head) + robot_text(spec)
