"""The plane in which the effector swings between two points, and the precession of its elliptic swing in that plane."""

from __future__ import annotations

import math
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array

from cspr_jax.motion.amplitudes import LawPiece
from cspr_jax.motion.formulas import Expression, combined, function, pi, rational, rationals
from cspr_jax.numerics.elementary import length
from cspr_jax.numerics.shapes import Bool, Float
from cspr_jax.robots.model.point_mass import AT_P0

# Sine of an angle below which a plane counts as upright.
UPRIGHT = 1e-12


@jax.jit
def swing_plane(
    v1: Float[Array, "3"],
    v2: Float[Array, "3"],
    scale: Float[Array, ""],
    normal: Float[Array, "3"],
    odd: Bool[Array, ""],
) -> tuple[Float[Array, "3 2"], Float[Array, ""], Float[Array, ""], Float[Array, ""]]:
    """Plane, radii and precession of a swing from one point to another.

    A swing from or to rest is a straight line. Where start and end lie on one line through p0, the plane is the one
    that is least inclined to the spool plane.
    """
    r1, r2 = length(v1), length(v2)  # (2.39)
    from_rest, to_rest = r1 < AT_P0 * scale, r2 < AT_P0 * scale
    toward_end = v2 / jnp.where(to_rest, 1.0, r2)
    x_axis = jnp.zeros_like(v1).at[0].set(1.0)
    q1 = jnp.where(from_rest, jnp.where(odd, -1.0, 1.0) * toward_end, v1 / jnp.where(from_rest, 1.0, r1))
    q1 = jnp.where(from_rest & to_rest, x_axis, q1)
    along = jnp.dot(q1, v2)
    across = v2 - q1 * along  # (2.30)
    distance = length(across)
    in_line = from_rest | to_rest | (distance < AT_P0 * scale)
    q2 = jnp.where(in_line, _least_inclined(normal, q1, x_axis), across / jnp.where(in_line, 1.0, distance))
    # Compute delta instead of psi: its arctangent keeps its digits where psi is close to pi.
    forward = jnp.where(from_rest | to_rest, 1.0, jnp.where(odd, -along, along))
    delta = jnp.arctan2(jnp.where(in_line, 0.0, distance), forward) / math.pi
    return jnp.stack([q1, q2], axis=1), jnp.where(from_rest, 0.0, r1), jnp.where(to_rest, 0.0, r2), delta


def _least_inclined(normal: Array, q1: Array, x_axis: Array) -> Array:
    level = jnp.cross(normal, q1)
    norm = length(level)
    upright = norm < UPRIGHT
    fallback = x_axis - q1 * jnp.dot(q1, x_axis)
    return jnp.where(upright, fallback / jnp.linalg.norm(fallback), level / jnp.where(upright, 1.0, norm))


def swing_formula(segment: Any, arcs: Any, law: LawPiece, tau: Expression, *, variable: bool) -> list[Expression]:
    """Position of a hypocycloid of constant or variable amplitude, (2.31) and (3.44), in the precessing frame."""
    p, sense, precession, start, end = map(
        rational, (arcs, segment.sense, segment.precession, segment.start_radius, segment.end_radius)
    )
    radius, phase, turn = law.at(tau) * (end - start) + start, tau * (sense * p), tau * (sense * precession)
    sine, cosine = function("sin_pi", phase), function("cos_pi", phase)
    lateral, axial = function("sin_pi", turn), function("cos_pi", turn)
    along, across = radius * cosine, radius * sine * (precession / p)
    if variable:
        along = along - law.at(tau, 1) * ((end - start) / (sense * p)) * sine / pi()
    forward, sideways = axial * along + lateral * across, axial * across - lateral * along
    columns = zip(*rationals(segment.plane), strict=True)
    return combined([1, forward, sideways], [rationals(segment.center), *columns])
