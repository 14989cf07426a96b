"""The fastest motion between poses: searched from many starts, and tightened until it is proved."""

import dataclasses
import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline

from cspr_jax.curves.spline import Spline
from cspr_jax.families.free.closed_forms import ClosedForm, form_starts
from cspr_jax.families.free.poses import FreePoses, divided, segments_of
from cspr_jax.families.free.problem import FreeQuestion, FreeSettings, planned_problem
from cspr_jax.families.free.proofs import first_optimum, proved, robust_proof
from cspr_jax.families.free.search.basis import DEGREE, Basis
from cspr_jax.families.free.search.interior_point import Ending, Optima, OutOfTime, optima, started
from cspr_jax.families.free.search.starts import Starts, joined_starts, starts
from cspr_jax.families.free.search.tasks import Tasks, Unknowns
from cspr_jax.motion.answers import Answers
from cspr_jax.motion.problem import Problem
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.runtime.stages import stage
from cspr_jax.verification.proved_answers import judge_all_robots

# Weights of barriers, and softness, with which searches go on from a coarser motion.
FINE = ((1e-4, 1e-1), (1e-2, 1.0), (1e-2, 10.0))
# Searches of all segments together: by what the intervals are divided, and the index of an option of `FINE`. Searches
# that get stuck on many intervals converge on fewer, on which motions are some parts in a thousand slower.
TOGETHER = ((1.0, 0), (1.0, 1), (1.5, 0), (2.0, 0), (1.0, 2))
# Searches of single segments, each for those for which the ones before have no two starts with the same best motion, by
# this part of its duration: by what the intervals are divided, and the softness; samples of each interval. The last
# one, on few intervals, is for those for which no start has led to any.
SEARCHES, FEWEST, SAME = ((2, 10.0), (2, 1.0), (1, 1.0), (3, 10.0)), 3, 1e-3
# Part of the time after which searches of segments end once each has a motion: the rest is for all together, and for
# tightening.
ENOUGH = 0.5

USUAL = FreeSettings()


class SegmentMotion(NamedTuple):
    """The best motion along one segment by itself.

    Fields:
        controls: (K, d) control points.
        duration: s.
        cost: the objective; inf where no search has converged.
        basis: of the control points.
        is_shared: whether two starts or more have led to it.
        start: number of its start.
    """

    controls: np.ndarray
    duration: float
    cost: float
    basis: Basis
    is_shared: bool
    start: int

    @property
    def is_optimal(self) -> bool:
        """Tell whether a search has converged to it."""
        return bool(np.isfinite(self.cost))


@dataclasses.dataclass(frozen=True)
class FreeMotion:
    """The best motion that the search has come to.

    Fields:
        motions: one a segment; of a search that came to none, the last one it tried.
        answers: of them: proved, refuted or undecided.
        energy: (n,) integral of the sum of the squares of the tensions, N^2 s, of the segments.
        level: (n,) of the objective, as `objectives` has it.
        is_optimal: whether the search met all limits at its samples.
        is_stopped: whether Ctrl-C, or `search_time`, has ended it before its end.
        searched: duration of all segments before bounds were tightened, s; NaN without a motion.
        parts: best motions along the segments by themselves.
        families: (n,) whose motions these are, where the search came to none that are faster; None: its own.
    """

    motions: list[Spline]
    answers: Answers
    energy: np.ndarray
    level: np.ndarray
    is_optimal: bool
    is_stopped: bool
    searched: float
    parts: tuple[SegmentMotion, ...] = ()
    families: tuple[str | None, ...] = ()

    @property
    def duration(self) -> float:
        """Duration of all segments, s."""
        return float(sum(motion.knots[-1] for motion in self.motions))


def free_motion(
    problem: Problem,
    scene: Scene | None,
    poses: FreePoses,
    settings: FreeSettings = USUAL,
    before: FreeMotion | None = None,
    forms: Sequence[ClosedForm] = (),
    lines: Sequence[ClosedForm] = (),
) -> FreeMotion:
    """Search for the fastest motion through poses, all its segments together, and prove it."""
    question = FreeQuestion.of(planned_problem(problem), scene, poses, settings)
    uncertainty = problem.limits.uncertainty
    if len(divided(problem, poses)):
        best, is_stopped = _begun(question), False
    else:
        best, is_stopped = _searched(question, () if before is None else before.parts, forms, lines)
    tasks, optimum = question.tasks(settings.intervals, question.samples), None
    for fraction, option in TOGETHER if all(one.is_optimal for one in best) else ():
        tasks = question.tasks(2 * round(0.5 * settings.intervals / fraction), question.samples)
        try:
            optimum = first_optimum(tasks, [(_together(tasks, best, FINE[option][0]), *FINE[option])], settings.until)
        except OutOfTime:
            is_stopped = True
            break
        if optimum is not None:
            break
    unknowns, is_optimal = optimum or _together(tasks, best, FINE[0][0]), optimum is not None
    searched = float(unknowns.duration.sum()) if is_optimal else np.nan
    proof = robust_proof(question, uncertainty, tasks, unknowns) if uncertainty is not None and is_optimal else None
    proof = proof or proved(question, tasks, unknowns, is_optimal=is_optimal)
    judge_all_robots(problem, proof.answers, proof.motions, scene)
    energy, level = proof.tasks.energies(proof.unknowns)[0], proof.unknowns.level[0]
    is_stopped |= proof.is_stopped
    return FreeMotion(proof.motions, proof.answers, energy, level, is_optimal, is_stopped, searched, tuple(best))


