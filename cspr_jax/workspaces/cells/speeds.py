"""Speeds of cables that velocities of the effector require, for maps of workspaces. Arrays in, answers out.

The length of a cable with unit vector u, attached at the arm a from the origin of the platform frame, has the rate
-(u.v + (a x u).w), where v is the velocity of the origin and w the angular velocity. Over all v and w with |v| <= V and
|w| <= W that the robot's pattern allows, the largest rate is |u'| V + |(a x u)'| W, where primes mark the components
along which the effector can move and about which it can turn: the rows of the wrench matrix.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.elementary import as_float64, unit_vectors
from cspr_jax.numerics.shapes import Float, Int
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.schema.verdicts import FLAGS, Verdict
from cspr_jax.workspaces.cells.cell_proofs import cable_wrenches
from cspr_jax.workspaces.cells.shifts import Shifts
from cspr_jax.workspaces.poses import geometry

BATCH = 4096


@dataclasses.dataclass(frozen=True)
class CableSpeeds:
    """Required velocities of an effector, and largest speeds of its cables.

    Fields:
        robot: robot in the kernels' axes, with arms from the origin of the platform frame; see `cable_speeds`.
        speed: required speed of the origin, m/s.
        angular_speed: required angular speed, rad/s.
        maximum: (n_cables,) largest speeds of the cables, m/s.
        of_motors: (n_cables,) whether these are the largest speeds of the motors.
    """

    robot: AnyRobot
    speed: float
    angular_speed: float
    maximum: np.ndarray
    of_motors: np.ndarray | bool = False

    @property
    def flags(self) -> Int[np.ndarray, "n_cables"]:
        """Flags of verdicts where each cable is too fast."""
        flags = np.where(self.of_motors, Verdict.MOTOR_TOO_FAST, Verdict.CABLE_TOO_FAST)
        return np.broadcast_to(flags, self.maximum.shape).astype(FLAGS)

    def margins(
        self, origins: Float[np.ndarray, "n 3"], quaternions: Float[np.ndarray, "n 4"]
    ) -> Float[np.ndarray, "n n_cables"]:
        """Smallest slack of the largest speeds of the cables, at each pose."""
        poses = origins, quaternions
        columns = in_batches(lambda x: geometry.wrench_matrices(self.robot, *x), poses, batch_size=BATCH)
        forces = len(PATTERNS[self.robot.pattern].forces)
        along, about = (np.linalg.norm(part, axis=1) for part in (columns[:, :forces], columns[:, forces:]))
        return self.maximum - (along * self.speed + about * self.angular_speed)

    def displaced(
        self, origins: Float[np.ndarray, "n 3"], quaternion: Float[np.ndarray, "4"], distance: float
    ) -> tuple[Float[np.ndarray, "n n_cables"], Float[np.ndarray, "n n_cables"]]:
        """Margins of robots without pulleys, with the displacements of spools that, to first order, are worst."""
        robot = self.robot
        arms, wrenches = cable_wrenches(robot, quaternion, np.ones(robot.dof))
        forces = len(PATTERNS[robot.pattern].forces)
        parts = (wrenches[:, :forces], self.speed), (wrenches[:, forces:], self.angular_speed)
        rays = np.asarray(robot.base_points) - arms - origins[:, None]

        def each(rays: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            # Unit vectors, rates, and derivatives of rates with respect to unit vectors.
            units = unit_vectors(rays)
            rates, gradients = np.zeros(units.shape[:2]), np.zeros_like(units)
            for wrench, speed in parts:
                columns = np.einsum("nik,kmi->nim", units, wrench)
                rates += np.linalg.norm(columns, axis=2) * speed
                gradients += np.einsum("nim,kmi->nik", unit_vectors(columns), wrench) * speed
            return units, rates, gradients

        units, _, gradients = each(rays)
        rays = rays + distance * unit_vectors(gradients - (gradients * units).sum(2, keepdims=True) * units)
        return self.maximum - each(rays)[1], np.linalg.norm(rays, axis=2)

    def changes(self, moved: Shifts) -> Float[np.ndarray, "n n_cables"]:
        """Largest change of `margins` within cells."""
        # |u'| is constant for a robot that can move in all directions that its cables can have.
        speed = self.speed if PATTERNS[self.robot.pattern].forces == (2,) else 0.0
        if not isinstance(self.robot, PlatformRobot):
            return moved.units * speed
        arms = np.linalg.norm(np.asarray(self.robot.platform_points), axis=1)
        return moved.units * (speed + arms * self.angular_speed)


def cable_speeds(
    robot: AnyRobot, maximum: np.ndarray, of_motors: np.ndarray | bool = False, *, speed: float, angular_speed: float
) -> CableSpeeds:
    """Required velocities of an effector, with its arms taken from the origin of the platform frame."""
    if isinstance(robot, PlatformRobot) and not PATTERNS[robot.pattern].is_jointed and robot.centre_of_mass is not None:
        points = np.asarray(robot.platform_points) + np.asarray(robot.centre_of_mass)
        robot = dataclasses.replace(robot, platform_points=as_float64(points))
    largest = np.broadcast_to(np.asarray(maximum, float), (robot.n_cables,))
    return CableSpeeds(robot, speed, angular_speed, largest, of_motors)
