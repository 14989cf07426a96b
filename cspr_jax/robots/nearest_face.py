"""The face of the set of wrenches that is nearest to a wrench, and the tensions that are most central there.

A face's d - 1 cables span it; the others, n - d + 1, are all at one distance from a limit where tensions are as far
from their limits as the face allows. With tensions t0 + N^T x, N without a wrench, these cables and the distance r obey
N_S^T x - sign r = limit_S - t0_S, one small system.

With up to two cables more than needed the products of the other cables with normals are relations among the rows of
N^T, some thirty products in place of determinants; with more they follow from the normals of `wrench_sets`.
"""

import functools
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.arithmetic.elementary import solved
from cspr_jax.robots.tension_distribution import all_tensions
from cspr_jax.robots.wrench_sets import FLAT, normals_to, spanning

# A tension without a largest value is held below so many times the largest that the wrench needs.
CAP = 1e3


class NearestFace(NamedTuple):
    """Nearest face of one balance.

    Fields:
        along: (n_cables,) products of a normal that points inside with the cables; 0 for those that span the face.
        columns: (dof - 1,) cables that span the face.
        tensions: (n_cables,) most central tensions, N.
    """

    along: Array
    columns: Array
    tensions: Array


def nearest_face(matrix: Array, wrench: Array, low: Array, high: Array) -> NearestFace:
    """Find the nearest face.

    Args:
        matrix: (dof, n_cables) unit columns.
        wrench: (dof,) N.
        low: (n_cables,) N.
        high: (n_cables,) N, inf for none.

    Returns:
        the face; anything where the cables do not span all components.
    """
    dof, count = matrix.shape
    solutions = all_tensions(matrix, wrench)
    cap = CAP * (jnp.max(jnp.abs(solutions.least)) + jnp.max(low))
    low, high = jnp.asarray(low), jnp.minimum(high, jnp.maximum(cap, low))
    chosen = beside_faces(count, dof)
    along = one_sided_faces(matrix, solutions.kernel)
    # Faces of both signs, each cable at the limit that gives the least.
    along, others = jnp.concatenate([along, -along]), np.concatenate([chosen, chosen])
    limits = jnp.where(along > 0.0, low[others], high[others])
    slacks = jnp.sum(along * (solutions.least[others] - limits), axis=1)
    span = high - low
    # If the range of one cable is the limit, each cable is as far from limits as its own range allows.
    weights = jnp.where(
        jnp.min(_distances(along, slacks, jnp.ones(along.shape))) > 0.5 * jnp.min(span), span / jnp.max(span), 1.0
    )
    place = jnp.argmin(_distances(along, slacks, weights[others]))
    at, product = jnp.asarray(others)[place], along[place]
    limit = jnp.where(product == 0.0, 0.5 * (low[at] + high[at]), limits[place])
    system = jnp.concatenate([solutions.kernel.T[at], -(jnp.sign(product) * weights[at])[:, None]], axis=1)
    along_kernel = solved(system, (solutions.least[at] - limit)[:, None])[0][:-1, 0]
    is_other = (at[:, None] == jnp.arange(count)[None]).astype(product.dtype)
    return NearestFace(
        along=product @ is_other,
        columns=jnp.asarray(spanning(count, dof))[place % len(chosen)],
        tensions=solutions.least - solutions.kernel.T @ along_kernel,
    )


def _distances(along: Array, slacks: Array, weights: Array) -> Array:
    sizes = jnp.sum(jnp.abs(along) * weights, axis=1)
    return jnp.where(sizes > 0.0, slacks / jnp.where(sizes > 0.0, sizes, 1.0), jnp.inf)


@functools.cache
def beside_faces(count: int, dof: int) -> np.ndarray:
    """Cables that do not span a face.

    Returns:
        (n_choices, count - dof + 1) in the order of `wrench_sets.spanning`.
    """
    return np.array([np.setdiff1d(np.arange(count), columns) for columns in spanning(count, dof)])


def one_sided_faces(matrix: Array, kernel: Array) -> Array:
    """Products of a normal to each choice of d - 1 cables with the other cables.

    Args:
        matrix: (dof, n_cables) unit columns.
        kernel: (n, n_cables) orthonormal tensions without a wrench, one for each cable beyond dof.

    Returns:
        (n_choices, n_others), the cables as `beside_faces` has them; 0 for cables in the face.
    """
    dof, count = matrix.shape
    chosen = beside_faces(count, dof)
    if count - dof > 2:
        normals = normals_to(matrix)
        size = jnp.linalg.norm(normals, axis=1)[:, None]
        along = jnp.take_along_axis(normals / jnp.where(size > FLAT, size, 1.0) @ matrix, jnp.asarray(chosen), axis=1)
        return jnp.where((size > FLAT) & (jnp.abs(along) > FLAT), along, 0.0)
    # One row of the null space more than it has columns: the relation among them.
    rows = kernel.T[chosen]
    if chosen.shape[1] == 1:
        return jnp.ones(chosen.shape)
    if chosen.shape[1] == 2:
        along = jnp.stack([rows[:, 1, 0], -rows[:, 0, 0]], axis=1)
    else:
        after, last = rows[:, np.array([1, 2, 0])], rows[:, np.array([2, 0, 1])]
        along = after[..., 0] * last[..., 1] - after[..., 1] * last[..., 0]
    size = jnp.max(jnp.abs(along), axis=1, keepdims=True)
    along = jnp.where(size > FLAT, along / jnp.where(size > FLAT, size, 1.0), 0.0)
    return jnp.where(jnp.abs(along) > FLAT, along, 0.0)
