"""The protocol of measures: columns of numbers that a robot has, and derivatives of their elements."""

from __future__ import annotations

import abc
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from cspr_jax.errors import InputError
from cspr_jax.numerics.shapes import Float, Int
from cspr_jax.synthesis.space import AT_BOUND, Point, RobotSpace, UnsuitableRobotError

# Step of differences, as a fraction of the range of a parameter.
STEP = 1e-6
# Fraction of a number by which a step changes it only where it jumps.
JUMP = 1e-4
# Number of points whose columns are kept.
KEPT = 256
# Facet of an element that is its cell's value, whichever of its facets that is.
SMALLEST_FACET = -1
FEASIBLE, FRACTION = "feasible", "fraction"

Columns = dict[str, np.ndarray]


class Measure(abc.ABC):
    """Numbers of a robot that objectives and requirements are about: a map, a plan, the frame, the hall.

    Elements of a column, cells of a map or segments of a plan, are (facet, cell) pairs: a cell may be the smallest of
    several smooth functions, its facets, each of which has a derivative where the cell has a kink.

    Fields:
        space: robots of the design.
        is_exact: whether derivatives are exact, or differences of numbers that take no time.
    """

    is_exact = False

    def __init__(self, space: RobotSpace) -> None:
        """Keep columns of the last points."""
        self.space = space
        self.columns = lru_cache(maxsize=KEPT)(self._columns)

    @abc.abstractmethod
    def _columns(self, point: Point) -> Columns:
        """Columns (n,) of the robot of a point; UnsuitableRobotError: it has none."""

    @abc.abstractmethod
    def check(self, quantity: str) -> None:
        """Refuse a quantity that the measure does not have, by an InputError of the key "quantity"."""

    def check_at(self, point: Point) -> None:
        """Refuse a point at which the file's own parameters leave no valid keys, by a ConfigError."""
        del point

    def check_proofs(self) -> None:
        """Refuse to prove full cells of what has none, by an InputError of the key "prove"."""
        raise InputError("prove", True, "absent: it is no map of a workspace")

    @abc.abstractmethod
    def slacks(self) -> tuple[str, ...]:
        """Columns that are not negative where the robot is feasible."""

    @abc.abstractmethod
    def jumps(self, quantity: str) -> bool:
        """Tell whether a quantity has no derivative, such as a number of arcs."""

    def sides(self, point: Point) -> Int[np.ndarray, "n"]:
        """Which side each full cell is proved to be on: 1 inside, 2 outside, 0 open; none without cells."""
        del point
        return np.zeros(0, int)

    def words(self, point: Point, quantity: str, element: Int[np.ndarray, "2"]) -> str:
        """Words that follow the name of a quantity: which element it is, and what decides it."""
        del point, quantity, element
        return ""

    def many(self, points: Sequence[Point]) -> list[Columns | None]:
        """Columns of many robots; None for points without a robot."""
        return [self._columns_or_none(point) for point in points]

    def _columns_or_none(self, point: Point) -> Columns | None:
        try:
            return self.columns(point)
        except UnsuitableRobotError:
            return None

    def elements(self, point: Point, quantity: str, cells: Int[np.ndarray, "m"]) -> Int[np.ndarray, "n 2"]:
        """Elements (facet, cell) of some cells."""
        del point, quantity
        return np.stack([np.full_like(cells, SMALLEST_FACET), cells], axis=1)

    def at(
        self, point: Point, quantity: str, elements: Int[np.ndarray, "m 2"]
    ) -> tuple[Float[np.ndarray, "m"], Float[np.ndarray, "m k"]]:
        """Values of elements, and derivatives by fractions of the ranges of the parameters: here by differences.

        Raises:
            UnsuitableRobotError: the robot has none.
        """
        cells = elements[:, 1]
        values = self.columns(point)[quantity][cells].astype(float)
        fractions = self.space.fractions(point)
        derivatives = np.zeros((len(cells), len(fractions)))

        def changes(i: int, step: float) -> np.ndarray:
            there = self.space.point(fractions + step * (np.arange(len(fractions)) == i), point.arrangement)
            with np.errstate(invalid="ignore"):  # margins without limits are infinite at both
                return self.columns(there)[quantity][cells] - values

        for i, fraction in enumerate(fractions):
            step = STEP if fraction < 0.5 else -STEP
            change = changes(i, step)
            derivatives[:, i] = change / step
            is_jump = np.abs(change) > JUMP * (np.abs(values) + 1e-300)
            back = -np.sign(step) * min(STEP, fraction if step > 0.0 else 1.0 - fraction)
            if is_jump.any() and abs(back) > AT_BOUND:
                other = changes(i, back)  # where another motion is chosen on one side, the other side counts
                derivatives[:, i] = np.where(is_jump & (np.abs(other) < np.abs(change)), other / back, change / step)
        return values, np.nan_to_num(derivatives, posinf=0.0, neginf=0.0)
