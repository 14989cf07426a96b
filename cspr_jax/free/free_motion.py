"""The fastest motion between poses: searched from many starts, and tightened until it is proved."""

import dataclasses
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline

from cspr_jax.curves.spline import Spline, chained
from cspr_jax.free.basis import DEGREE, Basis, basis
from cspr_jax.free.instants import ValueBounds, bounds
from cspr_jax.free.poses import FreePoses, check_searched, motions_of, segments_of, tasks_of
from cspr_jax.free.search import again, optima, started
from cspr_jax.free.starts import starts
from cspr_jax.free.tasks import Tasks, Unknowns
from cspr_jax.motions.criteria import criteria
from cspr_jax.motions.piece_slacks import piece_slacks
from cspr_jax.motions.problem import Problem
from cspr_jax.motions.proved_answers import ProvedAnswers, proved_answers
from cspr_jax.robots.clearance import Scene

# Rounds of proof and tightening; slack that is left, in the units of values; by what more than is missed, and by how
# much at least and at most, bounds tighten; by what share of it those of the next pieces do.
ROUNDS, LEFT, MORE, STEP, MOST, BESIDE = 10, 1e-7, 1.5, 1e-6, 0.03, 0.5
# Weights of barriers, and softness, with which searches go on from a motion within tighter bounds, or a coarser one.
ON = ((1e-5, 1e-2), (1e-3, 1e-1), (1e-2, 1.0), (1e-2, 10.0))
FINE = ((1e-4, 1e-1), (1e-2, 1.0), (1e-2, 10.0))
# Searches of single segments, each for those for which the ones before have no two starts with the same best motion, by
# this part of its duration: by what the intervals are divided, and the softness; instants of each interval.
SEARCHES, FEWEST, SAME = ((2, 10.0), (2, 1.0), (1, 1.0)), 3, 1e-3


class FreeSettings(NamedTuple):
    """Settings of a search.

    Fields:
        intervals: of the spline of a segment, even.
        instants: of each interval, at which the search looks.
    """

    intervals: int = 48
    instants: int = 4


USUAL = FreeSettings()


@dataclasses.dataclass(frozen=True)
class FreeMotion:
    """The fastest motion that was found.

    Fields:
        motions: one a segment; of a search that found none, the last one it looked at.
        answers: of them: proved, refuted or undecided.
        is_optimal: whether the search met all limits at the instants that it looks at.
        searched: duration of all segments before bounds were tightened, s; NaN without a motion.
    """

    motions: list[Spline]
    answers: ProvedAnswers
    is_optimal: bool
    searched: float

    @property
    def duration(self) -> float:
        """Duration of all segments, s."""
        return float(sum(motion.knots[-1] for motion in self.motions))


def free_motion(problem: Problem, scene: Scene | None, poses: FreePoses, settings: FreeSettings = USUAL) -> FreeMotion:
    """Search for the fastest motion through poses, all its segments together, and prove it.

    Args:
        scene: bodies that can meet; they are judged with the motion, and do not change it.

    Returns:
        the motion; where tightening ends before all is proved, the last one.

    Raises:
        InputError: a robot for which no free motion is sought, or a cable without a largest tension.
    """
    check_searched(problem)
    limits = bounds(problem.robot, problem.limits, criteria(problem.robot, problem.limits, scene))
    tasks = tasks_of(problem, basis(settings.intervals, settings.instants), limits, poses)
    best = _searched(problem, limits, poses, settings)
    optimum = None
    if all(one.is_optimal for one in best):
        optimum = _first_optimum(tasks, ((_together(tasks, best, each[0]), *each) for each in FINE))
    unknowns, is_optimal = optimum or _together(tasks, best, FINE[0][0]), optimum is not None
    searched = float(unknowns.duration.sum()) if is_optimal else np.nan
    for number in range(1, ROUNDS + 1):
        motions = motions_of(tasks, unknowns, poses.z0)
        answers = proved_answers(problem, motions, scene)
        tighter = None
        if is_optimal and number < ROUNDS and not answers.feasible.all():
            tighter = tightened(problem, scene, tasks, motions, limits)
        if tighter is None:
            break
        further = _first_optimum(tighter, ((again(tighter, unknowns, each[0]), *each) for each in ON))
        if further is None:
            break
        tasks, unknowns = tighter, further
    return FreeMotion(motions, answers, is_optimal, searched)


