"""The face of the set of wrenches that is nearest to a wrench, and the tensions that are most central there.

A face is spanned by d - 1 cables; where tensions are as far from their limits as the face allows, the n - d + 1 other
cables S all have the same distance r from a limit. With tensions t0 + N^T x, where rows of N give no wrench, x and r
follow from N_S^T x - sign r = limit_S - t0_S, one small system.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.numerics.elementary import maximum_of, minimum_of, solved
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.statics.wrench_sets import beside_faces, face_distances, one_sided_faces, spanning
from cspr_jax.robots.tensions.tension_distribution import all_tensions

# Cables without a largest tension get this multiple of the largest tension that the wrench needs as a limit.
CAP = 1e3


class NearestFace(NamedTuple):
    """Nearest face of one balance.

    Fields:
        along: (n_cables,) products of the inward normal with the cables' columns; 0 for cables that span the face.
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
    """Find the face nearest to a wrench, and the most central tensions."""
    dof, count = matrix.shape
    solutions = all_tensions(matrix, wrench)
    cap = CAP * (maximum_of(jnp.abs(solutions.min_norm)) + maximum_of(low))
    low, high = jnp.asarray(low), jnp.minimum(high, jnp.maximum(cap, low))
    chosen = beside_faces(count, dof)
    along = one_sided_faces(matrix, solutions.kernel)
    # Faces of both signs, with each cable at the limit that makes its product smallest.
    along, others = jnp.concatenate([along, -along]), np.concatenate([chosen, chosen])
    limits = jnp.where(along > 0.0, low[others], high[others])
    slacks = jnp.sum(along * (solutions.min_norm[others] - limits), axis=1)
    span = high - low
    # If the range of a cable, and not a face, bounds the distance, distances are proportional to the cables' ranges.
    weights = jnp.where(
        minimum_of(face_distances(along, slacks, jnp.ones(along.shape))) > 0.5 * minimum_of(span),
        span / maximum_of(span),
        1.0,
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
