"""The Bezier segment through the place and the velocity of a release."""

import jax.numpy as jnp
from jax import Array

from cspr_jax.arithmetic.elementary import sincospi


def through(start: Array, position: Array, velocity: Array, share: Array, duration: Array) -> tuple[Array, Array]:
    """Control points of the segment that passes a place with a velocity, (29).

    Args:
        start: (3,) first control point, m.
        position: (3,) place of the release, m.
        velocity: (3,) at the release, m/s.
        share: () time of the release over the duration of the segment, in ]0, 1[.
        duration: () s.

    Returns:
        the second and the third control point, (3,) each, m.
    """
    sine, c = sincospi(jnp.asarray(share, float))
    step = duration * velocity / (jnp.pi * sine)
    middle = (start * (1.0 + c) - 2.0 * position) / (c - 1.0) - step
    end = (start * (1.0 + c) ** 2 - 4.0 * c * position) / (c - 1.0) ** 2 - 2.0 * step * (1.0 + c) / (c - 1.0)
    return middle, end
