"""The face of the set of wrenches that is nearest to a wrench, and the tensions that are most central there.

A face's d - 1 cables span it; where tensions are as far from their limits as the face allows, the n - d + 1 others all
have the same distance r from a limit. With tensions t0 + N^T x, N without a wrench, these cables and r obey
N_S^T x - sign r = limit_S - t0_S, one small system.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.numerics.elementary import solved
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.statics.wrench_sets import beside_faces, face_distances, one_sided_faces, spanning
from cspr_jax.robots.tensions.tension_distribution import all_tensions

# Cables without a largest tension get a limit of so many times the largest tension that the wrench needs.
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


def nearest_face(
    matrix: Float[Array, "dof n_cables"],
    wrench: Float[Array, "dof"],
    low: Float[Array, "n_cables"],
    high: Float[Array, "n_cables"],
) -> NearestFace:
    """Find the nearest face."""
    dof, count = matrix.shape
    solutions = all_tensions(matrix, wrench)
    cap = CAP * (jnp.max(jnp.abs(solutions.min_norm)) + jnp.max(low))
    low, high = jnp.asarray(low), jnp.minimum(high, jnp.maximum(cap, low))
    chosen = beside_faces(count, dof)
    along = one_sided_faces(matrix, solutions.kernel)
    # Faces of both signs, each cable at the limit that gives the least.
    along, others = jnp.concatenate([along, -along]), np.concatenate([chosen, chosen])
    limits = jnp.where(along > 0.0, low[others], high[others])
    slacks = jnp.sum(along * (solutions.min_norm[others] - limits), axis=1)
    span = high - low
    # If the range of one cable is the limit, each cable is as far from limits as its own range allows.
    weights = jnp.where(
        jnp.min(face_distances(along, slacks, jnp.ones(along.shape))) > 0.5 * jnp.min(span), span / jnp.max(span), 1.0
    )
    index = jnp.argmin(face_distances(along, slacks, weights[others]))
    at, product = jnp.asarray(others)[index], along[index]
    limit = jnp.where(product == 0.0, 0.5 * (low[at] + high[at]), limits[index])
    system = jnp.concatenate([solutions.kernel.T[at], -(jnp.sign(product) * weights[at])[:, None]], axis=1)
    along_kernel = solved(system, (solutions.min_norm[at] - limit)[:, None])[0][:-1, 0]
    is_other = (at[:, None] == jnp.arange(count)[None]).astype(product.dtype)
    return NearestFace(
        along=product @ is_other,
        columns=jnp.asarray(spanning(count, dof))[index % len(chosen)],
        tensions=solutions.min_norm - solutions.kernel.T @ along_kernel,
    )
