"""Tension couples of a point mass on four cables from the corners of a level rectangle: Boralugoda (30) to (33)."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.point_mass import LEVEL, SPATIAL, PointMassRobot, relative_acceleration


def is_rectangle(base_points: Float[np.ndarray, "n_cables 3"]) -> bool:
    """Tell whether spools are the corners of a level rectangle with sides along x and y, in their order around it."""
    points = np.asarray(base_points, float)
    if points.shape != (4, SPATIAL):
        return False
    sides = np.roll(points, -1, axis=0) - points
    lengths = np.abs(sides[:2])
    along = 0 if lengths[0, 0] > lengths[0, 1] else 1
    expected = np.zeros((2, SPATIAL))
    expected[0, along], expected[1, 1 - along] = sides[0, along], sides[1, 1 - along]
    small = LEVEL * np.linalg.norm(lengths)
    is_right = (np.abs(sides - np.concatenate([expected, -expected])) <= small).all()
    return bool(is_right and lengths[0, along] > small and lengths[1, 1 - along] > small)


def tension_couples(
    robot: PointMassRobot, position: Float[Array, "3"], acceleration: Float[Array, "3"]
) -> Float[Array, "n_cables"]:
    """Tension couples T12, T23, T34, T41 of a point mass on four cables, Boralugoda (2019), (30) to (33).

    A couple is the force of two cables whose spools are the ends of a side, projected along that side, so that both lie
    on one line. Unlike tensions, couples follow from the motion alone: any two opposite couples add up to the force.
    """
    spools = robot.base_points
    force = robot.mass * relative_acceleration(robot, acceleration)
    # Vectors from each side across to the opposite side.
    across = jnp.roll(spools, -2, axis=0) - jnp.roll(spools, -1, axis=0)
    width = jnp.linalg.norm(across, axis=1)
    rays = position[None] - spools
    along, depth = jnp.sum(rays * across, axis=1) / width, rays[:, 2]
    lift = -force[2] / depth
    return ((width - along) * lift - across @ force / width) / width * jnp.hypot(along, depth)
