"""Witness tensions: tensions that balance a motion throughout a block of time, and bounds of their largest margin.

A line f + s f' of tensions that meets the balance and its derivative in the middle leaves a residual r(s) of second
order; with bounds around parabolas, a parabola leaves one of third order. For any B with A(s) B = 1 + E(s), the
correction B (1 + E)^-1 r makes the balance exact, and it is bounded where the rows of |E| sum to less than 1. Where the
bounds keep the limits, feasible tensions are proved to exist at all times. With as many cables as components these
tensions are the only ones, and A is nowhere singular.

With more cables, the line joins the most central tensions at both ends of the block: between the ends tensions are at
least about as far from their limits, even where another face becomes the nearest one. A face of the set of wrenches
refutes feasibility: let y(s) be normal to the d - 1 columns that span the face (found in the same way, as a solution of
a balance). If all tensions keep a distance r from their limits, y w is at least the sum of y A_i times the limits that
make it smallest, plus r sum |y A_i|: that bounds r from above.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from cspr_jax.numerics.bounds.affine_bounds import AffineBounds, constant, dot, rotated, rounded, squares
from cspr_jax.numerics.elementary import maximum_of, minimum_of, solved
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.statics.wrench_sets import FLAT
from cspr_jax.robots.tensions.nearest_face import NearestFace, nearest_face


class WitnessTensions(NamedTuple):
    """Tensions of one block.

    Fields:
        tension: (n_cables,) bounds of tensions that balance throughout, N; radii are NaN without bounds.
        below: (2,) values, at both ends of the block, of a line below the largest distance of tensions from their
            limits, N; -inf without a bound.
        above: (2,) likewise for a line above the largest distance; inf without a bound.
        is_regular: () whether the matrix is proved to have full rank throughout.
        inverse: (n_cables, dof) right inverse of the matrix in the middle.
    """

    tension: AffineBounds
    below: Array
    above: Array
    is_regular: Array
    inverse: Array

    @property
    def margin_low(self) -> Array:
        """Lower bound of the largest distance of tensions from their limits, at all times, N."""
        return minimum_of(self.below, axis=-1)

    @property
    def margin_high(self) -> Array:
        """Upper bound of the largest distance of tensions from their limits, at all times, N."""
        return maximum_of(self.above, axis=-1)


def witness_tensions(
    matrix: AffineBounds,
    wrench: AffineBounds,
    low: Float[Array, "*2 n_cables"],
    high: Float[Array, "*2 n_cables"],
    outer: tuple[Float[Array, "2 n_cables"], Float[Array, "2 n_cables"]] | None = None,
) -> WitnessTensions:
    """Tensions that balance a motion throughout a block.

    Limits of redundant cables may depend on time: then `low` and `high` are values at both ends of the block of lines
    not outside of these limits, and `outer` those of lines not inside.
    """
    dof, count = matrix.middle.shape
    inverse = right_inverse(matrix.middle)
    if count == dof:
        tension, is_regular = _solution(matrix, inverse, wrench, jnp.zeros(count), jnp.zeros(count))
        smallest = minimum_of(jnp.minimum(tension.high() - low, high - tension.low()))
        above = jnp.broadcast_to(jnp.where(is_regular, smallest, jnp.inf), (2,))
    else:
        matrices, wrenches = (
            jnp.stack([x.middle + squares(x) - x.linear, x.middle + squares(x) + x.linear]) for x in (matrix, wrench)
        )
        lows, highs = (jnp.broadcast_to(side, (2, count)) for side in (low, high))
        faces = jax.vmap(nearest_face)(matrices, wrenches, lows, highs)
        before, after = faces.tensions
        nearer = jnp.argmin(minimum_of(jnp.minimum(faces.tensions - lows, highs - faces.tensions), axis=1))
        face = jax.tree.map(lambda array: array[nearer], faces)
        back = inverse if matrix.square is None else _central_inverse(matrix.middle, face, inverse)
        tension, is_regular = _solution(matrix, back, wrench, 0.5 * (before + after), 0.5 * (after - before))
        above = _face_margin(matrix, inverse, wrench, outer or (lows, highs), face)
        low, high = maximum_of(lows, axis=0), minimum_of(highs, axis=0)
    if tension.square is not None:
        minimum = minimum_of(jnp.minimum(tension.low() - low, high - tension.high()))
        below = jnp.broadcast_to(jnp.where(is_regular, minimum, -jnp.inf), (2,))
        return WitnessTensions(tension, below, above, is_regular, inverse)
    # The minimum of several lines is a concave function, above the line between its values at both ends.
    if count == dof:
        lows, highs = (jnp.broadcast_to(side, (2, count)) for side in (low, high))
    lines = jnp.stack([tension.middle - tension.linear, tension.middle + tension.linear])
    below = minimum_of(jnp.minimum(lines - lows, highs - lines) - tension.radius[None], axis=1)
    return WitnessTensions(tension, jnp.where(is_regular, below, -jnp.inf), above, is_regular, inverse)


def _central_inverse(matrix: Array, face: NearestFace, other: Array) -> Array:
    # Right inverse with which tensions stay the most central ones near one face: all cables that do not span it move
    # away from their limits by the same amount. Return `other` where the cables of the face are linearly dependent.
    dof, count = matrix.shape
    signs = jnp.sign(face.along)
    system = jnp.concatenate([matrix[:, face.columns], (matrix @ signs)[:, None]], axis=1)
    rows = solved(system, jnp.eye(dof))[0]
    is_spanning = (jnp.arange(count)[:, None] == face.columns[None]).astype(matrix.dtype)
    central = is_spanning @ rows[:-1] + signs[:, None] * rows[-1][None]
    return jnp.where(jnp.isfinite(central).all(), central, other)


def right_inverse(matrix: Float[Array, "m n"]) -> Float[Array, "n m"]:
    """Right inverse of a matrix."""
    m, n = matrix.shape
    inverse = solved(matrix if m == n else matrix @ matrix.T, jnp.eye(m))[0]
    return inverse if m == n else matrix.T @ inverse


def _solution(
    matrix: AffineBounds, inverse: Array, right: AffineBounds, start: Array, rise: Array
) -> tuple[AffineBounds, Array]:
    # Bound a solution of M(s) x(s) = b(s), with M (m, n) and n >= m, near a line through `start` that rises by `rise`,
    # (n,); tell whether M, with this right inverse in the middle, is proved to have rank m throughout.
    m, n = matrix.middle.shape
    middle = start + inverse @ (right.middle - matrix.middle @ start)
    linear = rise + inverse @ (right.linear - matrix.linear @ middle - matrix.middle @ rise)
    line = AffineBounds(middle, linear, jnp.zeros(n))
    # Sums of the rows of |M B - 1|; in the middle only rounding errors contribute.
    sums = jnp.abs(matrix.middle @ inverse - jnp.eye(m)) + jnp.abs(matrix.linear @ inverse)
    if matrix.square is not None:
        line = line._replace(square=inverse @ (squares(right) - matrix.square @ middle - matrix.linear @ linear))
        sums += jnp.abs(matrix.square @ inverse)
    residual = (right - rotated(matrix, line)).magnitude()
    sums = jnp.sum(sums + matrix.radius @ jnp.abs(inverse), axis=1)
    fraction = maximum_of(sums, initial=0.0)
    radius = jnp.abs(inverse) @ (residual + sums * maximum_of(residual, initial=0.0) / (1.0 - fraction))
    is_known = (fraction < 1.0) & jnp.isfinite(middle).all() & jnp.isfinite(linear).all() & jnp.isfinite(radius).all()
    return line._replace(radius=jnp.where(is_known, radius, jnp.nan)), is_known


def _face_margin(
    matrix: AffineBounds, inverse: Array, wrench: AffineBounds, limits: tuple[Array, Array], face: NearestFace
) -> Array:
    # Values at both ends of a line above the largest distance from the limits, by the face nearest in the middle.
    dof, count = matrix.middle.shape
    columns, (low, high) = face.columns, limits
    across, nothing = matrix.each(lambda x: x[:, columns].T), constant(jnp.zeros(dof - 1))
    normal, is_normal = _solution(across, right_inverse(across.middle), nothing, face.along @ inverse, jnp.zeros(dof))
    is_spanning = (jnp.arange(count)[:, None] == columns[None]).any(1)
    along = rotated(matrix.each(jnp.transpose), normal).each(lambda x: jnp.where(is_spanning, 0.0, x))
    # Take each cable at the limit with the smaller product; the other limit counts if the product may change its sign.
    is_inward = along.middle > 0.0
    ends = jnp.where(is_spanning[None], 0.0, jnp.where(is_inward[None], low, high))
    is_bounded = jnp.isfinite(ends).all(0) | (along.magnitude() == 0.0)
    ends = jnp.where(is_bounded[None], ends, 0.0)
    limit = rounded(AffineBounds(0.5 * (ends[0] + ends[1]), 0.5 * (ends[1] - ends[0]), jnp.zeros(count)))
    over = jnp.where(is_inward, -along.low(), along.high())
    span = jnp.maximum(maximum_of(high - low, axis=0), 0.0)
    other = jnp.where(over > FLAT * jnp.abs(along.middle), over * span, 0.0)
    slack = dot(normal, wrench) - dot(along, limit)
    top = slack.middle + slack.radius + jnp.maximum(squares(slack), 0.0) + jnp.sum(other)
    ends = jnp.stack([top - slack.linear, top + slack.linear])
    # The quotient is a convex function of the slack: it is below the line between its values at both ends.
    smallest = jnp.maximum(along.magnitude() - 2.0 * along.half_range(), 0.0)
    norm = jnp.where(ends < 0.0, jnp.sum(along.magnitude()), jnp.sum(smallest))
    is_bound = is_normal & is_bounded.all() & (norm > 0.0).all() & jnp.isfinite(ends).all()
    above = jnp.where(is_bound, ends / jnp.where(is_bound, norm, 1.0), jnp.inf)
    halves = 0.5 * (high - low)
    half = halves[:, jnp.argmin(maximum_of(halves, axis=0))]
    return jnp.where(maximum_of(above) < maximum_of(half), above, half)
