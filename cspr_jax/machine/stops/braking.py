"""Stops along the path of the motions themselves: run on ever more slowly, or to the next place of rest.

The motion x(s) is run with s' = 1 - (10 u^3 - 15 u^4 + 6 u^5), u = t / T: speed and acceleration go on at the start,
and after the time T, in which it comes T / 2 further, the robot rests.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from cspr_jax.curves.interpolation import continuous
from cspr_jax.machine.stops.candidates import Candidate, hermite_spline
from cspr_jax.machine.stops.instants import StateSamples
from cspr_jax.numerics.linear.rotations import products
from cspr_jax.numerics.shapes import Float

KNOTS = 41  # of a stop
SPACING = 0.04  # largest distance of the knots of the planned motion, over half a swing
TRIED = 12  # durations
# Durations are tried between these multiples of the time in which gravity would take the speed away, at least a
# fraction of half a swing.
SHORTEST, LONGEST, SMALLEST = 0.5, 30.0, 0.05

StatesAt = Callable[[np.ndarray], StateSamples]


def brakes(
    states_at: StatesAt, samples: StateSamples, resting: Float[np.ndarray, "n"], end: float, z0: float, gravity: float
) -> list[Candidate]:
    """Stops along the path of motions, from their states at any time, the times at which they rest, and their end."""
    half, speeds = np.pi * np.sqrt(z0 / gravity), np.linalg.norm(samples.velocity, axis=1)
    plans = list(_durations(samples.times, speeds / gravity, resting, half, end))
    if not plans:
        return []
    u = np.linspace(0.0, 1.0, KNOTS)
    further = u - 2.5 * u**4 + 3.0 * u**5 - u**6
    rate, slowing = 1.0 - u**3 * (10.0 - 15.0 * u + 6.0 * u**2), -30.0 * u**2 * (1.0 - u) ** 2
    started = np.array([[samples.times[k], duration] for k, duration in plans])
    states = states_at((started[:, :1] + started[:, 1:] * further).ravel())
    candidates = []
    for i, (k, duration) in enumerate(plans):
        part = states.take(np.arange(i * KNOTS, (i + 1) * KNOTS))
        candidates.append(_along(k, part, u * duration, rate, slowing / duration, z0))
    return candidates


def rests_ahead(
    states_at: StatesAt, samples: StateSamples, resting: Float[np.ndarray, "n"], z0: float, gravity: float
) -> list[Candidate]:
    """The motions themselves, up to the next time at which they rest."""
    spacing, grids = SPACING * np.pi * np.sqrt(z0 / gravity), dict[int, np.ndarray]()
    for k, time in enumerate(samples.times.tolist()):
        later = resting[resting > time]
        if len(later):
            count = max(KNOTS, int(np.ceil((later[0] - time) / spacing)) + 1)
            grids[k] = np.linspace(time, later[0], count)
    if not grids:
        return []
    states, ends = states_at(np.concatenate(list(grids.values()))), np.cumsum([len(times) for times in grids.values()])
    candidates = []
    for (k, times), end in zip(grids.items(), ends.tolist(), strict=True):
        ones, part = np.ones(len(times)), states.take(np.arange(end - len(times), end))
        candidates.append(_along(k, part, times - times[0], ones, 0.0 * ones, z0))
    return candidates


def _durations(
    times: np.ndarray, braking: np.ndarray, resting: np.ndarray, half: float, end: float
) -> Iterator[tuple[int, float]]:
    for k, (time, unit) in enumerate(zip(times.tolist(), braking.tolist(), strict=True)):
        later = resting[resting > time]
        ahead = (later[0] if len(later) else end) - time
        low = max(SHORTEST * unit, SMALLEST * half)
        high = min(max(LONGEST * unit, half), 2.0 * ahead)
        if high > low:
            yield from ((k, duration) for duration in np.geomspace(low, high, TRIED).tolist())


def _along(
    k: int, part: StateSamples, times: np.ndarray, rate: np.ndarray, slowing: np.ndarray, z0: float
) -> Candidate:
    # A motion along a path, at its knots: s' and s'' of its parameter.
    first, second = rate[:, None], slowing[:, None]
    velocity, acceleration = part.velocity * first, part.acceleration * first**2 + part.velocity * second
    return Candidate(
        k, "path", hermite_spline(times, [part.position, velocity, acceleration], _turning(part, first, second), z0)
    )


def _turning(part: StateSamples, first: np.ndarray, second: np.ndarray) -> list[np.ndarray] | None:
    # Unit quaternions with two derivatives: q' = omega q / 2, q'' = alpha q / 2 - |omega|^2 q / 4.
    if part.quaternion is None or part.angular_velocity is None or part.angular_acceleration is None:
        return None
    omega = part.angular_velocity * first
    alpha = part.angular_acceleration * first**2 + part.angular_velocity * second
    turns = continuous(part.quaternion)

    def pure(vectors: np.ndarray) -> np.ndarray:
        return np.insert(vectors, 0, 0.0, axis=1)

    square = np.sum(omega**2, axis=1, keepdims=True)
    return [turns, 0.5 * products(pure(omega), turns), 0.5 * products(pure(alpha), turns) - 0.25 * square * turns]
