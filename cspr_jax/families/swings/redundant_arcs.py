"""Smallest numbers of arcs of swings of point masses on more cables than degrees of freedom: samples, then a proof.

The motion is that of three cables. With gravity / z0 = lambda, a pendulum's acceleration -lambda (p - P0) needs a force
from p towards the centroid of the spools, which lies between them, so that below the spools tensions can supply it; the
other terms fade with the number of arcs. What is tried in increasing order is refuted by samples, or else proved over
its whole time (`verification.proved`). Margins are distances of all tensions from their limits, over the weight per
cable.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from cspr_jax.families.swings.hypocycloid import Hypocycloid, Segment
from cspr_jax.families.swings.parities import pick
from cspr_jax.motion.answers import Answers
from cspr_jax.motion.limits import other_limits, other_slacks
from cspr_jax.motion.problem import Problem, touchable
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.search.minima import narrowed
from cspr_jax.robots.model.point_mass import plane_normal
from cspr_jax.robots.statics.wrench_sets import tension_range
from cspr_jax.robots.tensions.tension_distribution import centred
from cspr_jax.runtime.stages import stage
from cspr_jax.schema.verdicts import FLAGS, Verdict
from cspr_jax.verification.proved import proved

if TYPE_CHECKING:
    from jaxtyping import Float, Int

BATCH = 512
FEW = 4  # samples an arc, to begin with
MANY = 32  # before a proof
# Slacks that are not those of limits: of the tensions, and of the depth below the spools.
BASIC = 2


class _Trials(NamedTuple):
    # Numbers of arcs proved feasible (n,), smaller ones that stayed undecided, proved margins, and of those that fail
    # the ones with the largest sampled slack, with this slack.
    arcs: np.ndarray
    undecided: np.ndarray
    bound: np.ndarray
    best: np.ndarray
    reached: np.ndarray


@jax.jit
def _slacks_at(problem: Problem, items) -> jax.Array:
    robot, limits = problem.robot, problem.limits
    low, high = tension_range(robot, limits)

    def one(segment, arcs, tau):
        motion = Hypocycloid(segment, problem.amplitude, arcs)
        state = motion.state(tau)
        margin = centred(robot.wrench_matrix(state), robot.inertial_wrench(state), low, high)[1]
        depth = plane_normal(robot) @ state.position / motion.z0
        fraction = margin * robot.n_cables / (robot.mass * robot.gravity)
        slacks = jnp.stack([fraction, depth, *other_slacks(robot, limits, state, motion.z0)])
        return jnp.where(jnp.isnan(slacks), -jnp.inf, slacks)

    return jax.vmap(one)(*items)


def redundant_arcs(
    problem: Problem,
    parities: dict[int, Segment],
    infinity: Float[np.ndarray, "n"],
    *,
    max_arcs: int,
    arcs: np.ndarray | None = None,
    step: int = 1,
) -> tuple[Answers, Segment]:
    """Smallest number of arcs of each segment."""
    count = len(infinity)
    only = np.zeros(count, int) if arcs is None else np.asarray(arcs)
    nothing = np.full(count, np.nan)
    trials = _Trials(np.zeros(count, int), np.zeros(count, int), nothing.copy(), only.copy(), np.full(count, -np.inf))
    trials.best[only <= 0] = np.maximum(-only, step)[only <= 0]
    for number in range(step, max(max_arcs, int(only.max(initial=0))) + 1, step):
        is_tried = np.where(only > 0, only == number, (-only <= number) & (number <= max_arcs)) & (trials.arcs == 0)
        if is_tried.any():
            stage(f"arcs {number} of {max_arcs}")
            _try(problem, parities, np.flatnonzero(is_tried), number, trials)
    tried = np.where(trials.arcs > 0, trials.arcs, np.where(trials.undecided > 0, trials.undecided, trials.best))
    chosen = pick(parities, np.arange(count), tried)
    measured = partial(_measured, segments=chosen, tried=tried)
    minimum, refused = measured(problem, rows=np.arange(count)), np.flatnonzero(trials.arcs == 0)
    flags = (Verdict.WRENCH_INFEASIBLE, Verdict.ABOVE_SPOOLS, *(row.flag for row in other_limits(problem.limits)))
    broken = np.zeros(count, int)
    is_broken = measured(touchable(problem), rows=refused) <= 0.0
    broken[refused] = np.bitwise_or.reduce(np.where(is_broken, [flag.value for flag in flags], 0), axis=1)
    none = np.where(trials.undecided > 0, Verdict.UNDECIDED.value, broken | Verdict.NO_ARCS.value)
    fewer = np.where(trials.undecided > 0, Verdict.FEWER_ARCS_UNDECIDED.value, 0)
    duration = np.array([float(_motion(problem, chosen, i, int(tried[i])).duration()) for i in range(count)])
    answers = Answers(
        arcs=trials.arcs,
        tried_arcs=tried,
        verdict=np.where(trials.arcs > 0, fewer, none).astype(FLAGS),
        duration=duration,
        margin=minimum[:, 0],
        margin_bound=trials.bound,
        limit_margin=minimum[:, BASIC:].min(1, initial=np.inf),
        feasible_at_infinity=infinity,
        tolerated=nothing,
        not_tolerated=nothing,
    )
    return answers, chosen


def _measured(problem: Problem, *, segments: Segment, tried: np.ndarray, rows: np.ndarray) -> np.ndarray:
    # Smallest slacks of some of the segments with the numbers of arcs that are tried.
    each = [least_slacks(problem, segments, np.array([i]), int(tried[i]), MANY, is_narrowed=True) for i in rows]
    return np.concatenate([np.empty((0, BASIC + len(other_limits(problem.limits)))), *each])


def _try(problem: Problem, parities: dict[int, Segment], rows: np.ndarray, number: int, trials: _Trials) -> None:
    # Try a number of arcs for some of the segments.
    segments = parities[number % 2]
    for samples in (FEW, MANY):
        minimum = least_slacks(touchable(problem), segments, rows, number, samples).min(1)
        better = minimum > trials.reached[rows]
        trials.best[rows[better]], trials.reached[rows[better]] = number, minimum[better]
        rows = rows[minimum > 0.0]
        if not len(rows):
            return
    weight = float(problem.robot.mass * problem.robot.gravity) / problem.robot.n_cables
    for i in rows.tolist():
        proof = proved(problem, _motion(problem, segments, i, number))
        if proof.verdict == Verdict.FEASIBLE or (proof.verdict == Verdict.UNDECIDED and trials.undecided[i] == 0):
            trials.bound[i] = proof.bound / weight
            column = trials.arcs if proof.verdict == Verdict.FEASIBLE else trials.undecided
            column[i] = number


def _motion(problem: Problem, segments: Segment, i: int, number: int) -> Hypocycloid:
    return Hypocycloid(jax.tree.map(lambda x: np.asarray(x)[i], segments), problem.amplitude, as_float64(number))


def least_slacks(
    problem: Problem,
    segments: Segment,
    rows: Int[np.ndarray, "m"],
    number: int,
    samples: int,
    *,
    is_narrowed: bool = False,
) -> Float[np.ndarray, "m n_slacks"]:
    """Smallest sampled slacks of segments with one number of arcs."""
    kernel, chosen = partial(_slacks_at, problem), jax.tree.map(lambda x: np.asarray(x)[rows], segments)

    def at(tau: np.ndarray) -> np.ndarray:
        row = np.repeat(np.arange(len(rows)), tau.shape[1])
        items = (jax.tree.map(lambda x: x[row], chosen), np.full(len(row), float(number)), tau.ravel())
        return in_batches(kernel, items, batch_size=BATCH).reshape(*tau.shape, -1)

    tau = np.linspace(0.0, 1.0, samples * number + 1)
    slacks = at(np.tile(tau, (len(rows), 1)))
    return narrowed(at, tau, slacks) if is_narrowed else slacks.min(1)
