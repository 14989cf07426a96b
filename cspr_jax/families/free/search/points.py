"""Motions with their equations at all samples, and steps along which their merit decreases."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import numpy as np

from cspr_jax.families.free.search.condensation import Softness, repaired_values, times, transposed
from cspr_jax.families.free.search.derivatives import SCALARS, EquationValues
from cspr_jax.families.free.search.newton import Step, assembled_gradient
from cspr_jax.families.free.search.tasks import OUTER, Tasks, Unknowns, wide
from cspr_jax.numerics.shapes import Float

LARGE = 100.0  # if the mean multiplier of bounds is larger, errors are divided by the mean over this
REGULAR = 1e-6  # regularization of the metric of the tensions


class Levels(NamedTuple):
    """Weight of the barriers, (l,), and softness of the equations."""

    barrier: np.ndarray
    soft: Softness

    def take(self, indices: np.ndarray) -> "Levels":
        """Levels of some of the motions."""
        return Levels(self.barrier[indices], Softness(*(values[indices] for values in self.soft)))


@dataclasses.dataclass(frozen=True)
class SearchPoints:
    """l motions with their equations.

    Fields:
        equations: values and derivatives of the equations, leaves (l, s, m, n, ...).
        residual: (l, s, m, n, n_equations) residuals, which all values enter.
    """

    tasks: Tasks
    unknowns: Unknowns
    equations: EquationValues
    residual: np.ndarray

    @classmethod
    def of(cls, tasks: Tasks, unknowns: Unknowns) -> "SearchPoints":
        """Evaluate motions."""
        return cls(tasks, unknowns, *tasks.equations(unknowns))

    def take(self, indices: np.ndarray) -> "SearchPoints":
        """Some of the motions."""
        equations = EquationValues(*(values[indices] for values in self.equations))
        return SearchPoints(self.tasks.take(indices), self.unknowns.take(indices), equations, self.residual[indices])

    def metric(self) -> Float[np.ndarray, "l s m n dof dof"]:
        """Metric for residual wrenches: a wrench counts as much as the tensions that supply it."""
        matrix = self.equations.matrix
        return matrix @ transposed(matrix) + REGULAR * np.eye(matrix.shape[-2])

    def missed(self) -> Float[np.ndarray, "l"]:
        """Largest residual of the equations."""
        return np.abs(self.residual).reshape(len(self.residual), -1).max(1)

    def errors(self, levels: Levels) -> Float[np.ndarray, "l"]:
        """Largest error of Newton's equations."""
        tasks, unknowns, soft = self.tasks, self.unknowns, levels.soft
        count, dof, d, cables = len(unknowns.values), tasks.robot.dof, tasks.ends.shape[-1], tasks.robot.n_cables
        gradient = assembled_gradient(tasks.basis, times(transposed(self.equations.jacobian), unknowns.multipliers))
        tensions, weights = unknowns.values[..., :cables], tasks.energy_weights
        gradient[..., -2] += tasks.objective.time / tasks.scale[:, None] + np.sum(weights * tensions**2, axis=(2, 3, 4))
        along = times(transposed(tasks.border_jacobians(unknowns)), gradient[..., tasks.border])
        segments, accelerations = unknowns.duration.shape[1], np.zeros_like(unknowns.acceleration)
        for side in (0, 1):
            accelerations[:, side : segments + side] += along[..., 1 + side * d : 1 + (1 + side) * d]
        balance = times(transposed(self.equations.matrix), unknowns.multipliers[..., :dof])
        values = np.concatenate([balance, unknowns.multipliers[..., dof:]], axis=-1)
        values = values - unknowns.low_multipliers + unknowns.high_multipliers
        values[..., :cables] += 2.0 * weights * wide(unknowns.duration) * tensions
        parts = [gradient[..., OUTER * d : -SCALARS - OUTER * d], gradient[..., -2] + along[..., 0], values]
        parts.append(np.where(tasks.is_free[..., None], accelerations, 0.0))
        multipliers = unknowns.low_multipliers, unknowns.high_multipliers
        if tasks.objective.level > 0.0:
            lifts = tasks.objective.low_lift, -tasks.objective.high_lift
            by_level = sum(multiplier * lift for multiplier, lift in zip(multipliers, lifts, strict=True))
            parts.append(tasks.objective.level + by_level.sum((2, 3, 4)))
        for multiplier, gap in zip(multipliers, tasks.gaps(unknowns), strict=True):
            is_bound = np.isfinite(gap)
            parts.append(np.where(is_bound, np.where(is_bound, gap, 0.0) * multiplier - wide(levels.barrier), 0.0))
        unit = np.maximum(LARGE, (multipliers[0] + multipliers[1]).reshape(count, -1).mean(1)) / LARGE
        largest = np.max([np.abs(part).reshape(count, -1).max(1, initial=0.0) for part in parts], axis=0)
        price = self.residual - soft.missed(unknowns.multipliers - soft.level)
        return np.maximum(largest / unit, np.abs(price).reshape(count, -1).max(1))


