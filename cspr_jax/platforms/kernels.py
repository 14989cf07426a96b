"""Compiled criteria of many motions of a platform at instants, one lane an instant of a segment."""

from functools import partial

import jax
import jax.numpy as jnp
from jax import Array

from cspr_jax.arithmetic.lanes import dot, smallest
from cspr_jax.motions.platform_kind import PlatformMotionKind
from cspr_jax.motions.problem import Problem
from cspr_jax.platforms.platform_segment_lanes import instant, state
from cspr_jax.platforms.slack_lanes import moving_slacks, order, still_slacks
from cspr_jax.robots import interference_lanes
from cspr_jax.robots.wrench_lanes import cables


@partial(jax.jit, static_argnames=("pairs", "kind"))
def slacks_at(problem: Problem, items, *, pairs: tuple, kind: PlatformMotionKind) -> tuple[Array, ...]:
    """Slacks and distances between cables at instants.

    Args:
        problem: robot, limits, amplitude.
        items: segments (leaves (n, ...)), arcs (n,), instants (n,).
        pairs: of cables that can meet.

    Returns:
        n_criteria + 1 times (n,): slacks in the order of `slacks.flags`, infinite where the fast balance has too few
        digits; the smallest distance between cables, m.
    """
    segments, arcs, tau = items
    instant_lanes = instant(problem.amplitude, segments.sense, arcs, tau)
    here = state(segments, arcs, instant_lanes, kind)
    wires = cables(problem.robot, here.position, here.turn)
    slacks = [
        *moving_slacks(problem, segments, arcs, instant_lanes, kind),
        *still_slacks(problem, segments, here, wires),
    ]
    squares = [dot(gap, gap) for gap in interference_lanes.gaps(problem.robot.base_points, pairs, wires)]
    nearest = jnp.sqrt(smallest(squares)) if squares else jnp.full_like(segments.rate, jnp.inf)
    # Not stacked: XLA would compute all of them for each.
    return *(slacks[k] for k in order(problem.limits)), nearest
