"""Steps of a search along which its merit falls."""

import numpy as np

from cspr_jax.families.free.search.condensation import less_missed
from cspr_jax.families.free.search.newton import Step
from cspr_jax.families.free.search.points import Levels, SearchPoints
from cspr_jax.families.free.search.tasks import Tasks, Unknowns, wide

# Halvings of a step; part of the way to a bound that one goes, and that a correction goes; part of the slope by which
# the merit falls at least.
HALVINGS, SHARE, CORRECTED, DESCENT = 8, 0.99, 0.9, 1e-4


def _moved(unknowns: Unknowns, change: Unknowns, primal: np.ndarray, dual: np.ndarray) -> Unknowns:
    sizes = [primal] * 6 + [dual] * 2
    return Unknowns(
        *(
            leaf + size.reshape(-1, *[1] * (leaf.ndim - 1)) * step
            for leaf, size, step in zip(unknowns, sizes, change, strict=True)
        )
    )


def _length(*pairs: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    # Longest steps, up to 1, by which no value loses more than a share of itself, (l,).
    lengths = np.ones(len(pairs[0][0]))
    for value, change in pairs:
        with np.errstate(divide="ignore", invalid="ignore"):
            longest = np.where(change < 0.0, -SHARE * value / change, np.inf)
        lengths = np.minimum(lengths, longest.reshape(len(lengths), -1).min(1))
    return lengths


def _lengths(points: SearchPoints, step: Step) -> tuple[np.ndarray, np.ndarray]:
    # Longest steps of the unknowns, and of the multipliers of bounds.
    tasks, unknowns, change = points.tasks, points.unknowns, step.change
    gaps = zip(tasks.gaps(unknowns), tasks.gap_changes(change), strict=True)
    duals = (unknowns.low_push, change.low_push), (unknowns.high_push, change.high_push)
    return _length(*gaps, (0.5 * unknowns.duration, change.duration)), _length(*duals)


def _merit(tasks: Tasks, unknowns: Unknowns, residual: np.ndarray, levels: Levels) -> np.ndarray:
    soft, barrier = levels.soft, np.zeros(unknowns.values.shape)
    for gap in tasks.gaps(unknowns):
        barrier -= np.log(np.where(np.isfinite(gap), gap, 1.0))
    price = (soft.level + 0.5 * soft.paid(residual)) * residual
    each = price, wide(levels.barrier) * barrier
    return tasks.cost(unknowns) + sum(part.reshape(len(part), -1).sum(1) for part in each)


def descended(points: SearchPoints, step: Step, levels: Levels) -> SearchPoints:
    """Go a step, halved until the merit falls.

    A trial from which it does not fall is tried once more with values that make up for the curvature of the equations
    (a second-order correction): for platforms, whose wrenches change with every turn, steps are too short without.
    """
    primal, dual = _lengths(points, step)
    before = _merit(points.tasks, points.unknowns, points.residual, levels)
    rows, corrections = np.arange(len(primal)), np.zeros_like(points.unknowns.values)
    for _ in range(HALVINGS):
        part, change = points.taken(rows), step.taken(rows)
        trial = _moved(part.unknowns, change.change, primal[rows], dual[rows])
        residual, level = part.tasks.residual(trial), levels.taken(rows)
        minimum = before[rows] + DESCENT * primal[rows] * change.fall + 1e-12 * np.abs(before[rows])
        # Not above: a merit that is no number does not fall.
        is_over = ~(_merit(part.tasks, trial, residual, level) <= minimum)
        if not is_over.any():
            break
        rows, part, change, level = rows[is_over], part.taken(is_over), change.taken(is_over), level.taken(is_over)
        trial, missed = trial.taken(is_over), residual[is_over] - part.residual - wide(primal[rows]) * change.missed
        correction = _correction(part, trial, change, missed, level)
        trial = trial._replace(values=trial.values + correction)
        falls = _merit(part.tasks, trial, part.tasks.residual(trial), level) <= minimum[is_over]
        corrections[rows[falls]] = correction[falls]
        rows = rows[~falls]
        if not len(rows):
            break
        primal[rows] *= 0.5
    unknowns = _moved(points.unknowns, step.change, primal, dual)
    return SearchPoints.of(points.tasks, unknowns._replace(values=unknowns.values + corrections))


def _correction(points: SearchPoints, trial: Unknowns, step: Step, missed: np.ndarray, levels: Levels) -> np.ndarray:
    # Changes of the values of a trial, inside their bounds, for what equations miss beyond the step's own prediction.
    change = less_missed(points.equations.matrix, step.weights, missed, levels.soft)
    low, high = (np.where(np.isfinite(gap), CORRECTED * gap, np.inf) for gap in points.tasks.gaps(trial))
    return np.clip(change, -low, high)
