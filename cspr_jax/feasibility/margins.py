"""The smallest value along a segment of functions of one instant, refined between the samples.

Every block is sampled; where its smallest sample lies, a parabola estimates the minimum. The best
three estimates of a function over all blocks are then refined by two parabolas, each narrower.
"""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from cspr_jax.feasibility.blocks import INTERVALS, blocks, over_blocks
from cspr_jax.feasibility.certificate import BATCH, Shared
from cspr_jax.feasibility.criteria import counts, smooth_slacks
from cspr_jax.grids import in_batches
from cspr_jax.numerics import vertex
from cspr_jax.trajectories.hypocycloid import Segment

CANDIDATES = 3
# Distance of the points of the first refining parabola, in steps between samples, and of the next ones.
FIRST_WIDTH, NARROWER = 1.0 / 4.0, 1.0 / 16.0


def _block_estimates(function, shared: Shared, segment: Segment, arcs: Array, start: Array, stop: Array):
    # For each function: an estimate of its minimum in the block, and where.
    weight = jnp.arange(INTERVALS + 1, dtype=arcs.dtype) / INTERVALS
    tau = start * (1.0 - weight) + stop * weight
    estimates, places = [], []
    for values in jax.vmap(partial(function, *shared, segment, arcs))(tau):
        i = jnp.argmin(values)
        inner = jnp.clip(i, 1, INTERVALS - 1)
        move, estimate = vertex(values[inner - 1], values[inner], values[inner + 1])
        better = estimate < values[i]
        estimates.append(jnp.where(better, estimate, values[i]))
        places.append(jnp.where(better, tau[inner] + move * (tau[1] - tau[0]), tau[i]))
    return jnp.stack(estimates), jnp.stack(places)


def _insert(best: tuple[Array, Array], estimate: Array, place: Array) -> tuple[Array, Array]:
    # Keep the candidates in order, the new one in its place; leaves (CANDIDATES, n_values, n).
    estimates, places = [], []
    for old_estimate, old_place in zip(*best, strict=True):
        first = estimate < old_estimate
        estimates.append(jnp.where(first, estimate, old_estimate))
        places.append(jnp.where(first, place, old_place))
        estimate, place = jnp.where(first, old_estimate, estimate), jnp.where(first, old_place, place)
    return jnp.stack(estimates), jnp.stack(places)


def refined_minimum(function, tau: Array, step: Array) -> Array:
    """Smallest value of a smooth function near an estimated minimum, by two parabolas.

    Args:
        function: () -> ().
        tau: () the estimate.
        step: () distance of the samples that it came from.

    Returns:
        () a value that the function attains.
    """

    def narrow(i, state):
        smallest, at, width = state
        points = jnp.clip(at + width * jnp.array([-1.0, 0.0, 1.0]), 0.0, 1.0)
        values = jax.vmap(function)(points)
        at = jnp.clip(points[1] + width * vertex(*values)[0], 0.0, 1.0)
        return jnp.minimum(smallest, jnp.min(values)), at, width * NARROWER

    first = (jnp.full_like(tau, jnp.inf), tau, step * FIRST_WIDTH)
    # The third round evaluates where the second ended.
    return lax.fori_loop(0, 3, narrow, first)[0]


class Functions(NamedTuple):
    """Functions of one instant, whose smallest values are wanted.

    Fields:
        evaluate: (robot, limits, amplitude, segment, arcs, tau) -> `number` numbers (); hashable.
        number: how many.
        refined: of how many, from the first, the minimum is refined to a value that is attained; the
            others stay the estimates of parabolas through the samples.
    """

    evaluate: Callable
    number: int
    refined: int


@partial(jax.jit, static_argnums=0)
def _minima(functions: Functions, shared: Shared, edges: Array, counts: Array, arguments) -> Array:
    segments, arcs = arguments
    evaluate, _, n_refined = functions

    def step(state, start, stop):
        found = jax.vmap(partial(_block_estimates, evaluate, shared), out_axes=1)(segments, arcs, start, stop)
        return _insert(state, *found)

    nothing = jnp.full((CANDIDATES, functions.number, *arcs.shape), jnp.inf, arcs.dtype)
    estimates, places = over_blocks(edges, counts, arcs, (nothing, jnp.zeros_like(nothing)), step)
    steps = 1.0 / (INTERVALS * counts[arcs.astype(jnp.int32)])

    def refine(segment, p, place, width):
        # place: (CANDIDATES, n_refined). One copy of the function serves all of its values: it compiles much faster.
        def one(which, tau):
            return refined_minimum(lambda t: jnp.stack(evaluate(*shared, segment, p, t)[:n_refined])[which], tau, width)

        return jnp.min(jax.vmap(jax.vmap(one), in_axes=(None, 0))(jnp.arange(n_refined), place), axis=0)

    refined = jax.vmap(refine, in_axes=(0, 0, 2, 0))(segments, arcs, places[:, :n_refined], steps)
    return jnp.concatenate([refined, estimates[0, n_refined:].T], axis=1)


def smallest_values(
    functions: Functions, shared: Shared, segments: Segment, arcs: np.ndarray, table, *, batch: int = BATCH
) -> np.ndarray:
    """Smallest values along each segment of functions of one instant.

    Args:
        functions: of one instant.
        shared: robot, limits and amplitude.
        segments: leaves (n, ...), of the parity of `arcs`.
        arcs: (n,) number of arcs, 1 or more.
        table: blocks to sample, from `blocks.blocks`.
        batch: segments computed at a time.

    Returns:
        (n, functions.number).
    """
    arcs = np.asarray(arcs, float)
    order = np.argsort(arcs, kind="stable")
    arguments = jax.tree.map(lambda x: x[order], (segments, arcs))
    found = in_batches(partial(_minima, functions, shared, *table), arguments, size=batch)
    return found[np.argsort(order, kind="stable")]


def margins(shared: Shared, segments: Segment, arcs: np.ndarray) -> np.ndarray:
    """Smallest slack of each criterion along each segment.

    The smallest sample of every block is refined, so the value does not depend on where the samples lie.

    Args:
        shared: robot, limits and amplitude.
        segments: leaves (n, ...), of the parity of `arcs`.
        arcs: (n,) number of arcs, 1 or more.

    Returns:
        (n, n_criteria) in the order of `criteria.flags`; NaN where the motion is not finite.
    """
    table = blocks(shared.amplitude, int(np.max(arcs)))
    groups = counts(shared.robot, shared.limits)
    # The smallest over the cables has kinks, each cable's own slack has none: they are refined apart.
    # Limits are many: their slacks stay estimates.
    functions = Functions(smooth_slacks, sum(groups), sum(groups[:2]))
    every = smallest_values(functions, shared, segments, arcs, table)
    smallest = np.minimum.reduceat(every, np.cumsum([0, *groups[:-1]]), axis=1)
    # A compiled minimum may pass over NaN; what has no finite minimum has none.
    return np.where(np.isfinite(smallest), smallest, np.nan)