HALVINGS = 8  # largest number of times that a step is halved
FRACTION, CORRECTED = 0.99, 0.9  # steps, and corrections, may go these fractions of the distance to a bound
DESCENT = 1e-4  # smallest decrease of the merit, over its derivative times the step


def _moved(unknowns: Unknowns, change: Unknowns, primal: np.ndarray, dual: np.ndarray) -> Unknowns:
    lengths = [primal] * 6 + [dual] * 2
    return Unknowns(
        *(
            values + length.reshape(-1, *[1] * (values.ndim - 1)) * step
            for values, length, step in zip(unknowns, lengths, change, strict=True)
        )
    )


def _length(*pairs: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    # Return the longest steps, up to 1, in which no value decreases by more than a fraction of itself, (l,).
    lengths = np.ones(len(pairs[0][0]))
    for value, change in pairs:
        with np.errstate(divide="ignore", invalid="ignore"):
            longest = np.where(change < 0.0, -FRACTION * value / change, np.inf)
        lengths = np.minimum(lengths, longest.reshape(len(lengths), -1).min(1))
    return lengths


def _lengths(points: SearchPoints, step: Step) -> tuple[np.ndarray, np.ndarray]:
    # Return the longest steps of the unknowns, and of the multipliers of bounds.
    tasks, unknowns, change = points.tasks, points.unknowns, step.change
    gaps = zip(tasks.gaps(unknowns), tasks.gap_changes(change), strict=True)
    duals = (unknowns.low_multipliers, change.low_multipliers), (unknowns.high_multipliers, change.high_multipliers)
    return _length(*gaps, (0.5 * unknowns.duration, change.duration)), _length(*duals)


def _merit(tasks: Tasks, unknowns: Unknowns, residual: np.ndarray, levels: Levels) -> np.ndarray:
    soft, barrier = levels.soft, np.zeros(unknowns.values.shape)
    for gap in tasks.gaps(unknowns):
        barrier -= np.log(np.where(np.isfinite(gap), gap, 1.0))
    price = (soft.level + 0.5 * soft.paid(residual)) * residual
    each = price, wide(levels.barrier) * barrier
    return tasks.cost(unknowns) + sum(part.reshape(len(part), -1).sum(1) for part in each)


def descended(points: SearchPoints, step: Step, levels: Levels) -> SearchPoints:
    """Take a step, halved until the merit decreases.

    A trial without a decrease is repeated with values that correct the curvature of the equations (a second-order
    correction). Without it, steps of platforms, whose wrenches change with rotation, are too short.
    """
    primal, dual = _lengths(points, step)
    before = _merit(points.tasks, points.unknowns, points.residual, levels)
    indices, corrections = np.arange(len(primal)), np.zeros_like(points.unknowns.values)
    for _ in range(HALVINGS):
        part, change = points.take(indices), step.take(indices)
        trial = _moved(part.unknowns, change.change, primal[indices], dual[indices])
        residual, level = part.tasks.residual(trial), levels.take(indices)
        minimum = (
            before[indices] + DESCENT * primal[indices] * change.merit_derivative + 1e-12 * np.abs(before[indices])
        )
        # Do not write this as "above": NaN must not count as a decrease.
        is_over = ~(_merit(part.tasks, trial, residual, level) <= minimum)
        if not is_over.any():
            break
        indices, part, change, level = indices[is_over], part.take(is_over), change.take(is_over), level.take(is_over)
        trial, missed = trial.take(is_over), residual[is_over] - part.residual - wide(primal[indices]) * change.missed
        correction = _correction(part, trial, change, missed, level)
        trial = trial._replace(values=trial.values + correction)
        falls = _merit(part.tasks, trial, part.tasks.residual(trial), level) <= minimum[is_over]
        corrections[indices[falls]] = correction[falls]
        indices = indices[~falls]
        if not len(indices):
            break
        primal[indices] *= 0.5
    unknowns = _moved(points.unknowns, step.change, primal, dual)
    return SearchPoints.of(points.tasks, unknowns._replace(values=unknowns.values + corrections))


def _correction(points: SearchPoints, trial: Unknowns, step: Step, missed: np.ndarray, levels: Levels) -> np.ndarray:
    # Return changes of the values of a trial, within bounds, that correct residuals which the step did not predict.
    change = repaired_values(points.equations.matrix, step.weights, missed, levels.soft)
    low, high = (np.where(np.isfinite(gap), CORRECTED * gap, np.inf) for gap in points.tasks.gaps(trial))
    return np.clip(change, -low, high)
