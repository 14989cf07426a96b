"""Free flight of an object that is released from a moving effector."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import jax.numpy as jnp
import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Float


def flown(position: Any, velocity: Any, gravity: Any, time: Any) -> tuple[Any, Any]:
    """Position and velocity in free flight, launch paper (26)."""
    down = jnp.asarray([0.0, 0.0, 1.0]) * gravity
    return position + velocity * time + 0.5 * down * time**2, velocity + down * time


def aimed(position: Any, target: Any, gravity: Any, time: Any) -> Any:
    """Velocity at the release with which a target is reached after a time, launch paper (26a)."""
    down = jnp.asarray([0.0, 0.0, 1.0]) * gravity
    return (target - position) / time - 0.5 * down * time


def nearest_time(
    position: Float[np.ndarray, "3"], target: Float[np.ndarray, "3"], velocity: Float[np.ndarray, "3"], gravity: float
) -> tuple[float, float] | None:
    """Time of flight at which the parabola that reaches a target with a velocity comes nearest to a release."""
    down, way = 0.5 * gravity * np.array([0.0, 0.0, 1.0]), target - position
    # |way - velocity t + down t^2|^2, by powers of t, the highest first.
    square = [down @ down, -2.0 * down @ velocity, velocity @ velocity + 2.0 * way @ down, -2.0 * way @ velocity]
    roots = np.roots(np.array(square) * [4.0, 3.0, 2.0, 1.0])
    times = roots.real[(np.abs(roots.imag) < 1e-6 * np.abs(roots)) & (roots.real > 0.0)]
    if not len(times):
        return None
    apart = np.array([float(np.linalg.norm(way - velocity * t + down * t**2)) for t in times])
    return float(times[apart.argmin()]), float(apart.min())
