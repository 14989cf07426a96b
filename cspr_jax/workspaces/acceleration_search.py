"""Feasible accelerations at many positions: arrays in, answers out."""

from __future__ import annotations

from functools import partial

import jax
import numpy as np

from cspr_jax.motion.acceleration_sets import AccelerationRanges, acceleration_ranges_at, faces_at, verdict
from cspr_jax.motion.limits import touchable_limits
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.shapes import Float, Int
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.point_mass import PointMassRobot
from cspr_jax.robots.statics.wrench_sets import Faces

# Number of positions computed at a time; it is lower for robots on many cables, which have many faces.
BATCH = 4096
_LARGEST_BATCH_ENTRIES = 1 << 22


def _batch_size(robot: PointMassRobot, power: int) -> int:
    return max(min(BATCH, _LARGEST_BATCH_ENTRIES // robot.n_cables**power), 1)


def reach_of(robot: PointMassRobot, limits: Limits, positions: Float[np.ndarray, "n 3"]) -> AccelerationRanges:
    """Verdicts, margins and largest values of feasible accelerations at many positions."""
    kernel = partial(acceleration_ranges_at, robot, limits, touchable_limits(robot, limits))
    return in_batches(kernel, positions, batch_size=_batch_size(robot, 6))


@jax.jit
def _faces(robot: PointMassRobot, limits: Limits, positions) -> Faces:
    return jax.vmap(partial(faces_at, robot, limits))(positions)


def faces_of(robot: PointMassRobot, limits: Limits, positions: Float[np.ndarray, "n 3"]) -> Faces:
    """Faces of the sets of feasible accelerations at many positions."""
    return in_batches(partial(_faces, robot, limits), positions, batch_size=_batch_size(robot, 3))


@jax.jit
def _margins_and_verdicts(robot: PointMassRobot, arguments):
    def one(faces, wider, position, acceleration):
        return faces.margin(acceleration), verdict(robot, faces, wider, position, acceleration)

    return jax.vmap(one)(*arguments)


def margins_and_verdicts(
    robot: PointMassRobot,
    faces: Faces,
    wider: Faces,
    positions: Float[np.ndarray, "n 3"],
    accelerations: Float[np.ndarray, "n 3"],
) -> tuple[Float[np.ndarray, "n"], Int[np.ndarray, "n"]]:
    """Margins and verdicts of accelerations, one at each position, from faces as in `verdict`."""
    return in_batches(
        partial(_margins_and_verdicts, robot),
        (faces, wider, positions, accelerations),
        batch_size=_batch_size(robot, 3),
    )
