"""The wrench balance of a rigid platform on cables, thesis (3.1) to (3.11), in one state: the readable form."""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array

from cspr_jax.numerics.elementary import solved
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.platform import PlatformRobot, platform_radius, rays, wrench_per_mass
from cspr_jax.robots.model.point_mass import cable_units, plane_normal, rest_point
from cspr_jax.robots.model.robot import check_determined
from cspr_jax.robots.model.state import State
from cspr_jax.robots.statics.cable_lengths import moved_lengths

# Normalised determinants up to this magnitude count as singular, since rounding may decide their sign.
SINGULAR = 1e-6


def at_rest(position: Float[Array, "3"], rotation: Float[Array, "3 3"]) -> State:
    """State of a platform at rest."""
    zero = jnp.zeros_like(position)
    return State(position, zero, zero, rotation, zero, zero)


def jacobian(
    robot: PlatformRobot, position: Float[Array, "3"], rotation: Float[Array, "3 3"]
) -> Float[Array, "n_cables 6"]:
    """J of (3.5): cable lengths times their rates, from velocity and angular velocity."""
    cables, arms = rays(robot, position, rotation)
    return jnp.concatenate([cables, jnp.cross(arms, cables)], axis=1)


def normalised_determinant(
    robot: PlatformRobot, position: Float[Array, "3"], rotation: Float[Array, "3 3"]
) -> Float[Array, ""]:
    """Determinant of J with cables of length 1 and the platform's radius as the unit of length.

    It is zero where the cables cannot carry every wrench, (3.5); its sign is that of det J.
    """
    check_determined(robot, pulleys=True)
    arms = robot.platform_points @ rotation.T
    units = -cable_units(robot, position[None] + arms)
    radius = platform_radius(robot)
    return solved(jnp.concatenate([units, jnp.cross(arms / radius, units)], axis=1), jnp.zeros((robot.n_cables, 0)))[1]


def is_regular(determinant):
    """Tell whether cables can carry every wrench, so that a pose is not singular."""
    return determinant > SINGULAR


def determinant_ratio(
    robot: PlatformRobot, position: Float[Array, "3"], rotation: Float[Array, "3 3"]
) -> Float[Array, ""]:
    """Normalised determinant over that in the reference orientation below the centroid, as far below the spools."""
    middle = rest_point(plane_normal(robot) @ position)
    return normalised_determinant(robot, position, rotation) / normalised_determinant(robot, middle, jnp.eye(3))


def tensions_per_length(robot: PlatformRobot, state: State) -> Float[Array, "6"]:
    """Tension per mass and length of each cable: mu of (3.11)."""
    check_determined(robot)
    right = wrench_per_mass(robot, state)[:, None]
    return solved(-jacobian(robot, state.position, state.rotation).T, right)[0][:, 0]


def tensions(robot: PlatformRobot, state: State) -> Float[Array, "6"]:
    """Cable tensions, (3.10)."""
    cables, _ = rays(robot, state.position, state.rotation)
    return robot.mass * jnp.linalg.norm(cables, axis=1) * tensions_per_length(robot, state)


def cable_motion(
    robot: PlatformRobot, state: State
) -> tuple[Float[Array, "n_cables"], Float[Array, "n_cables"], Float[Array, "n_cables"]]:
    """Lengths of the cables, (3.2), and their first two derivatives in time, (3.3)."""
    arms = robot.platform_points @ state.rotation.T
    swing = jnp.cross(state.angular_velocity, arms)
    inward = jnp.cross(state.angular_velocity, swing)
    acceleration = state.acceleration[None] + jnp.cross(state.angular_acceleration, arms) + inward
    return moved_lengths(robot, state.position[None] + arms, state.velocity[None] + swing, acceleration)
