"""Small vectors as tuples of arrays, one lane a case: XLA then makes one loop over the cases of a long formula."""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array, lax

Vector = Sequence[Array]
Matrix = Sequence[Vector]


def dot(a: Vector, b: Vector) -> Array:
    """Scalar product.

    Args:
        a: three arrays (...).
        b: three arrays.

    Returns:
        (...).
    """
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Vector product.

    Args:
        a: three arrays (...).
        b: three arrays.

    Returns:
        three arrays.
    """
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def combined(terms: Sequence[tuple[Array, Vector]]) -> Vector:
    """Sum of weighted vectors.

    Args:
        terms: weight (...) and vector of each term.

    Returns:
        three arrays.
    """
    return tuple(sum((w * v[i] for w, v in terms[1:]), terms[0][0] * terms[0][1][i]) for i in range(3))


def turned(matrix: Matrix, vector: Vector) -> Vector:
    """Matrix times vector.

    Args:
        matrix: three rows.
        vector: three arrays.

    Returns:
        three arrays.
    """
    return tuple(dot(row, vector) for row in matrix)


def turned_back(matrix: Matrix, vector: Vector) -> Vector:
    """Transposed matrix times vector.

    Args:
        matrix: three rows.
        vector: three arrays.

    Returns:
        three arrays.
    """
    return combined([(vector[i], matrix[i]) for i in range(3)])


def rotation_matrix(quaternion: Sequence[Array]) -> Matrix:
    """The rotation matrix of a unit quaternion; see `arithmetic.rotations.matrix`.

    Args:
        quaternion: four arrays, scalar first.

    Returns:
        rows.
    """
    w, x, y, z = quaternion
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


def about_axis(axis: Vector, sine: Array, cosine: Array) -> Matrix:
    """The matrix of a rotation about an axis, by Rodrigues' formula.

    Args:
        axis: unit vector; zero where nothing turns.
        sine: (...) of the angle.
        cosine: (...) of the angle.

    Returns:
        rows.
    """
    x, y, z = axis
    sx, sy, sz = (sine * e for e in axis)
    px, py, pz = ((1.0 - cosine) * e for e in axis)
    return (
        (cosine + px * x, px * y - sz, px * z + sy),
        (px * y + sz, cosine + py * y, py * z - sx),
        (px * z - sy, py * z + sx, cosine + pz * z),
    )


def smallest(values: Sequence[Array]) -> Array:
    """The smallest of several arrays, case by case; NaN stays NaN.

    Args:
        values: arrays (...).

    Returns:
        (...).
    """
    least = values[0]
    for value in values[1:]:
        least = jnp.minimum(least, value)
    return least


def largest(values: Sequence[Array]) -> Array:
    """The largest of several arrays, case by case; NaN stays NaN.

    Args:
        values: arrays (...).

    Returns:
        (...).
    """
    most = values[0]
    for value in values[1:]:
        most = jnp.maximum(most, value)
    return most


def smallest_of_each(arrays: Sequence[Array]) -> tuple[Array, ...]:
    """The smallest of each of several arrays along the first axis; NaN stays NaN.

    On a CPU, XLA makes one loop of it, and computes what the arrays share once; it would repeat it for each minimum.

    Args:
        arrays: of one shape (n, ...).

    Returns:
        as many (...).
    """
    nothing = [jnp.asarray(jnp.inf, array.dtype) for array in arrays]
    return tuple(lax.reduce(tuple(arrays), tuple(nothing), lambda a, b: tuple(map(jnp.minimum, a, b)), (0,)))


def stored(values: Any, one: Array | None) -> Any:
    """The same values, which XLA then computes only once.

    On a CPU XLA computes a cheap value again, with all that leads to it, in every loop that uses it. It counts a
    division as expensive, and stores its result instead.

    Args:
        values: pytree of arrays.
        one: () the number 1, as an argument of the compiled function; None: values are not stored.

    Returns:
        the pytree.
    """
    return values if one is None else jax.tree.map(lambda x: x / one, values)
