"""Least time along paths on a grid: sets of path speeds from which the end can be reached, and fastest motions.

From the last cell to the first, K = {x : some u in the half-planes of the cell leads into the next K} is an interval
(Pham and Pham 2018) where h(x) = beta(x) - alpha(x) >= 0. With beta the smallest upper bound of u and alpha the largest
lower one, h is concave and piecewise linear. Newton's steps from outside never pass a zero of such a function, and end
after a few; a derivative that points away from zero proves that K is empty. So no linear program is needed.

Within a cell u changes at a constant rate, chosen in advance; half-planes hold at both ends of each cell.
Paths are the last axis of all arrays, and are solved together.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from cspr_jax.families.paths.least_time.constraints import HalfPlanes
from cspr_jax.numerics.shapes import Float
from cspr_jax.runtime import compile_options
from cspr_jax.runtime.persistent_jit import persistent_jit

FLAT = 1e-12  # a half-plane with a smaller coefficient of u bounds x alone
STEPS = 40  # largest number of Newton steps
# Rounding error of h, over the largest of its terms.
CLOSE = 1e-13


class GridCells(NamedTuple):
    """Half-planes of n_cells cells of n_paths paths.

    Fields:
        u: (n_cells, n_rows, n_paths) coefficient of u in the middle of the cell.
        x: (n_cells, n_rows, n_paths) coefficient of x at the start of the cell.
        bound: (n_cells, n_rows, n_paths) bounds.
        width: (n_cells, n_paths) width of the cells, m.
        cap: (n_cells + 1, n_paths) largest x at the nodes, finite.
    """

    u: Array
    x: Array
    bound: Array
    width: Array
    cap: Array


def _cells_of(sides: tuple[HalfPlanes, HalfPlanes], width: Array, u_rate: Array, cap: Array) -> GridCells:
    # At the end of a cell, x is its value at the start plus what u in the middle adds.
    start, end = sides
    half = (0.5 * u_rate * width)[:, None]
    return GridCells(
        u=jnp.concatenate([start.u, end.u + 2.0 * width[:, None] * end.x], axis=1),
        x=jnp.concatenate([start.x, end.x], axis=1),
        bound=jnp.concatenate([start.bound + start.u * half, end.bound - end.u * half], axis=1),
        width=width,
        cap=cap,
    )


class GridSolution(NamedTuple):
    """Fastest motions on the grid.

    Fields:
        low: (n_cells + 1, n_paths) smallest x from which the end can be reached; NaN before an empty set.
        high: (n_cells + 1, n_paths) largest such x.
        x: (n_cells + 1, n_paths) squared path speeds, 1/s^2 times the unit of s^2.
        u: (n_cells, n_paths) path accelerations in the middle of the cells.
        empty: (n_paths,) index of the last cell without a controllable x; -1 if all cells have one; n_cells if x at the
            end is above its cap.
        is_start: (n_paths,) whether the start is controllable.
    """

    low: Array
    high: Array
    x: Array
    u: Array
    empty: Array
    is_start: Array


class _Bounds(NamedTuple):
    # Bounds of u are lines in x, offset - rate x; `upper` is inf, and `lower` -inf, for no bound.
    upper: Array
    lower: Array
    rate: Array
    magnitude: Array


def _bounds_of(u: Array, x_coefficient: Array, bound: Array) -> _Bounds:
    over = jnp.where(jnp.abs(u) > FLAT, u, 1.0)
    offset, rate = bound / over, jnp.where(jnp.abs(u) > FLAT, x_coefficient / over, 0.0)
    upper, lower = jnp.where(u > FLAT, offset, jnp.inf), jnp.where(u < -FLAT, offset, -jnp.inf)
    return _Bounds(upper, lower, rate, jnp.abs(offset))


def _gap(bounds: _Bounds, x: Array) -> tuple[Array, Array, Array]:
    # Return h at x, its derivative, and its rounding error; use reductions alone, since searches for indices are slow.
    upper, lower = bounds.upper - bounds.rate * x[None], bounds.lower - bounds.rate * x[None]
    beta, alpha = jnp.min(upper, axis=0), jnp.max(lower, axis=0)
    falls = jnp.max(jnp.where(upper <= beta[None], bounds.rate, -jnp.inf), axis=0)
    rises = jnp.min(jnp.where(lower >= alpha[None], bounds.rate, jnp.inf), axis=0)
    magnitude = jnp.abs(bounds.rate * x[None]) + bounds.magnitude
    largest = jnp.max(jnp.where((upper <= beta[None]) | (lower >= alpha[None]), magnitude, 0.0), axis=0)
    return beta - alpha, rises - falls, CLOSE * largest


def _edge(bounds: _Bounds, x: Array, sign: float) -> Array:
    # Find the first x from outside at which h is not negative; NaN if there is none.
    def is_open(carry) -> Array:
        _, is_outside, _, step = carry
        return is_outside.any() & (step < STEPS)

    def follow(carry):
        x, is_outside, is_lost, step = carry
        gap, rate, rounding = _gap(bounds, x)
        is_outside &= ~(gap >= -rounding)
        # No step is possible where the gap is NaN, beyond an empty set. Where steps have ended, keep the last x.
        leads = (gap < 0.0) & (rate * sign < 0.0)
        is_lost |= is_outside & ~leads
        is_outside &= leads
        return jnp.where(is_outside, x - gap / jnp.where(leads, rate, 1.0), x), is_outside, is_lost, step + 1

    is_number = jnp.isfinite(x)
    x, is_outside, is_lost, _ = lax.while_loop(is_open, follow, (x, is_number, ~is_number, 0))
    return jnp.where(is_outside | is_lost, jnp.nan, x)


def _flat_range(u: Array, x_coefficient: Array, bound: Array, cap: Array) -> tuple[Array, Array]:
    # Return the smallest and the largest x by the half-planes that do not bound u, and by the cap; the largest is -1 if
    # none is possible.
    is_flat = jnp.abs(u) <= FLAT
    over = jnp.where(jnp.abs(x_coefficient) > FLAT, x_coefficient, 1.0)
    high = jnp.min(jnp.where(is_flat & (x_coefficient > FLAT), bound / over, jnp.inf), axis=0)
    low = jnp.max(jnp.where(is_flat & (x_coefficient < -FLAT), bound / over, 0.0), axis=0)
    never = (is_flat & (jnp.abs(x_coefficient) <= FLAT) & (bound < 0.0)).any(0)
    return jnp.maximum(low, 0.0), jnp.where(never, -1.0, jnp.minimum(high, cap))


@persistent_jit(compiler_options=compile_options.proof_options())
def fastest(
    sides: tuple[HalfPlanes, HalfPlanes],
    width: Float[Array, "n_cells n_paths"],
    u_rate: Float[Array, "n_cells n_paths"],
    cap: Float[Array, "n_cells+1 n_paths"],
    ends: tuple[Float[Array, "n_paths"], Float[Array, "n_paths"]],
) -> GridSolution:
    """Fastest motions along paths."""
    cells = _cells_of(sides, width, u_rate, cap)
    start, end = ends

    def half_planes_of(cell: GridCells, low: Array, high: Array) -> tuple[Array, Array, Array]:
        # Add the half-planes that lead into the next set.
        twice, one = 2.0 * cell.width, jnp.ones_like(cell.width)
        u = jnp.concatenate([cell.u, twice[None], -twice[None]])
        x = jnp.concatenate([cell.x, one[None], -one[None]])
        return u, x, jnp.concatenate([cell.bound, high[None], -low[None]])

    def back(following, cell: GridCells):
        low, high, empty, index = following
        half_planes = half_planes_of(cell, low, high)
        floor, ceiling = _flat_range(*half_planes, cell.cap)
        bounds = _bounds_of(*half_planes)
        top = _edge(bounds, jnp.where(ceiling >= floor, ceiling, jnp.nan), 1.0)
        bottom = _edge(bounds, floor, -1.0)
        is_empty = ~(bottom <= top)
        is_last = is_empty & (empty < 0) & jnp.isfinite(low)
        empty = jnp.where(is_last, index, empty)
        bottom, top = (jnp.where(is_empty, jnp.nan, side) for side in (bottom, top))
        return (bottom, top, empty, index - 1), (bottom, top)

    n_cells, n_paths = cells.width.shape
    is_end = end <= cells.cap[-1]
    last = jnp.where(is_end, end, jnp.nan)
    none = jnp.full(n_paths, -1)
    first = (last, last, jnp.where(is_end, none, n_cells), n_cells - 1)
    steps = cells._replace(cap=cells.cap[:-1])
    (_, _, empty, _), (low, high) = lax.scan(back, first, steps, reverse=True)
    low, high = jnp.concatenate([low, last[None]]), jnp.concatenate([high, last[None]])
    is_start = (start >= low[0] - CLOSE * (1.0 + start)) & (start <= high[0] + CLOSE * (1.0 + start))

    def ahead(x: Array, step):
        cell, low, high = step
        bounds = _bounds_of(*half_planes_of(cell, low, high))
        after = jnp.clip(x + 2.0 * cell.width * jnp.min(bounds.upper - bounds.rate * x[None], axis=0), low, high)
        return after, (after, 0.5 * (after - x) / cell.width)

    beginning = jnp.clip(start, low[0], high[0])
    _, (x, u) = lax.scan(ahead, beginning, (steps, low[1:], high[1:]))
    return GridSolution(low, high, jnp.concatenate([beginning[None], x]), u, empty, is_start)


def minmod_rates(u: Float[np.ndarray, "n_cells"], width: Float[np.ndarray, "n_cells"]) -> Float[np.ndarray, "n_cells"]:
    """Changes of u within cells: the smaller of the changes to both neighbours, 0 where their signs differ."""
    steps = np.diff(u) / (0.5 * (width[1:] + width[:-1]))
    before, after = steps[:-1], steps[1:]
    rates = np.where(before * after > 0.0, np.sign(before) * np.minimum(np.abs(before), np.abs(after)), 0.0)
    return np.concatenate([[0.0], rates, [0.0]])
