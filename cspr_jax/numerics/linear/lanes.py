"""Small vectors as tuples of arrays, one lane a case: XLA then compiles a long formula to one loop over the cases."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array, lax

from cspr_jax.numerics.elementary import minimum_of
from cspr_jax.numerics.shapes import Float

Vector = Sequence[Array]
Matrix = Sequence[Vector]


def dot(a: Vector, b: Vector) -> Float[Array, "..."]:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Vector product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def combined(terms: Sequence[tuple[Array, Vector]]) -> Vector:
    """Sum of weighted vectors."""
    return tuple(sum((w * v[i] for w, v in terms[1:]), terms[0][0] * terms[0][1][i]) for i in range(3))


def rotated(matrix: Matrix, vector: Vector) -> Vector:
    """Matrix times vector."""
    return tuple(dot(row, vector) for row in matrix)


def rotated_back(matrix: Matrix, vector: Vector) -> Vector:
    """Transposed matrix times vector."""
    return combined([(vector[i], matrix[i]) for i in range(3)])


def rotation_matrix(quaternion: Sequence[Array]) -> Matrix:
    """The rotation matrix of a unit quaternion; see `numerics.linear.rotations.matrix`."""
    w, x, y, z = quaternion
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


def product(left: Sequence[Array], right: Sequence[Array]) -> tuple[Array, ...]:
    """The product of two quaternions, of which the right one rotates first; see `numerics.linear.rotations.product`."""
    a, b, c, d = left
    w, x, y, z = right
    return (
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y + c * w + d * x - b * z,
        a * z + d * w + b * y - c * x,
    )


def about_axis(axis: Vector, sine: Float[Array, "..."], cosine: Float[Array, "..."]) -> Matrix:
    """The matrix of a rotation about an axis, by Rodrigues' formula."""
    x, y, z = axis
    sx, sy, sz = (sine * e for e in axis)
    px, py, pz = ((1.0 - cosine) * e for e in axis)
    return (
        (cosine + px * x, px * y - sz, px * z + sy),
        (px * y + sz, cosine + py * y, py * z - sx),
        (px * z - sy, py * z + sx, cosine + pz * z),
    )


def smallest(values: Sequence[Array]) -> Float[Array, "..."]:
    """The smallest of several arrays, case by case; NaN stays NaN."""
    minimum = values[0]
    for value in values[1:]:
        minimum = jnp.minimum(minimum, value)
    return minimum


def largest(values: Sequence[Array]) -> Float[Array, "..."]:
    """The largest of several arrays, case by case; NaN stays NaN."""
    maximum = values[0]
    for value in values[1:]:
        maximum = jnp.maximum(maximum, value)
    return maximum


def smallest_of_each(arrays: Sequence[Array]) -> tuple[Float[Array, "..."], ...]:
    """The smallest of each of several arrays along the first axis; NaN stays NaN."""
    if len(arrays) == 1:
        return (minimum_of(arrays[0], axis=0),)
    nothing = [jnp.asarray(jnp.inf, array.dtype) for array in arrays]
    return tuple(lax.reduce(tuple(arrays), tuple(nothing), lambda a, b: tuple(map(jnp.minimum, a, b)), (0,)))


def materialized(values: Any, one: Float[Array, ""] | None) -> Any:
    """The same values, divided by a runtime 1 so that XLA stores them instead of computing them again."""
    return values if one is None else jax.tree.map(lambda x: x / one, values)
