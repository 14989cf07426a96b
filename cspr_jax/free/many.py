"""The fastest motions of many pairs of poses: searched on few intervals, then on many, proved and tightened."""

import dataclasses
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import BSpline

from cspr_jax.curves.several import SeveralSplines
from cspr_jax.curves.spline import Spline
from cspr_jax.free.basis import DEGREE, Basis
from cspr_jax.free.free_motion import FEWEST, FINE, ON, ROUNDS
from cspr_jax.free.neighbours import FROM_NEIGHBOUR, Neighbours
from cspr_jax.free.poses import FreePoses, motions_of
from cspr_jax.free.question import FreeQuestion, FreeSettings, tightened
from cspr_jax.free.search import again, optima, started
from cspr_jax.free.tasks import Tasks, Unknowns
from cspr_jax.motions.problem import Problem
from cspr_jax.motions.proved_answers import ProvedAnswers, answers_of, judge_all_robots, proofs_of
from cspr_jax.robots.clearance import Scene

# Intervals of the first searches; of those where their motions lead to none on all intervals.
COARSE, MIDDLE = 12, 24
# Splines of maps are coarser than those of plans, and some parts in a thousand slower.
MAP = FreeSettings(intervals=32)


class ManyFreeMotions(NamedTuple):
    """The fastest motions that were found between pairs of poses.

    Fields:
        rows: (m,) numbers of the pairs for which the search met all limits at the instants that it looks at.
        motions: m of them.
        answers: of these: proved, refuted or undecided.
    """

    rows: np.ndarray
    motions: list[Spline]
    answers: ProvedAnswers


def free_motions(
    problem: Problem, scene: Scene | None, pairs: Sequence[FreePoses], settings: FreeSettings = MAP
) -> ManyFreeMotions:
    """Search for the fastest motions of many pairs of poses, and prove them.

    Args:
        scene: bodies that can meet; they are judged with the motions, and do not change them.
        pairs: two poses each, at least one pair.

    Returns:
        the motions.

    Raises:
        InputError: a robot for which no free motion is sought, or a cable without a largest tension.
    """
    questions = [FreeQuestion.of(problem, scene, pair, settings) for pair in pairs]

    def on(intervals: int, instants: int) -> Tasks:
        return _stacked([question.tasks(intervals, instants) for question in questions])

    coarse, fine = on(COARSE, FEWEST), on(settings.intervals, settings.instants)
    search = Neighbours(coarse, [pair.z0 for pair in pairs])
    search.search()
    rows = np.flatnonzero(np.isfinite(search.duration))
    if not len(rows):
        return ManyFreeMotions(rows, [], answers_of([], np.empty(0)))
    begun = _refined(coarse.basis, fine.taken(rows), search.controls[rows], search.duration[rows], FINE[0][0])
    unknowns, is_optimal = _first_optima(fine.taken(rows), begun, FINE)
    lost = rows[~is_optimal]
    if len(lost):
        middle = on(MIDDLE, FEWEST).taken(lost)
        begun = _refined(coarse.basis, middle, search.controls[lost], search.duration[lost], FROM_NEIGHBOUR[0])
        between = optima(middle, begun, *FROM_NEIGHBOUR).unknowns
        controls, duration = middle.controls(between)[:, 0], between.duration[:, 0]
        begun = _refined(middle.basis, fine.taken(lost), controls, duration, FINE[0][0])
        _put(unknowns, *_first_optima(fine.taken(lost), begun, FINE), ~is_optimal, is_optimal)
    tasks, unknowns = fine.taken(rows[is_optimal]), unknowns.taken(is_optimal)
    rows = rows[is_optimal]
    return _proved(questions[0], rows, tasks, unknowns, [pairs[k].z0 for k in rows.tolist()])


def _stacked(tasks: Sequence[Tasks]) -> Tasks:
    # Tasks of the same numbers of segments as one.
    values = {field.name: getattr(tasks[0], field.name) for field in dataclasses.fields(Tasks)}
    names = [name for name, value in values.items() if isinstance(value, np.ndarray) and value.ndim]
    joined: dict[str, Any] = {name: np.concatenate([getattr(one, name) for one in tasks]) for name in names}
    return dataclasses.replace(tasks[0], **joined)


def _refined(source: Basis, tasks: Tasks, controls: np.ndarray, duration: np.ndarray, barrier: float) -> Unknowns:
    # Motions on other intervals, (n, K, d), as the start of a search.
    functions = BSpline(source.knots, np.eye(source.controls), DEGREE)(tasks.basis.averages)
    fitted = np.einsum("kj,ji,nid->nkd", tasks.basis.fit, functions, controls, optimize=True)
    return started(tasks, fitted[:, None], duration[:, None], barrier)


def _first_optima(tasks: Tasks, start: Unknowns, levels: Iterable[tuple[float, float]]) -> tuple[Unknowns, np.ndarray]:
    # For each task the optimum of the first search that converges, with its barrier and softness; whether there is one.
    unknowns, is_optimal = Unknowns(*(leaf.copy() for leaf in start)), np.zeros(len(start.duration), bool)
    for barrier, softness in levels:
        rows = np.flatnonzero(~is_optimal)
        if len(rows):
            part = tasks.taken(rows)
            result = optima(part, again(part, start.taken(rows), barrier), barrier, softness)
            _put(unknowns, result.unknowns, result.is_optimal, rows, is_optimal)
    return unknowns, is_optimal


def _put(
    unknowns: Unknowns, others: Unknowns, are_optimal: np.ndarray, rows: np.ndarray, is_optimal: np.ndarray
) -> None:
    # Replace the unknowns of some motions, in place.
    for leaf, values in zip(unknowns, others, strict=True):
        leaf[rows] = values
    is_optimal[rows] = are_optimal


def _proved(
    question: FreeQuestion, rows: np.ndarray, tasks: Tasks, unknowns: Unknowns, depths: list[float]
) -> ManyFreeMotions:
    # Motions, tightened and searched again until all are proved, or no more helps.
    problem, scene = question.problem, question.scene

    def motion(k: int) -> Spline:
        one = np.array([k])
        return motions_of(tasks.taken(one), unknowns.taken(one), depths[k])[0]

    motions, proofs = [motion(k) for k in range(len(rows))], np.empty(len(rows), object)
    left = np.arange(len(rows))
    for number in range(1, ROUNDS + 1):
        if len(left):
            several = SeveralSplines([motions[k] for k in left.tolist()])
            parts = several.bounds, several.durations, scene, several.jumps
            proofs[left] = proofs_of(problem, *parts, intervals=False)
        left = np.array([k for k in left.tolist() if proofs[k].verdict], int)
        tighter = None
        if len(left) and number < ROUNDS:
            tighter = tightened(question, tasks.taken(left), [motions[k] for k in left.tolist()])
        if tighter is None:
            break
        further, is_optimal = _first_optima(tighter, unknowns.taken(left), ON)
        left = left[is_optimal]
        tasks.low[left], tasks.high[left] = tighter.low[is_optimal], tighter.high[is_optimal]
        for leaf, values in zip(unknowns, further, strict=True):
            leaf[left] = values[is_optimal]
        for k in left.tolist():
            motions[k] = motion(k)
    answers = answers_of(proofs.tolist(), unknowns.duration[:, 0])
    judge_all_robots(problem, answers, motions, scene)
    return ManyFreeMotions(rows, motions, answers)
