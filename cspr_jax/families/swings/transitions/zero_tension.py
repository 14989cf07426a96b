"""The zero-tension amplitude function A = tau, for which all formulas are closed, thesis sections 1.6 and 1.10.

It is no motion, since it breaks (1.27) and (1.28). On horizontal transitions it spreads the load evenly over time, so
it is a bound for all other functions; on inclined ones it is a guide. w_hi and w_lo are the largest and the smallest
weight, w_C is the one of larger magnitude.
"""

from __future__ import annotations

import math

import jax.numpy as jnp
from jax import Array

from cspr_jax.numerics.elementary import maximum_of, minimum_of
from cspr_jax.numerics.shapes import Float


def least_oscillations(weights: Float[Array, "n_cables"], inclination: Float[Array, ""]) -> Float[Array, ""]:
    """Oscillations that the envelopes require with A = tau: n_gdl of (1.115), n_idl of (1.104) for v = 0."""
    return maximum_of(jnp.abs(weights + inclination)) / (math.pi * jnp.sqrt((1.0 - inclination) * (1.0 + inclination)))


def best_inclination(weights: Float[Array, "n_cables"]) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """The inclination that requires the fewest oscillations with A = tau: (1.117) and (1.118).

    Either it divides the load between the two extreme cables, v = -(w_hi + w_lo) / 2, or the cable with the
    largest weight has its own minimum before that, at v = -1 / w_C.
    """
    high, low = maximum_of(weights), minimum_of(weights)
    largest = jnp.where(high >= -low, high, low)
    magnitude = jnp.minimum(0.5 * jnp.abs(high + low), 1.0 / jnp.abs(largest))
    v = -jnp.sign(largest) * magnitude
    return v, least_oscillations(weights, v)
