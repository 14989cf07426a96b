"""The angular acceleration of a platform at the end of a segment, beta-hat, thesis section 3.8.

At the end the platform is at rest, p'' = -(g / z0) (p - p0), and omega' = beta-hat (g / z0) gamma e: this is (3.71)
without its factor 2, since the angle of the rotation is gamma beta. The tensions are linear in beta-hat.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array

from cspr_jax.numerics.elementary import length, maximum_of, minimum_of, solved
from cspr_jax.numerics.linear import rotations
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.platform import PlatformRobot, rays
from cspr_jax.robots.model.point_mass import rest_point
from cspr_jax.robots.model.state import State
from cspr_jax.robots.statics.wrench_balance import jacobian

# At rest in the reference orientation beta-hat is arbitrary; this value is that of a pendulum.
AT_REST = -1.0
# Tensions whose derivative in beta-hat is below this fraction of the mean tension count as independent of it.
FLAT = 1e-12


class Endpoint(NamedTuple):
    """Tensions per mass and length at an end, offset + derivative * beta-hat, and the beta-hat that keep cables taut.

    Fields:
        offset: (n_cables,) tensions at beta-hat = 0, 1/s^2.
        derivative: (n_cables,) derivative with respect to beta-hat, 1/s^2.
        preferred: () beta-hat of (3.91), which makes the tensions as equal as possible.
        lowest: () start of the interval (3.92) in which every cable is taut; above `highest` if the interval is empty.
        highest: () end of the interval.
    """

    offset: Array
    derivative: Array
    preferred: Array
    lowest: Array
    highest: Array


def endpoint(
    robot: PlatformRobot, position: Float[Array, "3"], quaternion: Float[Array, "4"], z0: Float[Array, ""]
) -> Endpoint:
    """Tensions at one end of a segment as functions of beta-hat."""
    rotation = rotations.matrix(quaternion)
    matrix = -jacobian(robot, position, rotation).T
    eta = robot.gravity / z0  # (3.78)
    moment = eta * rotation @ robot.inertia @ _angle_vector(quaternion) / robot.mass  # (3.80)
    zero = jnp.zeros(3)
    right = jnp.stack([jnp.concatenate([-eta * position, zero]), jnp.concatenate([zero, moment])], axis=1)
    offset, derivative = solved(matrix, right)[0].T  # (3.79)
    # The translation determines the mean tension by (3.13): eta / n_cables if both centroids are at the origin.
    cables, _ = rays(robot, position, rotation)
    mean_ray = jnp.mean(cables, axis=0)
    mean_tension = eta * jnp.dot(position, mean_ray) / jnp.dot(mean_ray, mean_ray) / robot.n_cables
    squared_norm = jnp.dot(derivative, derivative)
    is_flat = squared_norm <= (FLAT * mean_tension) ** 2
    preferred = -jnp.dot(offset - mean_tension, derivative) / jnp.where(is_flat, 1.0, squared_norm)  # (3.91)
    where_slack = -offset / jnp.where(derivative == 0.0, 1.0, derivative)
    lowest = maximum_of(jnp.where(derivative > 0.0, where_slack, -jnp.inf))
    highest = minimum_of(jnp.where(derivative < 0.0, where_slack, jnp.inf))
    taut = jnp.where(jnp.all(offset > 0.0), jnp.inf, -jnp.inf)
    return Endpoint(
        offset,
        derivative,
        jnp.where(is_flat, AT_REST, preferred),
        jnp.where(is_flat, -taut, lowest),  # (3.92)
        jnp.where(is_flat, taut, highest),
    )


def end_state(
    robot: PlatformRobot,
    position: Float[Array, "3"],
    quaternion: Float[Array, "4"],
    z0: Float[Array, ""],
    beta_hat: Float[Array, ""],
) -> State:
    """State at one end of a segment, for any number of cables."""
    eta, zero = robot.gravity / z0, jnp.zeros(3)
    away = position - rest_point(z0)
    rotation = rotations.matrix(quaternion)
    return State(position, zero, -eta * away, rotation, zero, beta_hat * eta * _angle_vector(quaternion))


def _angle_vector(quaternion: Array) -> Array:
    # Return gamma e with gamma in [-pi, pi]; near 0 it is twice the vector part.
    q = rotations.upper(quaternion)
    sine = length(q[1:])
    ratio = 2.0 * jnp.arctan2(sine, q[0]) / jnp.where(sine > 0.0, sine, 1.0)
    return jnp.where(sine > 0.0, ratio, 2.0) * q[1:]
