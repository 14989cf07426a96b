"""Files of a design in its directory: robots, and all numbers as JSON."""

from __future__ import annotations

import json
from pathlib import Path

from cspr_jax import __version__
from cspr_jax.config.formats.writing import robot_text
from cspr_jax.config.robot import RobotFile
from cspr_jax.errors import printable
from cspr_jax.outputs.designs.report import design_object, held_lines, number, question_words, state_words, unit_of
from cspr_jax.store.files.disk import Disk
from cspr_jax.store.files.publishing import publish
from cspr_jax.synthesis.results import DesignedRobot, DesignSearch, Setting

NUMBERS = "design.json"


def write_design(search: DesignSearch, directory: Path) -> list[Path]:
    """Write the robots and the numbers of a design; robots of an earlier state of it are removed."""
    disk = Disk()
    robots = () if search.settings else search.robots
    texts = {robot.name: designed_text(search, robot) for robot in robots}
    texts |= {setting.name: setting_text(search, setting) for setting in (*search.settings, *search.alone)}
    paths = [directory / f"{name}.toml" for name in texts]
    for old in sorted(directory.glob("*.toml")):
        if old not in paths:
            disk.unlink(old)
    for text, path in zip(texts.values(), paths, strict=True):
        publish(disk, path, text.encode())
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
    head += held_lines(robot)
    return _text(head, robot.robot_file)


def setting_text(search: DesignSearch, setting: Setting) -> str:
    """Text of the robot file of a setting, with its tasks in comments."""
    head = [f"designed by cspr_jax {__version__} from {search.file.name}: set for {' and '.join(setting.tasks)}"]
    return _text([*head, f"{search.questions[0].name}: {number(setting.value)}"], setting.robot_file)


def _text(head: list[str], robot_file: RobotFile) -> str:
    spec = robot_file.model_dump(mode="json", exclude_none=True)
    return "".join(f"# {printable(line)}\n" for line in head) + robot_text(spec)
