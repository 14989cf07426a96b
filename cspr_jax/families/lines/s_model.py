"""Least duration of the S-model along a straight line, and of any motion along it.

With the ratio r = p / T the S-model has s = r S(x) and s'' = A(x) / (r T^2) while it accelerates, x from 0 to 1, with
A = 8 x and S = 4/3 x^3 up to the middle. A bound s'' <= b + m s is met while 1 / T^2 <= min of r (b + m r S) / A over
x, which has a closed form; braking is the same from the end with 1 - r. The first grows with r and the second falls,
so that 1 / T^2 is largest where they meet. Whatever the law, nothing is faster than to accelerate at the bound and
then to brake at it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from cspr_jax.families.lines.faces import Sides
from cspr_jax.motion.amplitudes import Amplitude, derivatives
from cspr_jax.numerics.search.minima import Bracket, golden_step, inner_points

if TYPE_CHECKING:
    from jaxtyping import Float

ROUNDS = 24
# Samples of half a motion by a law without a parameter, and golden sections between two of them.
SAMPLES, SECTIONS = 128, 48
# Share by which a least duration is made longer, so that its margin is above rounding.
LONGER = 1e-8


def _gain(ratio: Array, start: Array, slope: Array, touching: bool) -> Array:
    # The largest 1 / T^2 of one half of the S-model under each bound, (n,).
    corner = 0.25 * ratio * (start + slope * ratio / 6.0)
    if not touching:
        return corner
    # A rising bound may touch the curve before its corner, at x < 1/2.
    rising = (slope > 0.0) & (3.0 * start < slope * ratio)
    place = jnp.cbrt(jnp.where(rising, 3.0 * start / (8.0 * jnp.where(rising, slope * ratio, 1.0)), 0.125))
    return jnp.where(rising, 3.0 / 16.0 * ratio * start / jnp.where(place > 0.0, place, 1.0), corner)


class Least(NamedTuple):
    """The S-model of least duration along a line; () each.

    Fields:
        ratio: p / T.
        duration: T, s; inf where nothing is feasible.
        up: number of the bound that holds the acceleration back.
        down: number of the bound that holds the braking back.
    """

    ratio: Array
    duration: Array
    up: Array
    down: Array


def least_s_curve(sides: Sides, *, touching: bool = True) -> Least:
    """The S-model of least duration."""

    def gains(ratio):
        up = _gain(ratio, sides.up, sides.up_slope, touching)
        return up, _gain(1.0 - ratio, sides.down, sides.down_slope, touching)

    def step(_, place):
        # Newton's method for log(up / down) over the logit of the ratio, in which it is nearly a line.
        ratio = jax.nn.sigmoid(place)
        (up, down), (up_rate, down_rate) = jax.jvp(gains, (ratio,), (jnp.ones_like(ratio),))
        i, j = jnp.argmin(up), jnp.argmin(down)
        slope = ratio * (1.0 - ratio) * (up_rate[i] / up[i] - down_rate[j] / down[j])
        move = (jnp.log(up[i]) - jnp.log(down[j])) / slope
        return place - jnp.clip(jnp.where(jnp.isfinite(move), move, 0.0), -3.0, 3.0)

    ratio = jax.nn.sigmoid(lax.fori_loop(0, ROUNDS, step, jnp.zeros_like(sides.up[0])))
    up, down = gains(ratio)
    gain = jnp.minimum(jnp.min(up), jnp.min(down))
    duration = jnp.where(gain > 0.0, 1.0 / jnp.sqrt(jnp.where(gain > 0.0, gain, 1.0)), jnp.inf)
    return Least(ratio, duration, jnp.argmin(up), jnp.argmin(down))


def thesis_s_curve(sides: Sides) -> Least:
    """The S-model by the rule of the text: both branches for Q3, the one with the smaller path coordinate."""
    first = least_s_curve(sides, touching=False)
    start, slope = sides.up[first.up], sides.up_slope[first.up]
    # 1 / T^2 on the line of Q3 alone is largest at r = -3 b / m.
    apex = jnp.where(slope < 0.0, -3.0 * start / jnp.where(slope < 0.0, slope, 1.0), jnp.inf)
    ratio = jnp.where(apex < first.ratio, apex, first.ratio)
    gain = _gain(ratio, start, slope, False)
    duration = jnp.where(apex < first.ratio, 1.0 / jnp.sqrt(gain), first.duration)
    return Least(ratio, duration, first.up, first.down)


def least_of_law(law: Amplitude, sides: Sides) -> Least:
    """Least duration by a law without a parameter."""
    tau = jnp.linspace(0.0, 0.5, SAMPLES + 1)[1:-1]

    def smallest(start, slope):
        def gain(tau):
            s, _, second_derivative = derivatives(law, tau, order=2)
            return jnp.where(jnp.isfinite(start), start + slope * s, jnp.inf) / second_derivative

        values = jax.vmap(gain)(tau)  # (n_samples, n_bounds)
        width = tau[1] - tau[0]
        middle = tau[jnp.argmin(values, axis=0)]
        high = jnp.minimum(middle + width, 0.5 - 1e-9)

        def at(places):
            return jnp.diagonal(jax.vmap(gain)(places))

        low = jnp.maximum(middle - width, 0.0)
        left, right = inner_points(low, high)
        first = Bracket(low, high, left, right, at(left), at(right))
        last = lax.fori_loop(0, SECTIONS, lambda _, bracket: golden_step(at, bracket, left_if_equal=False)[0], first)
        narrow = jnp.minimum(jnp.minimum(last.at_left, last.at_right), at(low))
        return jnp.minimum(narrow, jnp.min(values, axis=0))

    up, down = smallest(sides.up, sides.up_slope), smallest(sides.down, sides.down_slope)
    gain = jnp.minimum(jnp.min(up), jnp.min(down))
    duration = jnp.where(gain > 0.0, 1.0 / jnp.sqrt(jnp.where(gain > 0.0, gain, 1.0)), jnp.inf)
    return Least(jnp.full_like(gain, 0.5), duration, jnp.argmin(up), jnp.argmin(down))


def least_time(sides: Sides, *, everywhere: bool = True) -> Float[Array, ""]:
    """Least duration of any motion along a line from rest to rest: it accelerates at the bound, then brakes at it."""
    braking = (sides.down + sides.down_slope, -sides.down_slope)  # over s
    parts = [] if everywhere else [sides.first, sides.last]
    nodes = jnp.concatenate([_crossings(sides.up, sides.up_slope), _crossings(*braking), *parts])
    x = jnp.sort(jnp.concatenate([jnp.array([0.0, 1.0]), nodes]))
    middle = 0.5 * (x[:-1] + x[1:])
    holds = None if everywhere else (sides.first[None] <= middle[:, None]) & (middle[:, None] <= sides.last[None])
    up, up_slope = _lowest(sides.up, sides.up_slope, middle, holds)
    down, down_slope = _lowest(*braking, middle, holds)
    if not everywhere:
        known = _is_positive(up, up_slope, x) & _is_positive(down, down_slope, x)
        up, down = jnp.where(known, up, 1.0), jnp.where(known, down, 1.0)

    def work(start, slope):
        return (x[1:] - x[:-1]) * (start + slope * middle)

    gained = jnp.concatenate([jnp.zeros_like(x[:1]), jnp.cumsum(work(up, up_slope))])
    lost = jnp.concatenate([jnp.cumsum(work(down, down_slope)[::-1])[::-1], jnp.zeros_like(x[:1])])
    # The switch lies in the first interval at whose end more is gained than can be lost.
    i = jnp.clip(jnp.argmax(gained >= lost) - 1, 0, len(middle) - 1)
    linear = up[i] + down[i] + (up_slope[i] + down_slope[i]) * x[i]
    square, missing = 0.5 * (up_slope[i] + down_slope[i]), jnp.maximum(lost[i] - gained[i], 0.0)
    step = 2.0 * missing / (linear + jnp.sqrt(jnp.maximum(linear**2 + 4.0 * square * missing, 0.0)))
    switch = x[i] + step
    early = _time(jnp.minimum(x, switch), x, gained[:-1], up, up_slope)
    # Braking is seen from the end, so that speeds grow along it as well.
    late = _time(
        1.0 - jnp.maximum(x, switch)[::-1], 1.0 - x[::-1], lost[::-1][:-1], (down + down_slope)[::-1], -down_slope[::-1]
    )
    return early + late if everywhere else jnp.where(known.all(), early + late, 0.0)


def _is_positive(start: Array, slope: Array, nodes: Array) -> Array:
    # Tell for each interval whether its bound is finite, and positive at both ends.
    ends = start + slope * nodes[:-1], start + slope * nodes[1:]
    return jnp.isfinite(start) & ((jnp.minimum(*ends) > 0.0) | (nodes[1:] <= nodes[:-1]))


def _crossings(start: Array, slope: Array) -> Array:
    first, second = np.triu_indices(len(start), 1)
    fall, rise = start[second] - start[first], slope[first] - slope[second]
    crosses = jnp.isfinite(fall) & (rise != 0.0)
    place = jnp.where(crosses, fall, 1.0) / jnp.where(crosses, rise, 1.0)
    return jnp.clip(place, 0.0, 1.0)


def _lowest(start: Array, slope: Array, places: Array, holds: Array | None) -> tuple[Array, Array]:
    values = start[None] + slope[None] * places[:, None]
    if holds is None:
        index = jnp.argmin(values, axis=1)
        return start[index], slope[index]
    values = jnp.where(holds, values, jnp.inf)
    index = jnp.argmin(values, axis=1)
    return jnp.where(jnp.isfinite(values.min(1)), start[index], jnp.inf), slope[index]


def _time(ends: Array, nodes: Array, energy: Array, start: Array, slope: Array) -> Array:
    # Sum of the times from node to node, up to the stops, of s'' = start + slope * s with s'^2 / 2 = energy at the
    # first node of each interval.
    low, high = ends[:-1], ends[1:]

    def speed(s):
        gone = s - nodes[:-1]
        return jnp.sqrt(jnp.maximum(2.0 * (energy + gone * (start + slope * (nodes[:-1] + 0.5 * gone))), 0.0))

    v0, v1, a0, a1 = speed(low), speed(high), start + slope * low, start + slope * high
    length, rate = high - low, jnp.sqrt(jnp.abs(slope))
    is_flat = rate**2 * length <= 1e-14 * (jnp.abs(a0) + jnp.abs(a1))
    k = jnp.where(is_flat, 1.0, rate)
    even = 2.0 * length / jnp.where(v0 + v1 > 0.0, v0 + v1, 1.0)
    base = a0 + k * v0
    growing = jnp.log1p((k * (v1 - v0) + k**2 * length) / jnp.where(base > 0.0, base, 1.0)) / k
    turning = jnp.arctan2(k * (v1 * a0 - v0 * a1), a0 * a1 + k**2 * v0 * v1) / k
    each = jnp.where(is_flat, even, jnp.where(slope > 0.0, growing, turning))
    return jnp.sum(jnp.where(length > 0.0, each, 0.0))
