"""Steps of Newton's method: matrices are banded for segments, bordered by durations and accelerations at poses."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dpbtrf, dpbtrs

from cspr_jax.families.free.search.basis import LOCAL, Basis
from cspr_jax.families.free.search.condensation import Softness, condensed, times, transposed
from cspr_jax.families.free.search.derivatives import SCALARS, EquationValues
from cspr_jax.families.free.search.tasks import OUTER, Tasks, Unknowns, wide
from cspr_jax.numerics.shapes import Float

# Smallest and largest regularization, added to the diagonal of a matrix that is not positive definite.
MIN_REGULARIZATION, MAX_REGULARIZATION = 1e-6, 1e6
GROWING = 6.0  # growth of the regularization from one try of a step to the next
SHRINKING = 3.0  # the next step that needs one first tries the last regularization over this
TRIES = 25


class Step(NamedTuple):
    """Step of l motions.

    Fields:
        change: change of the unknowns.
        merit_derivative: (l,) derivative of the merit along the step.
        regularization: (l,) number added to the diagonal.
        missed: (l, s, m, n, n_equations) change of the residuals of equations, to first order.
        weights: (l, s, m, n, n_values) second derivatives of the barriers by the values.
    """

    change: Unknowns
    merit_derivative: np.ndarray
    regularization: np.ndarray
    missed: np.ndarray
    weights: np.ndarray

    def take(self, indices: np.ndarray) -> "Step":
        """Steps of some of the motions."""
        return Step(self.change.take(indices), *(values[indices] for values in self[1:]))


class _Bordered(NamedTuple):
    # Newton's equations of segments, (l, s, ...): banded matrices of inner coordinates, their borders, and right-hand
    # sides.
    banded: np.ndarray
    beside: np.ndarray
    border: np.ndarray
    inner_right: np.ndarray
    border_right: np.ndarray


def assembled_gradient(basis: Basis, gradients: np.ndarray) -> np.ndarray:
    """Gradient of a sum over samples, by all coordinates."""
    d = (gradients.shape[-1] - SCALARS) // 3
    derivatives = gradients[..., :-SCALARS].reshape(*gradients.shape[:-1], 3, d)
    local = np.einsum("mnrk,lsmnrd->lsmkd", basis.functions, derivatives, optimize=True)
    full = np.zeros((*gradients.shape[:2], basis.controls, d))
    for m in range(len(basis.tau)):
        full[:, :, m : m + LOCAL] += local[:, :, m]
    return np.concatenate([full.reshape(*gradients.shape[:2], -1), gradients[..., -SCALARS:].sum((2, 3))], axis=-1)


def _assembled_hessian(basis: Basis, hessians: np.ndarray) -> np.ndarray:
    # Return the Hessian of a sum over samples, (l, s, K d + 2, K d + 2), as in `assembled_gradient`.
    d = (hessians.shape[-1] - SCALARS) // 3
    m, n = basis.tau.shape
    weights = np.zeros((m, n, 3 * d + SCALARS, LOCAL * d + SCALARS))
    for i in range(d):
        weights[:, :, i : 3 * d : d, i : LOCAL * d : d] = basis.functions
    weights[:, :, -SCALARS:, -SCALARS:] = np.eye(SCALARS)
    local = np.einsum("mnya,lsmnyb->lsmab", weights, hessians @ weights, optimize=True)
    width, last = LOCAL * d, basis.controls * d
    full = np.zeros((*hessians.shape[:2], last + SCALARS, last + SCALARS))
    for k in range(m):
        part = slice(k * d, k * d + width)
        full[:, :, part, part] += local[:, :, k, :width, :width]
        full[:, :, part, last:] += local[:, :, k, :width, width:]
    full[:, :, last:, last:] = local[:, :, :, width:, width:].sum(2)
    full[:, :, last:, :last] = transposed(full[:, :, :last, last:])
    return full


def _segments(
    tasks: Tasks, unknowns: Unknowns, hessian: np.ndarray, gradient: np.ndarray, lagrangian_gradient: np.ndarray
) -> _Bordered:
    # Return Newton's equations hessian z + gradient = 0 in inner coordinates, durations, accelerations and the level.
    d, border = tasks.ends.shape[-1], tasks.border
    inner = np.arange(OUTER * d, (tasks.basis.controls - OUTER) * d)
    columns = np.append(border, tasks.basis.controls * d + np.arange(SCALARS))
    moves = np.zeros((*unknowns.duration.shape, len(columns), SCALARS + 2 * d))
    moves[:, :, :-SCALARS, :-1] = tasks.border_jacobians(unknowns)
    moves[:, :, -2, 0] = moves[:, :, -1, -1] = 1.0
    width = LOCAL * d
    below = np.minimum(np.arange(width)[:, None] + np.arange(len(inner)), len(inner) - 1)
    is_inside = np.arange(width)[:, None] + np.arange(len(inner)) < len(inner)
    banded = np.where(is_inside, hessian[:, :, inner[below], inner[None]], 0.0)
    beside = hessian[:, :, inner[:, None], columns] @ moves
    corner = transposed(moves) @ hessian[:, :, columns[:, None], columns] @ moves
    corner[:, :, :-1, :-1] += tasks.border_hessians(unknowns, lagrangian_gradient[:, :, border])
    return _Bordered(banded, beside, corner, -gradient[:, :, inner], -times(transposed(moves), gradient[:, :, columns]))


def _solved(
    segments: _Bordered, k: int, is_moving: np.ndarray, regularization: float
) -> tuple[np.ndarray, np.ndarray] | None:
    # Return changes of inner coordinates, (s, n), and of durations, accelerations and the level; None if the matrix is
    # not positive definite.
    count, d, n = len(segments.banded[k]), (segments.border.shape[-1] - SCALARS) // 2, len(is_moving)
    matrix, right, parts = regularization * np.eye(n), np.zeros(n), []
    for s in range(count):
        banded = segments.banded[k, s].copy()
        banded[0] += regularization
        factor, failed = dpbtrf(banded, lower=1)
        if failed:
            return None
        sides = np.concatenate([segments.beside[k, s], segments.inner_right[k, s][:, None]], axis=1)
        solution = dpbtrs(factor, sides, lower=1)[0]
        indices = np.concatenate([[s], count + s * d + np.arange(2 * d), [n - count + s]])
        matrix[np.ix_(indices, indices)] += segments.border[k, s] - segments.beside[k, s].T @ solution[:, :-1]
        right[indices] += segments.border_right[k, s] - segments.beside[k, s].T @ solution[:, -1]
        parts.append((solution, indices))
    moving = np.flatnonzero(is_moving)
    matrix = matrix[np.ix_(moving, moving)]
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        return None
    change = np.zeros(n)
    change[moving] = np.linalg.solve(matrix, right[moving])
    inner = np.array([solution[:, -1] - solution[:, :-1] @ change[indices] for solution, indices in parts])
    return (inner, change) if np.isfinite(inner).all() and np.isfinite(change).all() else None


def _changes(
    tasks: Tasks, unknowns: Unknowns, segments: _Bordered, regularization: np.ndarray
) -> tuple[Unknowns, np.ndarray]:
    # Return changes of control points, durations, accelerations and levels, and the numbers added to the diagonal.
    count, d = len(unknowns.duration[0]), tasks.ends.shape[-1]
    changes = [np.zeros_like(part) for part in unknowns[:4]]
    used = np.zeros(len(regularization))
    for k in range(len(regularization)):
        is_moving = np.concatenate(
            [np.ones(count, bool), np.repeat(tasks.is_free[k], d), np.repeat(tasks.objective.level > 0.0, count)]
        )
        solution = _solved(segments, k, is_moving, 0.0)
        tries = min(max(MIN_REGULARIZATION, regularization[k] / SHRINKING), MAX_REGULARIZATION) * GROWING ** np.arange(
            TRIES
        )
        for trial in tries if solution is None else ():
            solution, used[k] = _solved(segments, k, is_moving, trial), trial
            if solution is not None:
                break
        if solution is not None:
            inner, border = solution
            changes[0][k] = inner.reshape(changes[0][k].shape)
            changes[1][k], changes[3][k] = border[:count], border[-count:]
            changes[2][k] = border[count:-count].reshape(count + 1, d)
    inner, duration, acceleration, level = changes
    moved = unknowns._replace(inner=inner, duration=duration, acceleration=acceleration, level=level)
    return moved, used


def newton_step(
    tasks: Tasks,
    unknowns: Unknowns,
    equations: EquationValues,
    residual: Float[np.ndarray, "l s m n n_equations"],
    barrier: Float[np.ndarray, "l"],
    soft: Softness,
    regularization: Float[np.ndarray, "l"],
) -> Step:
    """Step towards the optimum with barriers at the bounds."""
    cables, gaps = tasks.robot.n_cables, tasks.gaps(unknowns)
    equations, weights, value_right, by_scalars = _with_objective(tasks, unknowns, equations, gaps, wide(barrier))
    local = condensed(equations, weights, value_right, -residual - soft.missed(soft.level), soft)
    gradient = assembled_gradient(tasks.basis, local.gradient)
    gradient[..., -SCALARS:] += by_scalars
    lagrangian = assembled_gradient(tasks.basis, times(transposed(equations.jacobian), unknowns.multipliers))
    segments = _segments(tasks, unknowns, _assembled_hessian(tasks.basis, local.hessian), gradient, lagrangian)
    change, used = _changes(tasks, unknowns, segments, regularization)
    state = _at_samples(tasks, unknowns, change)
    values, multipliers = local.changes(state, cables, tasks.robot.dof)
    change = change._replace(values=values, multipliers=multipliers - unknowns.multipliers)
    steps, duals = tasks.gap_changes(change), (unknowns.low_multipliers, unknowns.high_multipliers)
    multipliers_change = (
        np.where(np.isfinite(gap), (wide(barrier) - last * step) / gap - last, 0.0)
        for gap, last, step in zip(gaps, duals, steps, strict=True)
    )
    missed = times(equations.jacobian, state)
    missed[..., : tasks.robot.dof] += times(equations.matrix, values[..., :cables])
    missed[..., tasks.robot.dof :] += values[..., cables:]
    price = (soft.level + soft.paid(residual)) * missed
    merit_derivative = tasks.cost_change(unknowns, change) + _sum(price)
    merit_derivative -= sum(_sum(wide(barrier) / gap * step) for gap, step in zip(gaps, steps, strict=True))
    return Step(Unknowns(*change[:-2], *multipliers_change), merit_derivative, used, missed, weights)


def _with_objective(
    tasks: Tasks,
    unknowns: Unknowns,
    equations: EquationValues,
    gaps: tuple[np.ndarray, np.ndarray],
    barrier: np.ndarray,
) -> tuple[EquationValues, np.ndarray, np.ndarray, np.ndarray]:
    # Return the equations with derivatives of objective and barriers added, second derivatives and right-hand side of
    # the values, and derivatives by duration and level, (l, s, 2).
    objective, cables, energy_weights = tasks.objective, tasks.robot.n_cables, tasks.energy_weights
    lifts, signs = (objective.low_lift, objective.high_lift), (1.0, -1.0)
    weights = [old / gap for old, gap in zip((unknowns.low_multipliers, unknowns.high_multipliers), gaps, strict=True)]
    barrier_gradients = [sign * barrier / gap for sign, gap in zip(signs, gaps, strict=True)]
    weight, value_right = sum(weights), sum(barrier_gradients)
    tensions, duration = unknowns.values[..., :cables], wide(unknowns.duration)
    weight[..., :cables] += 2.0 * energy_weights * duration
    value_right[..., :cables] -= 2.0 * energy_weights * duration * tensions
    mixed, hessian = equations.mixed.copy(), equations.hessian.copy()
    mixed[..., -2] += 2.0 * energy_weights * tensions
    mixed[..., -1] -= sum(part * lift for part, lift in zip(weights, lifts, strict=True))[..., :cables]
    hessian[..., -1, -1] += sum((part * lift**2).sum(-1) for part, lift in zip(weights, lifts, strict=True))
    by_level = objective.level + sum(
        (part * lift).sum((2, 3, 4)) for part, lift in zip(barrier_gradients, lifts, strict=True)
    )
    by_duration = objective.time / tasks.scale[:, None] + np.sum(energy_weights * tensions**2, axis=(2, 3, 4))
    by_scalars = np.stack([by_duration, by_level], axis=-1)
    return equations._replace(mixed=mixed, hessian=hessian), weight, value_right, by_scalars


def _at_samples(tasks: Tasks, unknowns: Unknowns, change: Unknowns) -> np.ndarray:
    # Return changes of coordinates with two derivatives, duration and level at all samples, (l, s, m, n, n_x).
    d, count = tasks.ends.shape[-1], len(unknowns.duration[0])
    moving = np.zeros((*unknowns.duration.shape, tasks.basis.controls * d))
    moving[..., OUTER * d : -OUTER * d] = change.inner.reshape(*moving.shape[:2], -1)
    near = [change.acceleration[:, side : count + side] for side in (0, 1)]
    by = np.concatenate([change.duration[..., None], *near], axis=-1)
    moving[..., tasks.border] = times(tasks.border_jacobians(unknowns), by)
    samples = tasks.basis.evaluate(moving.reshape(*moving.shape[:2], -1, d))
    shape = samples.shape[:4]
    scalars = wide(change.duration), wide(change.level)
    return np.concatenate(
        [samples.reshape(*shape, -1), *(np.broadcast_to(one, (*shape, 1)) for one in scalars)], axis=-1
    )


def _sum(values: np.ndarray) -> np.ndarray:
    return values.reshape(len(values), -1).sum(1)
