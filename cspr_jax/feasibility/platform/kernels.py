"""Compiled criteria of many motions of a platform at once, one lane a segment."""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import Array, lax

from cspr_jax.arithmetic.lanes import dot, smallest, stored
from cspr_jax.arithmetic.minima import Bracket, golden_step, inner_points
from cspr_jax.feasibility.platform.slack_lanes import moving_slacks, still_slacks
from cspr_jax.feasibility.problem import Problem
from cspr_jax.robots import contact_lanes
from cspr_jax.robots.wrench_lanes import cables
from cspr_jax.trajectories.platform_lanes import Instant, instant, instant_of_arc, state
from cspr_jax.trajectories.platform_segment import Kind, PoseSegment

# Steps between which a gap or a cable turns by more than this angle are to be halved.
LEAST_COSINE = 0.8
# Arcs of a call from which on a loop is unrolled.
UNROLLED = 1024
# Golden sections: the bracket shrinks to a 500th.
SECTIONS = 13


class StillSamples(NamedTuple):
    """Criteria of n poses on their way along an arc that depend on the pose alone, and their cables in between.

    Fields:
        values: (m, n_values, n) still slacks, and the smallest distance between cables, m.
        hit: (n,) whether a cable passed over the platform in a step that needs no halving.
        wide: (m - 1, n) steps to be halved.
    """

    values: Array
    hit: Array
    wide: Array


@partial(jax.jit, static_argnames="kind")
def moving_along(problem: Problem, within: Array, arcs, *, kind: Kind) -> Array:
    """The criteria that depend on the motion, along arcs of many segments.

    Args:
        problem: robot, limits, amplitude.
        within: (m,) places within an arc, from 0 to 1.
        arcs: segments (leaves (n, ...)), their numbers of arcs (n,), and which of them (n,), from 0 on.
        kind: of the motions.

    Returns:
        (m, n_values, n) of `slack_lanes.moving_slacks`.
    """
    segments, count, arc = arcs

    def at(place):
        now = instant_of_arc(problem.amplitude, segments.sense, count, arc, place)
        return moving_slacks(problem, segments, count, now, kind)

    # Stacked once they are there: within a loop XLA would compute all of them for each, a thousand times slower.
    return jnp.stack(lax.map(at, within), axis=1)


def _still(
    problem: Problem, pairs: tuple, segments: PoseSegment, arcs: Array, now: Instant, kind: Kind
) -> tuple[list[Array], list, list]:
    # (n,) each: the still slacks, and the smallest distance between cables; the vectors between cables;
    # the directions of cables.
    one = jnp.where(problem.robot.mass > 0.0, 1.0, 2.0).astype(segments.rate.dtype)
    here = state(segments, arcs, now, kind, one)
    wires = cables(problem.robot, here.position, here.turn)
    wires = wires._replace(rays=stored(wires.rays, one))
    apart = contact_lanes.gaps(problem.robot.base_points, pairs, wires)
    squares = [dot(gap, gap) for gap in apart]
    nearest = jnp.sqrt(smallest(squares)) if squares else jnp.full_like(segments.rate, jnp.inf)
    values = [*still_slacks(problem, segments, here, wires), nearest]
    return values, apart, contact_lanes.cable_directions(wires, here.turn)


@partial(jax.jit, static_argnames=("pairs", "kind"))
def still_along(
    problem: Problem, within: Array, arcs, *, platform: tuple[Array, Array], pairs: tuple, kind: Kind
) -> StillSamples:
    """The criteria that depend on the pose alone, and what meets, along arcs of many segments.

    Args:
        problem: robot, limits, amplitude.
        within: (m,) increasing places within an arc, from 0 to 1.
        arcs: segments (leaves (n, ...)), their numbers of arcs (n,), and which of them (n,), from 0 on.
        platform: sides (n_cables, 2, 3) and normal (3,) of `interference.Contacts`.
        pairs: of cables that can meet.
        kind: of the motions.

    Returns:
        the samples.
    """
    segments, count, arc = arcs

    def at(place):
        now = instant_of_arc(problem.amplitude, segments.sense, count, arc, place)
        return _still(problem, pairs, segments, count, now, kind)

    def step(before, place):
        values, gaps, directions = at(place)
        wide = contact_lanes.turns_much(before[0], gaps, LEAST_COSINE)
        wide |= contact_lanes.turns_much(before[1], directions, LEAST_COSINE)
        hit = contact_lanes.platform_hit(*platform, before[1], directions)
        return (gaps, directions), (values, hit, wide)

    shapes = jax.eval_shape(lambda: at(within[0])[1:])
    start = jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), shapes)
    # Two places a turn: what is carried on is copied half as often. Not where compiling takes longer than computing.
    unroll = 2 if len(arc) >= UNROLLED else 1
    _, (values, hit, wide) = lax.scan(step, start, within, unroll=unroll)
    # There is no step before the first place.
    return StillSamples(jnp.stack(values, axis=1), (hit & ~wide)[1:].any(0), wide[1:])


@partial(jax.jit, static_argnames=("pairs", "kind", "sections"))
def narrowed(problem: Problem, items, *, pairs: tuple | None, kind: Kind, sections: int = SECTIONS) -> Array:
    """The smallest value of one criterion around a sample, by golden sections.

    Args:
        problem: robot, limits, amplitude.
        items: segments (leaves (n, ...)), arcs (n,), instants (n,), half the width of the bracket (n,), and which
            value (n,) of `moving_along`, or of `still_along`.
        pairs: of cables that can meet; None: for `moving_along`.
        kind: of the motions.
        sections: how many; 0: the smaller value of two points inside.

    Returns:
        (n,) a value that is attained.
    """
    segments, arcs, tau, width, which = items

    def at(points):
        now = instant(problem.amplitude, segments.sense, arcs, points)
        if pairs is None:
            values = moving_slacks(problem, segments, arcs, now, kind)
        else:
            values = _still(problem, pairs, segments, arcs, now, kind)[0]
        chosen = values[0]
        for k, value in enumerate(values[1:], start=1):
            chosen = jnp.where(which == k, value, chosen)
        return jnp.where(jnp.isnan(chosen), jnp.inf, chosen)

    low, high = jnp.maximum(tau - width, 0.0), jnp.minimum(tau + width, 1.0)
    left, right = inner_points(low, high)
    at_left, at_right = lax.map(at, jnp.stack([left, right]))

    def section(_, carry):
        bracket, least = carry
        bracket, value = golden_step(at, bracket, left_if_equal=False)
        return bracket, jnp.minimum(least, value)

    start = Bracket(low, high, left, right, at_left, at_right), jnp.minimum(at_left, at_right)
    return lax.fori_loop(0, sections, section, start)[1]


@partial(jax.jit, static_argnames=("pairs", "kind"))
def cable_vectors(problem: Problem, items, *, pairs: tuple, kind: Kind) -> tuple[Array, Array]:
    """The vectors between cables, and the directions of cables, at one instant of each of many segments.

    Args:
        problem: robot, amplitude.
        items: segments (leaves (n, ...)), arcs (n,), instants (n,).
        pairs: of cables that can meet.
        kind: of the motions.

    Returns:
        (n, n_pairs, 3) m, and (n, n_cables, 3).
    """
    segments, arcs, tau = items
    now = instant(problem.amplitude, segments.sense, arcs, tau)
    return contact_lanes.as_arrays(*_still(problem, pairs, segments, arcs, now, kind)[1:])
