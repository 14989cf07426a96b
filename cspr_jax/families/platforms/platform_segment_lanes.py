"""States of many platforms, one lane a segment: the fast form of `platform_segment.motion`.

The mechanics are the same (tests compare both forms), written with numbers instead of small vectors. A transition from
rest needs neither an ellipse nor a quaternion: it is a straight swing and a rotation about one axis.
"""

from __future__ import annotations

import math
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.families.platforms.platform_segment import PlatformSegment
from cspr_jax.motion.amplitudes import Amplitude, derivatives
from cspr_jax.motion.platform_kind import PlatformMotionKind
from cspr_jax.numerics.elementary import polynomial, sincospi
from cspr_jax.numerics.linear.lanes import (
    Matrix,
    Vector,
    about_axis,
    combined,
    cross,
    dot,
    materialized,
    rotation_matrix,
)
from cspr_jax.numerics.shapes import Float, Num

# Degree of Chebyshev fits, for s in [0, 1], of W = arccos(s) / sqrt(1 - s^2) and of each of its derivatives; they are
# accurate to 2e-15. The derivative of the fit of W instead would be wrong by 3e-10.
_DEGREE = 22


class PhaseLanes(NamedTuple):
    """Normalised time, and what depends only on it and on the number of arcs: () or (n,) each.

    Fields:
        tau: normalised time.
        a: value A of the amplitude function.
        a1: A'.
        a2: A''.
        a3: A'''.
        sine: sine of the angle sense pi p tau.
        cosine: cosine of the same angle.
    """

    tau: Array
    a: Array
    a1: Array
    a2: Array
    a3: Array
    sine: Array
    cosine: Array


class StateLanes(NamedTuple):
    """States of n segments at one time: tuples of (n,) arrays; derivatives in normalised time.

    Fields:
        position: position of the mass centre, m.
        velocity: p', m.
        acceleration: p'', m.
        rotation: rows of the rotation matrix.
        omega: angular velocity, rad.
        angular_acceleration: rad.
    """

    position: Vector
    velocity: Vector
    acceleration: Vector
    rotation: Matrix
    omega: Vector
    angular_acceleration: Vector


@jax.jit
def phase_lanes(
    amplitude: Amplitude, sense: Float[Array, "..."], arcs: Num[Array, "..."], tau: Float[Array, "..."]
) -> PhaseLanes:
    """Phase of segments with the same number of arcs."""
    a, a1, a2, a3 = derivatives(amplitude, tau, order=3)
    return PhaseLanes(tau, a, a1, a2, a3, *sincospi(sense * arcs * tau))


def squared_duration(segment: PlatformSegment, arcs: Array) -> Float[Array, "n"]:
    """T^2, (3.77)."""
    nu = segment.precession / arcs
    return (math.pi * arcs) ** 2 * (1.0 - nu) * (1.0 + nu) / segment.rate


@partial(jax.jit, static_argnames="kind")
def state(
    segment: PlatformSegment,
    arcs: Array,
    phase: PhaseLanes,
    kind: PlatformMotionKind,
    one: Float[Array, ""] | None = None,
) -> StateLanes:
    """The state of the platform."""
    if kind.from_rest:
        translation = _straight(segment, arcs, phase, variable=kind.variable)
        rotation = _about_one_axis(segment, phase, _rotation_law(segment, arcs, phase, kind), one)
    else:
        translation = _ellipse(segment, arcs, phase, variable=kind.variable)
        rotation = _exponential(*_half_vector(segment, phase, _rotation_law(segment, arcs, phase, kind)))
    center = tuple(segment.center[:, i] for i in range(3))
    position = tuple(h + c for h, c in zip(center, translation[0], strict=True))
    return StateLanes(position, translation[1], translation[2], *rotation)


