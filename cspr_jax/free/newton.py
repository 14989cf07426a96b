"""Steps of Newton's method: banded matrices of segments, with durations and accelerations at poses as borders."""

from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dpbtrf, dpbtrs

from cspr_jax.free.basis import LOCAL, Basis
from cspr_jax.free.elimination import Softness, eliminated, times, transposed
from cspr_jax.free.instants import InstantValues
from cspr_jax.free.tasks import OUTER, Tasks, Unknowns

# Added to the diagonal where the matrix has a negative curvature: least, at first; by what it grows and shrinks; tries.
CURVED, MOST_CURVED, GROWING, SHRINKING, TRIES = 1e-6, 1e6, 6.0, 3.0, 25


class Step(NamedTuple):
    """Step of l motions.

    Fields:
        change: of the unknowns.
        fall: (l,) slope of the merit along it.
        curved: (l,) what was added to the diagonal.
    """

    change: Unknowns
    fall: np.ndarray
    curved: np.ndarray


class _Bordered(NamedTuple):
    # Newton's equations of segments, (l, s, ...): of inner coordinates in bands, with borders, and right-hand sides.
    band: np.ndarray
    beside: np.ndarray
    border: np.ndarray
    inner_right: np.ndarray
    border_right: np.ndarray


def gathered(basis: Basis, push: np.ndarray) -> np.ndarray:
    """Gradient of a sum over instants.

    Args:
        push: (l, s, m, n, 3 d + 1) gradients by coordinates with two derivatives, and by the duration.

    Returns:
        (l, s, K d + 1) by the coordinates of control points, and by the duration.
    """
    d = (push.shape[-1] - 1) // 3
    places = push[..., :-1].reshape(*push.shape[:-1], 3, d)
    local = np.einsum("mnrk,lsmnrd->lsmkd", basis.rows, places, optimize=True)
    whole = np.zeros((*push.shape[:2], basis.controls, d))
    for m in range(len(basis.tau)):
        whole[:, :, m : m + LOCAL] += local[:, :, m]
    duration = push[..., -1].sum((2, 3))
    return np.concatenate([whole.reshape(*push.shape[:2], -1), duration[..., None]], axis=-1)


def _assembled(basis: Basis, bend: np.ndarray) -> np.ndarray:
    # The Hessian of a sum over instants, (l, s, K d + 1, K d + 1), as `gathered`.
    d = (bend.shape[-1] - 1) // 3
    m, n = basis.tau.shape
    weights = np.zeros((m, n, 3 * d + 1, LOCAL * d + 1))
    for i in range(d):
        weights[:, :, i : 3 * d : d, i : LOCAL * d : d] = basis.rows
    weights[:, :, -1, -1] = 1.0
    local = np.einsum("mnya,lsmnyb->lsmab", weights, bend @ weights, optimize=True)
    size, last = LOCAL * d, basis.controls * d
    whole = np.zeros((*bend.shape[:2], last + 1, last + 1))
    for k in range(m):
        part = slice(k * d, k * d + size)
        whole[:, :, part, part] += local[:, :, k, :size, :size]
        whole[:, :, part, last] += local[:, :, k, :size, size]
    whole[:, :, last, last] = local[:, :, :, size, size].sum(2)
    whole[:, :, last, :last] = whole[:, :, :last, last]
    return whole


def _segments(tasks: Tasks, unknowns: Unknowns, bend: np.ndarray, slope: np.ndarray, push: np.ndarray) -> _Bordered:
    # Newton's equations bend z + slope = 0 in inner coordinates, and in durations and accelerations; push is the
    # gradient of the Lagrangian.
    d, border = tasks.places.shape[-1], tasks.border
    inner = np.arange(OUTER * d, (tasks.basis.controls - OUTER) * d)
    columns = np.append(border, tasks.basis.controls * d)
    moves = np.zeros((*unknowns.duration.shape, len(columns), 1 + 2 * d))
    moves[:, :, :-1] = tasks.border_slopes(unknowns)
    moves[:, :, -1, 0] = 1.0
    width = LOCAL * d
    below = np.minimum(np.arange(width)[:, None] + np.arange(len(inner)), len(inner) - 1)
    is_inside = np.arange(width)[:, None] + np.arange(len(inner)) < len(inner)
    band = np.where(is_inside, bend[:, :, inner[below], inner[None]], 0.0)
    beside = bend[:, :, inner[:, None], columns] @ moves
    corner = transposed(moves) @ bend[:, :, columns[:, None], columns] @ moves
    corner = corner + tasks.border_bends(unknowns, push[:, :, border])
    return _Bordered(band, beside, corner, -slope[:, :, inner], -times(transposed(moves), slope[:, :, columns]))


