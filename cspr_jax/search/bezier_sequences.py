"""Durations of a sequence of Bezier segments whose sum is least; accelerations that go on couple them all.

At the ends of segments the accelerations are affine in u = (pi / T)^2: each segment adds u (start - end) to the one
before it, (15). Of many durations the best ones are improved by sequential quadratic programming under the exact
margins, and proved. What is found is a local minimum, or several of them compared.
"""

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from scipy.optimize import minimize
from scipy.stats import qmc

from cspr_jax.arithmetic.batches import in_batches
from cspr_jax.feasibility.limits import given
from cspr_jax.feasibility.point_mass.bezier_margins import smallest_margins
from cspr_jax.feasibility.problem import Problem
from cspr_jax.feasibility.slacks import slacks
from cspr_jax.robots.point_mass import spool_radius
from cspr_jax.search.bezier_verdicts import verdicts
from cspr_jax.search.proved_verdicts import Verdicts
from cspr_jax.trajectories.bezier import Bezier

# Durations looked at first, over that of a fall by the robot's size; of these so many are improved.
SHORTEST, LONGEST, LOOKED_AT, IMPROVED = 0.2, 20.0, 4096, 8
# Smallest margins asked for, one after the other until the answer is proved.
MARGINS = (1e-9, 1e-7, 1e-5, 1e-3)
# Instants of a segment at which limits are asked for; they are proved afterwards.
SAMPLES = 65
STEPS, BATCH = 200, 512
# A search leaves its start by no more than this, in logarithms of durations.
WIDEST = 5.0


class Anchored(NamedTuple):
    """Sequence of segments, one of whose second control points is known; numbers of NumPy or of jax.

    Fields:
        points: (n + 1, 3) from the centroid of the spools, z down, m.
        segment: () number of the segment whose control point is known.
        control_point: (3,) m.
        z0: () depth at which slacks are normalised, m.
    """

    points: Any
    segment: Any
    control_point: Any
    z0: Any


def segments_of(sequence: Anchored, durations: Array) -> Bezier:
    """Segments of given durations.

    Args:
        sequence: the points.
        durations: (n,) s.

    Returns:
        leaves with a leading dimension n.
    """
    starts, ends = sequence.points[:-1], sequence.points[1:]
    r = (durations / np.pi) ** 2
    added = (starts - ends) / r[:, None]
    gained = jnp.cumsum(added, axis=0) - added
    at = sequence.segment
    known = (sequence.control_point - starts[at]) / r[at]
    middles = starts + r[:, None] * (known[None] + gained - gained[at][None])
    return Bezier(starts, middles, ends, durations, jnp.full_like(durations, sequence.z0))


@jax.jit
def _margins(problem: Problem, sequence: Anchored, durations: Array) -> Array:
    # (n, n_slacks): exact ones of taut cables and the depth, sampled ones of limits.
    def one(motion):
        own = smallest_margins(problem.robot, motion)
        found = jnp.append(own.taut, own.below)
        if not given(problem.limits):
            return found
        tau = jnp.linspace(0.0, 1.0, SAMPLES)
        limits = jax.vmap(lambda t: slacks(problem, motion, t)[len(found) :])(tau)
        return jnp.append(found, jnp.min(limits, axis=0))

    return jax.vmap(one)(segments_of(sequence, durations))


@jax.jit
def _smallest(problem: Problem, sequence: Anchored, durations: Array) -> Array:
    return jax.vmap(lambda times: jnp.min(_margins(problem, sequence, times)))(durations)


@jax.jit
def _slopes(problem: Problem, sequence: Anchored, durations: Array) -> Array:
    return jax.jacfwd(lambda times: _margins(problem, sequence, times).ravel())(durations)


def least_total(problem: Problem, sequence: Anchored, durations: list[float | None]) -> np.ndarray:
    """Durations whose sum is least.

    Args:
        problem: robot, a point mass on as many cables as it has degrees of freedom, and limits.
        sequence: the points.
        durations: of the n segments, s; None: to be chosen.

    Returns:
        (n,) s; where nothing feasible is found, those with the largest margin found.
    """
    fixed = np.array([np.nan if time is None else time for time in durations])
    free = np.flatnonzero(np.isnan(fixed))
    unit = np.sqrt(float(spool_radius(problem.robot)) / float(problem.robot.gravity))
    halton = qmc.Halton(len(free), seed=0).random(LOOKED_AT)
    tried = np.repeat(fixed[None], LOOKED_AT, axis=0)
    tried[:, free] = unit * SHORTEST * (LONGEST / SHORTEST) ** halton
    least = in_batches(partial(_smallest, problem, sequence), tried, size=BATCH)
    least = np.where(np.isfinite(least), least, -np.inf)
    # Those that are feasible and short first, then those that come nearest.
    order = np.lexsort((np.where(least > 0.0, tried.sum(1), -least), least <= 0.0))
    best = tried[order[0]]
    for start in tried[order[:IMPROVED]]:
        found = _improved(problem, sequence, start, free)
        best = _better(problem, sequence, best, found)
    return best


def _improved(problem: Problem, sequence: Anchored, start: np.ndarray, free: np.ndarray) -> np.ndarray:
    # In logarithms of the free durations.
    def times(x: np.ndarray) -> np.ndarray:
        own = start.copy()
        own[free] = np.exp(x)
        return own

    def slopes(x: np.ndarray) -> np.ndarray:
        return np.asarray(_slopes(problem, sequence, times(x)))[:, free] * np.exp(x)

    found = start
    for margin in MARGINS:
        limit = {
            "type": "ineq",
            "fun": lambda x, margin=margin: np.asarray(_margins(problem, sequence, times(x))).ravel() - margin,
            "jac": slopes,
        }
        with np.errstate(all="ignore"):
            answer = minimize(
                lambda x: times(x).sum(),
                np.log(found[free]),
                jac=lambda x: np.exp(x),
                method="SLSQP",
                bounds=[(x - WIDEST, x + WIDEST) for x in np.log(start[free])],
                constraints=[limit],
                options={"maxiter": STEPS, "ftol": 1e-12},
            )
        if not np.isfinite(answer.x).all():
            break
        found = times(answer.x)
        if (_judged(problem, sequence, found).verdict == 0).all():
            break
    return found


def _judged(problem: Problem, sequence: Anchored, durations: np.ndarray) -> Verdicts:
    motions = jax.tree.map(np.asarray, segments_of(sequence, jnp.asarray(durations)))
    return verdicts(problem, motions)


def _better(problem: Problem, sequence: Anchored, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    a, b = (_judged(problem, sequence, times) for times in (first, second))
    if (a.verdict == 0).all() or (b.verdict == 0).all():
        longer = [np.inf if (own.verdict != 0).any() else times.sum() for own, times in ((a, first), (b, second))]
        return second if longer[1] < longer[0] else first
    worst = [np.nan_to_num(np.minimum(own.margin, own.room), nan=-np.inf).min() for own in (a, b)]
    return second if worst[1] > worst[0] else first
