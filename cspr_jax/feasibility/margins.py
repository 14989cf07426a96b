"""The margin of a segment: the smallest slack it attains, refined between the samples."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.feasibility.blocks import INTERVALS, blocks, over_blocks
from cspr_jax.feasibility.certificate import BATCH, Shared
from cspr_jax.feasibility.criteria import slacks
from cspr_jax.feasibility.limits import given
from cspr_jax.grids import in_batches
from cspr_jax.trajectories.hypocycloid import Segment

ZOOM = 1.0 / 16.0


def vertex(left: Array, middle: Array, right: Array) -> Array:
    """Where the parabola through three equidistant values is smallest, in steps from the middle one.

    Args:
        left: () value one step before.
        middle: () value.
        right: () value one step after.

    Returns:
        () in [-1, 1]; an end where the parabola has no minimum inside.
    """
    bend = left - 2.0 * middle + right
    move = 0.5 * (left - right) / jnp.where(bend > 0.0, bend, 1.0)
    return jnp.clip(jnp.where(bend > 0.0, move, jnp.sign(left - right)), -1.0, 1.0)


def refined_minimum(function, tau: Array, values: Array) -> Array:
    """Smallest value of a smooth function near its smallest sample, by two parabolas, the second 16 times narrower.

    Args:
        function: () -> ().
        tau: (n,) equidistant, n >= 3.
        values: (n,) of the function there.

    Returns:
        () a value that the function attains, at most the smallest sample; its distance from the
        minimum is of sixth order in the step.
    """
    i = jnp.clip(jnp.argmin(values), 1, len(tau) - 2)
    step = tau[1] - tau[0]
    near = jnp.clip(tau[i] + step * vertex(values[i - 1], values[i], values[i + 1]), tau[0], tau[-1])
    close = jnp.clip(near + ZOOM * step * jnp.array([-1.0, 0.0, 1.0]), tau[0], tau[-1])
    f = jax.vmap(function)(close)
    nearer = jnp.clip(close[1] + ZOOM * step * vertex(f[0], f[1], f[2]), tau[0], tau[-1])
    return jnp.minimum(jnp.minimum(jnp.min(values), jnp.min(f)), function(nearer))


def _block_minima(
    function, shared: Shared, segment: Segment, arcs: Array, start: Array, stop: Array
) -> tuple[Array, ...]:
    weight = jnp.arange(INTERVALS + 1, dtype=arcs.dtype) / INTERVALS
    tau = start * (1.0 - weight) + stop * weight
    values = jax.vmap(partial(function, *shared, segment, arcs))(tau)
    return tuple(
        refined_minimum(lambda t, which=which: function(*shared, segment, arcs, t)[which], tau, v)
        for which, v in enumerate(values)
    )


@partial(jax.jit, static_argnums=(0, 1))
def _minima(function, n_values: int, shared: Shared, edges: Array, counts: Array, arguments) -> Array:
    segments, arcs = arguments

    def step(state, start, stop):
        found = jax.vmap(partial(_block_minima, function, shared))(segments, arcs, start, stop)
        return jnp.minimum(state, jnp.stack(found))

    nothing = jnp.full((n_values, *arcs.shape), jnp.inf, arcs.dtype)
    return over_blocks(edges, counts, arcs, nothing, step).T


def smallest_values(function, n_values: int, shared: Shared, segments: Segment, arcs: np.ndarray, table) -> np.ndarray:
    """Smallest values along each segment of functions of one instant, refined between samples.

    Args:
        function: (robot, limits, amplitude, segment, arcs, tau) -> n_values numbers (); hashable.
        n_values: how many.
        shared: robot, limits and amplitude.
        segments: leaves (n, ...), of the parity of `arcs`.
        arcs: (n,) number of arcs, 1 or more.
        table: blocks to sample, from `blocks.blocks`.

    Returns:
        (n, n_values).
    """
    arcs = np.asarray(arcs, float)
    order = np.argsort(arcs, kind="stable")
    arguments = jax.tree.map(lambda x: x[order], (segments, arcs))
    found = in_batches(partial(_minima, function, n_values, shared, *table), arguments, size=BATCH)
    return found[np.argsort(order, kind="stable")]


def margins(shared: Shared, segments: Segment, arcs: np.ndarray) -> np.ndarray:
    """Smallest slack of each criterion along each segment.

    The smallest sample of every block is refined, so the value does not depend on where the samples lie.

    Args:
        shared: robot, limits and amplitude.
        segments: leaves (n, ...), of the parity of `arcs`.
        arcs: (n,) number of arcs, 1 or more.

    Returns:
        (n, n_criteria) in the order of `criteria.flags`.
    """
    table = blocks(shared.amplitude, int(np.max(arcs)))
    return smallest_values(slacks, 2 + len(given(shared.limits)), shared, segments, arcs, table)
