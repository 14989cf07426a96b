"""Sensitivity of an effector to errors of its cable lengths, Machines 11 (2), 2023, 224, (7), at one position.

Let K be the matrix from velocity and angular velocity to the rates of the cable lengths, with one row (e, b x e) for
each cable; a small error d rho of the lengths moves the effector by K^-1 d rho. The largest displacement by errors of
up to one unit in each cable, sigma_p, is the induced norm (infinity, 2) of the upper rows of K^-1; the largest
rotation, sigma_r, is that norm of the lower rows. A norm is convex, so that its maximum over the cube of errors lies at
a corner: the maximum over all signs is exact. (J in the paper has the other sign in its lower rows, which changes no
norm.)

For n cables and d translations sigma_p is at least d / sqrt(n): the mean square over the corners is the squared
Frobenius norm of the upper rows, which for an inverse of n unit vectors e is at least d^2 / n. With three cables
sigma_p is thus at least sqrt 3, a value that only cables at right angles attain.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.numerics.elementary import maximum_of, solved
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.robot import Robot, check_determined
from cspr_jax.robots.statics.wrench_balance import at_rest, is_regular, normalised_determinant

_TRANSLATIONS = 3


class Sensitivities(NamedTuple):
    """Sensitivities to errors of the cable lengths; infinite where the cables do not hold the effector.

    Fields:
        sigma_p: () largest displacement over the largest error of a cable, m/m.
        sigma_r: () largest rotation of a platform over the largest error of a cable, rad/m; NaN for a point mass.
    """

    sigma_p: Array
    sigma_r: Array


def sensitivities(
    robot: Robot, position: Float[Array, "3"], rotation: Float[Array, "3 3"] | None = None
) -> Sensitivities:
    """Sensitivities of a robot with as many cables as degrees of freedom, for independent errors of all lengths."""
    check_determined(robot)
    rotation = jnp.eye(_TRANSLATIONS) if rotation is None else rotation
    rates = -robot.wrench_matrix(at_rest(position, rotation)).T
    inverse, determinant = solved(rates, jnp.eye(robot.dof))
    if isinstance(robot, PlatformRobot):
        determinant = normalised_determinant(robot, position, rotation)
    return _of_inverse(inverse[:_TRANSLATIONS], inverse[_TRANSLATIONS:], determinant)


def pair_sensitivities(
    exit_points: Float[Array, "3 3"], along: Float[Array, "3 3"], radius: Float[Array, ""], position: Float[Array, "3"]
) -> Sensitivities:
    """Sensitivities of a platform on three parallel pairs of cables in closed form, (A1) and (A2)."""
    cables = position[None] - exit_points
    units = cables / jnp.linalg.norm(cables, axis=1, keepdims=True)
    translation, first = solved(units, jnp.eye(_TRANSLATIONS))
    rotation, second = solved(jnp.cross(along, units), jnp.eye(_TRANSLATIONS))
    return _of_inverse(translation, 2.0 * rotation, first * second / radius**3)


def _of_inverse(translations: Array, rotations: Array, determinant: Array) -> Sensitivities:
    held = is_regular(jnp.abs(determinant))
    sigma_p, sigma_r = (jnp.where(held, _largest(rows), jnp.inf) for rows in (translations, rotations))
    return Sensitivities(sigma_p, sigma_r if len(rotations) else jnp.full_like(sigma_p, jnp.nan))


def _largest(rows: Array) -> Array:
    # Opposite corners give the same length, so that the last sign is kept.
    count = rows.shape[1]
    signs = np.array([(*corner, 1.0) for corner in itertools.product((-1.0, 1.0), repeat=count - 1)])
    return maximum_of(jnp.linalg.norm(signs @ rows.T, axis=1))
