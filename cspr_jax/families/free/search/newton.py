"""Steps of Newton's method: banded matrices of segments, with durations and accelerations at poses as borders."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg.lapack import dpbtrf, dpbtrs

from cspr_jax.families.free.search.basis import LOCAL, Basis
from cspr_jax.families.free.search.condensation import Softness, eliminated, times, transposed
from cspr_jax.families.free.search.derivatives import SCALARS, InstantValues
from cspr_jax.families.free.search.tasks import OUTER, Tasks, Unknowns, wide

if TYPE_CHECKING:
    from jaxtyping import Float

# Added to the diagonal where the matrix has a negative curvature: least, at first; by what it grows and shrinks; tries.
CURVED, MOST_CURVED, GROWING, SHRINKING, TRIES = 1e-6, 1e6, 6.0, 3.0, 25


class Step(NamedTuple):
    """Step of l motions.

    Fields:
        change: of the unknowns.
        fall: (l,) slope of the merit along it.
        regularization: (l,) what was added to the diagonal.
        missed: (l, s, m, n, n_equations) change of what equations miss, to first order.
        weights: (l, s, m, n, n_values) of the bounds of the values.
    """

    change: Unknowns
    fall: np.ndarray
    regularization: np.ndarray
    missed: np.ndarray
    weights: np.ndarray

    def taken(self, rows: np.ndarray) -> "Step":
        """Steps of some of the motions."""
        return Step(self.change.taken(rows), *(leaf[rows] for leaf in self[1:]))


class _Bordered(NamedTuple):
    # Newton's equations of segments, (l, s, ...): of inner coordinates in bands, with borders, and right-hand sides.
    band: np.ndarray
    beside: np.ndarray
    border: np.ndarray
    inner_right: np.ndarray
    border_right: np.ndarray


def gathered(basis: Basis, push: np.ndarray) -> np.ndarray:
    """Gradient of a sum over instants."""
    d = (push.shape[-1] - SCALARS) // 3
    places = push[..., :-SCALARS].reshape(*push.shape[:-1], 3, d)
    local = np.einsum("mnrk,lsmnrd->lsmkd", basis.rows, places, optimize=True)
    full = np.zeros((*push.shape[:2], basis.controls, d))
    for m in range(len(basis.tau)):
        full[:, :, m : m + LOCAL] += local[:, :, m]
    return np.concatenate([full.reshape(*push.shape[:2], -1), push[..., -SCALARS:].sum((2, 3))], axis=-1)


def _assembled(basis: Basis, second_derivative: np.ndarray) -> np.ndarray:
    # The Hessian of a sum over instants, (l, s, K d + 2, K d + 2), as `gathered`.
    d = (second_derivative.shape[-1] - SCALARS) // 3
    m, n = basis.tau.shape
    weights = np.zeros((m, n, 3 * d + SCALARS, LOCAL * d + SCALARS))
    for i in range(d):
        weights[:, :, i : 3 * d : d, i : LOCAL * d : d] = basis.rows
    weights[:, :, -SCALARS:, -SCALARS:] = np.eye(SCALARS)
    local = np.einsum("mnya,lsmnyb->lsmab", weights, second_derivative @ weights, optimize=True)
    size, last = LOCAL * d, basis.controls * d
    full = np.zeros((*second_derivative.shape[:2], last + SCALARS, last + SCALARS))
    for k in range(m):
        part = slice(k * d, k * d + size)
        full[:, :, part, part] += local[:, :, k, :size, :size]
        full[:, :, part, last:] += local[:, :, k, :size, size:]
    full[:, :, last:, last:] = local[:, :, :, size:, size:].sum(2)
    full[:, :, last:, :last] = transposed(full[:, :, :last, last:])
    return full


def _segments(
    tasks: Tasks, unknowns: Unknowns, second_derivative: np.ndarray, slope: np.ndarray, push: np.ndarray
) -> _Bordered:
    # Newton's equations bend z + slope = 0 in inner coordinates, and in durations, accelerations and the level; push
    # is the gradient of the Lagrangian.
    d, border = tasks.places.shape[-1], tasks.border
    inner = np.arange(OUTER * d, (tasks.basis.controls - OUTER) * d)
    columns = np.append(border, tasks.basis.controls * d + np.arange(SCALARS))
    moves = np.zeros((*unknowns.duration.shape, len(columns), SCALARS + 2 * d))
    moves[:, :, :-SCALARS, :-1] = tasks.border_slopes(unknowns)
    moves[:, :, -2, 0] = moves[:, :, -1, -1] = 1.0
    width = LOCAL * d
    below = np.minimum(np.arange(width)[:, None] + np.arange(len(inner)), len(inner) - 1)
    is_inside = np.arange(width)[:, None] + np.arange(len(inner)) < len(inner)
    band = np.where(is_inside, second_derivative[:, :, inner[below], inner[None]], 0.0)
    beside = second_derivative[:, :, inner[:, None], columns] @ moves
    corner = transposed(moves) @ second_derivative[:, :, columns[:, None], columns] @ moves
    corner[:, :, :-1, :-1] += tasks.border_bends(unknowns, push[:, :, border])
    return _Bordered(band, beside, corner, -slope[:, :, inner], -times(transposed(moves), slope[:, :, columns]))


def _solved(
    segments: _Bordered, k: int, is_moving: np.ndarray, regularization: float
) -> tuple[np.ndarray, np.ndarray] | None:
    # Changes of inner coordinates, (s, n), and of durations, accelerations and the level; None where the matrix is not
    # positive.
    count, d, size = len(segments.band[k]), (segments.border.shape[-1] - SCALARS) // 2, len(is_moving)
    matrix, right, parts = regularization * np.eye(size), np.zeros(size), []
    for s in range(count):
        band = segments.band[k, s].copy()
        band[0] += regularization
        factor, failed = dpbtrf(band, lower=1)
        if failed:
            return None
        sides = np.concatenate([segments.beside[k, s], segments.inner_right[k, s][:, None]], axis=1)
        solution = dpbtrs(factor, sides, lower=1)[0]
        rows = np.concatenate([[s], count + s * d + np.arange(2 * d), [size - count + s]])
        matrix[np.ix_(rows, rows)] += segments.border[k, s] - segments.beside[k, s].T @ solution[:, :-1]
        right[rows] += segments.border_right[k, s] - segments.beside[k, s].T @ solution[:, -1]
        parts.append((solution, rows))
    moving = np.flatnonzero(is_moving)
    matrix = matrix[np.ix_(moving, moving)]
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        return None
    change = np.zeros(size)
    change[moving] = np.linalg.solve(matrix, right[moving])
    inner = np.array([solution[:, -1] - solution[:, :-1] @ change[rows] for solution, rows in parts])
    return (inner, change) if np.isfinite(inner).all() and np.isfinite(change).all() else None


def _changes(
    tasks: Tasks, unknowns: Unknowns, segments: _Bordered, regularization: np.ndarray
) -> tuple[Unknowns, np.ndarray]:
    # Changes of control points, durations, accelerations and levels, with what had to be added to the diagonal.
    count, d = len(unknowns.duration[0]), tasks.places.shape[-1]
    changes = [np.zeros_like(part) for part in unknowns[:4]]
    used = np.zeros(len(regularization))
    for k in range(len(regularization)):
        is_moving = np.concatenate(
            [np.ones(count, bool), np.repeat(tasks.is_free[k], d), np.repeat(tasks.objective.level > 0.0, count)]
        )
        solution = _solved(segments, k, is_moving, 0.0)
        tries = min(max(CURVED, regularization[k] / SHRINKING), MOST_CURVED) * GROWING ** np.arange(TRIES)
        for more in tries if solution is None else ():
            solution, used[k] = _solved(segments, k, is_moving, more), more
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
    equations: InstantValues,
    residual: Float[np.ndarray, "l s m n n_equations"],
    barrier: Float[np.ndarray, "l"],
    soft: Softness,
    regularization: Float[np.ndarray, "l"],
) -> Step:
    """Step towards the optimum with a barrier before the bounds."""
    cables, gaps = tasks.robot.n_cables, tasks.gaps(unknowns)
    equations, weights, push, by_scalars = _with_objective(tasks, unknowns, equations, gaps, wide(barrier))
    local = eliminated(equations, weights, push, -residual - soft.missed(soft.level), soft)
    slope = gathered(tasks.basis, local.slope)
    slope[..., -SCALARS:] += by_scalars
    lagrangian = gathered(tasks.basis, times(transposed(equations.slope), unknowns.multipliers))
    segments = _segments(tasks, unknowns, _assembled(tasks.basis, local.second_derivative), slope, lagrangian)
    change, used = _changes(tasks, unknowns, segments, regularization)
    state = _at_instants(tasks, unknowns, change)
    values, multipliers = local.changes(state, cables, tasks.robot.dof)
    change = change._replace(values=values, multipliers=multipliers - unknowns.multipliers)
    steps, old = tasks.gap_changes(change), (unknowns.low_push, unknowns.high_push)
    pushes = (
        np.where(np.isfinite(gap), (wide(barrier) - last * step) / gap - last, 0.0)
        for gap, last, step in zip(gaps, old, steps, strict=True)
    )
    missed = times(equations.slope, state)
    missed[..., : tasks.robot.dof] += times(equations.matrix, values[..., :cables])
    missed[..., tasks.robot.dof :] += values[..., cables:]
    price = (soft.level + soft.paid(residual)) * missed
    fall = tasks.cost_change(unknowns, change) + _sum(price)
    fall -= sum(_sum(wide(barrier) / gap * step) for gap, step in zip(gaps, steps, strict=True))
    return Step(Unknowns(*change[:-2], *pushes), fall, used, missed, weights)


def _with_objective(
    tasks: Tasks, unknowns: Unknowns, equations: InstantValues, gaps: tuple[np.ndarray, np.ndarray], barrier: np.ndarray
) -> tuple[InstantValues, np.ndarray, np.ndarray, np.ndarray]:
    # Equations with mixed derivatives of objective and barriers, weights and push of the values, and the slope by
    # duration and level, (l, s, 2).
    objective, cables, shares = tasks.objective, tasks.robot.n_cables, tasks.energy_shares
    lifts, signs = (objective.low_lift, objective.high_lift), (1.0, -1.0)
    weights = [old / gap for old, gap in zip((unknowns.low_push, unknowns.high_push), gaps, strict=True)]
    pushes = [sign * barrier / gap for sign, gap in zip(signs, gaps, strict=True)]
    weight, push = sum(weights), sum(pushes)
    tensions, duration = unknowns.values[..., :cables], wide(unknowns.duration)
    weight[..., :cables] += 2.0 * shares * duration
    push[..., :cables] -= 2.0 * shares * duration * tensions
    mixed, second_derivative = equations.mixed.copy(), equations.second_derivative.copy()
    mixed[..., -2] += 2.0 * shares * tensions
    mixed[..., -1] -= sum(part * lift for part, lift in zip(weights, lifts, strict=True))[..., :cables]
    second_derivative[..., -1, -1] += sum((part * lift**2).sum(-1) for part, lift in zip(weights, lifts, strict=True))
    by_level = objective.level + sum((part * lift).sum((2, 3, 4)) for part, lift in zip(pushes, lifts, strict=True))
    by_duration = objective.time / tasks.scale[:, None] + np.sum(shares * tensions**2, axis=(2, 3, 4))
    slope = np.stack([by_duration, by_level], axis=-1)
    return equations._replace(mixed=mixed, second_derivative=second_derivative), weight, push, slope


def _at_instants(tasks: Tasks, unknowns: Unknowns, change: Unknowns) -> np.ndarray:
    # Changes of the coordinates with two derivatives, the duration and the level at all instants, (l, s, m, n, n_x).
    d, count = tasks.places.shape[-1], len(unknowns.duration[0])
    moving = np.zeros((*unknowns.duration.shape, tasks.basis.controls * d))
    moving[..., OUTER * d : -OUTER * d] = change.inner.reshape(*moving.shape[:2], -1)
    near = [change.acceleration[:, side : count + side] for side in (0, 1)]
    by = np.concatenate([change.duration[..., None], *near], axis=-1)
    moving[..., tasks.border] = times(tasks.border_slopes(unknowns), by)
    places = tasks.basis.places(moving.reshape(*moving.shape[:2], -1, d))
    shape = places.shape[:4]
    scalars = wide(change.duration), wide(change.level)
    return np.concatenate(
        [places.reshape(*shape, -1), *(np.broadcast_to(one, (*shape, 1)) for one in scalars)], axis=-1
    )


def _sum(values: np.ndarray) -> np.ndarray:
    return values.reshape(len(values), -1).sum(1)
