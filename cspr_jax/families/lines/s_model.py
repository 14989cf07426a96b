"""Least duration of the S-model along a straight line, and of any motion along the line.

With the ratio r = p / T the S-model has s = r S(x) and s'' = A(x) / (r T^2) while it accelerates, x from 0 to 1, with
A = 8 x and S = 4/3 x^3 up to the middle. It meets a bound s'' <= b + m s if 1 / T^2 <= min of r (b + m r S) / A over x,
which has a closed form; braking is the same, seen from the end, with 1 - r. Unless bounds fall steeply, the first
expression grows with r and the second falls, so 1 / T^2 is largest where they are equal. For all laws, no motion is
faster than accelerating at the bound and then braking at it.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from cspr_jax.families.lines.faces import Sides
from cspr_jax.motion.amplitudes import Amplitude, derivatives
from cspr_jax.numerics.elementary import minimum_of
from cspr_jax.numerics.search.minima import Bracket, golden_step, inner_points
from cspr_jax.numerics.shapes import Float

ROUNDS = 24
SAMPLES = 128  # samples of half a motion by a law without a parameter
SECTIONS = 48  # number of golden sections between two samples
# A least duration is prolonged by this fraction, so that its margin is above rounding.
LONGER = 1e-8


def _gain(ratio: Array, start: Array, change: Array, touching: bool) -> Array:
    # Return the largest 1 / T^2 of one half of the S-model under each bound, (n,).
    corner = 0.25 * ratio * (start + change * ratio / 6.0)
    if not touching:
        return corner
    # A rising bound may touch the acceleration before its corner, at x < 1/2.
    rising = (change > 0.0) & (3.0 * start < change * ratio)
    x = jnp.cbrt(jnp.where(rising, 3.0 * start / (8.0 * jnp.where(rising, change * ratio, 1.0)), 0.125))
    return jnp.where(rising, 3.0 / 16.0 * ratio * start / jnp.where(x > 0.0, x, 1.0), corner)


class LeastDuration(NamedTuple):
    """The S-model of least duration along a line; () each.

    Fields:
        ratio: p / T.
        duration: T, s; inf where nothing is feasible.
        up: index of the bound that limits the acceleration.
        down: index of the bound that limits the braking.
    """

    ratio: Array
    duration: Array
    up: Array
    down: Array


def least_s_curve(sides: Sides, *, touching: bool = True) -> LeastDuration:
    """The S-model of least duration."""

    def gains(ratio):
        up = _gain(ratio, sides.up, sides.up_change, touching)
        return up, _gain(1.0 - ratio, sides.down, sides.down_change, touching)

    def step(_, logit):
        # Solve for the ratio by Newton's method on log(up / down) over its logit, which is nearly linear.
        ratio = jax.nn.sigmoid(logit)
        (up, down), (up_rate, down_rate) = jax.jvp(gains, (ratio,), (jnp.ones_like(ratio),))
        i, j = jnp.argmin(up), jnp.argmin(down)
        derivative = ratio * (1.0 - ratio) * (up_rate[i] / up[i] - down_rate[j] / down[j])
        move = (jnp.log(up[i]) - jnp.log(down[j])) / derivative
        return logit - jnp.clip(jnp.where(jnp.isfinite(move), move, 0.0), -3.0, 3.0)

    ratio = jax.nn.sigmoid(lax.fori_loop(0, ROUNDS, step, jnp.zeros_like(sides.up[0])))
    up, down = gains(ratio)
    gain = jnp.minimum(minimum_of(up), minimum_of(down))
    duration = jnp.where(gain > 0.0, 1.0 / jnp.sqrt(jnp.where(gain > 0.0, gain, 1.0)), jnp.inf)
    return LeastDuration(ratio, duration, jnp.argmin(up), jnp.argmin(down))


def thesis_s_curve(sides: Sides) -> LeastDuration:
    """The S-model by the rule of the thesis: of both branches for Q3, the one with the smaller path coordinate."""
    first = least_s_curve(sides, touching=False)
    start, change = sides.up[first.up], sides.up_change[first.up]
    # On the line of Q3 alone, 1 / T^2 is largest at r = -3 b / m.
    apex = jnp.where(change < 0.0, -3.0 * start / jnp.where(change < 0.0, change, 1.0), jnp.inf)
    ratio = jnp.where(apex < first.ratio, apex, first.ratio)
    gain = _gain(ratio, start, change, False)
    duration = jnp.where(apex < first.ratio, 1.0 / jnp.sqrt(gain), first.duration)
    return LeastDuration(ratio, duration, first.up, first.down)


def least_of_law(law: Amplitude, sides: Sides) -> LeastDuration:
    """Least duration for a law without a parameter."""
    tau = jnp.linspace(0.0, 0.5, SAMPLES + 1)[1:-1]

    def smallest(start, change):
        def gain(tau):
            s, _, second_derivative = derivatives(law, tau, order=2)
            return jnp.where(jnp.isfinite(start), start + change * s, jnp.inf) / second_derivative

        values = jax.vmap(gain)(tau)  # (n_samples, n_bounds)
        width = tau[1] - tau[0]
        middle = tau[jnp.argmin(values, axis=0)]
        high = jnp.minimum(middle + width, 0.5 - 1e-9)

        def at(samples):
            return jnp.diagonal(jax.vmap(gain)(samples))

        low = jnp.maximum(middle - width, 0.0)
        left, right = inner_points(low, high)
        first = Bracket(low, high, left, right, at(left), at(right))
        last = lax.fori_loop(0, SECTIONS, lambda _, bracket: golden_step(at, bracket, left_if_equal=False)[0], first)
        narrow = jnp.minimum(jnp.minimum(last.at_left, last.at_right), at(low))
        return jnp.minimum(narrow, minimum_of(values, axis=0))

    up, down = smallest(sides.up, sides.up_change), smallest(sides.down, sides.down_change)
    gain = jnp.minimum(minimum_of(up), minimum_of(down))
    duration = jnp.where(gain > 0.0, 1.0 / jnp.sqrt(jnp.where(gain > 0.0, gain, 1.0)), jnp.inf)
    return LeastDuration(jnp.full_like(gain, 0.5), duration, jnp.argmin(up), jnp.argmin(down))


def least_time(sides: Sides, *, everywhere: bool = True) -> Float[Array, ""]:
    """Least duration of any motion along a line from rest to rest: it accelerates at the bound, then brakes at it."""
    braking = (sides.down + sides.down_change, -sides.down_change)  # bound of -s'' as a function of s
    parts = [] if everywhere else [sides.first, sides.last]
    nodes = jnp.concatenate([_crossings(sides.up, sides.up_change), _crossings(*braking), *parts])
    x = jnp.sort(jnp.concatenate([jnp.array([0.0, 1.0]), nodes]))
    middle = 0.5 * (x[:-1] + x[1:])
    holds = None if everywhere else (sides.first[None] <= middle[:, None]) & (middle[:, None] <= sides.last[None])
    up, up_change = _lowest(sides.up, sides.up_change, middle, holds)
    down, down_change = _lowest(*braking, middle, holds)
    if not everywhere:
        is_known = _is_positive(up, up_change, x) & _is_positive(down, down_change, x)
        up, down = jnp.where(is_known, up, 1.0), jnp.where(is_known, down, 1.0)

    def work(start, change):
        return (x[1:] - x[:-1]) * (start + change * middle)

    gained = jnp.concatenate([jnp.zeros_like(x[:1]), jnp.cumsum(work(up, up_change))])
    lost = jnp.concatenate([jnp.cumsum(work(down, down_change)[::-1])[::-1], jnp.zeros_like(x[:1])])
    # Braking starts in the first interval at whose end more energy is gained than braking can remove.
    i = jnp.clip(jnp.argmax(gained >= lost) - 1, 0, len(middle) - 1)
    linear = up[i] + down[i] + (up_change[i] + down_change[i]) * x[i]
    square, missing = 0.5 * (up_change[i] + down_change[i]), jnp.maximum(lost[i] - gained[i], 0.0)
    step = 2.0 * missing / (linear + jnp.sqrt(jnp.maximum(linear**2 + 4.0 * square * missing, 0.0)))
    switch = x[i] + step
    early = _time(jnp.minimum(x, switch), x, gained[:-1], up, up_change)
    # Reverse braking in time, so that speeds increase along it as well.
    late = _time(
        1.0 - jnp.maximum(x, switch)[::-1],
        1.0 - x[::-1],
        lost[::-1][:-1],
        (down + down_change)[::-1],
        -down_change[::-1],
    )
    return early + late if everywhere else jnp.where(is_known.all(), early + late, 0.0)


def _is_positive(start: Array, change: Array, nodes: Array) -> Array:
    # Tell for each interval whether its bound is finite, and positive at both ends.
    ends = start + change * nodes[:-1], start + change * nodes[1:]
    return jnp.isfinite(start) & ((jnp.minimum(*ends) > 0.0) | (nodes[1:] <= nodes[:-1]))


def _crossings(start: Array, change: Array) -> Array:
    first, second = np.triu_indices(len(start), 1)
    start_gap, change_gap = start[second] - start[first], change[first] - change[second]
    crosses = jnp.isfinite(start_gap) & (change_gap != 0.0)
    point = jnp.where(crosses, start_gap, 1.0) / jnp.where(crosses, change_gap, 1.0)
    return jnp.clip(point, 0.0, 1.0)


def _lowest(start: Array, change: Array, points: Array, holds: Array | None) -> tuple[Array, Array]:
    values = start[None] + change[None] * points[:, None]
    if holds is None:
        index = jnp.argmin(values, axis=1)
        return start[index], change[index]
    values = jnp.where(holds, values, jnp.inf)
    index = jnp.argmin(values, axis=1)
    return jnp.where(jnp.isfinite(minimum_of(values, axis=1)), start[index], jnp.inf), change[index]


def _time(ends: Array, nodes: Array, energy: Array, start: Array, change: Array) -> Array:
    # Return the total time from node to node, up to the ends, for s'' = start + change * s; `energy` is s'^2 / 2 at the
    # first node of each interval.
    low, high = ends[:-1], ends[1:]

    def speed(s):
        gone = s - nodes[:-1]
        return jnp.sqrt(jnp.maximum(2.0 * (energy + gone * (start + change * (nodes[:-1] + 0.5 * gone))), 0.0))

    v0, v1, a0, a1 = speed(low), speed(high), start + change * low, start + change * high
    length, rate = high - low, jnp.sqrt(jnp.abs(change))
    is_flat = rate**2 * length <= 1e-14 * (jnp.abs(a0) + jnp.abs(a1))
    k = jnp.where(is_flat, 1.0, rate)
    even = 2.0 * length / jnp.where(v0 + v1 > 0.0, v0 + v1, 1.0)
    base = a0 + k * v0
    growing = jnp.log1p((k * (v1 - v0) + k**2 * length) / jnp.where(base > 0.0, base, 1.0)) / k
    turning = jnp.arctan2(k * (v1 * a0 - v0 * a1), a0 * a1 + k**2 * v0 * v1) / k
    each = jnp.where(is_flat, even, jnp.where(change > 0.0, growing, turning))
    return jnp.sum(jnp.where(length > 0.0, each, 0.0))