def _first_optimum(tasks: Tasks, begun: Iterable[tuple[Unknowns, float, float]]) -> Unknowns | None:
    # The optimum of the first search that converges, of one task, with its start, barrier and softness.
    for start in begun:
        result = optima(tasks, *start)
        if result.is_optimal[0]:
            return result.unknowns
    return None


class _Best(NamedTuple):
    # The best motion along one segment: control points, (K, d), duration, s, and the basis; whether a search has
    # converged to it, and whether two starts or more have.
    controls: np.ndarray
    duration: float
    basis: Basis
    is_optimal: bool
    is_shared: bool


def _searched(problem: Problem, limits: ValueBounds, poses: FreePoses, settings: FreeSettings) -> list[_Best]:
    # The best motion along each segment by itself, from all starts; where starts disagree, by all searches.
    count = len(poses.positions) - 1
    best = dict[int, _Best]()
    for share, softness in SEARCHES:
        rows = np.array([k for k in range(count) if k not in best or not best[k].is_shared], int)
        if not len(rows):
            break
        single = segments_of(tasks_of(problem, basis(settings.intervals // share, FEWEST), limits, poses))
        begun = starts(single.taken(rows), poses.z0)
        lanes = single.taken(rows[begun.task])
        result = optima(lanes, started(lanes, begun.controls, begun.duration), softness=softness)
        controls = lanes.controls(result.unknowns)[:, 0]
        times = np.where(result.is_optimal, result.unknowns.duration[:, 0], np.inf)
        for i, k in enumerate(rows.tolist()):
            lanes_of = np.flatnonzero(begun.task == i)
            nearest = lanes_of[times[lanes_of].argmin()]
            duration, is_optimal = float(result.unknowns.duration[nearest, 0]), bool(result.is_optimal[nearest])
            if k in best and not (is_optimal and (duration < best[k].duration or not best[k].is_optimal)):
                continue
            is_shared = is_optimal and bool(np.sum(times[lanes_of] <= (1.0 + SAME) * duration) > 1)
            best[k] = _Best(controls[nearest], duration, single.basis, is_optimal, is_shared)
    return [best[k] for k in range(count)]


def _together(tasks: Tasks, best: list[_Best], barrier: float) -> Unknowns:
    # The motions along all segments as the start of a search for all together.
    averages, duration = tasks.basis.averages, np.array([[one.duration for one in best]])
    values = [BSpline(one.basis.knots, one.controls, DEGREE)(averages) for one in best]
    return started(tasks, np.einsum("kj,sjd->skd", tasks.basis.fit, np.array(values))[None], duration, barrier)


def tightened(
    problem: Problem, scene: Scene | None, tasks: Tasks, motions: list[Spline], limits: ValueBounds
) -> Tasks | None:
    """Tighter bounds where the proof finds less slack than is needed.

    Args:
        scene: as for `free_motion`.
        tasks: l of s segments each.
        motions: l s of them, along all segments.
        limits: of the values.

    Returns:
        the tasks; None where the proof finds enough everywhere, or no more helps.
    """
    whole = chained(motions)
    slacks = piece_slacks(problem, whole, np.asarray(whole.knots), scene)
    changes = np.abs(limits.rises) + np.abs(limits.falls)
    unit = changes.max(1)
    missed = np.where(unit > 0.0, LEFT - slacks.low * unit, 0.0)
    if not (missed > 0.0).any():
        return None
    steps = np.where(missed > 0.0, np.minimum(MORE * missed + STEP, MOST), 0.0) / np.where(unit > 0.0, unit, 1.0)
    # A slack that is smallest beside a border depends on the bounds of the next piece as much.
    steps = steps.reshape(len(tasks.low), -1, len(unit))
    near = steps.copy()
    near[:, 1:] = np.maximum(near[:, 1:], BESIDE * steps[:, :-1])
    near[:, :-1] = np.maximum(near[:, :-1], BESIDE * steps[:, 1:])
    shape = *tasks.low.shape[:3], 1, -1
    rise, fall = ((near[..., None] * side).max(2).reshape(shape) for side in (limits.rises, limits.falls))
    return dataclasses.replace(tasks, low=tasks.low + rise, high=tasks.high - fall)
