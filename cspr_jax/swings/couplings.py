"""Couplings of position and acceleration within a plane, or on a line, through p0 to the pseudotensions."""

import jax.numpy as jnp
from jax import Array

from cspr_jax.robots import point_mass
from cspr_jax.robots.point_mass import PointMassRobot
from cspr_jax.robots.robot import check_determined


def couplings(robot: PointMassRobot, hub: Array, axes: Array) -> tuple[Array, Array, Array]:
    """Coefficients of a motion p = p0 + axes c, about which the effector swings like a pendulum hung from the centroid.

    With d = c + c'' / lambda and lambda = gravity / z0, from (2.12) to (2.14) divided by their value
    at rest in p0: cable k has the normalised pseudotension 1 + tilt . c + pull_k . d + twist_k (c x d).

    Args:
        robot: centred; a point mass on three cables, any triangle; or on two, then the motion is a line in their plane.
        hub: (3,) p0 from the centroid of the spools, m.
        axes: (3, n) the directions of the motion, as columns; n is 1 or 2.

    Returns:
        tilt (n,), 1/m; pull (n_cables, n), 1/m, one row a cable; twist (n_cables,), 1/m^2, zero for a line.

    Raises:
        InputError: more cables.
    """
    check_determined(robot)
    if point_mass.is_planar(robot):
        half = robot.base_points[:, 0]
        tilt = axes[2] / hub[2]
        return tilt, axes[:1] / half[:, None] - tilt[None], jnp.zeros_like(half)  # (1.15), (1.16)
    a = robot.base_points
    area = jnp.cross(a[0], a[1]) + jnp.cross(a[1], a[2]) + jnp.cross(a[2], a[0])
    scale = 3.0 / (area[2] * hub[2])
    opposite = jnp.roll(a, -1, axis=0) - jnp.roll(a, -2, axis=0)  # a2 - a3, a3 - a1, a1 - a2
    tilt = point_mass.plane_normal(robot) @ axes / hub[2]
    pull = -scale * (jnp.cross(hub, opposite) + area[None] / 3.0) @ axes
    twist = scale * (opposite @ jnp.cross(axes[:, 0], axes[:, -1]))
    return tilt, pull, twist
