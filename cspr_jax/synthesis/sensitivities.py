"""Bounds and requirements that hold the parameters of the best robot, and derivatives.

At an optimum the derivatives of the objective are a sum of those of what is active, with weights that are not negative
(Karush, Kuhn and Tucker): the weights are found by non-negative least squares.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from cspr_jax.numerics.shapes import Float
from cspr_jax.synthesis.evaluations import Evaluator
from cspr_jax.synthesis.questions import Piece, pieces_of
from cspr_jax.synthesis.space import AT_BOUND, Point, UnsuitableRobotError

# Functions are active within this change of a parameter, as a fraction of its range, from what they may not pass.
ACTIVE = 1e-4
# Weights below this fraction of the largest count as zero.
WEIGHT = 1e-6


@dataclasses.dataclass(frozen=True)
class Holding:
    """Something active that holds a parameter.

    Fields:
        parameter: name of the parameter.
        by: what holds it, in words.
        price: by how much the objective would change with each unit of the parameter, if this did not hold it.
    """

    parameter: str
    by: str
    price: float


@dataclasses.dataclass(frozen=True)
class DesignSensitivities:
    """Derivatives at a robot.

    Fields:
        derivatives: derivatives (q, k) of the numbers of all objectives and requirements by the parameters, of
            `feasible` those of its smallest margin; one-sided at kinks; NaN where a number jumps.
        holdings: what holds the parameters, the dearest first.
        residual: largest derivative of the objective that nothing active explains, as a fraction of the largest.
    """

    derivatives: Float[np.ndarray, "q k"]
    holdings: tuple[Holding, ...]
    residual: float


@dataclasses.dataclass(frozen=True)
class _Active:
    # A function that is active: what it is, in words, and its derivatives by fractions of the ranges.
    words: str
    derivative: np.ndarray


def sensitivities_of(evaluator: Evaluator, point: Point, objective: int = 0) -> DesignSensitivities:
    """Derivatives at a robot, and what holds its parameters as the best one by an objective."""
    space = evaluator.space
    ranges = space.upper - space.lower
    rows = np.full((len(evaluator.questions), len(space.names)), np.nan)
    active = list[_Active]()
    levels = list[_Active]()
    for i, question in enumerate(evaluator.questions):
        if not question.is_smooth:
            continue
        smallest = math.inf
        for piece in pieces_of(question):
            try:
                elements = piece.worst(point)
                values, derivatives = piece.at(point, elements)
            except UnsuitableRobotError:
                continue
            if not np.isfinite(values).any():
                continue
            worst = int(np.nanargmin(values))
            if values[worst] < smallest:
                smallest, rows[i] = float(values[worst]), piece.sign * derivatives[worst] / ranges
            near = _near(values, derivatives, values[worst] if question.sense else 0.0)
            if question.sense and i == objective:
                levels += [_Active(words_of(piece, point, elements[k]), derivatives[k]) for k in near]
            elif not question.sense:
                active += [_Active(words_of(piece, point, elements[k]), derivatives[k]) for k in near]
    return DesignSensitivities(rows, *_held(evaluator, point, objective, levels, active, ranges))


def _near(values: np.ndarray, derivatives: np.ndarray, level: float) -> np.ndarray:
    magnitude = np.abs(derivatives).max(initial=0.0) or 1.0
    return np.flatnonzero(values - level <= ACTIVE * magnitude)


def _held(
    evaluator: Evaluator, point: Point, objective: int, levels: list[_Active], active: list[_Active], ranges: np.ndarray
) -> tuple[tuple[Holding, ...], float]:
    from scipy.optimize import nnls  # loads much of SciPy

    space, count, sense = evaluator.space, len(ranges), evaluator.objectives[objective].sense
    if not levels or not count:
        return (), math.nan
    fractions = space.fractions(point)
    bounds = [
        _Active(f"its upper bound, {space.upper[i]:g}", -np.eye(count)[i])
        for i in np.flatnonzero(fractions > 1.0 - AT_BOUND)
    ]
    bounds += [
        _Active(f"its lower bound, {space.lower[i]:g}", np.eye(count)[i]) for i in np.flatnonzero(fractions < AT_BOUND)
    ]
    # Weights of the objective's functions add up to one; with those of the others their derivatives cancel.
    others = [*active, *bounds]
    magnitude = max(float(np.abs(one.derivative).max(initial=0.0)) for one in levels) or 1.0
    norms = [float(np.abs(one.derivative).max(initial=0.0)) or 1.0 for one in others]
    columns = [np.append(one.derivative / magnitude, 1.0) for one in levels]
    columns += [np.append(one.derivative / norm, 0.0) for one, norm in zip(others, norms, strict=True)]
    weights, _ = nnls(np.stack(columns, axis=1), np.append(np.zeros(count), 1.0))
    residual = float(np.abs(np.stack(columns, axis=1)[:-1] @ weights).max(initial=0.0))
    holdings = list[Holding]()
    pieces = [*((one, magnitude) for one in levels), *zip(others, norms, strict=True)]
    is_active = weights > WEIGHT * weights.max(initial=0.0)
    if is_active[: len(levels)].sum() == 1:  # the objective itself, which the others hold
        is_active[: len(levels)] = False
    for (one, norm), weight, takes_part in zip(pieces, weights, is_active, strict=True):
        if not takes_part:
            continue
        prices = weight * one.derivative * magnitude / norm / ranges
        for i in np.flatnonzero(np.abs(prices) > WEIGHT * np.abs(prices).max(initial=0.0)):
            holdings.append(Holding(space.names[i], one.words, float(-sense * prices[i])))
    return tuple(sorted(holdings, key=lambda one: (space.names.index(one.parameter), -abs(one.price)))), residual


def words_of(piece: Piece, point: Point, element: np.ndarray) -> str:
    """A function in words: the quantity, and which of its elements it is."""
    name = f"{piece.question.of}.{piece.quantity}"
    return name if piece.is_one else f"{name} {piece.question.measure.words(point, piece.quantity, element)}".rstrip()