def _straight(segment: PlatformSegment, arcs: Array, phase: PhaseLanes, *, variable: bool) -> tuple[Vector, ...]:
    omega, radius = segment.sense * math.pi * arcs, segment.end_radius
    if variable:
        inner = phase.a * omega * omega + phase.a2
        position = phase.a * phase.cosine - phase.a1 * phase.sine / omega
        velocity = -inner * phase.sine / omega
        acceleration = -(inner * phase.cosine + (phase.a1 * omega + phase.a3 / omega) * phase.sine)
    else:
        position = phase.a * phase.cosine
        velocity = phase.a1 * phase.cosine - phase.a * omega * phase.sine
        acceleration = (phase.a2 - phase.a * omega * omega) * phase.cosine - 2.0 * phase.a1 * omega * phase.sine
    return tuple(
        tuple(segment.plane[:, i, 0] * (radius * x) for i in range(3)) for x in (position, velocity, acceleration)
    )


def _ellipse(segment: PlatformSegment, arcs: Array, phase: PhaseLanes, *, variable: bool) -> tuple[Vector, ...]:
    # Compute the same as `platform_segment._swing`.
    omega, nu = segment.sense * math.pi * arcs, segment.precession / arcs
    span = segment.end_radius - segment.start_radius
    r, r1, r2, r3 = segment.start_radius + span * phase.a, span * phase.a1, span * phase.a2, span * phase.a3
    steady = omega * omega * (1.0 - nu) * (1.0 + nu)
    lateral, axial = sincospi(segment.sense * segment.precession * phase.tau)
    sine, cosine = phase.sine, phase.cosine
    if variable:
        w = (-(r * steady + r2) / omega, 2.0 * nu * r1)
        w1 = (2.0 * nu * nu * r1 * omega - (r1 * steady + r3) / omega, nu * (r * steady + 3.0 * r2))
        position = (r * cosine - r1 * sine / omega, nu * r * sine)
        velocity = (sine * w[0], sine * w[1])
        acceleration = (omega * cosine * w[0] + sine * w1[0], omega * cosine * w[1] + sine * w1[1])
    else:
        position = (r * cosine, nu * r * sine)
        velocity = (r1 * cosine - r * steady / omega * sine, nu * r1 * sine)
        acceleration = (
            (r2 - r * steady) * cosine - 2.0 * r1 * steady / omega * sine,
            nu * (r2 + r * steady) * sine,
        )
    vectors = []
    for x, y in (position, velocity, acceleration):
        along, across = axial * x + lateral * y, axial * y - lateral * x
        vectors.append(tuple(segment.plane[:, i, 0] * along + segment.plane[:, i, 1] * across for i in range(3)))
    return tuple(vectors)


def _rotation_law(
    segment: PlatformSegment, arcs: Array, phase: PhaseLanes, kind: PlatformMotionKind
) -> tuple[Array, Array, Array]:
    # Compute the same as `oscillating_slerp.rotation_law`, at this phase.
    slerp, omega, nu = segment.slerp, math.pi * arcs, segment.precession / arcs
    fraction = (1.0 - nu) * (1.0 + nu)
    sine, cosine = segment.sense * phase.sine, phase.cosine
    if kind.plain:  # beta_1
        return cosine, -omega * sine, -omega * omega * cosine
    sine3, cosine3 = sine * (3.0 - 4.0 * sine * sine), cosine * (4.0 * cosine * cosine - 3.0)
    h_rate = (slerp.end_beta_hat - slerp.start_beta_hat) * fraction
    h = slerp.start_beta_hat * fraction + h_rate * phase.tau
    value = ((9.0 + h) * cosine - (1.0 + h) * cosine3) * 0.125
    rate = (h_rate * (cosine - cosine3) + omega * (3.0 * (1.0 + h) * sine3 - (9.0 + h) * sine)) * 0.125
    second_derivative = 2.0 * h_rate * omega * (3.0 * sine3 - sine) + omega * omega * (
        9.0 * (1.0 + h) * cosine3 - (9.0 + h) * cosine
    )
    return value, rate, second_derivative * 0.125


def _about_one_axis(
    segment: PlatformSegment, phase: PhaseLanes, betas: tuple[Array, ...], one: Array | None
) -> tuple[Matrix, Vector, Vector]:
    # From the reference orientation the envelope turns about one axis: the angle is 2 beta Theta_env A.
    axis = tuple(segment.slerp.across[:, i] for i in range(1, 4))
    beta, beta1, beta2 = betas
    full = 2.0 * segment.slerp.angle
    sine, cosine = materialized(sincospi(full * beta * phase.a / math.pi), one)
    rate = full * (beta1 * phase.a + beta * phase.a1)
    second_derivative = full * (beta2 * phase.a + 2.0 * beta1 * phase.a1 + beta * phase.a2)
    return about_axis(axis, sine, cosine), tuple(rate * e for e in axis), tuple(second_derivative * e for e in axis)


