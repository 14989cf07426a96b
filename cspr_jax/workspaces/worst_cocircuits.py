"""The cocircuit that decides at a pose: the normal to some cables against which the others do the least."""

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.robots.wrench_sets import normals_to, spanning

# Components of a cocircuit below this part of the largest one do not make it void.
ZERO = 1e-9
# A normal to dof - 1 unit columns whose products with all others are smaller than this means nothing.
SHORT = 1e-9


class WorstCocircuits(NamedTuple):
    """Cocircuits, one a pose.

    Fields:
        normal: (n, dof) c.
        subset: (n,) row of `wrench_sets.spanning`: the cables that it is normal to.
        load: (n,) the wrench that asks for the most along it.
        inner: (n, dof) sum of all normals that do not void, and that prove the same of the same wrench, each by how
            much: since what tensions give along c is a convex function of c, it proves so too, and has no cable normal
            to it.
    """

    normal: Array
    subset: Array
    load: Array
    inner: Array


@partial(jax.jit, static_argnames=("condition", "unbounded"))
def worst_cocircuits(
    matrices: Array,
    wrenches: Array,
    low: Array,
    high: Array,
    *,
    condition: str,
    unbounded: Sequence[bool],
) -> WorstCocircuits:
    """Cocircuits that leave the least, times the volume of the columns that they are normal to.

    By this length those of columns that are nearly dependent, whose normals turn fast from place to place, come last;
    where a single one is violated it is that one.

    Args:
        matrices: (n, dof, n_cables) unit columns, moments over a length.
        wrenches: (k, dof) what the cables must supply, N.
        low: (n_cables,) N.
        high: (n_cables,) N; of cables without a largest tension any number.
        condition: "closure": the cocircuit whose other components are the most of one sign, positive; or any other:
            that along which the wrenches are the farthest beyond what tensions can give.
        unbounded: which cables have no largest tension.

    Returns:
        the cocircuits.
    """
    dof, count = matrices.shape[1:]
    chosen = spanning(count, dof)
    is_own = np.zeros((len(chosen), count), bool)
    np.put_along_axis(is_own, chosen, True, axis=1)
    free = np.array(unbounded)

    def one(matrix):
        normals = jnp.ones((1, 1)) if dof == 1 else normals_to(matrix)
        along = jnp.where(is_own, 0.0, normals @ matrix)
        normals, along = jnp.concatenate([normals, -normals]), jnp.concatenate([along, -along])
        largest = jnp.max(jnp.abs(along), axis=1, keepdims=True)
        products = normals @ wrenches.T
        if condition == "closure":
            others = jnp.where(np.concatenate([is_own, is_own]), jnp.inf, along)
            value = -jnp.min(others, axis=1)
            is_void, load = jnp.zeros(value.shape, bool), jnp.asarray(0)
        else:
            reach = jnp.sum(jnp.where(along > 0.0, along * jnp.where(free, 0.0, high)[None], along * low[None]), axis=1)
            value = reach - jnp.max(products, axis=1)
            is_void = ((along > ZERO * largest) & free[None]).any(1)
        is_void = is_void | ~(largest[:, 0] > SHORT)
        worst = jnp.argmin(jnp.where(is_void, jnp.inf, value))
        if condition != "closure":
            load = jnp.argmax(products[worst])
            value = reach - products[:, load]
        weight = jnp.where(is_void, 0.0, jnp.maximum(-value, 0.0))
        return WorstCocircuits(normals[worst], worst % len(chosen), load, weight @ normals)

    return jax.vmap(one)(matrices)
