"""Stops that swing: about P0 at its natural frequency, with an amplitude that dies.

x(t) = P0 + A(t) (h cos wt + b sin wt) + c(t), with P0 = (0, 0, z0), w^2 = g / z0, h = x(0) - P0 and b = x'(0) / w. At
this frequency any amplitude in a level plane keeps cables taut (the field's harmonic ellipses), so that slow changes of
it do so too. A falls from 1 to 0 in some half swings, and c takes the acceleration that the swing lacks at the start
away within the first of them.
"""

from __future__ import annotations

import numpy as np

from cspr_jax.machine.stops.candidates import Candidate, hermite_spline
from cspr_jax.machine.stops.instants import StateSamples
from cspr_jax.numerics.linear.rotations import CONJUGATE, products

HALVES = (1, 2, 3, 4, 6, 8, 12, 16, 24)  # half swings until the amplitude is 0
DEPTHS = (1.0, 0.8, 1.25)  # depths of P0, over that of the robot at the instant
KNOTS = 16  # per half swing, and one more
NEAR = 1e-6  # smallest depth below the spools of a robot that can swing, m


def dying_swings(samples: StateSamples, gravity: float, *, jumps: bool) -> list[Candidate]:
    """Swings that die, from each instant; with `jumps` the acceleration may jump at the start."""
    return [
        _swing(samples, k, float(depth * factor), gravity, halves, jumps=jumps)
        for k, depth in enumerate(samples.position[:, 2].tolist())
        for factor in DEPTHS
        for halves in HALVES
        if depth > NEAR
    ]


def _swing(samples: StateSamples, k: int, z0: float, gravity: float, halves: int, *, jumps: bool) -> Candidate:
    omega = np.sqrt(gravity / z0)
    times = np.linspace(0.0, halves * np.pi / omega, KNOTS * halves + 1)
    away = samples.position[k] - np.array([0.0, 0.0, z0])
    cosine, sine = np.cos(omega * times)[:, None], np.sin(omega * times)[:, None]
    swing = away * cosine + samples.velocity[k] / omega * sine
    rate = -omega * away * sine + samples.velocity[k] * cosine
    falls = falling(times / times[-1])
    a, a1, a2 = (part[:, None] / times[-1] ** order for order, part in enumerate(falls))
    lacking = np.zeros(3) if jumps else samples.acceleration[k] + omega**2 * away
    position = [a * swing, a1 * swing + a * rate, a2 * swing + 2.0 * a1 * rate - omega**2 * a * swing]
    position = [one + other for one, other in zip(position, _vanishing(times, lacking, np.pi / omega), strict=True)]
    position[0] = position[0] + np.array([0.0, 0.0, z0])
    return Candidate(k, "swing", hermite_spline(times, position, _level(samples, k, times), z0))


def falling(u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The quintic that falls from 1 to 0 without slope and curvature at its ends, with two derivatives."""
    return (
        1.0 - u**3 * (10.0 - 15.0 * u + 6.0 * u**2),
        -30.0 * u**2 * (1.0 - u) ** 2,
        -60.0 * u * (1.0 - u) * (1.0 - 2.0 * u),
    )


def _vanishing(times: np.ndarray, acceleration: np.ndarray, within: float) -> list[np.ndarray]:
    # Motion t^2 (1 - t / T)^3 / 2 along an acceleration, which it has at the start and loses until T.
    t = np.minimum(times, within)
    left = 1.0 - t / within
    value = 0.5 * t**2 * left**3
    first = t * left**3 - 1.5 * t**2 * left**2 / within
    second = left**3 - 6.0 * t * left**2 / within + 3.0 * t**2 * left / within**2
    return [part[:, None] * acceleration for part in (value, first, second)]


def _level(samples: StateSamples, k: int, times: np.ndarray) -> list[np.ndarray] | None:
    # Quaternions (1, v) q0, of any norm, that turn by a quintic v to the reference orientation, or, where it is more
    # than 120 degrees away, towards it: v would grow without bound.
    if samples.quaternion is None or samples.angular_velocity is None or samples.angular_acceleration is None:
        return None
    q0 = samples.quaternion[k]
    back = (q0 if q0[0] >= 0.0 else -q0) * CONJUGATE
    end, duration = back[1:] / max(back[0], 0.5), times[-1]
    b, c = 0.5 * duration * samples.angular_velocity[k], 0.25 * duration**2 * samples.angular_acceleration[k]
    u = (times / duration)[:, None]
    gap, derivative, second_derivative = end - b - c, -(b + 2.0 * c), -2.0 * c
    x3, x4, x5 = (
        10 * gap - 4 * derivative + 0.5 * second_derivative,
        -15 * gap + 7 * derivative - second_derivative,
        6 * gap - 3 * derivative + 0.5 * second_derivative,
    )
    value = b * u + c * u**2 + x3 * u**3 + x4 * u**4 + x5 * u**5
    first = (b + 2 * c * u + 3 * x3 * u**2 + 4 * x4 * u**3 + 5 * x5 * u**4) / duration
    second = (2 * c + 6 * x3 * u + 12 * x4 * u**2 + 20 * x5 * u**3) / duration**2
    start = np.repeat(q0[None], len(times), axis=0)
    scalars = [np.ones_like(u), np.zeros_like(u), np.zeros_like(u)]
    parts = zip(scalars, (value, first, second), strict=True)
    return [products(np.concatenate([scalar, vector], axis=1), start) for scalar, vector in parts]
