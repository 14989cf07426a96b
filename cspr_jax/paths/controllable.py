"""Least time along paths on a grid: sets of path speeds from which the end can be reached, and the fastest motion.

From the last cell to the first, K = {x : some u in the half-planes of the cell leads into the next K} is an interval
(Pham and Pham 2018), where h(x) = beta(x) - alpha(x) >= 0: beta, the smallest upper bound of u, less alpha, the largest
lower one, is concave and piecewise linear. Newton's steps from outside never pass a zero of such a function, and end
after a few; a slope that points away from zero proves that K is empty. So no linear program is solved.

Within a cell u changes at a constant rate that is chosen before; half-planes hold at both ends of each cell. Paths are
the last axis of all arrays, and are solved together.
"""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

# A half-plane whose share of u is smaller bounds x alone. Steps of Newton, at most.
FLAT, STEPS = 1e-12, 40
# Part of the numbers in it by which h may miss zero.
CLOSE = 1e-13


class Cells(NamedTuple):
    """Half-planes of n_cells cells of n_paths paths.

    Fields:
        u: (n_cells, n_rows, n_paths) share of u in the middle of the cell.
        x: likewise, of x at its start.
        most: likewise, bounds.
        width: (n_cells, n_paths) width of the cells, m.
        cap: (n_cells + 1, n_paths) largest x at the nodes, finite.
    """

    u: Array
    x: Array
    most: Array
    width: Array
    cap: Array


class Fastest(NamedTuple):
    """Fastest motions on the grid.

    Fields:
        low: (n_cells + 1, n_paths) smallest x from which the end can be reached; NaN before an empty set.
        high: likewise, the largest.
        x: (n_cells + 1, n_paths) squared path speeds, 1/s^2 times the unit of s^2.
        u: (n_cells, n_paths) path accelerations in the middle of the cells.
        binding: (n_cells, n_paths) number of the half-plane that bounds u; n_rows: the next set.
        empty: (n_paths,) number of the last cell without a controllable x; -1: there is none.
        meeting: (2, n_paths) numbers of the half-planes that bound u from above and below there; n_rows and n_rows + 1
            are those of the next set.
        is_start: (n_paths,) whether the start is controllable.
    """

    low: Array
    high: Array
    x: Array
    u: Array
    binding: Array
    empty: Array
    meeting: Array
    is_start: Array


class _Sides(NamedTuple):
    # Bounds of u at x, their changes with x, the size of the numbers in them, and the half-planes that give them.
    beta: Array
    beta_slope: Array
    alpha: Array
    alpha_slope: Array
    size: Array
    above: Array
    below: Array


def _sides(u: Array, x_share: Array, most: Array, x: Array) -> _Sides:
    over = jnp.where(jnp.abs(u) > FLAT, u, 1.0)
    value, slope = (most - x_share * x[None]) / over, -x_share / over
    upper, lower = jnp.where(u > FLAT, value, jnp.inf), jnp.where(u < -FLAT, value, -jnp.inf)
    above, below = jnp.argmin(upper, axis=0), jnp.argmax(lower, axis=0)

    def at(array: Array, row: Array) -> Array:
        return jnp.take_along_axis(array, row[None], axis=0)[0]

    terms = (jnp.abs(most) + jnp.abs(x_share * x[None])) / jnp.abs(over)
    size = at(terms, above) + at(terms, below)
    return _Sides(at(upper, above), at(slope, above), at(lower, below), at(slope, below), size, above, below)


def _edge(u: Array, x_share: Array, most: Array, x: Array, sign: float) -> tuple[Array, _Sides]:
    # Follow h from outside to where it is no longer negative; a NaN says that it is so nowhere.
    def evaluate(x: Array) -> tuple[Array, Array, Array, _Sides]:
        sides = _sides(u, x_share, most, x)
        gap = sides.beta - sides.alpha
        return gap, sides.beta_slope - sides.alpha_slope, ~(gap >= -CLOSE * sides.size), sides

    def is_open(carry) -> Array:
        _, is_outside, step = carry
        return is_outside.any() & (step < STEPS)

    def follow(carry):
        x, is_outside, step = carry
        gap, slope, outside, _ = evaluate(x)
        leads = slope * sign < 0.0
        moved = jnp.where(leads, x - gap / jnp.where(leads, slope, 1.0), jnp.nan)
        return jnp.where(is_outside & outside, moved, x), is_outside & outside & leads, step + 1

    x, is_outside, _ = lax.while_loop(is_open, follow, (x, jnp.isfinite(x), 0))
    sides = evaluate(x)[3]
    return jnp.where(is_outside, jnp.nan, x), sides


def _flat_range(u: Array, x_share: Array, most: Array, cap: Array) -> tuple[Array, Array]:
    # Smallest and largest x by the half-planes that do not bound u, and by the cap; none: the largest is -1.
    is_flat = jnp.abs(u) <= FLAT
    over = jnp.where(jnp.abs(x_share) > FLAT, x_share, 1.0)
    high = jnp.min(jnp.where(is_flat & (x_share > FLAT), most / over, jnp.inf), axis=0)
    low = jnp.max(jnp.where(is_flat & (x_share < -FLAT), most / over, 0.0), axis=0)
    never = (is_flat & (jnp.abs(x_share) <= FLAT) & (most < 0.0)).any(0)
    return jnp.maximum(low, 0.0), jnp.where(never, -1.0, jnp.minimum(high, cap))


