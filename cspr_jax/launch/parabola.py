"""Flight that a [launch] table asks for, in the axes of the kernels."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from cspr_jax.config.keys.launch import LaunchTable
from cspr_jax.errors import ConfigError, shown
from cspr_jax.launch.flight import nearest_time
from cspr_jax.numerics.linear.frames import Frame

# A place of release counts as on a parabola that it misses by less than this part of its distance from the target.
ON_PARABOLA = 1e-6


class Parabola(NamedTuple):
    """Flight to a target, from a place of release or with a velocity at the target.

    Fields:
        target: (3,) from the centroid of the spools, z down, m.
        point: (3,) place of the release, m; None: `velocity` determines it.
        velocity: (3,) at the target, m/s; None: `point` and the time of flight determine it.
        time: of the flight, s; None: to be chosen.
    """

    target: np.ndarray
    point: np.ndarray | None
    velocity: np.ndarray | None
    time: float | None


def parabola_of(table: LaunchTable, frame: Frame, gravity: float, path: Path) -> Parabola:
    """Flight that a table asks for."""
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
