"""Numbers of oscillations that a transition needs, from the envelopes of its pseudotensions, thesis chapter 1.

With Omega = 4 pi^2 N - A''(1), N = n^2, the normalised pseudotension of cable k is, (1.32),

    1 - C cos(2 pi n tau) + S sin(2 pi n tau),  C = (v + w) c / Omega - v A,  S = 4 pi n (v + w) A' / Omega,

c = A'' - A A''(1). It is positive for any phase if C^2 + S^2 < 1, (1.39), which is quadratic in Omega. N must exceed
the largest root, the maximum over tau and over the cables. This is sufficient for taut cables, not necessary. n is a
real number here: a motion takes the next integer.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from cspr_jax.motion.amplitudes import SMALLEST_EPSILON, Amplitude, derivatives, named
from cspr_jax.numerics.elementary import maximum_of, minimum_of, vertex
from cspr_jax.numerics.search.minima import GOLDEN, Bracket, golden_step, inner_points
from cspr_jax.numerics.shapes import Float

# Number of samples of each piece of the amplitude function; the maximum is refined between them.
SAMPLES = 64
UNROLL = 4
# Steps of golden section, which narrow the bracket to 1/300; parabolas then find the time to rounding.
STEPS = 12
PARABOLAS = 2
SMALLEST_FRACTION = 1e-3
TINY = 1e-100
# Steps of golden section for the best inclination, which narrow the bracket to 4e-9 of its width.
INCLINATION_STEPS = 40
EPSILONS = 50
SMALLEST_WIDTH = 1e-9
LARGEST_INCLINATION = 1.0 - 1e-9


def squared_oscillations_at(
    amplitude: Amplitude, weight: Float[Array, ""], inclination: Float[Array, ""], tau: Float[Array, ""]
) -> Float[Array, ""]:
    """N_k(v, tau) of (1.44): squared number of oscillations that keep a cable taut at one time, for any phase."""
    end = derivatives(amplitude, jnp.ones_like(tau), order=2)[2]
    return _squared(_root(inclination + weight, inclination, end, derivatives(amplitude, tau, order=2)), end)


def _squared(omega: Array, end: Array) -> Array:
    # Convert Omega to N.
    return (omega + end) / (4.0 * math.pi**2)


def _root(load: Array, inclination: Array, end: Array, values: tuple[Array, ...]) -> Array:
    # Return the largest root Omega of the envelope, for A, A', A'' at one time.
    value, rate, second_derivative = values
    c, tilt = second_derivative - value * end, inclination * value
    d = (1.0 - tilt) * (1.0 + tilt)
    half = tilt * load * c - 2.0 * (load * rate) ** 2
    rest = load**2 * (c**2 + 4.0 * end * rate**2)
    squared = half**2 + d * rest
    root = jnp.sqrt(jnp.maximum(squared, 0.0))
    # Take the second form of the root where the first loses digits by cancellation. Without a real root, every Omega
    # keeps the envelope positive.
    is_second = half > 0.0
    largest = jnp.where(is_second, rest, root - half) / jnp.where(is_second, root + half, jnp.where(d > 0.0, d, 1.0))
    omega = jnp.where(squared < 0.0, 0.0, jnp.maximum(largest, 0.0))
    # If |v A| >= 1, the effector reaches the spool plane at some phase, and a cable is slack before that.
    return jnp.where(d > 0.0, omega, jnp.inf)


@jax.jit
def _samples(amplitude: Amplitude) -> Array:
    # Return samples that include every knot, and are dense towards the ends of each piece, where steep inclinations
    # have their maximum.
    ends = jnp.concatenate([jnp.zeros(1), jnp.asarray(amplitude.knots), jnp.ones(1)])
    part = 0.5 * (1.0 - np.cos(math.pi * np.arange(SAMPLES) / SAMPLES))
    inside = ends[:-1, None] + (ends[1:] - ends[:-1])[:, None] * part[None]
    return jnp.concatenate([inside.ravel(), jnp.ones(1)])


def _golden(function: Callable[[Array], Array], low: Array, high: Array, steps: int) -> Array:
    # Minimise a function that first falls and then rises, by golden section.
    left, right = inner_points(low, high)
    start = Bracket(low, high, left, right, function(left), function(right))
    last = lax.fori_loop(0, steps, lambda _, bracket: golden_step(function, bracket)[0], start)
    return 0.5 * (last.low + last.high)


@jax.jit
def _needed(amplitude: Amplitude, tau: Array, weights: Array, inclination: Array) -> Array:
    end = derivatives(amplitude, jnp.ones_like(inclination), order=2)[2]
    values = derivatives(amplitude, tau, order=2)

    def one(weight):
        def needed(sample):
            return _root(inclination + weight, inclination, end, sample)

        def at(t):
            return needed(derivatives(amplitude, t, order=2))

        indices, highest = _peaks(needed, values)
        low, high = tau[jnp.maximum(indices - 1, 0)], tau[jnp.minimum(indices + 1, len(tau) - 1)]
        return _squared(jnp.maximum(highest, maximum_of(jax.vmap(partial(_peak, at))(low, high))), end)

    return maximum_of(jax.vmap(one)(weights))


def _peaks(function: Callable[[tuple[Array, ...]], Array], points: tuple[Array, ...]) -> tuple[Array, Array]:
    # Find the times of the two highest peaks of a sampled function, and the height of the first. Take samples one after
    # the other, since sorting them would cost five times as much.
    none = -jnp.inf * jnp.ones_like(function(tuple(p[0] for p in points)))
    nowhere = jnp.zeros((), jnp.int32)

    def take(peaks, value, index):
        (first, at_first), (second, at_second) = peaks
        leads, follows = value > first, value > second
        next_one = jnp.where(leads, first, jnp.where(follows, value, second))
        at_next = jnp.where(leads, at_first, jnp.where(follows, index, at_second))
        return (jnp.where(leads, value, first), jnp.where(leads, index, at_first)), (next_one, at_next)

    def step(state, point):
        before, current, index, peaks = state
        after = function(point)
        is_peak = (current >= before) & (current >= after)
        return (current, after, index + 1, take(peaks, jnp.where(is_peak, current, -jnp.inf), index)), None

    start = (none, none, nowhere - 1, ((none, nowhere), (none, nowhere)))
    (before, current, index, peaks), _ = lax.scan(step, start, points, unroll=UNROLL)
    peaks = take(peaks, jnp.where(current >= before, current, -jnp.inf), index)
    return jnp.stack([peaks[0][1], peaks[1][1]]), peaks[0][0]


def _peak(function: Callable[[Array], Array], low: Array, high: Array) -> Array:
    # Return the largest value, not negative, near the only peak between two times. The peak is sharp if |v A| is close
    # to 1, but its reciprocal is smooth: lay parabolas through the reciprocal unless it is too large.
    middle, width = _golden(lambda t: -function(t), low, high, STEPS), 0.5 * (high - low) * GOLDEN**STEPS

    def narrow(_, state):
        largest, at, width = state
        points = jnp.clip(at + width * jnp.array([-1.0, 0.0, 1.0]), low, high)
        values = jax.vmap(function)(points)
        reciprocals = 1.0 / jnp.maximum(values, jnp.maximum(SMALLEST_FRACTION * maximum_of(values), TINY))
        move = vertex(reciprocals[0], reciprocals[1], reciprocals[2])[0]
        return jnp.maximum(largest, maximum_of(values)), jnp.clip(points[1] + width * move, low, high), width / 16.0

    return lax.fori_loop(0, PARABOLAS, narrow, (jnp.full_like(middle, -jnp.inf), middle, width))[0]


def least_oscillations(
    amplitude: Amplitude, weights: Float[Array, "n_cables"], inclination: Float[Array, ""]
) -> Float[Array, ""]:
    """Real number of oscillations that the envelopes require: (1.48), (1.94)."""
    return jnp.sqrt(jnp.maximum(_needed(amplitude, _samples(amplitude), _extreme(weights), inclination), 0.0))


@jax.jit
def _extreme(weights: Array) -> Array:
    # The loads that a given N allows are an interval about zero: only the extreme cables matter.
    return jnp.stack([maximum_of(weights), minimum_of(weights)])


def horizontal_oscillations(amplitude: Amplitude, weights: Float[Array, "n_cables"]) -> Float[Array, ""]:
    """Real number of oscillations that the envelopes require on a horizontal transition: (1.53)."""
    largest = maximum_of(jnp.abs(weights), keepdims=True)
    return jnp.sqrt(jnp.maximum(_needed(amplitude, _samples(amplitude), largest, jnp.zeros_like(largest[0])), 0.0))


def best_inclination(
    amplitude: Amplitude, weights: Float[Array, "n_cables"]
) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """The inclination that needs the fewest oscillations, by golden section."""
    return _best(amplitude, _samples(amplitude), _extreme(weights))


@jax.jit
def _best(amplitude: Amplitude, samples: Array, weights: Array) -> tuple[Array, Array]:
    high = LARGEST_INCLINATION / jnp.maximum(amplitude.largest[0], 1.0).astype(weights.dtype)
    v = _golden(lambda v: _needed(amplitude, samples, weights, v), -high, high, INCLINATION_STEPS)
    return v, jnp.sqrt(jnp.maximum(_needed(amplitude, samples, weights, v), 0.0))


def best_epsilon(weights: Float[Array, "n_cables"]) -> tuple[float, float]:
    """The epsilon of A_eff, (1.110), that needs the fewest oscillations on a horizontal transition."""

    def needed(epsilon: float) -> float:
        return float(horizontal_oscillations(named("effective", epsilon), weights))

    # Find the valley coarsely, then its minimum by golden section.
    trial = np.linspace(SMALLEST_EPSILON, 0.5, EPSILONS)
    index = int(np.argmin([needed(float(epsilon)) for epsilon in trial]))
    low, high = float(trial[max(index - 1, 0)]), float(trial[min(index + 1, EPSILONS - 1)])
    while high - low > SMALLEST_WIDTH:
        left, right = inner_points(low, high)
        low, high = (low, right) if needed(left) <= needed(right) else (left, high)
    return 0.5 * (low + high), needed(0.5 * (low + high))


def many_oscillations(amplitude: Amplitude, weights: Float[Array, "n_cables"]) -> Float[Array, ""]:
    """Limit of `least_oscillations` on a horizontal transition as the weights grow, (1.55)."""
    return maximum_of(jnp.abs(weights)) / math.pi * amplitude.largest[1]
