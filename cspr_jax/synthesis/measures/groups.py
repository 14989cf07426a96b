"""Measures of robots that are set anew between tasks: each task sees the setting of its group of tasks."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cspr_jax.config.keys.parameter import ParameterTable
from cspr_jax.config.robot import RobotFile
from cspr_jax.numerics.shapes import Float, Int
from cspr_jax.synthesis.measures.measure import Columns, Measure
from cspr_jax.synthesis.space import Point, RobotSpace


@dataclasses.dataclass(frozen=True)
class GroupedSpace(RobotSpace):
    """Robots with settings: some variables have a value for each group of tasks.

    Fields:
        base: robots with one setting.
        groups: names of the tasks of each group, in their order.
        columns: for each group, which of the variables are its variables of `base`, in their order.
    """

    base: RobotSpace
    groups: tuple[tuple[str, ...], ...]
    columns: tuple[tuple[int, ...], ...]

    def robot_at(self, point: Point) -> RobotFile:
        """The robot as it is set for the first group; see `RobotSpace.robot_at`."""
        return self.base.robot_at(self.of_group(point, 0))

    def of_group(self, point: Point, group: int) -> Point:
        """The point of one group's robot."""
        return Point(tuple(point.values[i] for i in self.columns[group]), point.arrangement)


def grouped(base: RobotSpace, changing: Sequence[str], groups: Sequence[Sequence[str]]) -> GroupedSpace:
    """Robots of which some parameters have a value for each group."""
    variables: list[ParameterTable] = [one for one in base.variables if one.name not in changing]
    index = {one.name: i for i, one in enumerate(variables)}
    columns = []
    for group in groups:
        positions = dict(index)
        for one in base.variables:
            if one.name in changing:
                positions[one.name] = len(variables)
                label = group[0] if len(group) == 1 else f"{group[0]} to {group[-1]}"
                name = one.name if len(groups) == 1 else f"{one.name} ({label})"
                variables.append(one.model_copy(update={"name": name}))
        columns.append(tuple(positions[name] for name in base.names))
    fields = {field.name: getattr(base, field.name) for field in dataclasses.fields(base)}
    names = tuple(tuple(group) for group in groups)
    return GroupedSpace(**fields | {"variables": tuple(variables)}, base=base, groups=names, columns=tuple(columns))


class TaskPart(NamedTuple):
    """A measure of one group.

    Fields:
        name: name of the task, which words begin with; empty: it is the same for all.
        measure: measure of robots with one setting.
        group: number of the group.
    """

    name: str
    measure: Measure
    group: int


class GroupMeasure(Measure):
    """Columns of measures of several groups, one after the other."""

    def __init__(self, space: GroupedSpace, parts: Sequence[TaskPart]) -> None:
        """Take the measures."""
        super().__init__(space)
        self._grouped, self._parts = space, tuple(parts)
        self.is_exact = all(part.measure.is_exact for part in parts)

    def check(self, quantity: str) -> None:
        """Refuse a quantity that a part does not have; see `Measure.check`."""
        for part in self._parts:
            part.measure.check(quantity)

    def slacks(self) -> tuple[str, ...]:
        """Margins that all parts have; see `Measure.slacks`."""
        return tuple(dict.fromkeys(name for part in self._parts for name in part.measure.slacks()))

    def jumps(self, quantity: str) -> bool:
        """Tell whether a part jumps; see `Measure.jumps`."""
        return any(part.measure.jumps(quantity) for part in self._parts)

    def _columns(self, point: Point) -> Columns:
        return _joined([part.measure.columns(self._grouped.of_group(point, part.group)) for part in self._parts])

    def sides(self, point: Point) -> Int[np.ndarray, "n"]:
        """Sides of the cells of all parts; see `Measure.sides`."""
        return np.concatenate([part.measure.sides(self._grouped.of_group(point, part.group)) for part in self._parts])

    def many(self, points: Sequence[Point]) -> list[Columns | None]:
        """Columns of many robots; see `Measure.many`."""
        results = [part.measure.many([self._grouped.of_group(p, part.group) for p in points]) for part in self._parts]
        joined = list[Columns | None]()
        for columns in zip(*results, strict=True):
            present = [one for one in columns if one is not None]
            joined.append(_joined(present) if len(present) == len(columns) else None)
        return joined

    def _offsets(self, point: Point) -> list[int]:
        columns = [part.measure.columns(self._grouped.of_group(point, part.group)) for part in self._parts]
        return [0, *np.cumsum([len(next(iter(one.values()))) for one in columns]).tolist()]

    def elements(self, point: Point, quantity: str, cells: Int[np.ndarray, "m"]) -> Int[np.ndarray, "n 2"]:
        """Elements of the parts, with cells counted on; see `Measure.elements`."""
        offsets, pieces = self._offsets(point), []
        for k, part in enumerate(self._parts):
            inside = cells[(cells >= offsets[k]) & (cells < offsets[k + 1])] - offsets[k]
            there = self._grouped.of_group(point, part.group)
            if len(inside) and quantity in part.measure.columns(there):
                pieces.append(part.measure.elements(there, quantity, inside) + np.array([0, offsets[k]]))
        return np.concatenate(pieces) if pieces else np.zeros((0, 2), int)

    def at(
        self, point: Point, quantity: str, elements: Int[np.ndarray, "m 2"]
    ) -> tuple[Float[np.ndarray, "m"], Float[np.ndarray, "m k"]]:
        """Values of elements and derivatives by the variables of all groups; see `Measure.at`."""
        offsets = self._offsets(point)
        values = np.zeros(len(elements))
        derivatives = np.zeros((len(elements), len(self.space.names)))
        for k, part in enumerate(self._parts):
            rows = np.flatnonzero((elements[:, 1] >= offsets[k]) & (elements[:, 1] < offsets[k + 1]))
            if len(rows):
                there = self._grouped.of_group(point, part.group)
                if quantity not in part.measure.columns(there):
                    values[rows] = np.inf
                    continue
                numbers, by_variables = part.measure.at(there, quantity, elements[rows] - np.array([0, offsets[k]]))
                values[rows] = numbers
                derivatives[np.ix_(rows, np.array(self._grouped.columns[part.group], int))] = by_variables
        return values, derivatives

    def words(self, point: Point, quantity: str, element: Int[np.ndarray, "2"]) -> str:
        """The task, and the words of its part; see `Measure.words`."""
        offsets = self._offsets(point)
        k = int(np.searchsorted(offsets, element[1], side="right")) - 1
        part = self._parts[k]
        there = self._grouped.of_group(point, part.group)
        words = part.measure.words(there, quantity, element - np.array([0, offsets[k]]))
        return f"of {part.name} {words}".rstrip() if part.name else words


def _joined(columns: Sequence[Columns]) -> Columns:
    # A margin that a part does not have holds nothing back there.
    names = dict.fromkeys(name for one in columns for name in one)
    counts = [len(next(iter(one.values()))) for one in columns]
    return {
        name: np.concatenate(
            [one.get(name, np.full(count, np.inf)) for one, count in zip(columns, counts, strict=True)]
        )
        for name in names
    }
