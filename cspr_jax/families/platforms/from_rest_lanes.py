"""Transitions of a platform from rest, one lane a segment, with the fewest operations for a state.

Such a motion is a straight swing and a rotation about one axis. A table holds all that depends on the number of arcs
and on time: position and acceleration are numbers times a vector of the segment; angle, angular speed and angular
acceleration are linear in the two values of beta-hat. The mechanics are those of `platform_segment_lanes` (tests
compare both).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import jax.numpy as jnp
from jax import Array

from cspr_jax.families.platforms.platform_segment import PlatformSegment
from cspr_jax.motion.amplitudes import Amplitude, derivatives
from cspr_jax.motion.platform_kind import PlatformMotionKind
from cspr_jax.numerics.elementary import sincospi
from cspr_jax.numerics.linear.lanes import Matrix, Vector, about_axis
from cspr_jax.numerics.shapes import Float, Num


class Swings(NamedTuple):
    """Segments from rest.

    Fields:
        center: the point p0, m.
        end_offset: vector in the direction of the first arc, as long as the distance of the end from p0, m.
        axis: unit vector of the rotation.
        angle: (n,) full angle of the envelope, in half turns.
        start_beta_hat: (n,) beta-hat in p0.
        end_beta_hat: (n,) beta-hat at the end.
        rate: (n,) lambda of (3.50), 1/s^2.
    """

    center: Vector
    end_offset: Vector
    axis: Vector
    angle: Array
    start_beta_hat: Array
    end_beta_hat: Array
    rate: Array


class Swing(NamedTuple):
    """State of swings at one time.

    Fields:
        position: m.
        acceleration: m/s^2.
        rotation: rows of the rotation matrix.
        squared_speed: (n,) square of the angular speed, rad^2/s^2.
        angular_acceleration: (n,) angular acceleration about the axis, rad/s^2.
    """

    position: Vector
    acceleration: Vector
    rotation: Matrix
    squared_speed: Array
    angular_acceleration: Array


def swings(segments: PlatformSegment) -> Swings:
    """Swings of segments from rest."""
    slerp = segments.slerp
    return Swings(
        tuple(segments.center[:, i] for i in range(3)),
        tuple(segments.plane[:, i, 0] * segments.end_radius for i in range(3)),
        tuple(slerp.across[:, i] for i in range(1, 4)),
        slerp.angle * (2.0 / math.pi),
        slerp.start_beta_hat,
        slerp.end_beta_hat,
        segments.rate,
    )


def rest_table(
    amplitude: Amplitude, arcs: Num[Array, ""], tau: Float[Array, "m"], kind: PlatformMotionKind
) -> Float[Array, "m 11"]:
    """Table that all segments from rest with the same number of arcs have in common."""
    theta = math.pi * arcs
    a, a1, a2, a3 = (x / theta**k for k, x in enumerate(derivatives(amplitude, tau, order=3)))
    sine, cosine = sincospi(arcs * tau)
    if kind.variable:  # (3.44)
        position = a * cosine - a1 * sine
        second_derivative = -((a + a2) * cosine + (a1 + a3) * sine)
    else:
        position = a * cosine
        second_derivative = (a2 - a) * cosine - 2.0 * a1 * sine
    rotation_law = _plain(sine, cosine) if kind.plain else _with_beta_hats(sine, cosine, tau, theta)
    angles = []
    for b, b1, b2 in rotation_law:
        angles.append((a * b, math.pi * (a1 * b + a * b1), math.pi * (a2 * b + 2.0 * a1 * b1 + a * b2)))
    return jnp.stack([position, second_derivative, *(angle[k] for k in range(3) for angle in angles)], axis=1)


def _plain(sine: Array, cosine: Array) -> list[tuple[Array, ...]]:
    # Return beta_1 of (3.66) and its derivatives, and zeros as factors of beta-hat.
    nothing = jnp.zeros_like(sine)
    return [(cosine, -sine, -cosine), (nothing,) * 3, (nothing,) * 3]


def _with_beta_hats(sine: Array, cosine: Array, tau: Array, theta: Array) -> list[tuple[Array, ...]]:
    # Return beta_ff of (3.93), (9 c - c3) / 8 + h (c - c3) / 8, where h goes from one beta-hat to the other.
    sine3, cosine3 = sine * (3.0 - 4.0 * sine * sine), cosine * (4.0 * cosine * cosine - 3.0)
    steady = ((9.0 * cosine - cosine3) / 8.0, (3.0 * sine3 - 9.0 * sine) / 8.0, 9.0 * (cosine3 - cosine) / 8.0)
    c, c1, c2 = (cosine - cosine3) / 8.0, (3.0 * sine3 - sine) / 8.0, (9.0 * cosine3 - cosine) / 8.0
    parts = [
        (h * c, h * c1 + h_rate * c, h * c2 + 2.0 * h_rate * c1)
        for h, h_rate in ((1.0 - tau, -1.0 / theta), (tau, 1.0 / theta))
    ]
    return [steady, *parts]


def swing(motions: Swings, row: Float[Array, "11"]) -> Swing:
    """The state of swings at one time, given by a row of the table."""

    def blended(k):
        return row[k] + motions.start_beta_hat * row[k + 1] + motions.end_beta_hat * row[k + 2]

    speed, angular_acceleration = motions.angle * blended(5), motions.angle * blended(8)
    sine, cosine = sincospi(motions.angle * blended(2))
    acceleration = motions.rate * row[1]
    return Swing(
        tuple(h + row[0] * r for h, r in zip(motions.center, motions.end_offset, strict=True)),
        tuple(acceleration * r for r in motions.end_offset),
        about_axis(motions.axis, sine, cosine),
        motions.rate * speed * speed,
        motions.rate * angular_acceleration,
    )
