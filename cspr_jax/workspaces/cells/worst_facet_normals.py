"""The facet normal of a pose, normal to dof - 1 cables, along which the slack is smallest."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.numerics.elementary import maximum_of, minimum_of
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.statics.wrench_sets import normals_to, spanning

# Products of a facet normal with cables count as zero below this fraction of the largest one.
ZERO = 1e-9
# A normal to dof - 1 unit columns is dropped if its products with all other columns are smaller than this.
SHORT = 1e-9


class WorstFacets(NamedTuple):
    """Facet normals, one for each pose.

    Fields:
        normal: (n, dof) c.
        subset: (n,) row of `wrench_sets.spanning`: the cables to which it is normal.
        load: (n,) index of the wrench with the smallest slack along it.
        inner: (n, dof) sum of all normals along which the same wrench cannot be supplied, weighted by the deficit. The
            largest component that tensions supply along c is a convex function of c, so that the wrench cannot be
            supplied along the sum either, and no cable is normal to the sum.
    """

    normal: Array
    subset: Array
    load: Array
    inner: Array


@partial(jax.jit, static_argnames=("condition", "unbounded"))
def worst_facets(
    matrices: Float[Array, "n dof n_cables"],
    wrenches: Float[Array, "k dof"],
    spreads: Float[Array, "l dof"],
    low: Float[Array, "n_cables"],
    high: Float[Array, "n_cables"],
    *,
    condition: str,
    unbounded: Sequence[bool],
) -> WorstFacets:
    """Facet normals with the smallest slack, where slacks are weighted by the volume of the columns.

    This weight puts normals to nearly dependent columns last, which turn fast with the position. If a single facet is
    violated, its normal is chosen; if none is, that of the nearest facet.
    """
    dof, count = matrices.shape[1:]
    chosen = spanning(count, dof)
    is_own = np.zeros((len(chosen), count), bool)
    np.put_along_axis(is_own, chosen, True, axis=1)
    free = np.array(unbounded)

    def one(matrix):
        normals = normals_to(matrix)
        along = jnp.where(is_own, 0.0, normals @ matrix)
        normals, along = jnp.concatenate([normals, -normals]), jnp.concatenate([along, -along])
        largest = maximum_of(jnp.abs(along), axis=1, keepdims=True)
        beside = jnp.sum(jnp.linalg.norm(normals[:, None] * spreads[None], axis=2), axis=1)
        products = normals @ wrenches.T + beside[:, None]
        if condition == "closure":
            others = jnp.where(np.concatenate([is_own, is_own]), jnp.inf, along)
            value = -minimum_of(others, axis=1)
            is_void, load = jnp.zeros(value.shape, bool), jnp.asarray(0)
        else:
            support = jnp.sum(
                jnp.where(along > 0.0, along * jnp.where(free, 0.0, high)[None], along * low[None]), axis=1
            )
            value = support - maximum_of(products, axis=1)
            is_void = ((along > ZERO * largest) & free[None]).any(1)
        is_void = is_void | ~(largest[:, 0] > SHORT)
        value = jnp.where(value > 0.0, value / jnp.linalg.norm(normals, axis=1), value)
        worst = jnp.argmin(jnp.where(is_void, jnp.inf, value))
        if condition != "closure":
            load = jnp.argmax(products[worst])
            value = support - products[:, load]
        weight = jnp.where(is_void, 0.0, jnp.maximum(-value, 0.0))
        return WorstFacets(normals[worst], worst % len(chosen), load, weight @ normals)

    return jax.vmap(one)(matrices)
