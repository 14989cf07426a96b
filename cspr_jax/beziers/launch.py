"""Launch of an object from a Bezier segment: free flight, and the segment through the place and velocity of release."""

from typing import Any

import jax.numpy as jnp
from jax import Array

from cspr_jax.arithmetic.elementary import sincospi


def flown(position: Any, velocity: Any, gravity: Any, time: Any) -> tuple[Any, Any]:
    """Position and velocity in free flight, (26).

    Args:
        position: (..., 3) at the release, z down, m.
        velocity: (..., 3) likewise, m/s.
        gravity: () m/s^2.
        time: (..., 1) since the release, s; negative before it.

    Returns:
        (..., 3) m, (..., 3) m/s.
    """
    down = jnp.asarray([0.0, 0.0, 1.0]) * gravity
    return position + velocity * time + 0.5 * down * time**2, velocity + down * time


def aimed(position: Any, target: Any, gravity: Any, time: Any) -> Any:
    """Velocity at the release with which a target is reached after a time, (26a).

    Args:
        position: (..., 3) of the release, z down, m.
        target: (..., 3) m.
        gravity: () m/s^2.
        time: (..., 1) of the flight, s.

    Returns:
        (..., 3) m/s.
    """
    down = jnp.asarray([0.0, 0.0, 1.0]) * gravity
    return (target - position) / time - 0.5 * down * time


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
