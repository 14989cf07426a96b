"""Smallest values of functions of time along a segment, refined between the samples.

Every block is sampled, and a parabola at its smallest sample estimates the minimum. The best three
estimates of a group of functions over all blocks are then refined by ever narrower parabolas.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from cspr_jax.families.swings.hypocycloid import Segment
from cspr_jax.families.swings.proof.blocks import INTERVALS, blocks, over_blocks
from cspr_jax.families.swings.proof.criteria import BASIC, counts, smooth_slacks
from cspr_jax.families.swings.proof.verdicts import OF_PLANS, SMALL, length
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.elementary import minimum_of, vertex
from cspr_jax.numerics.linear.lanes import materialized, smallest_of_each
from cspr_jax.numerics.shapes import Float, Num
from cspr_jax.runtime.persistent_jit import persistent_jit

CANDIDATES = 3
# The last 16 bits of an estimate store its time, to 1/4096 of the distance of samples; estimates are capped.
LAST_BITS = 2**16 - 1
LARGEST = 1e300
# Point distance of the first refining parabola, in steps between samples, and the factor for each next one.
FIRST_WIDTH = 1.0 / 4.0
NARROWER = 1.0 / 6.0
ROUNDS = 7


def _block_estimates(function, problem: Problem, segments: Segment, arcs: Array, start: Array, stop: Array):
    # Return for each function an estimate of its minimum in one block of each segment, and its time; (n_functions, n).
    weight = (jnp.arange(INTERVALS + 1, dtype=arcs.dtype) / INTERVALS)[:, None]
    tau = start[None] * (1.0 - weight) + stop[None] * weight
    sampled = partial(jax.vmap(jax.vmap(partial(function, *problem)), in_axes=(None, None, 0)), segments, arcs)
    # Lay a parabola through every three neighbours: the lowest sample may belong to the valley of another block. From
    # arrays XLA would recompute everything that several functions share.
    each = map(vertex, sampled(tau[:-2]), sampled(tau[1:-1]), sampled(tau[2:]))
    marked = smallest_of_each([_marked(estimate, weight[1:-1] + move / INTERVALS) for move, estimate in each])
    estimates, fractions = _unmarked(jnp.stack(marked))
    return estimates, start[None] * (1.0 - fractions) + stop[None] * fractions


def _marked(estimates: Array, fractions: Array) -> Array:
    # Store a time from 0 to 1 in the last bits of an estimate, so that the smallest estimate tells its time. XLA
    # computes an argmin one number at a time, and several minima in one loop only if nothing else is computed.
    numbers = jnp.where(estimates < LARGEST, estimates, LARGEST)  # neither is NaN
    bits = jnp.round(fractions * LAST_BITS).astype(jnp.int64)
    return lax.bitcast_convert_type(lax.bitcast_convert_type(numbers, jnp.int64) & ~LAST_BITS | bits, jnp.float64)


def _unmarked(marked: Array) -> tuple[Array, Array]:
    bits = lax.bitcast_convert_type(marked, jnp.int64)
    return lax.bitcast_convert_type(bits & ~LAST_BITS, jnp.float64), (bits & LAST_BITS).astype(jnp.float64) / LAST_BITS


def _insert(best: tuple[Array, Array], estimate: Array, at: Array) -> tuple[Array, Array]:
    # Insert a candidate, keeping the order; leaves (CANDIDATES, n_values, n). Segments with fewer blocks than others
    # repeat their last block: a time among the candidates is not inserted again.
    estimate = jnp.where((best[1] == at[None]).any(0), jnp.inf, estimate)
    estimates, times = [], []
    for old_estimate, old_at in zip(*best, strict=True):
        first = estimate < old_estimate
        estimates.append(jnp.where(first, estimate, old_estimate))
        times.append(jnp.where(first, at, old_at))
        estimate, at = jnp.where(first, old_estimate, estimate), jnp.where(first, old_at, at)
    return jnp.stack(estimates), jnp.stack(times)


def refined_minimum(
    function: Callable[[Array], Array],
    tau: Float[Array, ""],
    step: Float[Array, ""],
    one: Float[Array, ""] | None = None,
) -> Float[Array, ""]:
    """Smallest value of a continuous function near an estimated minimum, by ever narrower parabolas.

    A parabola is used only if its middle point is the lowest of the three; else the points move to the lowest. So
    minima that are steep on one side, or next to a kink, are found as well.
    """

    def narrow(i, state):
        smallest, at, width = state
        middle_point = jnp.clip(at, width, 1.0 - width)  # equidistant points within the motion
        points = jnp.stack([middle_point - width, middle_point, middle_point + width])
        left, middle, right = materialized(jax.vmap(function)(points), one)
        bracketed = (middle <= left) & (middle <= right)
        lower = jnp.where(left < right, points[0], points[2])
        at = jnp.where(bracketed, middle_point + width * vertex(left, middle, right)[0], lower)
        is_narrower = bracketed | (lower <= 0.0) | (lower >= 1.0)
        width = jnp.where(is_narrower, width * NARROWER, width)
        return jnp.minimum(smallest, jnp.minimum(middle, jnp.minimum(left, right))), at, width

    first = (jnp.full_like(tau, jnp.inf), tau, step * FIRST_WIDTH)
    # The last round evaluates the function where the previous one ended.
    return lax.fori_loop(0, ROUNDS, narrow, first)[0]


class Functions(NamedTuple):
    """Smooth functions of time in groups; the smallest value of each group is searched for.

    Fields:
        evaluate: (robot, limits, amplitude, segment, arcs, tau) -> values (), group by group; hashable.
        groups: number of functions in each group.
    """

    evaluate: Callable
    groups: tuple[int, ...]


def _best_of_groups(groups: tuple[int, ...], estimates: Array, times: Array) -> tuple[Array, Array]:
    # Choose the best candidates of each group, among all of its functions: index of the function, and time,
    # (n_groups, CANDIDATES, n) each, from (CANDIDATES, n_functions, n).
    functions, taus, first = [], [], 0
    for n in groups:
        columns = slice(first, first + n)
        values, where = (x[:, columns].reshape(CANDIDATES * n, -1) for x in (estimates, times))
        number = jnp.broadcast_to(jnp.arange(CANDIDATES * n)[:, None], values.shape)
        for _ in range(CANDIDATES):
            is_lowest = values == minimum_of(values, axis=0, keepdims=True)
            chosen = minimum_of(jnp.where(is_lowest, number, CANDIDATES * n), axis=0)
            is_chosen = number == chosen[None]
            functions.append(first + chosen % n)
            taus.append(jnp.sum(jnp.where(is_chosen, where, 0.0), axis=0))
            values = jnp.where(is_chosen, jnp.inf, values)
        first += n
    shape = (len(groups), CANDIDATES, -1)
    return jnp.stack(functions).reshape(shape), jnp.stack(taus).reshape(shape)


def _chosen(values: Sequence[Array], number: Array) -> Array:
    # Select one of several numbers. From an array XLA would recompute what they share for each of them.
    chosen = values[0]
    for i, value in enumerate(values[1:], 1):
        chosen = jnp.where(number == i, value, chosen)
    return chosen


@persistent_jit(static_argnames="functions")
def _minima(functions: Functions, problem: Problem, edges: Array, counts: Array, one: Array, arguments) -> Array:
    segments, arcs = arguments
    evaluate, groups = functions

    def step(state, start, stop):
        return _insert(state, *_block_estimates(evaluate, problem, segments, arcs, start[0], stop[0]))

    nothing = jnp.full((CANDIDATES, sum(groups), *arcs.shape), jnp.inf, arcs.dtype)
    nowhere = jnp.full_like(nothing, -1.0)
    estimates, times = over_blocks(edges, counts, arcs, (nothing, nowhere), step)
    number, where = _best_of_groups(groups, estimates, times)
    steps = 1.0 / (INTERVALS * counts[arcs.astype(jnp.int32)]).astype(arcs.dtype)

    def refine(segment, p, number, where, width):
        # Shapes are (n_groups, CANDIDATES). One copy of the function serves all, which compiles much faster.
        def minimum(number, tau):
            return refined_minimum(lambda t: _chosen(evaluate(*problem, segment, p, t), number), tau, width, one)

        return minimum_of(jax.vmap(jax.vmap(minimum))(number, where), axis=1)

    return jax.vmap(refine, in_axes=(0, 0, 2, 2, 0))(segments, arcs, number, where, steps)


def smallest_values(
    functions: Functions, problem: Problem, segments: Segment, arcs: Num[np.ndarray, "n"], table
) -> Float[np.ndarray, "n n_groups"]:
    """Smallest values of functions of time along each segment."""
    arcs = np.asarray(arcs, float)
    order = np.argsort(arcs, kind="stable")
    arguments = jax.tree.map(lambda x: x[order], (segments, arcs))
    kernel = partial(_minima, functions, problem, *table, 1.0)
    minima = in_batches(kernel, arguments, batch_size=length(problem, len(arcs), OF_PLANS))
    return minima[np.argsort(order, kind="stable")]


def margins(problem: Problem, segments: Segment, arcs: Num[np.ndarray, "n"]) -> Float[np.ndarray, "n n_criteria"]:
    """Smallest slack of each criterion along each segment.

    The smallest sample of every block is refined, so the value does not depend on the times of samples. For many
    segments with limits, if all slacks are positive, the first two columns both hold the smaller slack of cables and
    depth, and all others the smallest slack of limits: refining two numbers takes less time.
    """
    groups = counts(problem.robot, problem.limits)
    if len(groups) == BASIC or len(arcs) <= SMALL:
        return each_margin(problem, segments, arcs)
    table = blocks(problem.amplitude, int(np.max(arcs)))
    both = sum(groups[:BASIC]), sum(groups[BASIC:])
    minimum = smallest_values(Functions(smooth_slacks, both), problem, segments, arcs, table)
    smallest = np.repeat(minimum, [BASIC, len(groups) - BASIC], axis=1)
    unclear = np.flatnonzero(~(np.isfinite(minimum) & (minimum > 0.0)).all(1))
    if len(unclear):
        part, numbers = jax.tree.map(lambda array: np.asarray(array)[unclear], (segments, np.asarray(arcs)))
        smallest[unclear] = each_margin(problem, part, numbers)
    return smallest


def each_margin(problem: Problem, segments: Segment, arcs: Num[np.ndarray, "n"]) -> Float[np.ndarray, "n n_criteria"]:
    """Smallest slack of each criterion along each segment, each refined by itself, unlike in `margins`."""
    # The minimum over cables has kinks, the slack of each cable has none.
    table = blocks(problem.amplitude, int(np.max(arcs)))
    functions = Functions(smooth_slacks, counts(problem.robot, problem.limits))
    smallest = smallest_values(functions, problem, segments, arcs, table)
    # A compiled minimum may ignore NaN; if it is not finite, the function has no minimum.
    return np.where(np.isfinite(smallest), smallest, np.nan)
