"""Speeds of cables that velocities of the effector need, for maps of workspaces. Arrays in, answers out.

A cable of unit vector u, attached at the arm a from the origin of the platform frame, changes its length by
-(u.v + (a x u).w) a second, v being the velocity of that origin and w the angular velocity. Of all v and w with
|v| <= V and |w| <= W that the robot's pattern allows, the fastest is |u'| V + |(a x u)'| W, the primes standing for the
parts along which the effector can move and about which it can turn: the rows of the wrench matrix.
"""

import dataclasses

import numpy as np

from cspr_jax.arithmetic.batches import in_batches
from cspr_jax.arithmetic.elementary import leaf
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.patterns import PATTERNS
from cspr_jax.robots.platform import PlatformRobot
from cspr_jax.workspaces import geometry
from cspr_jax.workspaces.shifts import Shifts

BATCH = 4096


@dataclasses.dataclass(frozen=True)
class CableSpeeds:
    """Velocities that an effector must be able to have, and largest speeds of its cables.

    Fields:
        robot: centred, z down, its arms from the origin of the platform frame; see `cable_speeds`.
        speed: of that origin, m/s.
        angular_speed: rad/s.
        most: (n_cables,) largest speeds, m/s.
    """

    robot: AnyRobot
    speed: float
    angular_speed: float
    most: np.ndarray

    def margins(self, origins: np.ndarray, quaternions: np.ndarray) -> np.ndarray:
        """Slack that is left to the largest speeds of the cables.

        Args:
            origins: (n, 3) of the platform frame, kernels' coordinates, m.
            quaternions: (n, 4) unit quaternions, scalar first.

        Returns:
            (n, n_cables) m/s, negative where some velocity needs a faster cable.
        """
        poses = origins, quaternions
        columns = in_batches(lambda x: geometry.wrench_matrices(self.robot, *x), poses, size=BATCH)
        forces = len(PATTERNS[self.robot.pattern].forces)
        along, about = (np.linalg.norm(part, axis=1) for part in (columns[:, :forces], columns[:, forces:]))
        return self.most - (along * self.speed + about * self.angular_speed)

    def changes(self, moved: Shifts) -> np.ndarray:
        """How far `margins` change within cells at most.

        Returns:
            (n, n_cables) m/s.
        """
        # The first term does not change for a robot that moves in all directions in which its cables lie.
        speed = self.speed if PATTERNS[self.robot.pattern].forces == (2,) else 0.0
        if not isinstance(self.robot, PlatformRobot):
            return moved.units * speed
        arms = np.linalg.norm(np.asarray(self.robot.platform_points), axis=1)
        return moved.units * (speed + arms * self.angular_speed)


def cable_speeds(robot: AnyRobot, most: np.ndarray, *, speed: float, angular_speed: float) -> CableSpeeds:
    """Velocities that an effector must be able to have.

    Args:
        robot: centred, z down.
        most: () or (n_cables,) largest speeds of the cables, m/s.
        speed: of the origin of the platform frame, or of the point mass, m/s.
        angular_speed: rad/s.

    Returns:
        the question.
    """
    if isinstance(robot, PlatformRobot) and not PATTERNS[robot.pattern].is_jointed and robot.centre_of_mass is not None:
        points = np.asarray(robot.platform_points) + np.asarray(robot.centre_of_mass)
        robot = dataclasses.replace(robot, platform_points=leaf(points))
    return CableSpeeds(robot, speed, angular_speed, np.broadcast_to(np.asarray(most, float), (robot.n_cables,)))
