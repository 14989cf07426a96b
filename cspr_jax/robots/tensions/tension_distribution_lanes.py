"""Tensions of least norm within limits, one lane for each pose: a fast form of `tension_distribution.least_norm`.

It serves robots with one or two redundant cables. All tensions are t0 + N^T x, by Gram and Schmidt, with each row
orthogonalised twice. The shortest feasible x is 0, or lies on the line where one cable is at a limit, as near to 0 as
the other cables allow: on each line they leave an interval, whose point nearest to 0 is either the point of the line
nearest to 0 or an end of the interval.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from cspr_jax.numerics.batches import device_batch_size, in_batches, in_parts
from cspr_jax.numerics.elementary import nan_ignoring_min
from cspr_jax.numerics.linear.lanes import materialized
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.statics.wrench_sets import FLAT
from cspr_jax.robots.tensions.tension_distribution import TENSION_ERROR, WITHIN, Distribution

Lanes = Sequence[Array]

# Numbers of redundant cables that this form serves.
FREE = (1, 2)
# Number of poses of a batch on a CPU, so that some hundred arrays fit into a cache.
BATCH = 4096
# The slow form decides if rows of a wrench matrix are nearly dependent: each has a component normal to the rows before
# it, and the shortest of these components is not above this fraction of the longest.
UNCERTAIN = 1e-5


def _dot(a: Lanes, b: Lanes) -> Array:
    total = a[0] * b[0]
    for x, y in zip(a[1:], b[1:], strict=True):
        total = total + x * y
    return total


def _normal_part(vector: Lanes, units: Sequence[Lanes], one: Array) -> tuple[Lanes, Lanes]:
    """Component of a vector normal to unit vectors, and its products with them; done twice against rounding errors."""
    total: Lanes = [jnp.zeros_like(vector[0])] * len(units)
    for _ in range(2):
        products = materialized([_dot(vector, unit) for unit in units], one)
        total = [x + y for x, y in zip(total, products, strict=True)]
        left = [x - _dot(products, [unit[k] for unit in units]) if units else x for k, x in enumerate(vector)]
        vector = materialized(left, one)
    return vector, total


@jax.jit
def _all_tensions(matrix: Array, wrench: Array, one: Array) -> tuple[list[Array], list[list[Array]], Array]:
    # From matrix (dof, n_cables, n) and wrench (dof, n): t0, N, and the shortest normal component of a row over the
    # longest.
    dof, count = matrix.shape[:2]
    units: list[Lanes] = []
    along: list[Array] = []
    lengths: list[Array] = []
    for i in range(dof):
        left, products = _normal_part([matrix[i, k] for k in range(count)], units, one)
        length = jnp.sqrt(_dot(left, left))
        inverse = 1.0 / length
        along.append(materialized((wrench[i] - (_dot(products, along) if units else 0.0)) * inverse, one))
        units.append([x * inverse for x in left])
        lengths.append(length)
    min_norm = [_dot(along, [unit[k] for unit in units]) for k in range(count)]
    kernel: list[list[Array]] = []
    for _ in range(count - dof):
        # Continue with the cable whose unit vector has the longest component normal to all rows so far.
        rest = [1.0 - _dot(column, column) for column in ([unit[k] for unit in units] for k in range(count))]
        index, maximum = jnp.zeros_like(rest[0]), rest[0]
        for k, value in enumerate(rest[1:], 1):
            index, maximum = jnp.where(value > maximum, float(k), index), jnp.where(value > maximum, value, maximum)
        index = materialized(index, one)
        left, _ = _normal_part([jnp.where(index == k, 1.0, 0.0) for k in range(count)], units, one)
        inverse = 1.0 / jnp.sqrt(_dot(left, left))
        kernel.append([materialized(x * inverse, one) for x in left])
        units.append(kernel[-1])
    shortest, longest = lengths[0], lengths[0]
    for length in lengths[1:]:
        shortest, longest = nan_ignoring_min(length, shortest), jnp.where(length > longest, length, longest)
    return min_norm, kernel, shortest / longest


def _interval(values: Lanes, rates: Lanes, low: Lanes, high: Lanes, rounding: Array) -> tuple[Array, Array]:
    """Ends of the interval of s in which values + s * rates keep limits; where it is empty the first is the larger."""
    first, last = jnp.full_like(values[0], -jnp.inf), jnp.full_like(values[0], jnp.inf)
    for value, rate, minimum, maximum in zip(values, rates, low, high, strict=True):
        moves = jnp.abs(rate) > FLAT
        inverse = 1.0 / jnp.where(moves, rate, 1.0)
        to_least, to_most = (minimum - rounding - value) * inverse, (maximum + rounding - value) * inverse
        near, far = nan_ignoring_min(to_least, to_most), jnp.where(to_least > to_most, to_least, to_most)
        # A tension whose rate is zero keeps its limits for all s or for none.
        is_kept = (value >= minimum - rounding) & (value <= maximum + rounding)
        near, far = jnp.where(moves, near, -jnp.inf), jnp.where(moves | is_kept, far, -jnp.inf)
        far = jnp.where(moves | ~is_kept, far, jnp.inf)
        first, last = jnp.where(near > first, near, first), nan_ignoring_min(far, last)
    return first, last


def _nearest(first: Array, last: Array) -> Array:
    # Point of an interval that is nearest to 0.
    return jnp.where(first > 0.0, first, jnp.where(last < 0.0, last, 0.0))


@jax.jit
def _on_line(min_norm: Lanes, kernel: Sequence[Lanes], low: Lanes, high: Lanes, magnitude: Array) -> Array:
    # Shortest x with the first cable at a limit, as a complex number; not finite where there is none.
    (a, *others), (b, *more) = kernel
    square = a * a + b * b
    inverse = 1.0 / jnp.where(square > FLAT**2, square, 1.0)
    rates = [a * y - b * x for x, y in zip(others, more, strict=True)]
    best, shortest = lax.complex(jnp.full_like(a, jnp.inf), jnp.zeros_like(a)), jnp.full_like(a, jnp.inf)
    for limit in (low[0], high[0]):
        offset = (limit - min_norm[0]) * inverse
        values = [t + offset * (a * x + b * y) for t, x, y in zip(min_norm[1:], others, more, strict=True)]
        first, last = _interval(values, rates, low[1:], high[1:], TENSION_ERROR * magnitude)
        along = _nearest(first, last)
        length = (offset * offset + along * along) * square
        is_point = (first <= last) & jnp.isfinite(limit) & (square > FLAT**2) & (length < shortest)
        x, y = offset * a - along * b, offset * b + along * a
        best, shortest = jnp.where(is_point, lax.complex(x, y), best), jnp.where(is_point, length, shortest)
    return best


@jax.jit
def _in_interval(min_norm: Lanes, kernel: Sequence[Lanes], low: Lanes, high: Lanes, magnitude: Array) -> Array:
    # Shortest x of one component.
    first, last = _interval(min_norm, kernel[0], low, high, TENSION_ERROR * magnitude)
    along = jnp.where(first <= last, _nearest(first, last), jnp.inf)
    return lax.complex(along, jnp.zeros_like(along))


@jax.jit
def _magnitude(min_norm: Lanes, low: Lanes) -> Array:
    total = jnp.abs(min_norm[0]) + low[0]
    for tension, limit in zip(min_norm[1:], low[1:], strict=True):
        total = total + jnp.abs(tension) + limit
    return total


@jax.jit
def _shortest(min_norm: Lanes, low: Lanes, high: Lanes, magnitude: Array, points: Sequence[Array]) -> Array:
    within, rounding = jnp.full_like(min_norm[0], True, bool), TENSION_ERROR * magnitude
    for tension, lowest, highest in zip(min_norm, low, high, strict=True):
        within = within & (tension >= lowest - rounding) & (tension <= highest + rounding)
    best = points[0]
    shortest = best.real * best.real + best.imag * best.imag
    for point in points[1:]:
        square = point.real * point.real + point.imag * point.imag
        best, shortest = jnp.where(square < shortest, point, best), nan_ignoring_min(square, shortest)
    # The result is not finite where no point is within limits.
    return jnp.where(within, jnp.zeros_like(best), best)


@jax.jit
def _tensions(min_norm: Lanes, kernel: Sequence[Lanes], point: Array) -> list[Array]:
    parts = (point.real, point.imag)[: len(kernel)]
    is_point = jnp.isfinite(point.real)
    safe = [jnp.where(is_point, part, 0.0) for part in parts]
    return [t + _dot(safe, [row[k] for row in kernel]) for k, t in enumerate(min_norm)]


@jax.jit
def _verdict(tensions: Lanes, low: Lanes, high: Lanes, point: Array) -> Array:
    excess, largest = jnp.zeros_like(tensions[0]), jnp.zeros_like(tensions[0])
    for tension, lowest, highest in zip(tensions, low, high, strict=True):
        for far in (lowest - tension, tension - highest):
            excess = jnp.where(far > excess, far, excess)
        largest = jnp.where(jnp.abs(tension) > largest, jnp.abs(tension), largest)
    return jnp.isfinite(point.real) & (excess <= WITHIN * largest)


@jax.jit
def _residual(matrix: Array, wrench: Array, tensions: Lanes) -> Array:
    dof, count = matrix.shape[:2]
    off, square = jnp.zeros_like(wrench[0]), jnp.zeros_like(wrench[0])
    for i in range(dof):
        gap = _dot([matrix[i, k] for k in range(count)], tensions) - wrench[i]
        off, square = off + gap * gap, square + wrench[i] * wrench[i]
    return jnp.sqrt(off) / (1.0 + jnp.sqrt(square))


def _of_batch(batch: tuple[np.ndarray, ...]) -> tuple[tuple[Array, ...], Array, Array, Array]:
    matrix, wrench, low, high = (np.ascontiguousarray(np.moveaxis(x, 0, -1)) for x in batch)
    lows, highs = list(low), list(high)
    min_norm, kernel, fraction = _all_tensions(matrix, wrench, np.ones(()))
    magnitude = _magnitude(min_norm, lows)
    if len(kernel) == 1:
        points = [_in_interval(min_norm, kernel, lows, highs, magnitude)]
    else:
        # Take each cable in turn as the first, so that one compiled function serves all.
        points = []
        for k in range(len(lows)):
            rolled = [[x[k], *x[:k], *x[k + 1 :]] for x in (min_norm, *kernel, lows, highs)]
            points.append(_on_line(rolled[0], rolled[1:3], *rolled[3:], magnitude))
    point = _shortest(min_norm, lows, highs, magnitude, points)
    tensions = _tensions(min_norm, kernel, point)
    return tuple(tensions), _residual(matrix, wrench, tensions), _verdict(tensions, lows, highs, point), fraction


def least_norms(
    matrices: Float[np.ndarray, "n dof n_cables"],
    wrenches: Float[np.ndarray, "n dof"],
    low: Float[np.ndarray, "n n_cables"],
    high: Float[np.ndarray, "n n_cables"],
) -> tuple[Distribution, np.ndarray]:
    """Tensions of least norm within limits, of many poses, and a mask of poses that the slow form must decide."""

    def one(part: slice):
        arrays = tuple(x[part] for x in (matrices, wrenches, low, high))
        tensions, *others = in_batches(_of_batch, arrays, batch_size=BATCH)
        return np.stack(tensions, 1), *others

    parts = in_parts(one, len(matrices), 4 * device_batch_size(BATCH))
    tensions, residual, is_within, fraction = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Distribution(*(cast(Array, x) for x in (tensions, residual, is_within))), ~(fraction > UNCERTAIN)
