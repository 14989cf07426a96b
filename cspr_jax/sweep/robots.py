"""Robots of the cells of a sweep: axes may be parameters of the robot file."""

import itertools
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from cspr_jax.config.equivalents import as_moved
from cspr_jax.config.missing_cables import without_cables
from cspr_jax.config.robot import RobotFile
from cspr_jax.config.sweep import SweepFile
from cspr_jax.errors import ConfigError, InputError, shown
from cspr_jax.schema.map_kinds import MapKind
from cspr_jax.schema.quantities import PARAMETER


def robot_of(robot_file: RobotFile, spec: SweepFile, kind: MapKind, file: object) -> RobotFile:
    """The robot that a map moves: without the missing cables, or its equivalent point mass."""
    remaining = without_cables(robot_file, spec.without, file)
    return as_moved(remaining, [kind.patterns]) if kind.patterns else remaining


def robot_at(
    robot_file: RobotFile, spec: SweepFile, kind: MapKind, values: Mapping[str, float], file: object
) -> RobotFile:
    """The robot that a map moves where parameters of its file have other values."""
    try:
        return robot_of(robot_file.full.with_parameters(values), spec, kind, file)
    except InputError as error:
        raise ConfigError(file, f"axes.{PARAMETER}{str(error).removeprefix('parameters.')}") from error


def parameter_axes(axes: Mapping[str, Any]) -> list[str]:
    """Names of the axes that are parameters."""
    return [name for name in axes if name.startswith(PARAMETER)]


def check_robots(
    robot_file: RobotFile, spec: SweepFile, kind: MapKind, axes: Mapping[str, np.ndarray], path: Path
) -> None:
    """Refuse axes of parameters that the robot does not have, or that give no robot at their ends."""
    names = parameter_axes(axes)
    for name in names:
        parameter = name.removeprefix(PARAMETER)
        if parameter in (spec.parameters or {}):
            value = shown((spec.parameters or {})[parameter])
            raise ConfigError(path, f"parameters.{parameter} = {value}: must be absent beside axes.{name}")
    ends = [(float(axes[name].min()), float(axes[name].max())) for name in names]
    for corner in itertools.product(*ends) if names else ():
        values = {name.removeprefix(PARAMETER): value for name, value in zip(names, corner, strict=True)}
        robot_at(robot_file, spec, kind, values, path)


class CellsOfRobots:
    """Cells of several robots: each robot has a map, which computes its cells together.

    Args:
        make: makes the map of a robot, from values of the parameters.
    """

    def __init__(self, make: Callable[[dict[str, float]], Any]) -> None:
        """Begin without robots."""
        self._make = make
        self._parts: list[tuple[Any, np.ndarray]] = []

    def __call__(self, cells: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Answers of the cells of a tile."""
        names = parameter_axes(cells)
        robots, robot_of_cell = np.unique(np.stack([cells[name] for name in names]), axis=1, return_inverse=True)
        others = {name: points for name, points in cells.items() if name not in names}
        order = np.argsort(robot_of_cell, kind="stable")
        indices = np.split(order, np.cumsum(np.bincount(robot_of_cell))[:-1])
        self._parts, answers = [], []
        for values, index in zip(robots.T, indices, strict=True):
            each = {name.removeprefix(PARAMETER): float(value) for name, value in zip(names, values, strict=True)}
            cells_of_robot = self._make(each)
            answers.append(cells_of_robot({name: points[index] for name, points in others.items()}))
            self._parts.append((cells_of_robot, index))
        back = np.argsort(order, kind="stable")
        return {name: np.concatenate([answer[name] for answer in answers])[back] for name in answers[0]}

    def contradictions(self, answers: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Cells whose numbers contradict each other; see `maps.grid_map.GridMap.contradictions`."""
        errors: dict[str, np.ndarray] = {}
        count = sum(len(index) for _, index in self._parts)
        for cells_of_robot, index in self._parts:
            of_robot = {name: values[index] for name, values in answers.items()}
            for error, cells in cells_of_robot.contradictions(of_robot).items():
                errors.setdefault(error, np.zeros(count, bool))[index] = cells
        return errors

    def undecided(self, answers: dict[str, np.ndarray]) -> int | None:
        """Number of cells whose verdict is not proved; see `maps.grid_map.GridMap.undecided`."""
        return self._parts[0][0].undecided(answers)
