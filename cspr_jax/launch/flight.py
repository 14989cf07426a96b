"""Free flight of an object that is released from a moving effector, and the flight that a [launch] table asks for."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cspr_jax.config.keys.launch import LaunchTable
from cspr_jax.errors import ConfigError, shown
from cspr_jax.numerics.linear.frames import Frame
from cspr_jax.numerics.shapes import Float

# A release lies on a parabola if its distance from it is at most this fraction of its distance from the target.
ON_PARABOLA = 1e-6
DOWN = np.array([0.0, 0.0, 1.0])


def flown(position: Any, velocity: Any, gravity: Any, time: Any) -> tuple[Any, Any]:
    """Position and velocity in free flight, launch paper (26)."""
    down = DOWN * gravity
    return position + velocity * time + 0.5 * down * time**2, velocity + down * time


def aimed(position: Any, target: Any, gravity: Any, time: Any) -> Any:
    """Velocity of a release from which free flight reaches a target after a time, launch paper (26a)."""
    down = DOWN * gravity
    return (target - position) / time - 0.5 * down * time


def nearest_time(
    position: Float[np.ndarray, "3"], target: Float[np.ndarray, "3"], velocity: Float[np.ndarray, "3"], gravity: float
) -> tuple[float, float] | None:
    """Time and distance at which the parabola through a target, with a velocity there, is nearest to a release."""
    down, ray = 0.5 * gravity * np.array([0.0, 0.0, 1.0]), target - position
    # Coefficients of |ray - velocity t + down t^2|^2 in powers of t, the highest first.
    square = [
        down @ down,
        -2.0 * down @ velocity,
        velocity @ velocity + 2.0 * ray @ down,
        -2.0 * ray @ velocity,
    ]
    roots = np.roots(np.array(square) * [4.0, 3.0, 2.0, 1.0])
    times = roots.real[(np.abs(roots.imag) < 1e-6 * np.abs(roots)) & (roots.real > 0.0)]
    if not len(times):
        return None
    distances = np.array([float(np.linalg.norm(ray - velocity * t + down * t**2)) for t in times])
    return float(times[distances.argmin()]), float(distances.min())


class Parabola(NamedTuple):
    """Flight to a target, given by the point of release or by the velocity at the target.

    Fields:
        target: (3,) from the centroid of the spools, z down, m.
        point: (3,) of release, m; None: `velocity` determines it.
        velocity: (3,) at the target, m/s; None: `point` and the time of flight determine it.
        time: time of flight, s; None: to be chosen.
    """

    target: np.ndarray
    point: np.ndarray | None
    velocity: np.ndarray | None
    time: float | None


def parabola_of(table: LaunchTable, frame: Frame, gravity: float, path: Path) -> Parabola:
    """Flight that a [launch] table asks for."""
    target = np.asarray(frame.inward(table.target))
    point = None if table.point is None else np.asarray(frame.inward(table.point))
    velocity = None if table.velocity is None else np.asarray(frame.rotated(np.asarray(table.velocity)))
    if point is None or velocity is None:
        return Parabola(target, point, velocity, table.time)
    nearest = nearest_time(point, target, velocity, gravity)
    if nearest is None or not nearest[1] <= ON_PARABOLA * max(float(np.linalg.norm(target - point)), 1e-300):
        missed = f"passes it by {nearest[1]:.3g} m" if nearest else "never comes near it before the target"
        raise ConfigError(
            path,
            f"launch.point = {shown(table.point)}: must lie on the parabola that "
            f"reaches the target with launch.velocity, which {missed}",
        )
    return Parabola(target, point, None, nearest[0])
