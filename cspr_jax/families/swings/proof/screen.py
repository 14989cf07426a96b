"""First screen, for all numbers of arcs together: upper bounds of the margin, fast.

The closed form splits a pseudotension into factors that depend on the points, and factors that depend only on
the number of arcs and tau. The latter are in a table; the precession is the same for all numbers of arcs of one
parity. A check then takes some fifty multiplications and additions, and no division. A fused loop runs over the
segments of a batch and takes several samples at a time, so that the numbers of a segment stay in registers and
the only array of segments by samples is the precession.

The screen only rejects candidates; `families.swings.proof.verdicts` decides the remaining ones.
"""

from __future__ import annotations

import math
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.families.swings.hypocycloid import Segment, oscillation
from cspr_jax.families.swings.proof.slacks import largest_term
from cspr_jax.motion.amplitudes import Amplitude, derivatives
from cspr_jax.numerics.batches import row_by_row
from cspr_jax.numerics.elementary import nan_ignoring_min, sincospi
from cspr_jax.numerics.shapes import Float, Int, Num
from cspr_jax.runtime.persistent_jit import persistent_jit

SAMPLES = 32
BATCH = 2048
# Number of samples in one pass over the batch; the fastest as measured.
UNROLL = 4
# With T^2 lambda below this, a segment has no duration (p = 1, psi -> 0) and is no trajectory.
SMALLEST_PERIOD = 1e-9
# A sampled value is raised by this many rounding units of the largest term, to be an upper bound.
EPSILONS = 256.0


def sample_table(
    amplitude: Amplitude, arcs: Num[np.ndarray, "n_arcs"], tau: Float[np.ndarray, "n_samples"], dtype
) -> Float[Array, "n_arcs 6 n_samples"]:
    """Table of the factors of a check that do not depend on the points, but on the phase pi p tau and on A."""
    phase = math.pi * arcs[:, None] * tau
    cosine, sine = jnp.asarray(np.cos(phase)), jnp.asarray(np.sin(phase))
    value, rate, second_derivative = (
        jnp.broadcast_to(v, phase.shape) for v in derivatives(amplitude, jnp.asarray(tau), order=2)
    )
    return jnp.stack([cosine, sine, value, second_derivative, second_derivative * cosine, rate * sine], axis=1).astype(
        dtype
    )


def smallest_sampled(
    amplitude: Amplitude, segments: Segment, arcs: Int[np.ndarray, "n_arcs"], tau: Float[np.ndarray, "n_samples"]
) -> Float[Array, "n_arcs n"]:
    """Smallest normalised pseudotension or depth ratio over samples, for some numbers of arcs of one parity."""
    dtype = segments.rate.dtype
    start, span = segments.start_radius, segments.end_radius - segments.start_radius
    laterals, axials = sincospi(jnp.asarray(tau, dtype)[:, None] * segments.precession[None, :])
    # Mirror the second axis for the sense -1: then all formulas are those of the sense +1.
    mirror = jnp.stack([jnp.ones_like(span), segments.sense], axis=-1)
    tilt = tuple((segments.tilt * mirror).T)
    rows = [(*(segments.coupling[:, k] * mirror).T, segments.twist[:, k] * segments.sense) for k in range(3)]

    def one(candidate):
        p, table = candidate
        ratio, _, period = oscillation(segments, p)
        exists = period > SMALLEST_PERIOD
        second_derivative, radial_rate = span / jnp.where(exists, period, 1.0), span * ((2.0 / math.pi) / p)

        def check(i, smallest):
            cosine, sine, value, a2, a2_cosine, a1_sine = (table[column, i] for column in range(6))
            lateral, axial, r, small = laterals[i], axials[i], start + span * value, ratio * sine
            c_r, c_t = r * cosine, small * r
            d_r, d_t = second_derivative * a2_cosine - radial_rate * a1_sine, small * (second_derivative * a2 + 2.0 * r)
            c0, c1 = axial * c_r + lateral * c_t, axial * c_t - lateral * c_r
            d0, d1 = axial * d_r + lateral * d_t, axial * d_t - lateral * d_r
            cross = c_r * d_t - c_t * d_r
            eta = 1.0 + tilt[0] * c0 + tilt[1] * c1
            couplings = [row[0] * d0 + row[1] * d1 + row[2] * cross for row in rows]
            # kappa_k is eta + coupling_k, and eta itself the depth ratio.
            # NaN may be ignored: the result is still an upper bound, and `families.swings.proof.verdicts` decides.
            lowest = nan_ignoring_min(
                nan_ignoring_min(couplings[0], couplings[1]), nan_ignoring_min(couplings[2], jnp.zeros_like(eta))
            )
            return nan_ignoring_min(smallest, eta + lowest)

        def chunk(j):
            smallest = check(UNROLL * j, jnp.full_like(span, jnp.inf))
            for i in range(1, UNROLL):
                smallest = check(UNROLL * j + i, smallest)
            return smallest

        # Do not carry the minimum from sample to sample: loops that stack results run on one core, as the caller's
        # threads need.
        smallest = row_by_row(chunk, jnp.arange(len(tau) // UNROLL)).min(0)
        return jnp.where(exists, smallest, -jnp.inf)

    return row_by_row(one, (jnp.asarray(arcs, dtype), sample_table(amplitude, arcs, tau, dtype)))


@persistent_jit(static_argnames=("max_arcs", "samples"))
def upper_bounds(
    amplitude: Amplitude, even: Segment, odd: Segment, *, max_arcs: int, samples: int = SAMPLES
) -> Num[Array, "n max_arcs"]:
    """Upper bounds of the margin of segments for every number of arcs, with an allowance for rounding."""
    tau = (np.arange(samples) + 0.5) / samples
    numbers = np.arange(1, max_arcs + 1)
    dtype = even.rate.dtype
    bounds = jnp.zeros((max_arcs, len(even.rate)), dtype)
    scale = jax.vmap(partial(largest_term, amplitude), in_axes=(0, None))
    for first, segments in ((0, odd), (1, even)):
        arcs = numbers[first::2]
        if len(arcs):
            terms = jax.vmap(scale, in_axes=(None, 0))(segments, jnp.asarray(arcs, dtype))
            guard = EPSILONS * jnp.finfo(dtype).eps * jnp.where(jnp.isfinite(terms), terms, 0.0)
            bounds = bounds.at[first::2].set(smallest_sampled(amplitude, segments, arcs, tau) + guard)
    return bounds.T
