"""Least duration along a straight line under any limits, by search over the ratio p / T.

For one law every slack is affine in q = 1 / T^2, so each sample bounds q from above or, where the robot could not rest,
from below. The largest q is searched for among samples, where a parabola through three of them refines each smallest
bound; the ratio is searched for on finer and finer grids.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from cspr_jax.families.lines.motion import s_curve
from cspr_jax.families.lines.s_model import LeastDuration
from cspr_jax.families.lines.slacks import LineSlacks, LineStates, slacks, tensions_at
from cspr_jax.motion.amplitudes import Amplitude, derivatives
from cspr_jax.numerics.elementary import maximum_of, minimum_of
from cspr_jax.numerics.shapes import Float

# Number of samples of a piece of the S-model; each half of another law has twice as many.
SAMPLES = 33
HALF = 2 * SAMPLES
# Ratios tried first, as logits. Each later round tries points at the fractions `FINER` of the spacing about the best
# one.
LOGITS = np.linspace(-6.0, 6.0, 33)
FINER, ROUNDS = np.linspace(-2.0, 2.0, 5) / 3.0, 14
# A duration from the search is prolonged by these fractions, in order, until it is proved.
LONGER = (1e-7, 1e-6, 3e-6, 1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3, 1.0)
# The acceleration of a cable has a peak where the cable is shortest: samples lie on both sides of that point, at these
# distances over the shortest length.
BESIDE = np.linspace(-1.5, 1.5, 4 * SAMPLES - 3)
HALVINGS = 45  # bisections for the times of these samples


class Gain(NamedTuple):
    """Feasible q = 1 / T^2 of one law along a line.

    Fields:
        high: () largest q, 1/s^2; not positive if there is none.
        low: () smallest q, 1/s^2: 0 unless the line passes points at which the robot could not rest.
        up: index of the slack that bounds q in the first half: first the faces of taut cables, then the same faces as
            smallest tensions shift them, then as largest tensions do, then the other limits in order, and last the
            largest acceleration.
        down: index of the slack that bounds q in the second half.
    """

    high: Array
    low: Array
    up: Array
    down: Array


def gain(
    line: LineSlacks,
    law: Amplitude,
    edges: Float[Array, "n_pieces+1"],
    middle: Float[Array, ""],
    largest: Float[Array, ""],
) -> Gain:
    """Feasible q of one law."""
    fraction = jnp.linspace(0.0, 1.0, SAMPLES if edges.shape[0] > 2 else 2 * HALF)
    tau = edges[:-1, None] + jnp.diff(edges)[:, None] * fraction[None]
    s, speed, second_derivative = (x[..., None] for x in derivatives(law, tau, order=2))
    # States at rest and at q = 1: (2, n_pieces, n_samples, 1).
    both = jnp.asarray([0.0, 1.0])[:, None, None, None]
    states = LineStates(s[None], both * speed[None] ** 2, both * second_derivative[None])
    line = jax.tree.map(lambda x: x[None, None, None], line)
    tensions = tensions_at(line, line.tightest, s[None])
    groups = [slacks(line, line.tightest, states, tensions)]
    groups += [slacks(line, name, states) for name in line.names if name in line.largest]
    at_rest, moving = jnp.concatenate(groups, axis=-1)
    is_finite = jnp.isfinite(at_rest)
    maximum = jnp.where(is_finite, at_rest, 1.0)
    needed = jnp.where(is_finite, at_rest - moving, 0.0)
    maximum = jnp.concatenate([maximum, jnp.broadcast_to(largest[None, None, None], second_derivative.shape)], axis=-1)
    needed = jnp.concatenate([needed, jnp.abs(second_derivative)], axis=-1)
    is_limited = jnp.concatenate([is_finite, jnp.ones_like(second_derivative, bool)], axis=-1)
    above = _above(maximum, needed, is_limited)
    below = jnp.where((maximum < 0.0) & (needed < 0.0), maximum / jnp.where(needed < 0.0, needed, 1.0), 0.0)
    first, numbers = (tau <= middle)[..., None], _numbers(line, tensions, above.shape)
    halves = [jnp.where(half, above, jnp.inf) for half in (first, ~first)]
    up, down = (numbers.ravel()[jnp.argmin(half)] for half in halves)
    # Samples of s'' miss its peak: take the peak from the law's formula.
    high = jnp.minimum(minimum_of(above), largest / law.largest[2])
    q_range = Gain(high, maximum_of(below), up, down)
    if "cable_acceleration_max" not in line.largest:
        return q_range
    count = groups[0].shape[-1]
    return _with_peaks(q_range, halves, _near_spools(line, law), middle, 3 * count)


def _above(at_rest: Array, needed: Array, is_limited: Array) -> Array:
    # Return the largest q at samples (n_pieces, n_samples, n_rows) whose slack is at_rest - q needed.
    is_limited &= at_rest > 0.0
    fraction = _between(jnp.where(at_rest > 0.0, needed / jnp.where(at_rest > 0.0, at_rest, 1.0), 0.0), is_limited)
    above = jnp.where(fraction > 0.0, 1.0 / jnp.where(fraction > 0.0, fraction, 1.0), jnp.inf)
    return jnp.where((at_rest <= 0.0) & (needed >= 0.0), -1.0, above)


def _near_spools(
    line: LineSlacks, law: Amplitude
) -> tuple[Float[Array, "n_cables n_samples n_rows"], Float[Array, "n_cables n_samples 1"]]:
    """Largest q under the limits of motion, near the point where each cable is shortest."""
    line = jax.tree.map(lambda x: x[0, 0, 0], line)
    s = jnp.clip(
        line.nearest[:, None] + jnp.sqrt(line.squared_distance / line.square)[:, None] * BESIDE[None], 0.0, 1.0
    )

    def halved(_, ends):
        low, high = ends
        middle = 0.5 * (low + high)
        is_before = derivatives(law, middle, order=0)[0] < s
        return jnp.where(is_before, middle, low), jnp.where(is_before, high, middle)

    tau, _ = lax.fori_loop(0, HALVINGS, halved, (jnp.zeros_like(s), jnp.ones_like(s)))
    position, speed, second_derivative = (x[..., None] for x in derivatives(law, tau, order=2))
    at = LineStates(position, speed**2, second_derivative)
    line = jax.tree.map(lambda x: x[None, None], line)
    groups = jnp.concatenate([slacks(line, name, at) for name in line.names if name in line.largest], axis=-1)
    # Use no parabolas between these samples, since knots of the law lie among them.
    return _above(jnp.ones_like(groups), 1.0 - groups, jnp.zeros_like(groups, bool)), tau[..., None]


def _with_peaks(q_range: Gain, halves: list[Array], peaks: tuple[Array, Array], middle: Array, first_peak: int) -> Gain:
    # Add the peaks beside spools: where they bound q more, name their limit as the one that binds.
    above, tau = peaks
    numbers = jnp.broadcast_to(jnp.arange(above.shape[-1])[None, None] + first_peak, above.shape).ravel()
    sides = [jnp.where(half, above, jnp.inf) for half in (tau <= middle, tau > middle)]
    names = [
        jnp.where(minimum_of(side) < minimum_of(half), numbers[jnp.argmin(side)], name)
        for side, half, name in zip(sides, halves, (q_range.up, q_range.down), strict=True)
    ]
    return Gain(jnp.minimum(q_range.high, minimum_of(above)), q_range.low, *names)


def _numbers(line: LineSlacks, tensions: Array, shape: tuple[int, ...]) -> Array:
    # Number the slacks of each sample; a face has different numbers if tensions shift it.
    low, high = line.low[line.tightest][..., None, :], line.high[line.tightest][..., None, :]
    is_tensioned = tensions > 0.0
    by_largest = (is_tensioned & (tensions == high) & (low < high)).any(-1)[0]
    by_smallest, count = is_tensioned.any(-1)[0] & ~by_largest, by_largest.shape[-1]
    faces = jnp.where(by_largest, 2 * count, jnp.where(by_smallest, count, 0))
    others = jnp.full((*shape[:2], shape[2] - count), 2 * count)
    shift = jnp.concatenate([faces, others], axis=-1)
    return jnp.arange(shape[2])[None, None] + shift


def _between(values: Array, is_limited: Array) -> Array:
    # Raise samples (n_pieces, n_samples, n_rows) that are the largest of three to the vertex of their parabola, and
    # ends of a piece if the parabola rises from them.
    a, b, c = values[:, :-2], values[:, 1:-1], values[:, 2:]
    three = is_limited[:, :-2] & is_limited[:, 1:-1] & is_limited[:, 2:]
    is_high, curvature = three & (b >= a) & (b >= c), 2.0 * b - a - c
    higher = b + (c - a) ** 2 / (8.0 * jnp.where(curvature > 0.0, curvature, 1.0))
    inner = jnp.where(is_high & (curvature > 0.0), higher, b)
    first = _from_end(values[:, :3], is_limited[:, :3].all(1))
    last = _from_end(values[:, :-4:-1], is_limited[:, :-4:-1].all(1))
    return jnp.concatenate([first[:, None], inner, last[:, None]], axis=1)


def _from_end(values: Array, is_limited: Array) -> Array:
    # Return the peak of the parabola through three samples from an end inwards; without a peak, the value at the end.
    a, b, c = (values[:, k] for k in range(3))
    derivative, curvature = 0.5 * (4.0 * b - 3.0 * a - c), 2.0 * b - a - c
    rises = is_limited & (derivative > 0.0) & (curvature > derivative)
    return jnp.where(rises, a + derivative**2 / (2.0 * jnp.where(rises, curvature, 1.0)), a)


def gain_of_law(line: LineSlacks, ratio: Float[Array, ""], largest: Float[Array, ""], law: Amplitude | None) -> Gain:
    """Feasible q of one motion."""
    if law is not None:
        return gain(line, law, jnp.asarray([0.0, 1.0]), jnp.asarray(0.5), largest)
    edges = jnp.stack([0.0 * ratio, 0.5 * ratio, ratio, 0.5 * (1.0 + ratio), jnp.ones_like(ratio)])
    return gain(line, s_curve(ratio), edges, ratio, largest)


def least_by_search(line: LineSlacks, largest: Float[Array, ""], law: Amplitude | None) -> LeastDuration:
    """Least duration along a line under its limits."""
    if law is not None:
        half = jnp.asarray(0.5)
        return _least_duration(gain_of_law(line, half, largest, law), half)

    def cost(logit):
        q_range = gain_of_law(line, jax.nn.sigmoid(logit), largest, None)
        return jnp.where(q_range.low <= q_range.high, -q_range.high, jnp.maximum(q_range.low, 0.0)), q_range

    logits = jnp.asarray(LOGITS)
    center = logits[jnp.argmin(lax.map(cost, logits)[0])]
    width = logits[1] - logits[0]

    def finer(_, best):
        # The new points lie between the neighbours of the best one so far.
        center, width, _ = best
        points = center + width * jnp.asarray(FINER)
        costs, q_range = lax.map(cost, points)
        i = jnp.argmin(costs)
        return points[i], width * (FINER[1] - FINER[0]), jax.tree.map(lambda x: x[i], q_range)

    none = Gain(jnp.zeros_like(center), jnp.zeros_like(center), jnp.asarray(0), jnp.asarray(0))
    logit, _, q_range = lax.fori_loop(0, ROUNDS, finer, (center, width, none))
    return _least_duration(q_range, jax.nn.sigmoid(logit))


def _least_duration(q_range: Gain, ratio: Array) -> LeastDuration:
    is_feasible = (q_range.high > 0.0) & (q_range.low <= q_range.high)
    duration = jnp.where(is_feasible, 1.0 / jnp.sqrt(jnp.where(is_feasible, q_range.high, 1.0)), jnp.inf)
    return LeastDuration(ratio, duration, q_range.up, q_range.down)
