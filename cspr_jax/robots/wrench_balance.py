"""The wrench balance of a rigid platform on cables, thesis (3.1) to (3.11), at one instant: the readable form."""

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array

from cspr_jax.arithmetic.elementary import solved
from cspr_jax.robots.platform import CABLES, PlatformRobot


class Pose(NamedTuple):
    """Where the platform is, and how it moves.

    Fields:
        position: (3,) of the mass centre, m.
        rotation: (3, 3) from platform to fixed axes.
        velocity: (3,) m/s.
        angular_velocity: (3,) fixed axes, rad/s.
        acceleration: (3,) m/s^2.
        angular_acceleration: (3,) fixed axes, rad/s^2.
    """

    position: Array
    rotation: Array
    velocity: Array
    angular_velocity: Array
    acceleration: Array
    angular_acceleration: Array


def at_rest(position: Array, rotation: Array) -> Pose:
    """A pose without motion.

    Args:
        position: (3,) m.
        rotation: (3, 3).

    Returns:
        the pose.
    """
    still = jnp.zeros_like(position)
    return Pose(position, rotation, still, still, still, still)


def rays(robot: PlatformRobot, position: Array, rotation: Array) -> tuple[Array, Array]:
    """Cables as vectors from spool to platform, (3.1), and their attachment points from the mass centre.

    Args:
        robot: the robot.
        position: (3,) m.
        rotation: (3, 3).

    Returns:
        (6, 3) each, fixed axes, m.
    """
    arms = robot.platform_points @ rotation.T
    return position[None] + arms - robot.base_points, arms


def jacobian(robot: PlatformRobot, position: Array, rotation: Array) -> Array:
    """J of (3.5): cable lengths times their rates, from velocity and angular velocity.

    Args:
        robot: the robot.
        position: (3,) m.
        rotation: (3, 3).

    Returns:
        (6, 6) one row a cable.
    """
    cables, arms = rays(robot, position, rotation)
    return jnp.concatenate([cables, jnp.cross(arms, cables)], axis=1)


def conditioning(robot: PlatformRobot, position: Array, rotation: Array) -> Array:
    """Determinant of J with cables of length 1 and the platform's size as the unit of length.

    It is zero where the cables cannot carry every wrench, (3.5); its sign is that of det J.

    Args:
        robot: the robot.
        position: (3,) m.
        rotation: (3, 3).

    Returns:
        () a pure number.
    """
    cables, arms = rays(robot, position, rotation)
    units = cables / jnp.linalg.norm(cables, axis=1, keepdims=True)
    size = jnp.sqrt(jnp.mean(jnp.sum(robot.platform_points**2, axis=1)))
    return solved(jnp.concatenate([units, jnp.cross(arms / size, units)], axis=1), jnp.zeros((CABLES, 0)))[1]


def inertial_wrench(robot: PlatformRobot, pose: Pose) -> Array:
    """Right-hand side of (3.11): what the cables must supply per mass.

    Args:
        robot: the robot.
        pose: the state.

    Returns:
        (6,) p'' - g, m/s^2, and the rate of the angular momentum (3.8) over the mass, m^2/s^2.
    """
    inertia = pose.rotation @ robot.inertia @ pose.rotation.T
    spin = inertia @ pose.angular_acceleration + jnp.cross(pose.angular_velocity, inertia @ pose.angular_velocity)
    return jnp.concatenate([pose.acceleration.at[2].add(-robot.gravity), spin / robot.mass])


def tensions_per_length(robot: PlatformRobot, pose: Pose) -> Array:
    """Tension per mass and length of each cable: mu of (3.11).

    Args:
        robot: the robot.
        pose: the state.

    Returns:
        (6,) in cable order, 1/s^2. Not clipped: a negative entry is a push that a cable cannot give.
    """
    right = inertial_wrench(robot, pose)[:, None]
    return solved(-jacobian(robot, pose.position, pose.rotation).T, right)[0][:, 0]


def tensions(robot: PlatformRobot, pose: Pose) -> Array:
    """Cable tensions, (3.10).

    Args:
        robot: the robot.
        pose: the state.

    Returns:
        (6,) in cable order, N; negative where a cable would have to push.
    """
    cables, _ = rays(robot, pose.position, pose.rotation)
    return robot.mass * jnp.linalg.norm(cables, axis=1) * tensions_per_length(robot, pose)


def cable_motion(robot: PlatformRobot, pose: Pose) -> tuple[Array, Array, Array]:
    """Lengths of the cables, (3.2), and their first two derivatives in time, (3.3).

    Args:
        robot: the robot.
        pose: the state.

    Returns:
        lengths (6,) m, rates (6,) m/s (positive pays out), accelerations (6,) m/s^2.
    """
    cables, arms = rays(robot, pose.position, pose.rotation)
    lengths = jnp.linalg.norm(cables, axis=1)
    swing = jnp.cross(pose.angular_velocity, arms)
    velocity = pose.velocity[None] + swing
    inward = jnp.cross(pose.angular_velocity, swing)
    pull = pose.acceleration[None] + jnp.cross(pose.angular_acceleration, arms) + inward
    rates = jnp.sum(cables * velocity, axis=1) / lengths
    return lengths, rates, (jnp.sum(velocity**2 + cables * pull, axis=1) - rates**2) / lengths
