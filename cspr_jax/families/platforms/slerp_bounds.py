"""Affine bounds of oscillating SLERP over a block of time, by the formulas of `oscillating_slerp`."""

from __future__ import annotations

import math

import jax.numpy as jnp
from jax import Array

from cspr_jax.families.platforms.oscillating_slerp import Slerp, angle_ratio, sinc
from cspr_jax.numerics.bounds.affine_bounds import AffineBounds, dot, joined, norm_squared, squared
from cspr_jax.numerics.bounds.function_bounds import deviation, sincospi
from cspr_jax.numerics.shapes import Float, Num

# Bound of the rounding error of derivatives by recurrences, over their magnitude (`angle_ratio`) or over 1 (`sinc`).
DERIVATIVE_ERROR = 1e-12
# Largest second derivatives in y = r^2 of cos r, of sin r / r, and of the first two derivatives of sin r / r. The n-th
# derivative of sin r / r is (-1/2)^n j_n(r) / r^n, with the spherical Bessel function j_n; its magnitude is largest at
# 0, where it is (-1/2)^n / (1 3 5 ... (2 n + 1)).
_SECOND_DERIVATIVES = (1.0 / 12.0, 1.0 / 60.0, 1.0 / 840.0, 1.0 / 15120.0)

Bounds3 = tuple[AffineBounds, AffineBounds, AffineBounds]


def rotation_law_bounds(
    start_beta_hat: Float[Array, ""],
    end_beta_hat: Float[Array, ""],
    fraction: Float[Array, ""],
    arcs: Num[Array, ""],
    tau: AffineBounds,
) -> Bounds3:
    """Bounds of the time function of the rotation and its first two derivatives in tau."""
    omega, h_rate = math.pi * arcs, (end_beta_hat - start_beta_hat) * fraction
    more = tau * h_rate + (1.0 + start_beta_hat * fraction)  # 1 + h
    (sine, cosine), (sine3, cosine3) = sincospi(tau * arcs), sincospi(tau * (3.0 * arcs))
    value = cosine + more * (cosine - cosine3) * 0.125
    rate = (cosine - cosine3) * (0.125 * h_rate) + (more * (3.0 * sine3 - sine) * 0.125 - sine) * omega
    second_derivative = (3.0 * sine3 - sine) * (0.25 * h_rate * omega)
    return value, rate, second_derivative + (more * (9.0 * cosine3 - cosine) * 0.125 - cosine) * omega**2


def orientation_bounds(slerp: Slerp, values: tuple[AffineBounds, ...], betas: Bounds3) -> Bounds3:
    """Bounds of the orientation and its first two derivatives in tau."""
    u, u1, u2 = _half_vector(slerp, values)
    beta, beta1, beta2 = betas
    return _exponential(beta * u, beta1 * u + beta * u1, beta2 * u + 2.0 * (beta1 * u1) + beta * u2)


def _half_vector(slerp: Slerp, values: tuple[AffineBounds, ...]) -> Bounds3:
    a, a1, a2 = values[:3]
    sine, cosine = (f.each(lambda x: x[None]) for f in sincospi(a * (slerp.angle / math.pi)))
    rate, second_derivative = a1 * slerp.angle, a2 * slerp.angle
    q = cosine * slerp.start + sine * slerp.across
    along = cosine * slerp.across - sine * slerp.start
    q1, q2 = along * rate, along * second_derivative - q * squared(rate)
    (s, v), (s1, v1), (s2, v2) = ((f.each(lambda x: x[0]), f.each(lambda x: x[1:])) for f in (q, q1, q2))
    w, w1, w2 = _angle_ratio(s)
    second = w2 * squared(s1) + w1 * s2
    return v * w, v1 * w + v * (w1 * s1), v2 * w + 2.0 * (v1 * (w1 * s1)) + v * second


def _angle_ratio(s: AffineBounds) -> Bounds3:
    # Derivatives alternate in sign, and their magnitudes grow as s falls: second derivatives are largest at the lower
    # end.
    low = s.low()
    middle = angle_ratio(s.middle, 1.0 - s.middle**2, orders=4)
    steepest = angle_ratio(low, 1.0 - low**2, orders=5)
    w, w1, w2 = (
        _widened(deviation(s, middle[j], middle[j + 1], (1.0 + DERIVATIVE_ERROR) * steepest[j + 2]), middle[j])
        for j in range(3)
    )
    return w, w1, w2


def _exponential(u: AffineBounds, u1: AffineBounds, u2: AffineBounds) -> Bounds3:
    y, y1, y2 = norm_squared(u), 2.0 * dot(u, u1), 2.0 * (norm_squared(u1) + dot(u, u2))
    cosine, s, s1, s2 = _sinc(y)
    scalars = (cosine, s * y1 * -0.5, (s1 * squared(y1) + s * y2) * -0.5)
    vectors = (u * s, u1 * s + u * (s1 * y1), u2 * s + 2.0 * (u1 * (s1 * y1)) + u * (s2 * squared(y1) + s1 * y2))
    q, q1, q2 = (
        joined([scalar.each(lambda x: x[None]), vector]) for scalar, vector in zip(scalars, vectors, strict=True)
    )
    return q, q1, q2


def _sinc(y: AffineBounds) -> tuple[AffineBounds, ...]:
    # Second derivatives of these functions may change sign.
    cosine, *derivatives = sinc(y.middle)
    firsts = (-0.5 * derivatives[0], *derivatives[1:])
    half = 0.5 * y.half_range() ** 2
    return tuple(
        _widened(
            AffineBounds(value, first * y.linear, jnp.abs(first) * y.radius + second * half),
            1.0 + y.half_range(),
        )
        for value, first, second in zip((cosine, *derivatives[:3]), firsts, _SECOND_DERIVATIVES, strict=True)
    )


def _widened(f: AffineBounds, scale: Array) -> AffineBounds:
    return f._replace(radius=f.radius + DERIVATIVE_ERROR * jnp.abs(scale))
