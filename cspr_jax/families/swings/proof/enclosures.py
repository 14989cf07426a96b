"""Enclosures of a point mass in motion, for bounds over slightly different robots."""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.families.swings.hypocycloid import Segment, duration, motion
from cspr_jax.families.swings.proof.blocks import INTERVALS
from cspr_jax.families.swings.proof.limit_slacks import motion_bounds
from cspr_jax.families.swings.proof.slacks import interval_bounds, row_bounds, swing_state, taut_bounds
from cspr_jax.motion.problem import Problem, touchable
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.elementary import maximum_of, minimum_of
from cspr_jax.numerics.shapes import Num
from cspr_jax.verification.bounds.blocks import Blocks, parts_of_arcs
from cspr_jax.verification.bounds.enclosures import Distances, Enclosure, Rates, largest_moves
from cspr_jax.verification.robustness.tolerances import Tolerated, tolerated
from cspr_jax.verification.robustness.uncertainty import requirements_of

PARTS = 4  # number of blocks of an arc at first
BATCH = 1024  # number of blocks computed at a time


class _BlockValues(NamedTuple):
    # Values of one block: the first three are in the middle, the others bounds within the block.
    rays: Array
    velocity: Array
    acceleration: Array
    low: Array
    high: Array
    deviation: Array
    velocity_change: Array
    acceleration_change: Array


@jax.jit
def _enclosed(problem: Problem, items) -> _BlockValues:
    return jax.vmap(partial(_block, problem))(*items)


def _block(problem: Problem, segment: Segment, arcs: Array, start: Array, stop: Array) -> _BlockValues:
    robot, amplitude = problem.robot, problem.amplitude
    half, time = 0.5 * (stop - start), duration(segment, arcs)
    over = interval_bounds(segment, amplitude, arcs, start, stop)
    weight = jnp.arange(INTERVALS + 1, dtype=arcs.dtype) / INTERVALS
    states = jax.vmap(lambda tau: swing_state(segment, amplitude, arcs, tau))(start * (1.0 - weight) + stop * weight)
    step = (2.0 * half / INTERVALS) ** 2 / 8.0
    kappa, taut = jnp.stack(states.kappa, axis=1), taut_bounds(segment, arcs, over).curvature * step
    level = row_bounds(segment, arcs, over, segment.tilt).curvature * step
    eta = minimum_of(states.eta) - level, maximum_of(states.eta) + level
    scale = segment.rate / robot.base_points.shape[0]

    def fraction(top, is_low):
        # Bound tensions where eta is positive; divide a negative lower bound by the smallest eta.
        bottom = jnp.where((top > 0.0) == is_low, eta[1], eta[0])
        return jnp.where(eta[0] > 0.0, scale * top / bottom, jnp.where(is_low, -jnp.inf, jnp.inf))

    position, velocity, acceleration = motion(segment, amplitude, arcs, over.middle)
    position_bounds, acceleration_bounds = motion_bounds(segment, arcs, over)
    return _BlockValues(
        position[None] - robot.base_points,
        velocity,
        acceleration,
        fraction(minimum_of(kappa, axis=0) - taut, True),
        fraction(maximum_of(kappa, axis=0) + taut, False),
        0.5 * half * half * position_bounds.curvature,
        half * position_bounds.curvature / time,
        half * acceleration_bounds.derivative / time**2,
    )


@jax.jit
def _durations(items) -> Array:
    return jax.vmap(duration)(*items)


def enclosure(problem: Problem, segments: Segment, arcs: Num[np.ndarray, "n"], blocks: Blocks) -> Enclosure:
    """Enclosure of blocks of motions."""
    items = (*jax.tree.map(lambda x: np.asarray(x)[blocks.row], (segments, arcs.astype(float))), *blocks[1:])
    values: Any = in_batches(partial(_enclosed, problem), items, batch_size=BATCH)
    count, n_cables = values.rays.shape[:2]
    nothing, each = np.zeros(count), (count, n_cables, 3)
    half = 0.5 * (blocks.stop - blocks.start)
    tangent = (half * in_batches(_durations, items[:2], batch_size=BATCH))[:, None] * values.velocity
    moved = largest_moves(tangent, values.deviation)[:, None]
    lengths, longest = np.linalg.norm(values.rays, axis=2), touchable(problem).limits.cable_length_max
    slack = np.zeros((count, 0)) if longest is None else np.asarray(longest) - lengths
    once = np.ones(slack.shape)
    changes = [np.repeat(x[:, None], n_cables, axis=1) for x in (values.velocity_change, values.acceleration_change)]
    vectors = [np.broadcast_to(x[:, None], each) for x in (values.velocity, values.acceleration)]
    return Enclosure(
        rays=values.rays,
        arms=np.zeros((n_cables, 3)),
        force=values.acceleration - np.array([0.0, 0.0, float(problem.robot.gravity)]),
        moment=np.zeros((count, 3)),
        acceleration_matrix=np.zeros((count, 3, 3)),
        tangent=np.broadcast_to(tangent[:, None], each),
        deviation=np.repeat(values.deviation[:, None], n_cables, axis=1),
        force_change=values.acceleration_change,
        acceleration_matrix_change=nothing,
        low=values.low,
        high=values.high,
        distances=Distances(slack, moved * once, *(0.0 * once,) * 3, np.ones(slack.shape[1]), slack, once),
        rates=Rates(vectors[0], vectors[1], *changes),
    )


def tolerated_by_point_masses(
    problem: Problem, segments: Segment, arcs: Num[np.ndarray, "n"], *, full: bool = True
) -> Tolerated:
    """Multiples of the uncertainty that motions of a point mass tolerate."""
    blocks = parts_of_arcs(arcs, np.asarray(problem.amplitude.knots), PARTS)
    rates: Any = np.asarray(segments.rate)
    requirements = requirements_of(problem, rates / problem.robot.base_points.shape[0])
    return tolerated(blocks, arcs, requirements, partial(enclosure, problem, segments, arcs), full=full)
