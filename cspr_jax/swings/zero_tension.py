"""The zero-tension amplitude function A = tau, for which everything has a closed form, thesis section 1.6 and 1.10.

It is no motion, since it breaks (1.27) and (1.28). On horizontal transitions it spreads the load evenly over
the time, so that it bounds the others; on inclined ones it is a guide. w_hi and w_lo are the largest and the
smallest weight, w_C the one that is larger in size.
"""

import math

import jax.numpy as jnp
from jax import Array


def least_oscillations(weights: Array, inclination: Array) -> Array:
    """Oscillations that the envelopes ask for with A = tau: n_gdl of (1.115), n_idl of (1.104) for v = 0.

    No amplitude function with A''(1) = 0 needs fewer on a horizontal transition.

    Args:
        weights: (n_cables,) w_k.
        inclination: () v, |v| < 1.

    Returns:
        () n.
    """
    return jnp.max(jnp.abs(weights + inclination)) / (math.pi * jnp.sqrt((1.0 - inclination) * (1.0 + inclination)))


def best_inclination(weights: Array) -> tuple[Array, Array]:
    """The inclination that asks for the fewest oscillations with A = tau: (1.117) and (1.118).

    Either it shares the load between the two extreme cables, v = -(w_hi + w_lo) / 2, or the cable with the
    largest weight has its own minimum before that, at v = -1 / w_C.

    Args:
        weights: (n_cables,) w_k, not all zero.

    Returns:
        v and n, () each.
    """
    high, low = jnp.max(weights), jnp.min(weights)
    largest = jnp.where(high >= -low, high, low)
    size = jnp.minimum(0.5 * jnp.abs(high + low), 1.0 / jnp.abs(largest))
    v = -jnp.sign(largest) * size
    return v, least_oscillations(weights, v)
