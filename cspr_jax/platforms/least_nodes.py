"""Reduce node values of blocks to what a verdict needs: the smallest of each criterion, and where the worst lies."""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.arithmetic.lanes import smallest


def least_nodes(nodes: Sequence[Array], allowed: np.ndarray, places: np.ndarray) -> tuple[Array, Array]:
    """Smallest values at the nodes of n blocks.

    Args:
        nodes: of each criterion, (m, n).
        allowed: (n_slacks,) what the first of these may be below zero; see `work_list.allowance`.
        places: (m,) of the nodes, from -1 at the start of a block to 1 at its stop, increasing.

    Returns:
        (1, n_criteria, n) the values; (n,) the first place of the smallest of all slacks, no number where that is none.
    """
    worst = smallest([x + extra for x, extra in zip(nodes, allowed, strict=False)])
    is_there = worst == jnp.min(worst, axis=0)[None]
    first = jnp.min(jnp.where(is_there, places[:, None], jnp.inf), axis=0)
    return jnp.stack([jnp.min(x, axis=0) for x in nodes])[None], jnp.where(first <= 1.0, first, jnp.nan)
