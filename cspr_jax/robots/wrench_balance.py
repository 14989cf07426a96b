"""The wrench balance of a rigid platform on cables, thesis (3.1) to (3.11), at one instant: the readable form."""

import jax.numpy as jnp
from jax import Array

from cspr_jax.arithmetic.elementary import solved
from cspr_jax.robots.cable_lengths import moved_lengths
from cspr_jax.robots.platform import PlatformRobot, rays, wrench_per_mass
from cspr_jax.robots.point_mass import plane_normal, pulls, rest_point
from cspr_jax.robots.robot import check_determined
from cspr_jax.robots.state import State

# Normalised determinants up to this count as singular, since rounding may decide their sign.
SINGULAR = 1e-6


def at_rest(position: Array, rotation: Array) -> State:
    """State of a platform that stands still.

    Args:
        position: (3,) m.
        rotation: (3, 3).

    Returns:
        the state.
    """
    still = jnp.zeros_like(position)
    return State(position, still, still, rotation, still, still)


def jacobian(robot: PlatformRobot, position: Array, rotation: Array) -> Array:
    """J of (3.5): cable lengths times their rates, from velocity and angular velocity.

    Args:
        position: (3,) m.
        rotation: (3, 3).

    Returns:
        (n_cables, 6) one row a cable.
    """
    cables, arms = rays(robot, position, rotation)
    return jnp.concatenate([cables, jnp.cross(arms, cables)], axis=1)


def normalised_determinant(robot: PlatformRobot, position: Array, rotation: Array) -> Array:
    """Determinant of J with cables of length 1 and the platform's size as the unit of length.

    It is zero where the cables cannot carry every wrench, (3.5); its sign is that of det J.

    Args:
        position: (3,) m.
        rotation: (3, 3).

    Returns:
        () a pure number.

    Raises:
        InputError: more than six cables.
    """
    check_determined(robot, pulleys=True)
    arms = robot.platform_points @ rotation.T
    units = -pulls(robot, position[None] + arms)
    size = jnp.sqrt(jnp.mean(jnp.sum(robot.platform_points**2, axis=1)))
    return solved(jnp.concatenate([units, jnp.cross(arms / size, units)], axis=1), jnp.zeros((robot.n_cables, 0)))[1]


def is_regular(determinant):
    """Tell whether cables can carry every wrench: the rule that decides which poses are singular.

    Args:
        determinant: (...) of `normalised_determinant`, or its share of that of another pose, which no singularity may
            separate from this one; NumPy or jax.

    Returns:
        (...) whether it is above `SINGULAR`; False for NaN, and for a negative share, beyond a singularity.
    """
    return determinant > SINGULAR


def determinant_share(robot: PlatformRobot, position: Array, rotation: Array) -> Array:
    """Normalised determinant over its value in the reference orientation at the same depth in the middle.

    Args:
        robot: centred, in its reference axes.
        position: (3,) m.
        rotation: (3, 3).

    Returns:
        () as `is_regular` takes it.
    """
    middle = rest_point(plane_normal(robot) @ position)
    return normalised_determinant(robot, position, rotation) / normalised_determinant(robot, middle, jnp.eye(3))


def tensions_per_length(robot: PlatformRobot, state: State) -> Array:
    """Tension per mass and length of each cable: mu of (3.11).

    Returns:
        (6,) in cable order, 1/s^2. Not clipped: a negative entry is a push that a cable cannot give.

    Raises:
        InputError: more than six cables.
    """
    check_determined(robot)
    right = wrench_per_mass(robot, state)[:, None]
    return solved(-jacobian(robot, state.position, state.rotation).T, right)[0][:, 0]


def tensions(robot: PlatformRobot, state: State) -> Array:
    """Cable tensions, (3.10).

    Returns:
        (6,) in cable order, N; negative where a cable would have to push.
    """
    cables, _ = rays(robot, state.position, state.rotation)
    return robot.mass * jnp.linalg.norm(cables, axis=1) * tensions_per_length(robot, state)


def cable_motion(robot: PlatformRobot, state: State) -> tuple[Array, Array, Array]:
    """Lengths of the cables, (3.2), and their first two derivatives in time, (3.3).

    Returns:
        lengths (n_cables,) m, rates (n_cables,) m/s (positive pays out), accelerations (n_cables,) m/s^2.
    """
    arms = robot.platform_points @ state.rotation.T
    swing = jnp.cross(state.angular_velocity, arms)
    inward = jnp.cross(state.angular_velocity, swing)
    pull = state.acceleration[None] + jnp.cross(state.angular_acceleration, arms) + inward
    return moved_lengths(robot, state.position[None] + arms, state.velocity[None] + swing, pull)
