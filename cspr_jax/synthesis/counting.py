"""Local search for the largest fraction of feasible cells: a smooth count whose steps sharpen.

A cell counts by the logistic function of its margin over a width; the widths shrink, so that at last the count is that
of cells with a margin above zero, up to those next to it.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from cspr_jax.synthesis.evaluations import Evaluation, Evaluator, Goal
from cspr_jax.synthesis.measures.measure import SMALLEST_FACET
from cspr_jax.synthesis.questions import Piece, Question, pieces_of
from cspr_jax.synthesis.space import Point, UnsuitableRobotError

# Widths of steps in turn, as fractions of the spread of the margins.
WIDTHS = (0.3, 0.1, 0.03, 0.01)
MAX_ITERATIONS = 12


def counted(evaluator: Evaluator, start: Point, goal: Goal, stopped: Callable[[], bool] = lambda: False) -> Evaluation:
    """The best robot that a local search for a fraction finds from a start, with its arrangement of the cables."""
    from scipy.optimize import minimize  # loads much of SciPy

    space, question = evaluator.space, evaluator.objectives[goal.objective]
    pieces = [piece for one in evaluator.requirements for piece in pieces_of(one)]
    if math.isfinite(goal.level):
        of_other = pieces_of(evaluator.objectives[goal.other])
        pieces += [dataclasses.replace(piece, offset=-goal.level) for piece in of_other]
    best = evaluator.one(start)
    for width in WIDTHS:
        if stopped():
            break
        count = _Count(evaluator, question, best.point, width)
        elements = [piece.worst(best.point) for piece in pieces]
        required = [
            {"type": "ineq", "fun": _part(count, piece, chosen, 0), "jac": _part(count, piece, chosen, 1)}
            for piece, chosen in zip(pieces, elements, strict=True)
        ]
        bounds = [(0.0, 1.0)] * len(space.names)
        at = space.fractions(best.point)
        try:
            result = minimize(
                count, at, jac=True, bounds=bounds, method="SLSQP", constraints=required,
                options={"maxiter": MAX_ITERATIONS, "ftol": 1e-9},
            )  # fmt: skip
        except UnsuitableRobotError:
            continue
        if np.isfinite(result.x).all():
            there = evaluator.one(space.point(result.x, start.arrangement))
            best = min(best, there, key=lambda one: goal.rank(evaluator, one))
    return best


def _part(count: _Count, piece: Piece, elements: np.ndarray, part: int) -> Callable[[np.ndarray], np.ndarray]:
    return lambda x: piece.at(count.point(x), elements)[part]


class _Count:
    # The negative smooth count, with its derivatives.

    def __init__(self, evaluator: Evaluator, question: Question, start: Point, width: float) -> None:
        self._evaluator, self._question, self._arrangement = evaluator, question, start.arrangement
        columns = question.measure.columns(start)
        cells = np.arange(len(columns[question.quantity]))
        self._elements = np.stack([np.full_like(cells, SMALLEST_FACET), cells], axis=1)
        spreads = {name: float(np.nanstd(columns[name].astype(float))) for name in question.measure.slacks()}
        self._widths = {name: width * (spread if spread > 0.0 else 1.0) for name, spread in spreads.items()}

    def point(self, fractions: np.ndarray) -> Point:
        """The point of fractions."""
        return self._evaluator.space.point(fractions, self._arrangement)

    def __call__(self, fractions: np.ndarray) -> tuple[float, np.ndarray]:
        self._evaluator.count += 1
        point = self.point(fractions)
        weight: Any = 1.0
        derivative: Any = np.zeros((len(self._elements), len(fractions)))
        for name, width in self._widths.items():
            values, derivatives = self._question.measure.at(point, name, self._elements)
            scaled = np.nan_to_num(values / width, nan=-1e3, posinf=1e3, neginf=-1e3)
            step = 1.0 / (1.0 + np.exp(-np.clip(scaled, -500.0, 500.0)))
            # The product over all margins of a cell, by the rule of products.
            derivative = (
                derivative * step[:, None] + np.reshape(weight * step * (1.0 - step) / width, (-1, 1)) * derivatives
            )
            weight = weight * step
        return -float(np.mean(weight)), -np.mean(derivative, axis=0)
