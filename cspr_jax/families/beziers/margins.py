"""Smallest pseudotensions and depth along Bezier segments by formulas: nothing is sampled.

Pseudotensions are (rows + p x arms) (p'' - g), bilinear in p and p'' - g, both of which are quadratic in c, the cosine
of pi tau. The fourth power cancels, since its factors are parallel. So each triangle of spools has a cubic in c (19),
whose smallest value on [-1, 1] is at an end or where its derivative is zero. The depth below the spools is a quadratic.
The same holds for a point mass on two cables in a plane.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from cspr_jax.families.beziers.motion import Bezier, powers
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.point_mass import PointMassRobot, plane_normal, rest_point, spool_radius
from cspr_jax.robots.statics.force_balance import adjugate, pseudotensions

# Rounding errors are below this many units in the last place of the sum of the magnitudes of all terms.
EPSILONS = 64.0


class Margins(NamedTuple):
    """Smallest slacks of a segment.

    Fields:
        taut: (n_cables,) smallest pseudotension over its value at rest in P0.
        below: () smallest depth below the spools over z0.
        taut_rounding: (n_cables,) bound of the rounding error of `taut`.
        below_rounding: () bound of the rounding error of `below`.
    """

    taut: Array
    below: Array
    taut_rounding: Array
    below_rounding: Array


@jax.jit
def cubics(robot: PointMassRobot, motion: Bezier) -> Float[Array, "n_cables 4"]:
    """Pseudotensions over their value at rest in P0, as coefficients of powers of c = cos(pi tau), (19) and (20)."""
    rows, arms = adjugate(robot)
    square, linear, constant = powers(motion.start, motion.middle, motion.end)
    u = (np.pi / motion.time) ** 2
    weight = jnp.zeros_like(square).at[2].set(robot.gravity)
    first = 2.0 * u * square - weight
    moments = jnp.stack(
        [
            jnp.cross(first, constant),
            -u * jnp.cross(linear, constant) + 2.0 * u * jnp.cross(square, linear) - jnp.cross(weight, linear),
            -4.0 * u * jnp.cross(square, constant) - jnp.cross(weight, square),
            -3.0 * u * jnp.cross(square, linear),
        ]
    )
    forces = jnp.stack([first, -u * linear, -4.0 * u * square, jnp.zeros_like(square)])
    return (rows @ forces.T + arms @ moments.T) / _at_rest(robot, motion.z0)[:, None]


@jax.jit
def depth_quadratic(robot: PointMassRobot, motion: Bezier) -> Float[Array, "3"]:
    """Depth below the spools over z0, as coefficients of powers of c = cos(pi tau)."""
    square, linear, constant = powers(motion.start, motion.middle, motion.end)
    return jnp.stack([constant, linear, square]) @ plane_normal(robot) / motion.z0


@jax.jit
def smallest_margins(robot: PointMassRobot, motion: Bezier) -> Margins:
    """Smallest pseudotensions and depth of a segment: (22) to (25), with a minimum in (25) instead of "max"."""
    rows, arms = adjugate(robot)
    square, linear, constant = (jnp.sum(jnp.abs(x)) for x in powers(motion.start, motion.middle, motion.end))
    position = square + linear + constant
    force = (np.pi / motion.time) ** 2 * (6.0 * square + linear) + robot.gravity
    terms = force * (jnp.sum(jnp.abs(rows), axis=1) + position * jnp.sum(jnp.abs(arms), axis=1))
    epsilon = EPSILONS * jnp.finfo(position.dtype).eps
    return Margins(
        smallest_cubic(cubics(robot, motion).T),
        smallest_quadratic(depth_quadratic(robot, motion)),
        epsilon * terms / jnp.abs(_at_rest(robot, motion.z0)),
        epsilon * position * jnp.sum(jnp.abs(plane_normal(robot))) / jnp.abs(motion.z0),
    )


def depths_of(robot: PointMassRobot, starts: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n"]:
    """Depths at which slacks are normalised where there is no P0: those of the starts."""
    depth = starts @ np.asarray(plane_normal(robot))
    return np.where(depth > 0.0, depth, float(spool_radius(robot)))


def smallest_cubic(powers_of_c: Float[Array, "4 ..."]) -> Float[Array, "..."]:
    """Smallest value of cubics on [-1, 1].

    The zeros of the derivative are found without cancellation; a zero outside the interval is replaced by an end.
    """
    f0, f1, f2, f3 = powers_of_c
    discriminant = f2**2 - 3.0 * f3 * f1
    root = f2 + jnp.where(f2 < 0.0, -1.0, 1.0) * jnp.sqrt(jnp.maximum(discriminant, 0.0))
    at = [_inside(x) for x in (-root / (3.0 * f3), -f1 / root)]
    values = [f0 + c * (f1 + c * (f2 + c * f3)) for c in at]
    ends = jnp.minimum(f0 + f1 + f2 + f3, f0 - f1 + f2 - f3)
    return jnp.minimum(ends, jnp.minimum(*values))


def smallest_quadratic(powers_of_c: Float[Array, "3 ..."]) -> Float[Array, "..."]:
    """Smallest value of quadratics on [-1, 1]."""
    f0, f1, f2 = powers_of_c
    at = _inside(-0.5 * f1 / f2)
    ends = f0 + f2 - jnp.abs(f1)
    return jnp.minimum(ends, f0 + at * (f1 + at * f2))


def _inside(c: Array) -> Array:
    # Keep the argument of the minimum constant: it does not affect derivatives, since the derivative there is zero.
    return lax.stop_gradient(jnp.clip(jnp.where(c * 0.0 == 0.0, c, 1.0), -1.0, 1.0))


def _at_rest(robot: PointMassRobot, z0: Array) -> Array:
    center = rest_point(z0)
    return pseudotensions(robot, center, jnp.zeros_like(center))
