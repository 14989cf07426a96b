"""Inclinations with the fewest oscillations for transitions on more cables than degrees of freedom.

Redundant cables have no pseudotensions whose envelopes could tell what each inclination needs. So numbers of
oscillations are tried in increasing order, each with inclinations on a grid; the first number that samples do not
refute for all of them takes the inclination with the largest slack, which a finer grid refines. `redundant_arcs` then
proves the motion. A smaller number may exist between the inclinations tried.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from cspr_jax.families.swings.hypocycloid import Segment
from cspr_jax.families.swings.redundant_arcs import FEW, MANY, least_slacks
from cspr_jax.families.swings.transitions.envelope_oscillations import LARGEST_INCLINATION
from cspr_jax.families.swings.transitions.transition import depth_for
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.point_mass import plane_normal
from cspr_jax.runtime.stages import stage

TRIED = 41  # number of inclinations in the first grid
FINER = 9  # number of inclinations in each finer grid
ROUNDS = 3  # number of finer grids
Transitions = Callable[[Problem, np.ndarray, np.ndarray], Segment]


def redundant_inclinations(
    problem: Problem, targets: Float[np.ndarray, "n 3"], transitions: Transitions, *, max_arcs: int
) -> Float[np.ndarray, "n"]:
    """The inclination of each target with the fewest oscillations; among equals, that of the largest slack."""
    largest = LARGEST_INCLINATION / max(float(np.asarray(problem.amplitude.largest)[0]), 1.0)
    best, maximum = np.zeros(len(targets)), np.full(len(targets), -np.inf)
    is_open = targets @ np.asarray(plane_normal(problem.robot)) > 0.0
    for arcs in range(2, 2 * max(max_arcs // 2, 1) + 1, 2):
        rows = np.flatnonzero(is_open)
        if not len(rows):
            break
        stage(f"inclinations for {arcs // 2} oscillations")
        slack = partial(_slacks, problem, transitions, targets[rows], arcs)
        # Leave out the ends, at which there is no transition.
        fractions, step = np.linspace(-1.0, 1.0, TRIED + 2)[1:-1], 2.0 * largest / (TRIED + 1)
        tried = np.tile(largest * fractions, (len(rows), 1))
        slacks = slack(tried, FEW)
        for _ in range(ROUNDS):
            v = _at(tried, slacks.argmax(1))
            tried = np.clip(v[:, None] + step * np.linspace(-1.0, 1.0, FINER), -largest, largest)
            slacks, step = slack(tried, MANY), 2.0 * step / (FINER - 1)
        v, highest = _at(tried, slacks.argmax(1)), slacks.max(1)
        gains = highest > maximum[rows]
        best[rows[gains]], maximum[rows[gains]] = v[gains], highest[gains]
        is_open[rows] = highest <= 0.0
    return best


def _at(values: np.ndarray, column: np.ndarray) -> np.ndarray:
    return np.take_along_axis(values, column[:, None], axis=1)[:, 0]


def _slacks(
    problem: Problem,
    transitions: Transitions,
    targets: np.ndarray,
    arcs: int,
    inclinations: np.ndarray,
    samples: int,
) -> np.ndarray:
    # Return the smallest slack of the transition to each of n targets with each of m inclinations, (n, m).
    positions = np.repeat(targets, inclinations.shape[1], axis=0)
    kernel = jax.vmap(partial(depth_for, problem.robot))
    segments = transitions(
        problem, positions, np.asarray(kernel(jnp.asarray(positions), jnp.asarray(inclinations.ravel())))
    )
    minimum = least_slacks(problem, segments, np.arange(len(positions)), arcs, samples)
    return minimum.min(1).reshape(inclinations.shape)
