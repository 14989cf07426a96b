"""Orientations of platforms on ellipses: a turn between mean orientations, and an oscillation about one axis.

    R = Q(axis, psi) S(s turn) R0,    psi = p cos(theta) + q sin(theta),

with the law s of the transfer and the angle theta of the ellipse; p and q go from those of the first ellipse to those
of the last along s, as the half-axes do.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.motion.formulas import Expression, constant, function, product, rational, rationals
from cspr_jax.numerics.bounds.affine_bounds import AffineBounds, cross, dot, rotated
from cspr_jax.numerics.bounds.function_bounds import sincospi
from cspr_jax.numerics.bounds.rotation_bounds import RotationBounds
from cspr_jax.numerics.elementary import as_float64, length
from cspr_jax.numerics.linear import rotations
from cspr_jax.numerics.shapes import Float


class Rotation(NamedTuple):
    """Rotation of a platform along a motion.

    Fields:
        start: (4,) first mean orientation, a unit quaternion, scalar first.
        turn: (3,) rotation vector from the first mean orientation to the last one, fixed axes, rad.
        axis: (3,) unit vector of the axis of oscillation, fixed axes.
        first: (2,) p and q on the first ellipse, rad.
        last: (2,) p and q on the last ellipse, rad.
    """

    start: Any
    turn: Any
    axis: Any
    first: Any
    last: Any


def turn_between(start: Float[np.ndarray, "4"], end: Float[np.ndarray, "4"]) -> Float[Array, "3"]:
    """Rotation vector of the shortest rotation from one orientation to another."""
    quaternion = rotations.products(end[None], start[None] * np.array([1.0, -1.0, -1.0, -1.0]))[0]
    quaternion = quaternion * (1.0 if quaternion[0] >= 0.0 else -1.0)
    sine = float(np.linalg.norm(quaternion[1:]))
    angle = 2.0 * math.atan2(sine, quaternion[0])
    return as_float64(quaternion[1:] * (angle / sine if sine > 0.0 else 2.0))


def _quaternion(axis: Array, angle: Array) -> Array:
    return jnp.concatenate([jnp.cos(0.5 * angle)[None], jnp.sin(0.5 * angle) * axis])


def _direction(vector: Array) -> tuple[Array, Array]:
    # Return a vector's direction and length; the direction is (1, 0, 0) if the length is zero.
    norm = length(vector)
    return jnp.where(norm > 0.0, vector / jnp.where(norm > 0.0, norm, 1.0), jnp.eye(3)[0]), norm


def rotation_state(
    rotation: Rotation, s: tuple, psi: tuple
) -> tuple[Float[Array, "3 3"], Float[Array, "3"], Float[Array, "3"], Float[Array, "4"]]:
    """Rotation at one time."""
    direction, angle = _direction(rotation.turn)
    swing = _quaternion(rotation.axis, psi[0])
    quaternion = rotations.product(swing, rotations.product(_quaternion(direction, s[0] * angle), rotation.start))
    outer = rotations.matrix(swing)
    turning, second_derivative = outer @ (s[1] * rotation.turn), outer @ (s[2] * rotation.turn)
    oscillating = psi[1] * rotation.axis
    rate = psi[2] * rotation.axis + second_derivative + jnp.cross(oscillating, turning)
    return rotations.matrix(quaternion), oscillating + turning, rate, quaternion


def rotation_formula(rotation: Rotation, s: Expression, cosine: Expression, sine: Expression) -> list[Expression]:
    """Quaternion of the rotation; see `rotation_state`."""
    direction, angle = _direction(jnp.asarray(rotation.turn))
    (p0, q0), (p1, q1) = rationals(rotation.first), rationals(rotation.last)
    psi = (s * (p1 - p0) + p0) * cosine + (s * (q1 - q0) + q0) * sine

    def about(axis: Any, half: Expression) -> list[Expression]:
        return [function("cos", half), *(function("sin", half) * x for x in rationals(axis))]

    swing, turn = about(rotation.axis, psi * Fraction(1, 2)), about(direction, s * (rational(angle) / 2))
    return product(swing, product(turn, [constant(x) for x in rationals(rotation.start)]))


def rotation_bounds(rotation: Rotation, s: tuple, psi: tuple) -> RotationBounds:
    """Bounds of the rotation over a block; see `rotation_state`."""
    direction, angle = _direction(rotation.turn)
    outer = _about(rotation.axis, psi[0])
    inner = dot(_expanded(_about(direction, s[0] * angle)), rotations.matrix(rotation.start).T[None])
    full = dot(_expanded(outer), inner.each(lambda x: x.T[None]))
    turning, second_derivative = rotated(outer, s[1] * rotation.turn), rotated(outer, s[2] * rotation.turn)
    oscillating = psi[1] * rotation.axis
    return RotationBounds(
        full, oscillating + turning, psi[2] * rotation.axis + second_derivative + cross(oscillating, turning)
    )


def _expanded(matrix: AffineBounds) -> AffineBounds:
    return matrix.each(lambda x: x[:, None])


def _about(axis: Array, angle: AffineBounds) -> AffineBounds:
    # Bounds (3, 3) of rotations about one axis, I + sin K + (1 - cos) K^2.
    x, y, z = axis
    zero = jnp.zeros_like(x)
    skew: Any = jnp.stack([jnp.stack([zero, -z, y]), jnp.stack([z, zero, -x]), jnp.stack([-y, x, zero])])
    sine, cosine = (f.each(lambda array: array[:, None]) for f in sincospi(angle * (1.0 / math.pi)))
    square = jnp.outer(axis, axis) - jnp.eye(3)
    return sine * skew + (1.0 - cosine) * square + jnp.eye(3)
