"""Rotation of an oscillating platform: oscillating SLERP, thesis section 3.7.

The orientation moves back and forth through the reference orientation, between an envelope q_env and its inverse; the
envelope moves slowly from the first orientation to the last, (3.59). With u the rotation vector of half the envelope's
angle, q = exp(beta u): no division by an angle, so small angles are no special case. The angle of the envelope stays
within [0, pi], since the scalar parts of both of its ends are not negative.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.numerics.elementary import length, polynomial, sincospi
from cspr_jax.numerics.linear import rotations
from cspr_jax.numerics.shapes import Bool, Float, Num

# Series replace quotients that lose digits by cancellation: of arccos(s) / sqrt(1 - s^2) if 1 - s is below `_NEAR`, and
# of sin(r) / r if r^2 is below `_SMALL`.
_NEAR, _NEAR_TERMS = 0.1, 16
_LOG = [float(c) for c in np.cumprod([1.0, *((k + 1.0) / (2.0 * k + 3.0) for k in range(_NEAR_TERMS + 3))])]
_SMALL, _SERIES = 0.5, 12
# An envelope with a smaller angle does not turn.
_NO_ANGLE = 1e-12


class Slerp(NamedTuple):
    """Oscillating SLERP from one pose to another, for one parity of the number of arcs.

    Fields:
        start: (4,) q_1, a unit quaternion.
        across: (4,) unit quaternion perpendicular to q_1 towards the end of the envelope; zero if the envelope does not
            turn.
        angle: () Theta_env of (3.60), rad.
        start_beta_hat: () beta-hat of the first pose, (3.81).
        end_beta_hat: () beta-hat of the last pose.
    """

    start: Array
    across: Array
    angle: Array
    start_beta_hat: Array
    end_beta_hat: Array


@jax.jit
def slerp_between(
    start: Float[Array, "4"],
    end: Float[Array, "4"],
    start_beta_hat: Float[Array, ""],
    end_beta_hat: Float[Array, ""],
    *,
    odd: Bool[Array, ""],
) -> Slerp:
    """Parameters of the oscillating SLERP between two orientations."""
    first, last = rotations.upper(start), rotations.upper(end)
    last = jnp.where(odd, rotations.conjugate(last), last)  # (3.58)
    along = jnp.dot(first, last)
    beside = last - first * along
    beside = beside - first * jnp.dot(first, beside)
    norm = length(beside)
    angle = jnp.arctan2(norm, along)
    # Opposite ends are both half a turn from the reference orientation: the envelope passes through it.
    identity = jnp.zeros_like(first).at[0].set(1.0)
    is_opposite = (norm < _NO_ANGLE) & (along < 0.0)
    across = jnp.where(norm < _NO_ANGLE, 0.0, beside / jnp.where(norm < _NO_ANGLE, 1.0, norm))
    across = jnp.where(is_opposite, identity, across)
    return Slerp(first, across, jnp.where((norm < _NO_ANGLE) & ~is_opposite, 0.0, angle), start_beta_hat, end_beta_hat)


def rotation_law(
    start_beta_hat: Float[Array, ""],
    end_beta_hat: Float[Array, ""],
    fraction: Float[Array, ""],
    arcs: Num[Array, ""],
    tau: Float[Array, ""],
) -> tuple[Float[Array, ""], Float[Array, ""], Float[Array, ""]]:
    """beta_ff of (3.93) and its first two derivatives in tau.

    The function is linear in beta-hat, so the mean of two beta_f is the beta_f of the mean beta-hat. It is beta_1 of
    (3.66) if beta-hat is -1 / fraction, and beta_0 of (3.67) if beta-hat is 0.
    """
    omega = math.pi * arcs
    h_rate = (end_beta_hat - start_beta_hat) * fraction
    h = start_beta_hat * fraction + h_rate * tau  # beta'' over (pi p)^2
    sine, cosine = sincospi(arcs * tau)
    sine3, cosine3 = sine * (3.0 - 4.0 * sine**2), cosine * (4.0 * cosine**2 - 3.0)
    value = ((9.0 + h) * cosine - (1.0 + h) * cosine3) / 8.0  # (3.68)
    rate = (h_rate * (cosine - cosine3) + omega * (3.0 * (1.0 + h) * sine3 - (9.0 + h) * sine)) / 8.0
    second_derivative = (
        2.0 * h_rate * omega * (3.0 * sine3 - sine) + omega**2 * (9.0 * (1.0 + h) * cosine3 - (9.0 + h) * cosine)
    ) / 8.0
    return value, rate, second_derivative


@jax.jit
def orientation(
    slerp: Slerp, amplitude_values: tuple[Float[Array, ""], ...], betas: tuple[Float[Array, ""], ...]
) -> tuple[Float[Array, "4"], Float[Array, "4"], Float[Array, "4"]]:
    """The orientation and its first two derivatives in tau, (3.59) to (3.65)."""
    half = _half_vector(slerp, amplitude_values)
    beta, beta1, beta2 = betas
    return _exponential(
        beta * half[0],
        beta1 * half[0] + beta * half[1],
        beta2 * half[0] + 2.0 * beta1 * half[1] + beta * half[2],
    )


def _half_vector(slerp: Slerp, amplitude_values: tuple[Array, ...]) -> tuple[Array, Array, Array]:
    # Return half of the rotation vector of the envelope and its derivatives; all quaternions of the envelope lie in a
    # plane.
    a, a1, a2 = amplitude_values[:3]
    sine, cosine = sincospi(slerp.angle * a / math.pi)
    rate, second_derivative = slerp.angle * a1, slerp.angle * a2
    q = slerp.start * cosine + slerp.across * sine
    along = slerp.across * cosine - slerp.start * sine
    q1, q2 = along * rate, along * second_derivative - q * rate**2
    s, s1, s2, v, v1, v2 = q[0], q1[0], q2[0], q[1:], q1[1:], q2[1:]
    w, w1, w2 = angle_ratio(s, jnp.dot(v, v), orders=3)
    return v * w, v1 * w + v * w1 * s1, v2 * w + 2.0 * v1 * w1 * s1 + v * (w2 * s1**2 + w1 * s2)


def angle_ratio(s: Float[Array, ""], square: Float[Array, ""], *, orders: int) -> tuple[Float[Array, ""], ...]:
    """W = arccos(s) / sqrt(1 - s^2), and its derivatives in s, which alternate in sign."""
    x = 1.0 - s
    is_near = x < _NEAR
    square = jnp.where(is_near, 1.0, square)
    sine = jnp.sqrt(square)
    w = jnp.arctan2(sine, s) / sine
    far = [w, (s * w - 1.0) / square]
    for n in range(1, orders - 1):
        far.append((float(n**2) * far[n - 1] + (2.0 * n + 1.0) * s * far[n]) / square)
    small = jnp.where(is_near, x, 0.0)
    near = [
        (-1.0) ** j * polynomial([math.perm(k, j) * _LOG[k] for k in range(j, _NEAR_TERMS + j)], small)
        for j in range(orders)
    ]
    return tuple(jnp.where(is_near, a, b) for a, b in zip(near, far, strict=True))


def _exponential(u: Array, u1: Array, u2: Array) -> tuple[Array, Array, Array]:
    # Return the quaternion (cos |u|, u sin |u| / |u|) and its derivatives, with y = |u|^2.
    y, y1, y2 = jnp.dot(u, u), 2.0 * jnp.dot(u, u1), 2.0 * (jnp.dot(u1, u1) + jnp.dot(u, u2))
    cosine, s, s1, s2, _ = sinc(y)
    q = jnp.concatenate([cosine[None], u * s])
    q1 = jnp.concatenate([(-0.5 * s * y1)[None], u1 * s + u * s1 * y1])
    scalar = -0.5 * (s1 * y1**2 + s * y2)
    return q, q1, jnp.concatenate([scalar[None], u2 * s + 2.0 * u1 * s1 * y1 + u * (s2 * y1**2 + s1 * y2)])


def sinc(
    y: Float[Array, ""],
) -> tuple[Float[Array, ""], Float[Array, ""], Float[Array, ""], Float[Array, ""], Float[Array, ""]]:
    """Cosine of r, sin r / r, and the first three derivatives of sin r / r in y = r^2."""
    is_small = y < _SMALL
    large = jnp.where(is_small, 1.0, y)
    r = jnp.sqrt(large)
    cosine, s = jnp.cos(r), jnp.sin(r) / r
    s1 = 0.5 * (cosine - s) / large
    s2 = -(0.5 * s + 3.0 * s1) / (2.0 * large)
    s3 = -(s1 + 10.0 * s2) / (4.0 * large)
    terms = [(-1.0) ** k / math.factorial(2 * k + 1) for k in range(_SERIES + 3)]
    small = jnp.where(is_small, y, 0.0)
    series = [polynomial([math.perm(k, j) * terms[k] for k in range(j, _SERIES + j)], small) for j in range(4)]
    near = polynomial([(-1.0) ** k / math.factorial(2 * k) for k in range(_SERIES)], small)
    pairs = zip((near, *series), (cosine, s, s1, s2, s3), strict=True)
    cosine, s, s1, s2, s3 = (jnp.where(is_small, a, b) for a, b in pairs)
    return cosine, s, s1, s2, s3


def rates(
    quaternions: tuple[Float[Array, "4"], Float[Array, "4"], Float[Array, "4"]],
) -> tuple[Float[Array, "3"], Float[Array, "3"]]:
    """Angular velocity and acceleration in fixed axes, from a quaternion and its derivatives, (3.32) and (3.33)."""
    back = rotations.conjugate(quaternions[0])
    return 2.0 * rotations.product(quaternions[1], back)[1:], 2.0 * rotations.product(quaternions[2], back)[1:]
