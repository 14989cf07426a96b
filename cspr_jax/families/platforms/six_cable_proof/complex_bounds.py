"""Bounds of a platform's motion on an ellipse of complex time, one lane a block.

A motion is analytic between the knots of its amplitude function. Around the middle m of a block, on the ellipse with
semi-axes a (along time) and b, every quantity of the motion is bounded in the Hermitian norm: polynomials by their
terms, sines and cosines by their values in the middle, and rotations by the imaginary part of half their rotation
vector v = beta u. For a complex v

    |exp(2 [v])| <= exp(2 |Im v|) = G,    omega = 2 beta' u + 2 beta (integral over s from 0 to 1 of exp(2 s [v]) u')

since a rotation does not change its own axis. With b = 0 these are bounds on an interval of real time: docs/theory.md.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import jax.numpy as jnp
from jax import Array

from cspr_jax.families.platforms.platform_segment import PlatformSegment
from cspr_jax.families.platforms.platform_segment_lanes import PhaseLanes
from cspr_jax.motion.amplitudes import Amplitude, derivatives
from cspr_jax.motion.platform_kind import PlatformMotionKind
from cspr_jax.numerics.elementary import polynomial, sincospi
from cspr_jax.numerics.shapes import Float, Num

FARTHEST = 1.9  # largest 1 - s for which arccos(s) / sqrt(1 - s^2) is bounded; 2 is singular
NEAREST = 0.1  # smaller values of 1 - s are replaced by this


class Middle(NamedTuple):
    """The middle of a block, and the amplitude function around it.

    Fields:
        tau: (n,) normalised time.
        terms: Taylor coefficients of A in the middle, of the polynomial piece there; (n,) each.
    """

    tau: Array
    terms: Sequence[Array]


class EllipseBounds(NamedTuple):
    """Bounds on an ellipse, (n,) each; derivatives in normalised time.

    Fields:
        speed: bound of |p'|, m.
        second_derivative: bound of |p''|, m.
        rotation_norm: bound of the norm of the rotation matrix.
        rotation_rate: bound of the norm of the derivative of the rotation matrix.
        omega: bound of |omega|, rad.
        angular_acceleration: bound of |omega'|, rad.
    """

    speed: Array
    second_derivative: Array
    rotation_norm: Array
    rotation_rate: Array
    omega: Array
    angular_acceleration: Array


def middle_of(amplitude: Amplitude, tau: Float[Array, "n"]) -> Middle:
    """The middle of a block."""
    values = derivatives(amplitude, tau, order=amplitude.coefficients.shape[1] - 1)
    return Middle(tau, [value / math.factorial(j) for j, value in enumerate(values)])


def phase_beside(middle: Middle, sense: Float[Array, "n"], arcs: Num[Array, "n"], off: Float[Array, "n"]) -> PhaseLanes:
    """Phase at a time beside the middle of a block, by the polynomial piece of the middle."""
    tau, terms = middle.tau + off, middle.terms
    a, a1, a2, a3 = (polynomial([math.perm(i, j) * terms[i] for i in range(j, len(terms))], off) for j in range(4))
    return PhaseLanes(tau, a, a1, a2, a3, *sincospi(sense * arcs * tau))


def ellipse_bounds(
    segment: PlatformSegment,
    arcs: Num[Array, "n"],
    middle: Middle,
    axes: tuple[Float[Array, "n"], Float[Array, "n"]],
    kind: PlatformMotionKind,
) -> EllipseBounds:
    """Bounds of motions around the middles of blocks."""
    along, aside = axes
    bounds = _polynomial_bounds(middle.terms, along)
    phase = math.pi * arcs * along, jnp.exp(math.pi * arcs * aside)
    sine, cosine = sincospi(arcs * middle.tau)
    first = _trigonometric((jnp.abs(sine), jnp.abs(cosine)), *phase)
    speed, second_derivative = _swing(segment, arcs, middle, (along, aside), bounds, first, kind)
    if kind.plain:
        omega = math.pi * arcs
        betas = _RotationLaw(first.cosine, omega * first.sine, omega * omega * first.cosine, first.aside)
    else:
        sine3, cosine3 = sine * (3.0 - 4.0 * sine * sine), cosine * (4.0 * cosine * cosine - 3.0)
        third = _trigonometric((jnp.abs(sine3), jnp.abs(cosine3)), 3.0 * phase[0], phase[1] * phase[1] * phase[1])
        betas = _rotation_law(segment, arcs, middle, (along, aside), first, third)
    angle = jnp.abs(segment.slerp.angle)
    if kind.from_rest:
        u, u1, u2 = (angle * bound for bound in bounds[:3])
    else:
        u, u1, u2 = _half_vector(segment, middle, (along, aside), bounds, angle)
    beta, beta1, beta2, beta_aside = betas
    v1 = beta1 * u + beta * u1
    grown = jnp.exp(2.0 * jnp.minimum(beta_aside * u + beta * aside * u1, beta * u))
    beside = 1.0 if kind.from_rest else grown  # from rest, the rotation is about one axis
    omega = beta1 * u + beside * beta * u1
    angular_acceleration = beta2 * u + beta1 * u1 + beside * (beta1 * u1 + beta * u2)
    if not kind.from_rest:
        angular_acceleration = angular_acceleration + grown * beta * u1 * v1
    return EllipseBounds(speed, second_derivative, grown, 2.0 * grown * v1, 2.0 * omega, 2.0 * angular_acceleration)


def _polynomial_bounds(terms: Sequence[Array], along: Array) -> tuple[Array, ...]:
    # Return bounds of |A|, |A'|, |A''| and |A'''|.
    values = [jnp.abs(term) for term in terms]
    return tuple(polynomial([math.perm(i, j) * values[i] for i in range(j, len(values))], along) for j in range(4))


class _Trigonometric(NamedTuple):
    # Bounds of |sin|, |cos|, and the imaginary part of the cosine.
    sine: Array
    cosine: Array
    aside: Array


class _RotationLaw(NamedTuple):
    # Bounds of |beta|, |beta'|, |beta''|, and the imaginary part of beta.
    value: Array
    rate: Array
    second_derivative: Array
    aside: Array


def _trigonometric(middle: tuple[Array, Array], along: Array, expansion: Array) -> _Trigonometric:
    # Bound sines and cosines within `along` of an angle whose |sin| and |cos| are `middle`; `expansion` is the
    # exponential of the largest imaginary part.
    shrunk = 1.0 / expansion
    cosh, sinh = 0.5 * (expansion + shrunk), 0.5 * (expansion - shrunk)
    near = jnp.minimum(along, 1.0)
    off = jnp.sqrt(near * near + sinh * sinh)
    sine, cosine = middle
    return _Trigonometric(
        jnp.minimum(cosh, sine * cosh + cosine * off),
        jnp.minimum(cosh, cosine * cosh + sine * off),
        jnp.minimum(1.0, sine + cosine * near) * sinh,
    )


def _swing(
    segment: PlatformSegment, arcs: Array, middle: Middle, axes, bounds, first, kind: PlatformMotionKind
) -> tuple[Array, Array]:
    # Bound |p'| and |p''| by the terms of `platform_segment_lanes`, and by the norm of the frame that precesses with
    # the ellipse.
    omega = math.pi * arcs
    sine, cosine, _ = first
    if kind.from_rest:
        r, r1, r2, r3 = (jnp.abs(segment.end_radius) * bound for bound in bounds)
        nu, steady, frame = 0.0 * r, omega * omega, jnp.ones_like(r)
    else:
        span = segment.end_radius - segment.start_radius
        r1, r2, r3 = (jnp.abs(span) * bound for bound in bounds[1:])
        r = jnp.abs(segment.start_radius + span * middle.terms[0]) + axes[0] * r1
        nu = segment.precession / arcs
        steady = omega * omega * (1.0 - nu) * (1.0 + nu)
        frame = jnp.exp(math.pi * segment.precession * axes[1])
    if kind.variable:
        w, across = (r * steady + r2) / omega, 2.0 * nu * r1
        w1 = 2.0 * nu * nu * r1 * omega + (r1 * steady + r3) / omega
        across1 = nu * (r * steady + 3.0 * r2)
        speed = sine * _hypotenuse(w, across)
        second_derivative = _hypotenuse(omega * cosine * w + sine * w1, omega * cosine * across + sine * across1)
    else:
        inner = r2 + r * steady
        speed = _hypotenuse(r1 * cosine + r * steady / omega * sine, nu * r1 * sine)
        second_derivative = _hypotenuse(inner * cosine + 2.0 * r1 * steady / omega * sine, nu * inner * sine)
    return frame * speed, frame * second_derivative


def _hypotenuse(a: Array, b: Array) -> Array:
    return jnp.sqrt(a * a + b * b)


def _rotation_law(segment: PlatformSegment, arcs: Array, middle: Middle, axes, first, third) -> _RotationLaw:
    # Bound beta_ff of (3.93) by its terms.
    slerp, omega, nu = segment.slerp, math.pi * arcs, segment.precession / arcs
    fraction = (1.0 - nu) * (1.0 + nu)
    h_rate = (slerp.end_beta_hat - slerp.start_beta_hat) * fraction
    h, steep = slerp.start_beta_hat * fraction + h_rate * middle.tau, jnp.abs(h_rate)
    nine, one = jnp.abs(9.0 + h) + steep * axes[0], jnp.abs(1.0 + h) + steep * axes[0]
    value = nine * first.cosine + one * third.cosine
    rate = steep * (first.cosine + third.cosine) + omega * (3.0 * one * third.sine + nine * first.sine)
    second_derivative = 2.0 * steep * omega * (3.0 * third.sine + first.sine)
    second_derivative = second_derivative + omega * omega * (9.0 * one * third.cosine + nine * first.cosine)
    aside = nine * first.aside + one * third.aside + steep * axes[1] * (first.cosine + third.cosine)
    return _RotationLaw(value * 0.125, rate * 0.125, second_derivative * 0.125, aside * 0.125)


def _half_vector(segment: PlatformSegment, middle: Middle, axes, bounds, angle: Array) -> tuple[Array, ...]:
    # Bound |u|, |u'| and |u''|: u = W(s) times the vector part of the envelope at the angle phi = Theta A.
    slerp = segment.slerp
    rate, second_derivative = angle * bounds[1], angle * bounds[2]
    grown = jnp.exp(axes[1] * rate)
    shrunk = 1.0 / grown
    cosh = 0.5 * (grown + shrunk)
    norm = jnp.sqrt(0.5 * (grown * grown + shrunk * shrunk))
    sine, cosine = sincospi(slerp.angle * middle.terms[0] / math.pi)
    largest = _hypotenuse(slerp.start[:, 0], slerp.across[:, 0]) * cosh
    off = jnp.abs(1.0 - slerp.start[:, 0] * cosine - slerp.across[:, 0] * sine) + axes[0] * rate * largest
    w, w1, w2 = _angle_ratio(jnp.maximum(off, NEAREST))
    s, s1 = jnp.minimum(1.0 + off, largest), largest
    by_angle = norm * (w + w1 * s1)
    by_square = norm * (w + 2.0 * w1 * s1 + w2 * s1 * s1 + w1 * s)
    return norm * w, by_angle * rate, by_square * rate * rate + by_angle * second_derivative


def _angle_ratio(off: Array) -> tuple[Array, ...]:
    # Bound W = arccos(s) / sqrt(1 - s^2) and its derivatives where |1 - s| <= off: their series in 1 - s have only
    # positive terms, so they are largest on the real axis.
    is_inside = off < FARTHEST
    s = 1.0 - jnp.where(is_inside, off, 1.0)
    square = 1.0 - s * s
    sine = jnp.sqrt(square)
    w = jnp.arctan2(sine, s) / sine
    w1 = (1.0 - s * w) / square
    w2 = (w - 3.0 * s * w1) / square
    return tuple(jnp.where(is_inside, x, jnp.inf) for x in (w, w1, w2))
