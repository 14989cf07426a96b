"""Feasible accelerations at many places: arrays in, answers out."""

from functools import partial

import jax
import numpy as np

from cspr_jax.arithmetic.batches import in_batches
from cspr_jax.motions.acceleration_sets import AccelerationReach, faces_at, reaches, verdict
from cspr_jax.robots.limits import Limits
from cspr_jax.robots.point_mass import PointMassRobot
from cspr_jax.robots.wrench_sets import Faces

# Number of places computed at a time; fewer for robots on many cables, whose faces are many.
BATCH = 4096
_ROOM = 1 << 22


def _size(robot: PointMassRobot, power: int) -> int:
    return max(min(BATCH, _ROOM // robot.n_cables**power), 1)


def reach_of(robot: PointMassRobot, limits: Limits, positions: np.ndarray) -> AccelerationReach:
    """Sizes of the sets of feasible accelerations at many places.

    Args:
        robot: a point mass, centred, z down.
        limits: only limits of tensions count.
        positions: (n, 3) m.

    Returns:
        the numbers, (n,) each.
    """
    return in_batches(partial(reaches, robot, limits), positions, size=_size(robot, 6))


@jax.jit
def _faces(robot: PointMassRobot, limits: Limits, positions) -> Faces:
    return jax.vmap(partial(faces_at, robot, limits))(positions)


def faces_of(robot: PointMassRobot, limits: Limits, positions: np.ndarray) -> Faces:
    """Faces of the sets of feasible accelerations at many places.

    Args:
        robot: a point mass, centred, z down.
        limits: only limits of tensions count.
        positions: (n, 3) m.

    Returns:
        the faces, leaves (n, ...).
    """
    return in_batches(partial(_faces, robot, limits), positions, size=_size(robot, 3))


@jax.jit
def _judged(robot: PointMassRobot, arguments):
    def one(faces, position, acceleration):
        return faces.margin(acceleration), verdict(robot, faces, position, acceleration)

    return jax.vmap(one)(*arguments)


def judged(
    robot: PointMassRobot, faces: Faces, positions: np.ndarray, accelerations: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Margins and verdicts of accelerations, one at each place.

    Args:
        robot: a point mass, centred, z down.
        positions: (n, 3) m.
        accelerations: (n, 3) m/s^2.

    Returns:
        (n,) m/s^2, and (n,) flags of `Verdict`.
    """
    return in_batches(partial(_judged, robot), (faces, positions, accelerations), size=_size(robot, 3))
