"""The force balance of a point mass on three cables, or on two cables in a plane, in one state."""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array

from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.point_mass import PointMassRobot, is_planar, relative_acceleration
from cspr_jax.robots.model.robot import check_determined
from cspr_jax.robots.statics.cable_lengths import moved_lengths


def pseudotensions(
    robot: PointMassRobot, position: Float[Array, "3"], acceleration: Float[Array, "3"]
) -> Float[Array, "n_cables"]:
    """Pseudotensions kappa, thesis (2.12) to (2.14), for a planar robot (1.15) and (1.16): Adj(M) (p'' - g)."""
    rows, arms = adjugate(robot)
    return (rows + jnp.cross(position, arms)) @ relative_acceleration(robot, acceleration)


def adjugate(robot: PointMassRobot) -> tuple[Float[Array, "n_cables 3"], Float[Array, "n_cables 3"]]:
    """Adjugate of the structure matrix M, affine in the position.

    With the two returned arrays, pseudotensions are (rows + position x arms) (p'' - g).
    """
    check_determined(robot)
    a = robot.base_points
    if is_planar(robot):
        sides = jnp.sign(a[1, 0] - a[0, 0]) * jnp.asarray([1.0, -1.0])
        across = sides[:, None] * jnp.asarray([[0.0, 1.0, 0.0]])
        return jnp.cross(across, a[::-1]), across
    following, preceding = jnp.roll(a, -1, axis=0), jnp.roll(a, -2, axis=0)
    sign = -jnp.sign(jnp.cross(a[1] - a[0], a[2] - a[0])[2])
    return sign * jnp.cross(following, preceding), sign * (following - preceding)


def tensions(
    robot: PointMassRobot, position: Float[Array, "3"], acceleration: Float[Array, "3"]
) -> Float[Array, "n_cables"]:
    """Cable tensions, thesis (2.2) to (2.7), as kappa / det(M) times mass and length."""
    check_determined(robot)
    rays = robot.base_points - position[None]  # (2.6)
    if is_planar(robot):
        adjugate = _planar_adjugate(rays)
        determinant = jnp.dot(adjugate[1], rays[1])
    else:
        adjugate = jnp.stack([jnp.cross(rays[1], rays[2]), jnp.cross(rays[2], rays[0]), jnp.cross(rays[0], rays[1])])
        determinant = jnp.dot(adjugate[2], rays[2])  # (2.9)
    per_length = adjugate @ relative_acceleration(robot, acceleration) / determinant  # (2.7), (2.11)
    return robot.mass * per_length * jnp.linalg.norm(rays, axis=1)  # (2.4)


def cable_motion(
    robot: PointMassRobot, position: Float[Array, "3"], velocity: Float[Array, "3"], acceleration: Float[Array, "3"]
) -> tuple[Float[Array, "n_cables"], Float[Array, "n_cables"], Float[Array, "n_cables"]]:
    """Lengths of the cables, (2.1), and their first two derivatives in time."""
    return moved_lengths(robot, position[None], velocity[None], acceleration[None])


def _planar_adjugate(rays: Array) -> Array:
    # Rows whose products with p'' - g are the numerators of Cramer's rule for both tensions, in the plane y = 0.
    rotated = jnp.stack([rays[:, 2], jnp.zeros_like(rays[:, 0]), -rays[:, 0]], axis=1)
    return jnp.stack([rotated[1], -rotated[0]])
