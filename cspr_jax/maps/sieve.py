"""A first sieve over all numbers of arcs at once: upper bounds of the margin, fast.

The closed form splits a pseudotension into what depends on the points and what depends only on the
number of arcs and tau. The second is a table; the precession is the same for all numbers of arcs of
one parity. What is left for each (segment, arcs, tau) is some fifty multiplications and additions,
in one fusion, without a division.

The sieve rejects candidates; it accepts none. `feasibility.certificate` decides about the rest.
"""

import math
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from cspr_jax.amplitudes import Amplitude, derivatives
from cspr_jax.feasibility.slacks import largest_term
from cspr_jax.numerics import sincospi
from cspr_jax.trajectories.hypocycloid import Segment, oscillation

SAMPLES = 32
BATCH = 1024
# Below this T^2 lambda a segment has no duration (p = 1, psi -> 0) and is no trajectory.
SMALLEST_PERIOD = 1e-9
# Units of rounding of the largest term by which a sampled value is raised to be an upper bound.
ROUNDING = 64.0


def phase_table(arcs: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """Cosine and sine of pi p tau.

    Args:
        arcs: (n_arcs,) numbers of arcs.
        tau: (n_samples,).

    Returns:
        (n_arcs, 2, n_samples).
    """
    phase = math.pi * arcs[:, None] * tau
    return np.stack([np.cos(phase), np.sin(phase)], axis=1)


def smallest_sampled(amplitude: Amplitude, segments: Segment, arcs: np.ndarray, tau: np.ndarray) -> Array:
    """Smallest normalised pseudotension, or depth ratio, over samples, for several numbers of arcs of one parity.

    Args:
        amplitude: A.
        segments: leaves (n, ...), of the parity of `arcs`.
        arcs: (n_arcs,) all odd or all even.
        tau: (n_samples,).

    Returns:
        (n_arcs, n): an upper bound of the margin; -inf where there is no trajectory.
    """
    dtype = segments.rate.dtype
    shape = (len(tau), len(segments.rate))
    across = partial(jnp.broadcast_to, shape=shape)  # a number for each segment
    sampled = [jnp.broadcast_to(v[:, None], shape) for v in derivatives(amplitude, jnp.asarray(tau, dtype), order=2)]
    lateral, axial = sincospi(across(segments.sense * segments.precession) * jnp.asarray(tau, dtype)[:, None])
    span = across(segments.end_radius - segments.start_radius)
    r, growth, bend = across(segments.start_radius) + span * sampled[0], span * sampled[1], span * sampled[2]
    growth = across(segments.sense) * growth

    def one(candidate):
        p, table = candidate
        period, ratio = oscillation(segments, p)
        exists = period > SMALLEST_PERIOD
        cosine = jnp.broadcast_to(table[0][:, None], shape)
        sine = across(segments.sense) * jnp.broadcast_to(table[1][:, None], shape)
        rho, nu = bend * across(1.0 / jnp.where(exists, period, 1.0)), across(ratio)
        c_r, c_t = r * cosine, nu * (r * sine)
        d_r, d_t = rho * cosine - (2.0 / math.pi) / p * (growth * sine), nu * ((rho + 2.0 * r) * sine)
        c0, c1 = axial * c_r + lateral * c_t, axial * c_t - lateral * c_r
        d0, d1 = axial * d_r + lateral * d_t, axial * d_t - lateral * d_r
        cross = c_r * d_t - c_t * d_r
        eta = 1.0 + across(segments.tilt[:, 0]) * c0 + across(segments.tilt[:, 1]) * c1
        pull = [
            across(segments.pull[:, k, 0]) * d0
            + across(segments.pull[:, k, 1]) * d1
            + across(segments.twist[:, k]) * cross
            for k in range(3)
        ]
        # min over k of eta + pull_k, and eta itself
        smallest = eta + jnp.minimum(jnp.minimum(pull[0], pull[1]), jnp.minimum(pull[2], 0.0))
        return jnp.where(exists, jnp.min(smallest, axis=0), -jnp.inf)

    tables = jnp.asarray(phase_table(arcs, tau), dtype)
    return lax.map(one, (jnp.asarray(arcs, dtype), tables))


@partial(jax.jit, static_argnames="max_arcs")
def upper_bounds(amplitude: Amplitude, even: Segment, odd: Segment, *, max_arcs: int) -> Array:
    """Upper bounds of the margin of segments, for every number of arcs; rounding is allowed for.

    Args:
        amplitude: A.
        even: the segments for even numbers of arcs, leaves (n, ...).
        odd: the same for odd numbers.
        max_arcs: largest number of arcs.

    Returns:
        (n, max_arcs): column p - 1 for p arcs.
    """
    tau = (np.arange(SAMPLES) + 0.5) / SAMPLES
    numbers = np.arange(1, max_arcs + 1)
    dtype = even.rate.dtype
    found = jnp.zeros((max_arcs, len(even.rate)), dtype)
    scale = jax.vmap(partial(largest_term, amplitude), in_axes=(0, None))
    for first, segments in ((0, odd), (1, even)):
        mine = numbers[first::2]
        if len(mine):
            terms = jax.vmap(scale, in_axes=(None, 0))(segments, jnp.asarray(mine, dtype))
            guard = ROUNDING * jnp.finfo(dtype).eps * jnp.where(jnp.isfinite(terms), terms, 0.0)
            found = found.at[first::2].set(smallest_sampled(amplitude, segments, mine, tau) + guard)
    return found.T
