"""Objectives and requirements: a column of a measure, reduced to one number that is to be large, small or bounded."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping

import numpy as np

from cspr_jax.config.design import QuantityKeys
from cspr_jax.numerics.shapes import Float, Int
from cspr_jax.synthesis.measures.measure import FEASIBLE, FRACTION, SMALLEST_FACET, Columns, Measure
from cspr_jax.synthesis.space import Point

_REDUCTIONS: dict[str, Callable[[np.ndarray], float]] = {
    "smallest": lambda values: float(np.min(values)),
    "largest": lambda values: float(np.max(values)),
    "mean": lambda values: float(np.mean(values)),
    "sum": lambda values: float(np.sum(values)),
}
# Largest number of cells whose elements enter a local search.
CELLS = 40
# Fraction by which a bound may be missed by rounding.
ROUNDING = 1e-9


def usual_reduction(of_plan: bool, quantity: str) -> str:
    """How the values of cells or segments become one, where a file does not say."""
    if quantity == FRACTION or quantity.endswith("_fraction"):
        return "mean"
    if quantity in ("duration", "arcs") and of_plan:
        return "sum"
    parts = quantity.split("_")
    is_lower = "margin" in parts or parts[-1] in ("min", "bound") or quantity in (FEASIBLE, "clearance", "tolerated")
    return "smallest" if is_lower else "largest"


@dataclasses.dataclass(frozen=True)
class Question:
    """A number of a robot, and which values of it are good.

    Fields:
        key: the key of its table in the design file, such as "requirement[0]".
        measure: the measure.
        of: name of the measure.
        quantity: column.
        reduction: how its values become one.
        low: smallest value that is allowed.
        high: largest value that is allowed.
        sense: 1 where larger values are better, -1 where smaller ones are, 0 of requirements.
        prove: whether full cells are to be proved.
        reserves: by how much margins stay above what is required, by columns, so that proofs succeed.
    """

    key: str
    measure: Measure
    of: str
    quantity: str
    reduction: str
    low: float = -math.inf
    high: float = math.inf
    sense: int = 0
    prove: bool = False
    reserves: Mapping[str, float] = dataclasses.field(default_factory=dict)

    @property
    def name(self) -> str:
        """Name of the number, for people and columns."""
        return f"{self.of}.{self.quantity}"

    def value(self, columns: Columns) -> float:
        """The number of a robot."""
        return _REDUCTIONS[self.reduction](columns[self.quantity].astype(float))

    def miss(self, value: float, columns: Columns) -> float:
        """By how much a value misses the bounds, as a fraction of the bound, or of the cells that are not feasible."""
        missed = max(self.low - value, value - self.high, 0.0)
        magnitude = max((abs(x) for x in (self.low, self.high) if math.isfinite(x)), default=1.0) or 1.0
        if missed > ROUNDING * magnitude:
            return 1.0 - float(np.mean(columns[FEASIBLE])) if self.quantity == FEASIBLE else missed / magnitude
        short = [1.0 - float(np.nanmin(columns[name])) / reserve for name, reserve in self.reserves.items()]
        return max((x for x in short if x > ROUNDING), default=0.0)

    def with_reserve(self, fraction: float, columns: Columns) -> Question:
        """The question with a fraction of the largest margins of a robot kept in reserve."""
        largest = {}
        for name in self.measure.slacks():
            margins = np.abs(columns[name].astype(float))
            largest[name] = float(np.max(margins[np.isfinite(margins)], initial=0.0))
        reserves = {name: fraction * magnitude for name, magnitude in largest.items() if magnitude > 0.0}
        return dataclasses.replace(self, reserves=reserves)

    @property
    def is_smooth(self) -> bool:
        """Tell whether the number, or what decides it, has derivatives; of a fraction that is required, margins do."""
        if self.quantity == FEASIBLE and self.reduction == "smallest":
            return bool(self.measure.slacks())
        if self.quantity == FRACTION:
            return bool(self.measure.slacks()) and self.sense == 0 and self.low > 0.0
        return not self.measure.jumps(self.quantity)


@dataclasses.dataclass(frozen=True)
class Piece:
    """Smooth functions, all of which must not be negative, or the smallest of which is to be large.

    Fields:
        question: its question.
        quantity: column that they are elements of.
        sign: 1 for values as they are, -1 for their negatives.
        offset: what is added to them.
        is_one: whether the mean or the sum of all elements is one function.
    """

    question: Question
    quantity: str
    sign: float
    offset: float
    is_one: bool

    def worst(self, point: Point) -> Int[np.ndarray, "n 2"]:
        """Elements that are, or may become, the smallest ones."""
        measure = self.question.measure
        values = self.sign * measure.columns(point)[self.quantity].astype(float)
        values = np.where(np.isnan(values), -np.inf, values)
        order = np.argsort(values, kind="stable")
        if self.is_one:
            return np.stack([np.full_like(order, SMALLEST_FACET), np.arange(len(order))], axis=1)
        if {"smallest": -1.0, "largest": 1.0}.get(self.question.reduction) == self.sign:  # the best one decides
            return np.array([[SMALLEST_FACET, order[-1]]])
        missing = self._left_out(len(values))
        return measure.elements(point, self.quantity, order[missing : missing + CELLS])

    def _left_out(self, count: int) -> int:
        # Number of the worst cells that may be lost: those beyond a required fraction.
        question = self.question
        if question.quantity != FRACTION:
            return 0
        return max(math.floor(count * (1.0 - question.low) + ROUNDING), 0)

    def at(
        self, point: Point, elements: Int[np.ndarray, "n 2"]
    ) -> tuple[Float[np.ndarray, "m"], Float[np.ndarray, "m k"]]:
        """Values of elements and their derivatives by fractions of the ranges of the parameters."""
        values, derivatives = self.question.measure.at(point, self.quantity, elements)
        if self.is_one:
            total = len(values) if self.question.reduction == "mean" else 1
            values, derivatives = values.sum(keepdims=True) / total, derivatives.sum(0, keepdims=True) / total
        return self.sign * values + self.offset, self.sign * derivatives


def pieces_of(question: Question) -> list[Piece]:
    """Smooth functions that decide an objective (the smallest is to be large) or a requirement (none is negative)."""
    if not question.is_smooth:
        return []
    if question.quantity in (FEASIBLE, FRACTION):
        reserves = question.reserves
        return [
            Piece(question, name, 1.0, -reserves.get(name, 0.0), is_one=False) for name in question.measure.slacks()
        ]
    is_one = question.reduction in ("mean", "sum")
    if question.sense:
        return [Piece(question, question.quantity, float(question.sense), 0.0, is_one)]
    pieces = []
    if math.isfinite(question.low):
        pieces.append(Piece(question, question.quantity, 1.0, -question.low, is_one))
    if math.isfinite(question.high):
        pieces.append(Piece(question, question.quantity, -1.0, question.high, is_one))
    return pieces


def question_of(table: QuantityKeys, key: str, measure: Measure, *, of_plan: bool) -> Question:
    """The question of a table of a design file."""
    low, high = getattr(table, "bounds", (-math.inf, math.inf))
    sense = {"largest": 1, "smallest": -1}.get(getattr(table, "goal", ""), 0)
    reduction = table.reduce or usual_reduction(of_plan, table.quantity)
    prove = bool(getattr(table, "prove", False))
    return Question(key, measure, table.of, table.quantity, reduction, low, high, sense, prove)