def _angle_ratio_coefficients() -> list[list[float]]:
    # Fit polynomials in x = 1 - s to the exact series of W and of its derivatives in x.
    terms = np.cumprod([1.0, *((k + 1.0) / (2.0 * k + 3.0) for k in range(120))])
    nodes = np.polynomial.chebyshev.chebpts1(64) * 0.5 + 0.5
    coefficients = []
    for order in range(3):
        values = np.polynomial.Polynomial(terms).deriv(order)(nodes)
        fit = np.polynomial.Chebyshev.fit(nodes, values, _DEGREE, domain=[0, 1])
        coefficients.append([float(c) for c in fit.convert(kind=np.polynomial.Polynomial).coef])
    return coefficients


_RATIO = _angle_ratio_coefficients()


def _half_vector(
    segment: PlatformSegment, phase: PhaseLanes, betas: tuple[Array, ...]
) -> tuple[Vector, Vector, Vector]:
    # Return half of the rotation vector and its derivatives, as in `oscillating_slerp`.
    slerp, (beta, beta1, beta2) = segment.slerp, betas
    sine, cosine = sincospi(slerp.angle * phase.a / math.pi)
    rate, second_derivative = slerp.angle * phase.a1, slerp.angle * phase.a2
    q = [slerp.start[:, i] * cosine + slerp.across[:, i] * sine for i in range(4)]
    along = [slerp.across[:, i] * cosine - slerp.start[:, i] * sine for i in range(4)]
    q1 = [x * rate for x in along]
    q2 = [x * second_derivative - y * rate * rate for x, y in zip(along, q, strict=True)]
    x = 1.0 - q[0]
    w, w1, w2 = (polynomial(each, x) for each in _RATIO)
    w1 = -w1
    u = combined([(w, q[1:])])
    u1 = combined([(w, q1[1:]), (w1 * q1[0], q[1:])])
    u2 = combined([(w, q2[1:]), (2.0 * w1 * q1[0], q1[1:]), (w2 * q1[0] * q1[0] + w1 * q2[0], q[1:])])
    v1 = combined([(beta1, u), (beta, u1)])
    return combined([(beta, u)]), v1, combined([(beta2, u), (2.0 * beta1, u1), (beta, u2)])


def _exponential(v: Vector, v1: Vector, v2: Vector) -> tuple[Matrix, Vector, Vector]:
    # Return the rotation matrix, angular velocity and angular acceleration from half of the rotation vector.
    y, y1, y2 = dot(v, v), 2.0 * dot(v, v1), 2.0 * (dot(v1, v1) + dot(v, v2))
    root = jnp.sqrt(jnp.maximum(y, 1e-24))
    sine, cosine = sincospi(root / math.pi)
    is_small = y < 0.05
    large = jnp.where(is_small, 1.0, y)
    s = sine / root
    s1 = 0.5 * (cosine - s) / large
    s2 = -(0.5 * s + 3.0 * s1) / (2.0 * large)
    terms = [(-1.0) ** k / math.factorial(2 * k + 1) for k in range(9)]
    near1, near2 = (polynomial([math.perm(k, j) * terms[k] for k in range(j, 8)], y) for j in (1, 2))
    s1, s2 = jnp.where(is_small, near1, s1), jnp.where(is_small, near2, s2)
    q, q1 = (cosine, *combined([(s, v)])), (-0.5 * s * y1, *combined([(s, v1), (s1 * y1, v)]))
    q2 = (-0.5 * (s1 * y1 * y1 + s * y2), *combined([(s, v2), (2.0 * s1 * y1, v1), (s2 * y1 * y1 + s1 * y2, v)]))

    def vector_part(left):  # twice the vector part of left times the conjugate of q
        across = cross(left[1:], q[1:])
        return tuple(2.0 * (q[0] * left[i + 1] - left[0] * q[i + 1] - across[i]) for i in range(3))

    return rotation_matrix(q), vector_part(q1), vector_part(q2)
