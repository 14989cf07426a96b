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
from cspr_jax.verification.proved_answers import verify_all_robots

# Weights of barriers, and softness, of searches that start from the motion of a coarser search.
FINE = ((1e-4, 1e-1), (1e-2, 1.0), (1e-2, 10.0))
# Searches of all segments together, in order until one converges: divisor of the number of intervals, and index of
# `FINE`. On fewer intervals a search gets stuck less often, but motions are some parts in a thousand slower.
TOGETHER = ((1.0, 0), (1.0, 1), (1.5, 0), (2.0, 0), (1.0, 2))
# Searches of single segments: divisor of the number of intervals, and softness. All but the last are for segments whose
# best motion no two starts have led to so far; the last, on few intervals, is for segments without a motion.
SEARCHES = ((2, 10.0), (2, 1.0), (1, 1.0), (3, 10.0))
FEWEST = 3  # smallest number of samples of each interval
SAME = 1e-3  # relative difference of objectives within which two motions are the same
# Searches of single segments end after this fraction of the search time, once each has a motion. The rest is for the
# search of all segments together, and for tightening.
ENOUGH = 0.5

USUAL = FreeSettings()


class SegmentMotion(NamedTuple):
    """The best motion along one segment by itself.

    Fields:
        controls: (K, d) control points.
        duration: s.
        cost: the objective; inf where no search has converged.
        basis: basis functions of the control points.
        is_shared: whether two or more starts have led to it.
        start: index of the start from which it was found.
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
    """The best motion that the search has found.

    Fields:
        motions: one per segment; if the search did not converge, the last ones that it tried.
        answers: answers of the motions: proved, refuted or undecided.
        energy: (n,) integral of the sum of the squares of the tensions over each segment, N^2 s.
        level: (n,) level of the objective, as `objectives` defines it.
        is_optimal: whether the search met all limits at its samples.
        is_stopped: whether Ctrl-C, or `search_time`, ended the search early.
        searched: duration of all segments before bounds are tightened, s; NaN without a motion.
        parts: best motion along each segment by itself.
        families: (n,) family whose motion replaces the search's own; None where none does, () if none does anywhere.
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
    verify_all_robots(problem, proof.answers, proof.motions, scene)
    energy, level = proof.tasks.energies(proof.unknowns)[0], proof.unknowns.level[0]
    is_stopped |= proof.is_stopped
    return FreeMotion(proof.motions, proof.answers, energy, level, is_optimal, is_stopped, searched, tuple(best))


def _begun(question: FreeQuestion) -> list[SegmentMotion]:
    # Return the starts themselves: no motion can be proved, so none is searched for.
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
    # Return the best motion along each segment by itself, and whether the search was stopped (Ctrl-C raises if there is
    # no motion to keep). With closed forms, all searches start from these instead of the usual starts.
    settings, poses = question.settings, question.poses
    # Motions from earlier searches do not come from a start of this search.
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
    # Announce the best motion so far to people who wait.
    if not best or not _all_optimal(best):
        return ""
    return f", so far {sum(one.duration for one in best.values()):.4g} s" if objective == "time" else ", one is there"


def _all_optimal(best: dict[int, SegmentMotion]) -> bool:
    return all(one.is_optimal for one in best.values())


def _keep(
    best: dict[int, SegmentMotion], segments: np.ndarray, of_task: np.ndarray, lanes: Tasks, result: Optima
) -> None:
    # Keep the better motions; mark those that two starts have led to, even if in different searches.
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
    # Start the search for all segments together from the motions along each.
    averages, duration = tasks.basis.averages, np.array([[one.duration for one in best]])
    values = [BSpline(one.basis.knots, one.controls, DEGREE)(averages) for one in best]
    return started(tasks, np.einsum("kj,sjd->skd", tasks.basis.fit, np.array(values))[None], duration, barrier)