def _begun(question: FreeQuestion) -> list[SegmentMotion]:
    # Starts that are not searched from, since no motion can be proved.
    single = segments_of(question.tasks(question.settings.intervals, FEWEST))
    begun = starts(single, question.poses.z0, 1)
    pairs = zip(begun.controls[:, 0], begun.duration[:, 0].tolist(), strict=True)
    return [SegmentMotion(*pair, np.inf, single.basis, is_shared=False, start=0) for pair in pairs]


def _searched(
    question: FreeQuestion,
    before: Sequence[SegmentMotion],
    forms: Sequence[ClosedForm],
    lines: Sequence[ClosedForm],
) -> tuple[list[SegmentMotion], bool]:
    # The best motion along each segment by itself, from all starts, or after those from forms; where starts disagree,
    # by all searches. Whether the search has been stopped: by Ctrl-C only where there is something to keep.
    settings, poses = question.settings, question.poses
    # No form is the start that has led to what was there before.
    count, best = len(poses.positions) - 1, {k: part._replace(start=-1) for k, part in enumerate(before)}
    until, begin = settings.until, time.monotonic()
    enough = begin + ENOUGH * (until - begin)
    for number, (fraction, softness) in enumerate(SEARCHES, 1):
        is_last = number == len(SEARCHES)
        is_left = [
            k not in best or not (best[k].is_optimal if is_last else best[k].is_shared) or (number == 1 and bool(forms))
            for k in range(count)
        ]
        open_segments = np.flatnonzero(is_left)
        if not len(open_segments) or (best and time.monotonic() > (enough if _all_optimal(best) else until)):
            return list(best.values()), bool(len(open_segments))
        stage(f"free motion: search {number}{_said(best, settings.objective)}")
        single = segments_of(question.tasks(settings.intervals // fraction, FEWEST))
        begun = form_starts(single, open_segments, forms) if forms else _starts(question, single, open_segments, lines)
        if not len(begun.task):
            break
        lanes, ending = single.take(open_segments[begun.task]), Ending(until, enough, begun.task)
        unknowns = started(lanes, begun.controls, begun.duration)
        result = optima(lanes, unknowns, softness=softness, ending=ending, keeps=True)
        _keep(best, open_segments, begun.task, lanes, result)
        if result.is_stopped:
            if not _all_optimal(best) and time.monotonic() < until:
                raise KeyboardInterrupt
            return list(best.values()), True
    return list(best.values()), False


def _starts(question: FreeQuestion, single: Tasks, chosen: np.ndarray, lines: Sequence[ClosedForm]) -> Starts:
    usual = starts(single.take(chosen), question.poses.z0, question.settings.starts)
    return joined_starts([usual, form_starts(single, chosen, lines)])


def _said(best: dict[int, SegmentMotion], objective: str) -> str:
    # The best so far, for people who wait.
    if not best or not _all_optimal(best):
        return ""
    return f", so far {sum(one.duration for one in best.values()):.4g} s" if objective == "time" else ", one is there"


def _all_optimal(best: dict[int, SegmentMotion]) -> bool:
    return all(one.is_optimal for one in best.values())


def _keep(
    best: dict[int, SegmentMotion], segments: np.ndarray, of_task: np.ndarray, lanes: Tasks, result: Optima
) -> None:
    # Keeps what is better than before. Starts of different searches that lead to the same motion agree, too.
    controls, costs = lanes.controls(result.unknowns)[:, 0], lanes.cost(result.unknowns)
    is_optimal = result.is_optimal & lanes.objective.keeps_limits(result.unknowns.level)
    costs = np.where(is_optimal, costs, np.inf)
    for i, k in enumerate(segments.tolist()):
        lanes_of = np.flatnonzero(of_task == i)
        if not len(lanes_of):
            continue
        start = int(costs[lanes_of].argmin())
        nearest = lanes_of[start]
        before = best[k].cost if k in best else np.inf
        minimum = min(costs[nearest], before)
        allowed = minimum + SAME * abs(minimum)
        agreeing = set(np.flatnonzero(np.isfinite(costs[lanes_of]) & (costs[lanes_of] <= allowed)).tolist())
        if np.isfinite(before) and before <= allowed:
            agreeing.add(best[k].start)
        if k not in best or costs[nearest] < before:
            duration = float(result.unknowns.duration[nearest, 0])
            part = controls[nearest], duration, float(costs[nearest]), lanes.basis
            best[k] = SegmentMotion(*part, is_shared=False, start=start)
        best[k] = best[k]._replace(is_shared=len(agreeing) > 1)


def _together(tasks: Tasks, best: list[SegmentMotion], barrier: float) -> Unknowns:
    # The motions along all segments as the start of a search for all together.
    averages, duration = tasks.basis.averages, np.array([[one.duration for one in best]])
    values = [BSpline(one.basis.knots, one.controls, DEGREE)(averages) for one in best]
    return started(tasks, np.einsum("kj,sjd->skd", tasks.basis.fit, np.array(values))[None], duration, barrier)
