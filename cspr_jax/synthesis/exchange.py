"""Local search where numbers have derivatives: the smallest of many smooth functions is made large, exactly.

A smallest margin has kinks, where another pose, or another facet normal of it, becomes the smallest. With the level t
as a further unknown the problem is smooth: make t large while each function stays above t and each requirement holds.
Only functions that are nearly the smallest take part; those that turn out smaller at the solution join, and the problem
is solved again in a smaller box, until none joins. SciPy's sequential quadratic programming (SLSQP) solves it.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from cspr_jax.numerics.shapes import Float
from cspr_jax.synthesis.evaluations import FIRST, Evaluation, Evaluator, Goal
from cspr_jax.synthesis.questions import Piece, pieces_of
from cspr_jax.synthesis.space import Point, UnsuitableRobotError

# Half of the edge of the box about the best robot so far, as a fraction of the ranges, at first.
BOX = 0.3
MAX_FAILURES = 3


class _Effort(NamedTuple):
    # Half of the edge of the last box, number of rounds and of iterations of SLSQP in each, relative improvement below
    # which a search ends, and precision of the level that SLSQP seeks.
    smallest_box: float
    rounds: int
    iterations: int
    converged: float
    precision: float


_EXACT = _Effort(1e-7, 25, 25, 1e-9, 1e-11)
# Differences are no more accurate, jump where another motion is chosen, and do not tell kinks apart.
_BY_DIFFERENCES = _Effort(1e-3, 10, 6, 1e-6, 1e-7)
# Reserves above requirements, in units of the ranges of the parameters, in turn, while the solution only
# touches them and its verdict is no more than undecided.
RESERVES = (0.0, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5)


@dataclasses.dataclass
class _Constraint:
    # Functions of one piece, their scale, and whether they bound the level of the objective.
    piece: Piece
    elements: np.ndarray
    scale: float
    is_level: bool

    def join(self, elements: np.ndarray) -> int:
        """Take further elements; return how many are new."""
        both = np.unique(np.concatenate([self.elements, elements]), axis=0)
        count = len(both) - len(self.elements)
        self.elements = both
        return count


def improved(
    evaluator: Evaluator, start: Point, goal: Goal = FIRST, stopped: Callable[[], bool] = lambda: False
) -> Evaluation:
    """The best robot that a local search finds from a start, with its arrangement of the cables."""
    try:
        constraints = _constraints(evaluator, start, goal)
    except UnsuitableRobotError:
        return evaluator.one(start)
    best, half, failures, reserves = evaluator.one(start), BOX, 0, list(RESERVES)
    effort = _EXACT if all(measure.is_exact for measure in evaluator.measures) else _BY_DIFFERENCES
    for _ in range(effort.rounds):
        if stopped() or half < effort.smallest_box or failures > MAX_FAILURES:
            break
        there = _solved(evaluator, constraints, best.point, half, reserves[0], effort)
        if there is None or there == best.point:
            half, failures = 0.1 * half, failures + 1
            continue
        evaluation = evaluator.one(there)
        joined = _joined(constraints, there)
        before, after = goal.rank(evaluator, best), goal.rank(evaluator, evaluation)
        if not after < before:
            if joined:
                half *= 0.5
            elif evaluation.missed > 0.0 and len(reserves) > 1:  # by rounding, since no function says so
                reserves.pop(0)
            else:
                half, failures = 0.1 * half, failures + 1
            continue
        gain = before[1] - after[1] if before[0] == after[0] else math.inf
        moved = np.abs(evaluator.space.fractions(there) - evaluator.space.fractions(best.point)).max()
        best = evaluation
        if not joined and not gain > effort.converged * max(abs(after[1]), 1e-300):
            break
        half = min(max(2.0 * moved, 0.25 * half), BOX)
    return best


def _joined(constraints: list[_Constraint], point: Point) -> int:
    # Let functions that may be the smallest at a point take part; return how many are new.
    try:
        return sum(one.join(one.piece.worst(point)) for one in constraints)
    except UnsuitableRobotError:
        return 0


def _constraints(evaluator: Evaluator, point: Point, goal: Goal) -> list[_Constraint]:
    objective = evaluator.objectives[goal.objective]
    pieces = [(piece, True) for piece in pieces_of(objective)]
    if math.isfinite(goal.level):
        for piece in pieces_of(evaluator.objectives[goal.other]):
            pieces.append((dataclasses.replace(piece, offset=-goal.level), False))
    pieces += [
        (piece, False) for question in evaluator.requirements if question.is_smooth for piece in pieces_of(question)
    ]
    constraints = []
    for piece, is_level in pieces:
        elements = piece.worst(point)
        values, derivatives = piece.at(point, elements)
        magnitude = np.abs(derivatives).max(initial=0.0) or np.abs(values[np.isfinite(values)]).max(initial=0.0) or 1.0
        constraints.append(_Constraint(piece, elements, float(magnitude), is_level))
    level = max((one.scale for one in constraints if one.is_level), default=1.0)
    for one in constraints:
        one.scale = level if one.is_level else one.scale
    return constraints


def _solved(
    evaluator: Evaluator, constraints: list[_Constraint], start: Point, half: float, reserve: float, effort: _Effort
) -> Point | None:
    # The solution among the functions that take part, in a box about the start; None where it has no robot.
    from scipy.optimize import minimize  # loads much of SciPy

    space, arrangement = evaluator.space, start.arrangement
    at_start = space.fractions(start)
    values = _Values(evaluator, constraints, arrangement, reserve)
    try:
        level = values.level(at_start)
        count = len(at_start)
        bounds = [(max(x - half, 0.0), min(x + half, 1.0)) for x in at_start] + [(None, None)]
        result = minimize(
            lambda x: (-x[-1], np.append(np.zeros(count), -1.0)),
            np.append(at_start, level),
            jac=True,
            bounds=bounds,
            method="SLSQP",
            constraints={"type": "ineq", "fun": lambda x: values(x)[0], "jac": lambda x: values(x)[1]},
            options={"maxiter": effort.iterations, "ftol": effort.precision},
        )
    except UnsuitableRobotError:
        return None
    return space.point(result.x[:-1], arrangement) if np.isfinite(result.x).all() else None


class _Values:
    # Values of all functions that take part, with derivatives, at the last unknowns that were asked for.

    def __init__(self, evaluator: Evaluator, constraints: list[_Constraint], arrangement: int, reserve: float) -> None:
        self._evaluator, self._constraints = evaluator, constraints
        self._arrangement, self._reserve = arrangement, reserve
        self._last: tuple[bytes, tuple[np.ndarray, np.ndarray]] | None = None

    def level(self, fractions: Float[np.ndarray, "k"]) -> float:
        """Smallest value of the objective's functions."""
        values, _ = self(np.append(fractions, 0.0))
        return float(values[self._is_level].min())

    def __call__(self, unknowns: Float[np.ndarray, "k1"]) -> tuple[np.ndarray, np.ndarray]:
        key = unknowns.tobytes()
        if self._last is None or self._last[0] != key:
            self._last = key, self._at(unknowns)
        return self._last[1]

    def _at(self, unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        point = self._evaluator.space.point(unknowns[:-1], self._arrangement)
        self._evaluator.count += 1
        parts, derivatives, is_level = [], [], []
        for one in self._constraints:
            values, jacobian = one.piece.at(point, one.elements)
            values = np.nan_to_num(values / one.scale, nan=-1e6, posinf=1e6, neginf=-1e6)
            level = unknowns[-1] if one.is_level else self._reserve
            parts.append(values - level)
            derivatives.append(np.c_[jacobian / one.scale, np.full(len(values), -float(one.is_level))])
            is_level.append(np.full(len(values), one.is_level))
        self._is_level = np.concatenate(is_level)
        return np.concatenate(parts), np.concatenate(derivatives)
