"""Sensitivities of a robot at many positions: arrays in, answers out."""

from __future__ import annotations

from functools import partial

import jax
import numpy as np

from cspr_jax.errors import InputError
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.linear.frames import IDENTITY
from cspr_jax.numerics.linear.rotations import matrix
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.parallel_pairs import ParallelPairs, parallel_pairs
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.point_mass import PointMassRobot
from cspr_jax.robots.model.robot import check_determined
from cspr_jax.robots.statics.reference_pose import aligned
from cspr_jax.robots.statics.sensitivities import Sensitivities, pair_sensitivities, sensitivities

BATCH = 8192  # number of positions computed at a time


@jax.jit
def _of_point_mass(robot: PointMassRobot, positions) -> Sensitivities:
    return jax.vmap(partial(sensitivities, robot))(positions)


@jax.jit
def _of_platform(robot: PlatformRobot, poses) -> Sensitivities:
    return jax.vmap(lambda position, quaternion: sensitivities(robot, position, matrix(quaternion)))(*poses)


@jax.jit
def _of_pairs(geometry, positions) -> Sensitivities:
    exits, along, length = geometry
    return jax.vmap(partial(pair_sensitivities, exits, along, length))(positions)


class SensitivitySearch:
    """Sensitivities of a robot at positions.

    A platform whose cables form three parallel pairs has the orientation of its file, in which they are parallel; any
    other platform has its reference orientation. `robot` has platform axes in which that orientation is no rotation.

    Args:
        robot: centred robot; a platform in the axes of its file.

    Raises:
        InputError: `check_determined` refuses the robot.
    """

    def __init__(self, robot: PointMassRobot | PlatformRobot) -> None:
        """Find the orientation of a platform."""
        check_determined(robot)
        self.robot, self._pairs = robot, None
        if isinstance(robot, PlatformRobot):
            self._pairs = _pairs(robot)
            self.robot = robot if self._pairs is not None else aligned(robot)[0]

    def __call__(
        self, positions: Float[np.ndarray, "n 3"], quaternions: Float[np.ndarray, "n 4"] | None = None
    ) -> Sensitivities:
        """Sensitivities at positions."""
        robot, pairs = self.robot, self._pairs
        if isinstance(robot, PointMassRobot):
            return in_batches(partial(_of_point_mass, robot), positions, batch_size=BATCH)
        if quaternions is None and pairs is not None:
            points = np.asarray(robot.platform_points)
            first, second = points[pairs.cables[:, 0]], points[pairs.cables[:, 1]]
            geometry = (
                as_float64(pairs.exit_points),
                as_float64(second - first),
                as_float64(np.sqrt((points**2).sum(1).mean())),
            )
            return in_batches(partial(_of_pairs, geometry), positions, batch_size=BATCH)
        quaternions = np.tile(IDENTITY, (len(positions), 1)) if quaternions is None else quaternions
        return in_batches(partial(_of_platform, robot), (positions, quaternions), batch_size=BATCH)


def _pairs(robot: PlatformRobot) -> ParallelPairs | None:
    try:
        return parallel_pairs(robot.base_points, robot.platform_points)
    except InputError:
        return None
