"""The force balance of a point mass on three cables, or on two in a plane, at one instant."""

import jax.numpy as jnp
from jax import Array

from cspr_jax.robots.cable_lengths import moved_lengths
from cspr_jax.robots.point_mass import PointMassRobot, is_planar, relative_acceleration
from cspr_jax.robots.robot import check_determined


def pseudotensions(robot: PointMassRobot, position: Array, acceleration: Array) -> Array:
    """Pseudotensions kappa, thesis (2.12) to (2.14), for a planar robot (1.15) and (1.16): Adj(M) (p'' - g).

    Below the spools they have the sign of the tensions, and they need no division. The sign is corrected for spools
    numbered the other way round, so that it never depends on the order of the cables.

    Args:
        robot: a point mass on three cables, or on two in a plane.
        position: (3,) of the mass, z down, m.
        acceleration: (3,) m/s^2.

    Returns:
        (n_cables,) in cable order, m^3/s^2 (planar: m^2/s^2); positive pulls, as long as the mass is below the spools.

    Raises:
        InputError: more cables.
    """
    rows, arms = adjugate(robot)
    return (rows + jnp.cross(position, arms)) @ relative_acceleration(robot, acceleration)


def adjugate(robot: PointMassRobot) -> tuple[Array, Array]:
    """Adjugate of the structure matrix M, affine in the position.

    Pseudotensions are (rows + position x arms) (p'' - g).

    Args:
        robot: a point mass on three cables, or on two in a plane.

    Returns:
        rows: (n_cables, 3) m^2, planar m; arms: (n_cables, 3) m, planar 1; both of the sign of `pseudotensions`.

    Raises:
        InputError: more cables.
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


def tensions(robot: PointMassRobot, position: Array, acceleration: Array) -> Array:
    """Cable tensions, thesis (2.2) to (2.7), as kappa / det(M) times mass and length.

    Args:
        robot: a point mass on three cables, or on two in a plane.
        position: (3,) of the mass, z down, m.
        acceleration: (3,) m/s^2.

    Returns:
        (n_cables,) in cable order, N. Not clipped: a negative entry is the push that a cable cannot give.
        Infinite or NaN in the spool plane, where M is singular.

    Raises:
        InputError: more cables.
    """
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
    robot: PointMassRobot, position: Array, velocity: Array, acceleration: Array
) -> tuple[Array, Array, Array]:
    """Lengths of the cables, (2.1), and their first two derivatives in time.

    Args:
        robot: a point mass on any number of cables.
        position: (3,) m.
        velocity: (3,) m/s.
        acceleration: (3,) m/s^2.

    Returns:
        lengths (n_cables,) m, rates (n_cables,) m/s (positive pays out), accelerations (n_cables,) m/s^2.
    """
    return moved_lengths(robot, position[None], velocity[None], acceleration[None])


def _planar_adjugate(rays: Array) -> Array:
    # Return rows whose products with p'' - g are the numerators of both unknowns by Cramer's rule, in the plane y = 0.
    turned = jnp.stack([rays[:, 2], jnp.zeros_like(rays[:, 0]), -rays[:, 0]], axis=1)
    return jnp.stack([turned[1], -turned[0]])
