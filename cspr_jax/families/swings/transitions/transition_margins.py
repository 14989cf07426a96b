"""Margins of transitions: the smallest pseudotension from two functions, not one for each cable and the depth."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.families.swings.hypocycloid import Segment, oscillation
from cspr_jax.families.swings.proof.blocks import blocks
from cspr_jax.families.swings.proof.margins import Functions, margins, smallest_values
from cspr_jax.families.swings.transitions import transition
from cspr_jax.motion.amplitudes import Amplitude, derivatives
from cspr_jax.motion.limits import limits_set
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.elementary import sincospi

if TYPE_CHECKING:
    from jaxtyping import Float, Int


def _extreme_pseudotensions(robot, limits, amplitude: Amplitude, segment: Segment, arcs: Array, tau: Array):
    # (1.32) is linear in the load v + w_k: at any instant the cables with the extreme loads have the smallest
    # pseudotensions; load 0 is the depth below the spools.
    del robot, limits
    v = transition.inclination(segment)
    loads = v + transition.weights(segment)
    _, steady, period = oscillation(segment, arcs)
    size, slope, second_derivative = derivatives(amplitude, tau, order=2)
    sine, cosine = sincospi(arcs * tau)
    # d of `hypocycloid.swing` over the radius; the sense of an even number of arcs is -1.
    pull = (
        second_derivative - size * segment.end_curvature
    ) / period * cosine - 2.0 * steady / period * slope * sine / (math.pi * arcs)
    level = 1.0 + v * size * cosine
    return level - jnp.maximum(jnp.max(loads), 0.0) * pull, level - jnp.minimum(jnp.min(loads), 0.0) * pull


def transition_margins(
    problem: Problem, segments: Segment, arcs: Int[np.ndarray, "n"]
) -> Float[np.ndarray, "n n_criteria"]:
    """Smallest slack of each criterion along each transition, as `margins` gives them.

    Where both are positive, the slack of the cables stands in both of the first two columns.
    """
    if limits_set(problem.limits):
        return margins(problem, segments, arcs)
    table = blocks(problem.amplitude, int(np.max(arcs)))
    smallest = smallest_values(Functions(_extreme_pseudotensions, (1, 1)), problem, segments, arcs, table).min(1)
    slacks = np.stack([smallest, smallest], axis=1)
    unclear = np.flatnonzero(~(np.isfinite(smallest) & (smallest > 0.0)))
    if len(unclear):
        slacks[unclear] = margins(problem, jax.tree.map(lambda leaf: leaf[unclear], segments), arcs[unclear])
    return slacks
