"""Lengths of cables from spools, or around pulleys, to moving points, and their first two derivatives in time.

Let t be the unit vector along the free cable, n normal to it in the plane of the pulley, and p normal to this plane. If
its end B moves by dB the length changes by t . dB, since the exit moves along t by as much as the arc changes. Then t
turns by n . dB / s about p, with s the free length, and together with its plane by p . dB / w about the swivel axis k,
with w the distance of B from this axis. Since w = r (1 - t . k) + s (t . e), the second derivative is

    l'' = t . B'' + ((n . B')^2 + (p . B')^2 s (t . e) / w) / s
        = t . B'' + (|B'|^2 - l'^2 - (p . B')^2 r (1 - t . k) / w) / s
"""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array

from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.pulleys import exits
from cspr_jax.robots.model.robot import Robot


def moved_lengths(
    robot: Robot, targets: Array, velocities: Array, accelerations: Array
) -> tuple[Float[Array, "n_cables"], Float[Array, "n_cables"], Float[Array, "n_cables"]]:
    """Lengths of the cables, including the arcs on pulleys, and their first two derivatives in time."""
    rays, pulleys = targets - robot.base_points, robot.pulleys
    squares = jnp.sum(velocities**2, axis=1)
    if pulleys is None:
        lengths = jnp.linalg.norm(rays, axis=1)
        rates = jnp.sum(rays * velocities, axis=1) / lengths
        return lengths, rates, (squares + jnp.sum(rays * accelerations, axis=1) - rates**2) / lengths
    leaving = exits(robot.base_points, pulleys.axes, pulleys.radius, rays + robot.base_points)
    along = jnp.asarray(leaving.direction)
    rates = jnp.sum(along * velocities, axis=1)
    across = jnp.cross(pulleys.axes, rays)
    wide = jnp.sum(across**2, axis=1)
    wide = jnp.where(wide > 0.0, wide, 1.0)  # on the axis p . B' has no meaning, and any divisor will do
    swivel = jnp.sum(across * velocities, axis=1) ** 2 / wide**1.5
    slower = pulleys.radius * (1.0 - jnp.sum(along * pulleys.axes, axis=1)) * swivel
    return (
        leaving.wrapped + leaving.free,
        rates,
        jnp.sum(along * accelerations, axis=1) + (squares - rates**2 - slower) / leaving.free,
    )
