"""The Bezier segment through the place and the velocity of a release."""

from __future__ import annotations

from typing import TYPE_CHECKING

import jax.numpy as jnp
from jax import Array

from cspr_jax.numerics.elementary import sincospi

if TYPE_CHECKING:
    from jaxtyping import Float


def through(
    start: Float[Array, "3"],
    position: Float[Array, "3"],
    velocity: Float[Array, "3"],
    fraction: Float[Array, ""],
    duration: Float[Array, ""],
) -> tuple[Float[Array, "3"], Float[Array, "3"]]:
    """Control points of the segment that passes a place with a velocity, (29)."""
    sine, c = sincospi(jnp.asarray(fraction, float))
    step = duration * velocity / (jnp.pi * sine)
    middle = (start * (1.0 + c) - 2.0 * position) / (c - 1.0) - step
    end = (start * (1.0 + c) ** 2 - 4.0 * c * position) / (c - 1.0) ** 2 - 2.0 * step * (1.0 + c) / (c - 1.0)
    return middle, end