@partial(jax.jit, static_argnames=("free_end",))
def fastest(cells: Cells, start: Array, end: Array, free_end: bool = False) -> Fastest:
    """Fastest motions along paths.

    Args:
        start: (n_paths,) x at the start.
        end: (n_paths,) x at the end.
        free_end: whether the end may have any x up to that one.

    Returns:
        the motions.
    """
    n_rows = cells.u.shape[1]

    def rows_of(cell: Cells, low: Array, high: Array) -> tuple[Array, Array, Array]:
        # With the half-planes that lead into the next set.
        twice, one = 2.0 * cell.width, jnp.ones_like(cell.width)
        u = jnp.concatenate([cell.u, twice[None], -twice[None]])
        x = jnp.concatenate([cell.x, one[None], -one[None]])
        return u, x, jnp.concatenate([cell.most, high[None], -low[None]])

    def back(following, cell: Cells):
        low, high, empty, meeting, index = following
        rows = rows_of(cell, low, high)
        floor, ceiling = _flat_range(*rows, cell.cap)
        top, sides = _edge(*rows, jnp.where(ceiling >= floor, ceiling, jnp.nan), 1.0)
        bottom, _ = _edge(*rows, floor, -1.0)
        is_empty = ~(bottom <= top)
        is_last = is_empty & (empty < 0) & jnp.isfinite(low)
        empty = jnp.where(is_last, index, empty)
        meeting = jnp.where(is_last, jnp.stack([sides.above, sides.below]), meeting)
        bottom, top = (jnp.where(is_empty, jnp.nan, side) for side in (bottom, top))
        return (bottom, top, empty, meeting, index - 1), (bottom, top)

    n_cells, n_paths = cells.width.shape
    is_end = end <= cells.cap[-1]
    last = jnp.where(is_end, end, jnp.nan)
    lowest = jnp.where(is_end, 0.0, jnp.nan) if free_end else last
    none = jnp.full(n_paths, -1)
    first = (lowest, last, jnp.where(is_end, none, n_cells), jnp.full((2, n_paths), n_rows), n_cells - 1)
    steps = cells._replace(cap=cells.cap[:-1])
    (_, _, empty, meeting, _), (low, high) = lax.scan(back, first, steps, reverse=True)
    low, high = jnp.concatenate([low, lowest[None]]), jnp.concatenate([high, last[None]])
    is_start = (start >= low[0] - CLOSE * (1.0 + start)) & (start <= high[0] + CLOSE * (1.0 + start))

    def ahead(x: Array, step):
        cell, low, high = step
        sides = _sides(*rows_of(cell, low, high), x)
        after = jnp.clip(x + 2.0 * cell.width * sides.beta, low, high)
        return after, (after, 0.5 * (after - x) / cell.width, jnp.minimum(sides.above, n_rows))

    beginning = jnp.clip(start, low[0], high[0])
    _, (x, u, binding) = lax.scan(ahead, beginning, (steps, low[1:], high[1:]))
    return Fastest(low, high, jnp.concatenate([beginning[None], x]), u, binding, empty, meeting, is_start)


def cells_of(sides, width: Array, bend: Array, cap: Array) -> Cells:
    """Cells of half-planes at their ends.

    Args:
        sides: `paths.rows.Rows` of the starts, and of the ends of cells, leaves (n_cells, n_rows, n_paths).
        width: (n_cells, n_paths) m.
        bend: (n_cells, n_paths) change of u along the cell, over its width.
        cap: (n_cells + 1, n_paths).

    Returns:
        the cells.
    """
    start, end = sides
    half = (0.5 * bend * width)[:, None]
    return Cells(
        u=jnp.concatenate([start.u, end.u + 2.0 * width[:, None] * end.x], axis=1),
        x=jnp.concatenate([start.x, end.x], axis=1),
        most=jnp.concatenate([start.most + start.u * half, end.most - end.u * half], axis=1),
        width=width,
        cap=cap,
    )


def smallest_of_slopes(u: np.ndarray, width: np.ndarray) -> np.ndarray:
    """Changes of u within cells: of the changes to both neighbours the smaller one, 0 where their signs differ.

    Args:
        u: (n_cells, n_paths) in the middle of the cells.
        width: (n_cells, n_paths) m.

    Returns:
        (n_cells, n_paths) 0 in the first and the last cell.
    """
    steps = np.diff(u, axis=0) / (0.5 * (width[1:] + width[:-1]))
    before, after = steps[:-1], steps[1:]
    slopes = np.where(before * after > 0.0, np.sign(before) * np.minimum(np.abs(before), np.abs(after)), 0.0)
    nothing = np.zeros((1, u.shape[1]))
    return np.concatenate([nothing, slopes, nothing])
