"""Lower envelopes of the pseudotensions along a transition, thesis chapter 1, and proofs from them.

For any phase of the swing, the normalised pseudotension of a cable is at least 1 - sqrt(C^2 + S^2), (1.39). C and S
have no fast oscillation, so a few samples, with a bound of the second derivative between them, prove a full transition;
the pseudotensions themselves need many samples per arc.
"""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from cspr_jax.motion.amplitudes import Amplitude, derivatives, local_bounds
from cspr_jax.numerics.elementary import maximum_of, minimum_of
from cspr_jax.numerics.shapes import Float, Num

# Number of intervals of each piece of the amplitude function.
INTERVALS = 64
UNROLL = 4


def lower_envelope(
    amplitude: Amplitude,
    weight: Float[Array, ""],
    inclination: Float[Array, ""],
    n: Num[Array, ""],
    tau: Float[Array, ""],
) -> Float[Array, ""]:
    """Lower envelope of the normalised pseudotension of one cable at one time, (1.39); (1.50) for v = 0."""
    end = derivatives(amplitude, jnp.ones_like(tau), order=2)[2]
    omega = (2.0 * math.pi * n) ** 2 - end
    values = derivatives(amplitude, tau, order=2)
    squared = _squared(inclination + weight, inclination, n, omega, end, values)
    return jnp.where(omega > 0.0, 1.0 - jnp.sqrt(squared), jnp.nan)


def _squared(load: Array, inclination: Array, n: Array, omega: Array, end: Array, values: tuple[Array, ...]) -> Array:
    # Return C^2 + S^2 of (1.33) and (1.34), for A, A', A''.
    value, rate, second_derivative = values
    cosine = load * (second_derivative - value * end) / omega - inclination * value
    sine = 4.0 * math.pi * n * load * rate / omega
    return cosine**2 + sine**2


class _EnvelopeInterval(NamedTuple):
    # An interval without a knot inside: A, A', A'' at its end, bounds of |A| to |A''''| over it, and its width.
    values: tuple[Array, ...]
    bounds: tuple[Array, ...]
    width: Array


def _intervals(amplitude: Amplitude) -> _EnvelopeInterval:
    knots = jnp.concatenate([jnp.zeros(1), jnp.asarray(amplitude.knots), jnp.ones(1)])
    part = jnp.asarray(np.arange(INTERVALS) / INTERVALS)
    inside = [start + (stop - start) * part for start, stop in itertools.pairwise(knots)]
    edges = jnp.concatenate([*inside, jnp.ones(1)])
    start, stop = edges[:-1], edges[1:]
    bounds = local_bounds(amplitude, 0.5 * (start + stop), 0.5 * (stop - start))
    return _EnvelopeInterval(derivatives(amplitude, stop, order=2), bounds, stop - start)


def proved_envelope(
    amplitude: Amplitude, weights: Float[Array, "n_cables"], inclination: Float[Array, ""], n: Num[Array, ""]
) -> Float[Array, ""]:
    """Lower bound of all pseudotensions, and of the depth below the spools over z0, over a full transition."""
    end = derivatives(amplitude, jnp.ones_like(n), order=2)[2]
    omega = (2.0 * math.pi * n) ** 2 - end
    # The squares are convex in the load: loads between these, such as 0 for the depth, have no lower envelopes.
    loads = jnp.stack(
        [jnp.maximum(maximum_of(weights) + inclination, 0.0), jnp.minimum(minimum_of(weights) + inclination, 0.0)]
    )

    def one(load):
        def step(state, interval):
            before, worst = state
            current = _squared(load, inclination, n, omega, end, interval.values)
            hidden = interval.width**2 / 8.0 * _curvature(jnp.abs(load), jnp.abs(inclination), n, omega, end, interval)
            return (current, jnp.maximum(worst, jnp.maximum(before, current) + hidden)), None

        start = _squared(load, inclination, n, omega, end, derivatives(amplitude, jnp.zeros_like(n), order=2))
        return lax.scan(step, (start, start), _intervals(amplitude), unroll=UNROLL)[0][1]

    return 1.0 - jnp.sqrt(jnp.maximum(one(loads[0]), one(loads[1])))


def _curvature(load: Array, v: Array, n: Array, omega: Array, end: Array, interval: _EnvelopeInterval) -> Array:
    # Bound the second derivative of C^2 + S^2 over an interval, from bounds of C, S and their derivatives.
    a, fraction, gain = interval.bounds, load / omega, 4.0 * math.pi * n * load / omega
    c0, c1, c2 = (fraction * (a[j + 2] + a[j] * jnp.abs(end)) + v * a[j] for j in range(3))
    s0, s1, s2 = (gain * a[j + 1] for j in range(3))
    return 2.0 * (c1**2 + c0 * c2 + s1**2 + s0 * s2)
