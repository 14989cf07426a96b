"""Sequences of Bezier segments of least total duration; continuous accelerations couple all durations.

Accelerations at the ends of segments are affine in u = (pi / T)^2: each segment adds u (start - end) to the
acceleration at its start, (15).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.families.beziers.durations import slowest
from cspr_jax.families.beziers.margins import smallest_margins
from cspr_jax.families.beziers.motion import Bezier
from cspr_jax.families.beziers.verdicts import smallest_slacks, verdicts
from cspr_jax.motion.limits import limits_set
from cspr_jax.motion.problem import Problem
from cspr_jax.motion.slacks import slacks
from cspr_jax.numerics.elementary import minimum_of
from cspr_jax.numerics.search.constrained_minima import Verified, constrained_minimum
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.point_mass import spool_radius

# Shortest and longest duration tried, over the time of a fall by the robot's radius.
SHORTEST, LONGEST = 0.1, 40.0
# Number of samples of a segment at which the search keeps limits; they are proved afterwards.
SAMPLES = 65


class Anchored(NamedTuple):
    """Sequence of segments, one of which has a given second control point; numbers of NumPy or of jax.

    Fields:
        points: (n + 1, 3) from the centroid of the spools, z down, m.
        segment: () index of the segment whose control point is given.
        control_point: (3,) its second control point, m.
        z0: () depth at which slacks are normalised, m.
    """

    points: Any
    segment: Any
    control_point: Any
    z0: Any


@jax.jit
def segments_of(sequence: Anchored, durations: Float[Array, "n"]) -> Bezier:
    """Segments of given durations."""
    starts, ends = sequence.points[:-1], sequence.points[1:]
    r = (durations / np.pi) ** 2
    added = (starts - ends) / r[:, None]
    gained = jnp.cumsum(added, axis=0) - added
    at = sequence.segment
    acceleration = (sequence.control_point - starts[at]) / r[at]
    middles = starts + r[:, None] * (acceleration[None] + gained - gained[at][None])
    return Bezier(starts, middles, ends, durations, jnp.full_like(durations, sequence.z0))


def margins_of(problem: Problem, segments: Bezier, samples: int = SAMPLES) -> Array:
    """Margins of segments for a search: exact for taut cables and the depth, sampled for limits.

    On redundant cables those of tensions are sampled, too.
    """
    tau = jnp.linspace(0.0, 1.0, samples)
    if problem.robot.n_cables > problem.robot.dof:
        from cspr_jax.families.beziers.redundant_verdicts import slacks_at

        sampled = jax.vmap(lambda motion: minimum_of(jax.vmap(lambda t: slacks_at(problem, motion, t))(tau), axis=0))
        return sampled(segments).ravel()

    def one(motion):
        exact = smallest_margins(problem.robot, motion)
        margins = jnp.append(exact.taut, exact.below)
        if not limits_set(problem.limits):
            return margins
        limits = jax.vmap(lambda t: slacks(problem, motion, t)[len(margins) :])(tau)
        return jnp.append(margins, minimum_of(limits, axis=0))

    return jax.vmap(one)(segments).ravel()


def verified(problem: Problem, segments: Bezier) -> Verified:
    """Verify a sequence: return whether it is proved feasible, and its smallest slack."""
    results = verdicts(problem, jax.tree.map(np.asarray, segments))
    worst = smallest_slacks(problem, results).min()
    return Verified(bool((results.verdict == 0).all()), float(worst))


def duration_bounds(problem: Problem, points: Float[np.ndarray, "n+1 3"]) -> tuple[float, float]:
    """Logarithms of the shortest and the longest duration that searches try."""
    unit = np.sqrt(float(spool_radius(problem.robot)) / float(problem.robot.gravity))
    longest = max(LONGEST * unit, slowest(problem, points))
    return float(np.log(SHORTEST * unit)), float(np.log(longest))


def _parts(arguments, x: Array) -> tuple[Array, Array]:
    problem, sequence, durations, free = arguments
    times = durations.at[free].set(jnp.exp(x))
    return jnp.sum(times), margins_of(problem, segments_of(sequence, times))


def least_total(problem: Problem, sequence: Anchored, durations: list[float | None]) -> Float[np.ndarray, "n"]:
    """Durations with the least sum."""
    initial = np.array([1.0 if time is None else time for time in durations])
    free = np.array([i for i, time in enumerate(durations) if time is None])

    def times(x: np.ndarray) -> np.ndarray:
        all_durations = initial.copy()
        all_durations[free] = np.exp(x)
        return all_durations

    bounds = duration_bounds(problem, np.asarray(sequence.points))
    shortest, longest = (np.full(len(free), bound) for bound in bounds)
    logarithms = constrained_minimum(
        _parts,
        (problem, sequence, jnp.asarray(initial), free),
        shortest,
        longest,
        lambda x: verified(problem, segments_of(sequence, jnp.asarray(times(x)))),
    )
    return times(logarithms)
