"""Robots among which a design searches: values of parameters, and an arrangement of the cables, give a robot."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cspr_jax.config.arrangements import Invariants, arrangement_points
from cspr_jax.config.design import DesignFile
from cspr_jax.config.keys.parameter import ParameterTable
from cspr_jax.config.parameters import moved
from cspr_jax.config.robot import RobotFile, resolve_robot
from cspr_jax.errors import ConfigError, InputError, demand, shown
from cspr_jax.errors.suggestions import did_you_mean
from cspr_jax.numerics.shapes import Float
from cspr_jax.schema.quantities import ARRANGEMENT

# Fraction of the bounds within which a value counts as its bound.
AT_BOUND = 1e-9


class UnsuitableRobotError(Exception):
    """Values of parameters give no robot, or one of which a question has no answer."""


class Point(NamedTuple):
    """Values of the variables, which give a robot.

    Fields:
        values: (k,) values of the parameters.
        arrangement: number of the arrangement of the cables.
    """

    values: tuple[float, ...]
    arrangement: int = 0


@dataclasses.dataclass(frozen=True)
class RobotSpace:
    """Robots among which a design searches.

    Fields:
        file: path of the design file.
        robot_file: robot at the values of its file.
        tables: "maps" and "plans": their keys by name.
        variables: parameters that are searched for.
        of_file: parameters of the design file, which move numbers of the tables.
        arrangements: arrangements of the cables; (0,) without others.
    """

    file: Path
    robot_file: RobotFile
    tables: Mapping[str, Mapping[str, Any]]
    variables: tuple[ParameterTable, ...]
    of_file: tuple[ParameterTable, ...]
    arrangements: tuple[int, ...]

    @property
    def names(self) -> list[str]:
        """Names of the variables."""
        return [variable.name for variable in self.variables]

    @cached_property
    def lower(self) -> Float[np.ndarray, "k"]:
        """Smallest values."""
        return np.array([variable.lower for variable in self.variables])

    @cached_property
    def upper(self) -> Float[np.ndarray, "k"]:
        """Largest values."""
        return np.array([variable.upper for variable in self.variables])

    @property
    def first(self) -> Point:
        """The point of the robot file."""
        return Point(tuple(variable.value for variable in self.variables), self.arrangements[0])

    @cached_property
    def of_robot(self) -> list[str]:
        """Names of the variables that are parameters of the robot file."""
        of_file = {table.name for table in self.of_file}
        return [name for name in self.names if name not in of_file]

    def parameters(self, point: Point) -> dict[str, float]:
        """Values of the parameters at a point, by name."""
        return dict(zip(self.names, point.values, strict=True))

    def point(self, fractions: Float[np.ndarray, "k"], arrangement: int) -> Point:
        """The point at fractions of the ranges of the parameters."""
        inside = np.clip(fractions, 0.0, 1.0)
        inside = np.where(inside < AT_BOUND, 0.0, np.where(inside > 1.0 - AT_BOUND, 1.0, inside))
        values = self.lower + inside * (self.upper - self.lower)
        return Point(tuple(np.clip(values, self.lower, self.upper).tolist()), arrangement)

    def fractions(self, point: Point) -> Float[np.ndarray, "k"]:
        """Values of a point as fractions of their ranges."""
        return (np.array(point.values) - self.lower) / (self.upper - self.lower)

    def robot_at(self, point: Point) -> RobotFile:
        """The robot of a point.

        Raises:
            UnsuitableRobotError: there is none.
        """
        values = {name: value for name, value in self.parameters(point).items() if name in self.of_robot}
        if point.arrangement:
            values[ARRANGEMENT] = point.arrangement
        try:
            return self.robot_file.full.with_parameters(values)
        except InputError as error:
            raise UnsuitableRobotError(str(error)) from error

    def moves(self, table: str, name: str, key: str = "") -> bool:
        """Tell whether variables move numbers of a map or plan, or of one of its keys."""
        start = f"{table}.{name}.{key}"
        return any(target.startswith(start) for one in self.of_file for target in one.moves if one.name in self.names)

    def table_at(self, point: Point, table: str, name: str) -> dict[str, Any]:
        """Keys of a map or plan at a point."""
        of_file = {one.name for one in self.of_file}
        values = {key: value for key, value in self.parameters(point).items() if key in of_file}
        there = moved(self.of_file, self.tables, values) if values else None
        return dict((self.tables if there is None else there[0])[table][name])


def space_of(design: DesignFile, content: Mapping[str, Any], file: Path) -> RobotSpace:
    """The robots of a design file.

    Raises:
        ConfigError: no parameters, unknown ones, or one name twice.
    """
    robot_file = resolve_robot(design.robot, file, file.parent)
    of_robot, of_file = list(robot_file.full.parameter or []), list(design.parameter or [])
    for i, one in enumerate(of_file):
        if one.name in [table.name for table in of_robot]:
            raise ConfigError(
                file, f"parameter[{i}].name = {one.name}: must be a name that the robot file does not have"
            )
    tables = {one.name: one for one in (*of_robot, *of_file)}
    names = list(tables) if design.parameters is None else design.parameters
    for i, name in enumerate(names):
        if name not in tables:
            hint = did_you_mean(name, tables)
            allowed = f"{hint}one of {', '.join(tables)}" if tables else "absent: there is no [[parameter]]"
            raise ConfigError(file, f"parameters[{i}] = {shown(name)}: {demand(allowed)}")
        if name in names[:i]:
            raise ConfigError(file, f"parameters[{i}] = {shown(name)}: must be named once")
    arrangements: tuple[int, ...] = (0,)
    if design.arrangements is not None:
        try:
            points = arrangement_points(robot_file.full, design.arrangements, Invariants(points=not names))
        except InputError as error:
            raise ConfigError(file, str(error).replace(ARRANGEMENT, "arrangements", 1)) from error
        arrangements = tuple(int(number) for number in points)
    if not names and len(arrangements) == 1:
        raise ConfigError(file, "parameters: there are none: must be [[parameter]] in the robot file, or arrangements")
    numbers = {table: content[table] for table in ("maps", "plans")}
    return RobotSpace(file, robot_file, numbers, tuple(tables[name] for name in names), tuple(of_file), arrangements)
