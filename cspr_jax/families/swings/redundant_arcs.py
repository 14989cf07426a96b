"""Smallest numbers of arcs of swings of point masses on redundant cables: samples first, then a proof.

The motion is that for three cables. With lambda = gravity / z0, the acceleration of a pendulum -lambda (p - P0) needs a
force from p towards the centroid of the spools. The centroid lies between the spools, so below them tensions can supply
the force; all other terms vanish as the number of arcs grows. Candidates are tried in increasing order; each is refuted
by samples, or proved over its full time (`verification.proved_answers`). Margins are distances of all tensions from
their limits, over the weight per cable.
"""

from __future__ import annotations

from functools import partial

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
from cspr_jax.numerics.shapes import Float, Int
from cspr_jax.robots.model.point_mass import plane_normal
from cspr_jax.robots.statics.wrench_sets import tension_range
from cspr_jax.robots.tensions.tension_distribution import centred
from cspr_jax.runtime.stages import stage
from cspr_jax.schema.verdicts import FLAGS, Verdict
from cspr_jax.verification.proved_answers import proof_of
from cspr_jax.verification.smallest_proved import NONE, smallest_proved

BATCH = 512
FEW = 4  # samples per arc at first
MANY = 32  # samples per arc before a proof
# Number of slacks that are not of limits: of the tensions, and of the depth below the spools.
BASIC = 2


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
    trials, last = _Trials(problem, parities, count), np.where(only > 0, only, max_arcs)
    first = np.where(only > 0, only, -(-np.maximum(-only, step) // step) * step)
    smallest = smallest_proved(trials, first, step=step, last=last)
    is_found, is_undecided = smallest.number != NONE, smallest.undecided != NONE
    best = np.where(np.isfinite(trials.slack), trials.best, np.maximum(only, np.maximum(-only, step)))
    tried = np.where(is_found, smallest.number, np.where(is_undecided, smallest.undecided, best))
    chosen = pick(parities, np.arange(count), tried)
    measured = partial(_measured, segments=chosen, tried=tried)
    minimum, refused = measured(problem, rows=np.arange(count)), np.flatnonzero(~is_found)
    flags = (Verdict.WRENCH_INFEASIBLE, Verdict.ABOVE_SPOOLS, *(row.flag for row in other_limits(problem.limits)))
    broken = np.zeros(count, int)
    is_broken = measured(touchable(problem), rows=refused) <= 0.0
    broken[refused] = np.bitwise_or.reduce(np.where(is_broken, [flag.value for flag in flags], 0), axis=1)
    none = np.where(is_undecided, Verdict.UNDECIDED.value, broken | Verdict.NO_ARCS.value)
    fewer = np.where(is_undecided, Verdict.FEWER_ARCS_UNDECIDED.value, 0)
    duration = np.array([float(_motion(problem, chosen, i, int(tried[i])).duration()) for i in range(count)])
    answers = Answers(
        arcs=np.where(is_found, smallest.number, 0),
        tried_arcs=tried,
        verdict=np.where(is_found, fewer, none).astype(FLAGS),
        duration=duration,
        margin=minimum[:, 0],
        margin_bound=np.array([trials.bounds.get((i, k), np.nan) for i, k in enumerate(tried.tolist())]),
        limit_margin=minimum[:, BASIC:].min(1, initial=np.inf),
        feasible_at_infinity=infinity,
        tolerated=nothing,
        not_tolerated=nothing,
    )
    return answers, chosen


def _measured(problem: Problem, *, segments: Segment, tried: np.ndarray, rows: np.ndarray) -> np.ndarray:
    # Return smallest slacks of some of the segments, for the numbers of arcs that are tried.
    each = [least_slacks(problem, segments, np.array([i]), int(tried[i]), MANY, is_narrowed=True) for i in rows]
    return np.concatenate([np.empty((0, BASIC + len(other_limits(problem.limits)))), *each])


class _Trials:
    # Trials of numbers of arcs: proved margins of those that samples do not refute, and for each segment the tried
    # number with the largest sampled slack.

    def __init__(self, problem: Problem, parities: dict[int, Segment], count: int) -> None:
        self._problem, self._parities = problem, parities
        self.bounds = dict[tuple[int, int], float]()
        self.best, self.slack = np.zeros(count, int), np.full(count, -np.inf)

    def __call__(self, index: np.ndarray, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        verdict = np.full(len(index), Verdict.NO_ARCS.value)
        for number in np.unique(numbers).tolist():
            stage(f"arcs {number}")
            verdict[numbers == number] = self._verdicts(index[numbers == number], number)
        return numbers, verdict

    def _verdicts(self, index: np.ndarray, number: int) -> np.ndarray:
        segments, verdict = self._parities[number % 2], np.full(len(index), Verdict.NO_ARCS.value)
        remaining = np.arange(len(index))
        for samples in (FEW, MANY):
            if not len(remaining):
                return verdict
            chosen = index[remaining]
            minimum = least_slacks(touchable(self._problem), segments, chosen, number, samples).min(1)
            better = minimum > self.slack[chosen]
            self.best[chosen[better]], self.slack[chosen[better]] = number, minimum[better]
            remaining = remaining[minimum > 0.0]
        weight = float(self._problem.robot.mass * self._problem.robot.gravity) / self._problem.robot.n_cables
        for k in remaining.tolist():
            proof = proof_of(self._problem, _motion(self._problem, segments, int(index[k]), number))
            verdict[k] = proof.verdict.value
            self.bounds[int(index[k]), number] = proof.margin_bound / weight if not proof.broken.any() else np.nan
        return verdict


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
    """Smallest sampled slacks of segments that have the same number of arcs."""
    kernel, chosen = partial(_slacks_at, problem), jax.tree.map(lambda x: np.asarray(x)[rows], segments)

    def at(tau: np.ndarray) -> np.ndarray:
        row = np.repeat(np.arange(len(rows)), tau.shape[1])
        items = (jax.tree.map(lambda x: x[row], chosen), np.full(len(row), float(number)), tau.ravel())
        return in_batches(kernel, items, batch_size=BATCH).reshape(*tau.shape, -1)

    tau = np.linspace(0.0, 1.0, samples * number + 1)
    slacks = at(np.tile(tau, (len(rows), 1)))
    return narrowed(at, tau, slacks) if is_narrowed else slacks.min(1)
