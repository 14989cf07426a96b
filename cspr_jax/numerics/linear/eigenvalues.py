"""Eigenvalues of small symmetric matrices without LAPACK, for which see `numerics.elementary.solved`."""

from __future__ import annotations

import itertools

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from cspr_jax.numerics.shapes import Float

# Number of sweeps of Jacobi's method: with six rows all that converges does so in half of them.
SWEEPS = 12


@jax.custom_jvp
def eigenpairs(matrix: Float[Array, "n n"]) -> tuple[Float[Array, "n"], Float[Array, "n n"]]:
    """Eigenvalues, increasing, and orthonormal eigenvectors, one column each, by Jacobi's rotations."""
    count = matrix.shape[0]
    pairs = np.array(list(itertools.combinations(range(count), 2)), int).reshape(-1, 2)
    index = np.arange(count)

    def rotate(carry, pair):
        rest, vectors = carry
        first, second = (index == k for k in pair)
        a, b, c = rest[pair[0], pair[0]], rest[pair[1], pair[1]], rest[pair[0], pair[1]]
        is_off = c != 0.0
        ratio = 0.5 * (b - a) / jnp.where(is_off, c, 1.0)
        sign = jnp.where(ratio < 0.0, -1.0, 1.0)
        tangent = jnp.where(is_off, sign / (jnp.abs(ratio) + jnp.sqrt(1.0 + ratio * ratio)), 0.0)
        cosine = 1.0 / jnp.sqrt(1.0 + tangent * tangent)
        sine = tangent * cosine
        diagonal = jnp.where(first | second, cosine, 1.0)
        skew = jnp.where(first[:, None] & second[None], sine, 0.0)
        turn = jnp.diag(diagonal) + skew - skew.T
        return (turn.T @ rest @ turn, vectors @ turn), None

    if not count:
        return jnp.zeros(0, matrix.dtype), matrix
    start = matrix, jnp.eye(count, dtype=matrix.dtype)
    rest, vectors = lax.scan(rotate, start, jnp.asarray(np.tile(pairs, (SWEEPS, 1))))[0]
    order = jnp.argsort(jnp.diagonal(rest))
    return jnp.diagonal(rest)[order], vectors[:, order]


@eigenpairs.defjvp
def _derivatives(primals, tangents):
    # Eigenvectors of equal eigenvalues have no derivatives, which then are left out.
    values, vectors = eigenpairs(*primals)
    change = vectors.T @ (0.5 * (tangents[0] + tangents[0].T)) @ vectors
    differences = values[None] - values[:, None]
    is_other = differences != 0.0
    turning = jnp.where(is_other, change / jnp.where(is_other, differences, 1.0), 0.0)
    return (values, vectors), (jnp.diagonal(change), vectors @ turning)


def inverse_factor(matrix: Float[Array, "n n"]) -> Float[Array, "n n"]:
    """Inverse of the triangular factor L of a positive definite matrix, L L^T."""
    rows, count = list[Array](), matrix.shape[0]
    # Rows of the inverse by Gram and Schmidt on unit vectors, in the scalar product of the matrix.
    for k in range(count):
        row = jnp.eye(count, dtype=matrix.dtype)[k]
        for other in rows:
            row = row - jnp.dot(other @ matrix, row) * other
        rows.append(row / jnp.sqrt(jnp.dot(row @ matrix, row)))
    return jnp.stack(rows)