def _solved(segments: _Bordered, k: int, is_free: np.ndarray, curved: float) -> tuple[np.ndarray, np.ndarray] | None:
    # Changes of inner coordinates, (s, n), and of durations and accelerations; None where the matrix is not positive.
    count, d = len(segments.band[k]), (segments.border.shape[-1] - 1) // 2
    size = count + (count + 1) * d
    matrix, right, parts = curved * np.eye(size), np.zeros(size), []
    for s in range(count):
        band = segments.band[k, s].copy()
        band[0] += curved
        factor, failed = dpbtrf(band, lower=1)
        if failed:
            return None
        sides = np.concatenate([segments.beside[k, s], segments.inner_right[k, s][:, None]], axis=1)
        solution = dpbtrs(factor, sides, lower=1)[0]
        rows = np.append(s, count + s * d + np.arange(2 * d))
        matrix[np.ix_(rows, rows)] += segments.border[k, s] - segments.beside[k, s].T @ solution[:, :-1]
        right[rows] += segments.border_right[k, s] - segments.beside[k, s].T @ solution[:, -1]
        parts.append((solution, rows))
    moving = np.flatnonzero(np.append(np.ones(count, bool), np.repeat(is_free, d)))
    matrix = matrix[np.ix_(moving, moving)]
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        return None
    change = np.zeros(size)
    change[moving] = np.linalg.solve(matrix, right[moving])
    inner = np.array([solution[:, -1] - solution[:, :-1] @ change[rows] for solution, rows in parts])
    return (inner, change) if np.isfinite(inner).all() and np.isfinite(change).all() else None


def _changes(tasks: Tasks, unknowns: Unknowns, segments: _Bordered, curved: np.ndarray) -> tuple[Unknowns, np.ndarray]:
    # Changes of control points, durations and accelerations, with what had to be added to the diagonal.
    count, d = len(unknowns.duration[0]), tasks.places.shape[-1]
    changes = [np.zeros_like(part) for part in unknowns[:3]]
    used = np.zeros(len(curved))
    for k in range(len(curved)):
        solution = _solved(segments, k, tasks.is_free[k], 0.0)
        tries = min(max(CURVED, curved[k] / SHRINKING), MOST_CURVED) * GROWING ** np.arange(TRIES)
        for more in tries if solution is None else ():
            solution, used[k] = _solved(segments, k, tasks.is_free[k], more), more
            if solution is not None:
                break
        if solution is not None:
            inner, border = solution
            changes[0][k] = inner.reshape(changes[0][k].shape)
            changes[1][k], changes[2][k] = border[:count], border[count:].reshape(count + 1, d)
    return unknowns._replace(inner=changes[0], duration=changes[1], acceleration=changes[2]), used


def newton_step(
    tasks: Tasks,
    unknowns: Unknowns,
    equations: InstantValues,
    residual: np.ndarray,
    barrier: np.ndarray,
    soft: Softness,
    curved: np.ndarray,
) -> Step:
    """Step towards the optimum with a barrier before the bounds.

    Args:
        equations: at the unknowns.
        residual: (l, s, m, n, n_equations) of them.
        barrier: (l,) weight of the logarithms of the distances from the bounds.
        curved: (l,) what was added to the diagonal last.

    Returns:
        the step.
    """
    weight, cables = barrier[:, None, None, None, None], tasks.robot.n_cables
    to_low, to_high = unknowns.values - tasks.low, tasks.high - unknowns.values
    weights = unknowns.low_push / to_low + unknowns.high_push / to_high
    push = weight / to_low - weight / to_high
    local = eliminated(equations, weights, push, -residual - soft.missed(soft.level), soft)
    slope = gathered(tasks.basis, local.slope)
    slope[..., -1] += 1.0 / tasks.scale[:, None]
    lagrangian = gathered(tasks.basis, times(transposed(equations.slope), unknowns.multipliers))
    segments = _segments(tasks, unknowns, _assembled(tasks.basis, local.bend), slope, lagrangian)
    change, used = _changes(tasks, unknowns, segments, curved)
    state = _at_instants(tasks, unknowns, change)
    values, multipliers = local.changes(state, cables, tasks.robot.dof)
    pushes = (
        np.where(np.isfinite(gap), weight / gap - old - old / gap * step, 0.0)
        for gap, old, step in ((to_low, unknowns.low_push, values), (to_high, unknowns.high_push, -values))
    )
    missed = times(equations.slope, state)
    missed[..., : tasks.robot.dof] += times(equations.matrix, values[..., :cables])
    missed[..., tasks.robot.dof :] += values[..., cables:]
    price = (soft.level + soft.paid(residual)) * missed
    fall = change.duration.sum(1) / tasks.scale + _sum(price) - _sum(push * values)
    return Step(Unknowns(*change[:3], values, multipliers - unknowns.multipliers, *pushes), fall, used)


def _at_instants(tasks: Tasks, unknowns: Unknowns, change: Unknowns) -> np.ndarray:
    # Changes of the coordinates with two derivatives, and of the duration, at all instants, (l, s, m, n, n_x).
    d, count = tasks.places.shape[-1], len(unknowns.duration[0])
    moving = np.zeros((*unknowns.duration.shape, tasks.basis.controls * d))
    moving[..., OUTER * d : -OUTER * d] = change.inner.reshape(*moving.shape[:2], -1)
    near = [change.acceleration[:, side : count + side] for side in (0, 1)]
    by = np.concatenate([change.duration[..., None], *near], axis=-1)
    moving[..., tasks.border] = times(tasks.border_slopes(unknowns), by)
    places = tasks.basis.places(moving.reshape(*moving.shape[:2], -1, d))
    shape = places.shape[:4]
    duration = np.broadcast_to(change.duration[:, :, None, None, None], (*shape, 1))
    return np.concatenate([places.reshape(*shape, -1), duration], axis=-1)


def _sum(values: np.ndarray) -> np.ndarray:
    return values.reshape(len(values), -1).sum(1)
