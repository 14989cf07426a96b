"""Motions from a search, tightened until they are proved: for the planned robot, or for all within an uncertainty."""

from collections.abc import Iterable
from typing import NamedTuple

from cspr_jax.curves.spline import Spline
from cspr_jax.families.free.contacts import around, separated
from cspr_jax.families.free.poses import motions_of
from cspr_jax.families.free.problem import FreeQuestion, slacks_of, tightened
from cspr_jax.families.free.robust import for_all_robots, widened
from cspr_jax.families.free.search.interior_point import Ending, OutOfTime, again, optima
from cspr_jax.families.free.search.tasks import Tasks, Unknowns
from cspr_jax.motion.answers import Answers
from cspr_jax.robots.model.limits import Uncertainty
from cspr_jax.runtime.stages import stage
from cspr_jax.verification.piece_slacks import PieceSlacks
from cspr_jax.verification.proved_answers import proved_answers

# Largest number of rounds of proof and tightening, and of earlier rounds that leave slack for all robots.
ROUNDS, WIDER = 10, 3
# Weights of barriers, and softness, of searches that start from a motion within tighter bounds.
ON = ((1e-5, 1e-2), (1e-4, 1e-1), (1e-3, 1e-1), (1e-2, 1.0), (1e-2, 10.0))
# If no motion is found for the full uncertainty, one for this fraction of it is searched for first.
PART = 0.5


class FreeProof(NamedTuple):
    """A motion with its proof.

    Fields:
        tasks: the task, with the bounds within which the motion is the best one.
        unknowns: unknowns of the motion.
        motions: one per segment.
        answers: answers of the motions, for the planned robot alone.
        is_stopped: whether Ctrl-C, or its time limit, ended the search.
    """

    tasks: Tasks
    unknowns: Unknowns
    motions: list[Spline]
    answers: Answers
    is_stopped: bool


def first_optimum(tasks: Tasks, begun: Iterable[tuple[Unknowns, float, float]], until: float) -> Unknowns | None:
    """The optimum of the first search that converges."""
    for start in begun:
        result = optima(tasks, *start, Ending(until))
        if result.is_optimal[0] and tasks.objective.keeps_limits(result.unknowns.level)[0]:
            return result.unknowns
    return None


def proved(question: FreeQuestion, tasks: Tasks, unknowns: Unknowns, *, is_optimal: bool = True) -> FreeProof:
    """A motion with its proof, tightened until the proof meets the limits of a question."""
    planned, is_stopped = question.planned, False
    for number in range(1, ROUNDS + 1):
        stage(f"free motion: proof {number}")
        motions = motions_of(tasks, unknowns, question.poses.z0)
        answers = proved_answers(planned, motions, question.scene)
        tighter = None
        if is_optimal and number < ROUNDS and not (answers.feasible.all() and question.is_planned):
            slacks = slacks_of(question, motions)
            tighter = _tighter(question, tasks, unknowns, slacks, number)
        if tighter is None:
            break
        try:
            further = _again(question, *tighter)
            if further is None and tighter[0].planes is not None and tasks.planes is None:
                stage("free motion: round obstacles")
                further = around(question, tasks, unknowns, slacks)
        except (KeyboardInterrupt, OutOfTime):
            is_stopped = True
            break
        if further is None:
            break
        tasks, unknowns = further
    return FreeProof(tasks, unknowns, motions, answers, is_stopped)


def _tighter(
    question: FreeQuestion, tasks: Tasks, unknowns: Unknowns, slacks: PieceSlacks, number: int
) -> tuple[Tasks, Unknowns] | None:
    # Return the task within tighter bounds and the motion as its unknowns; None if the proof finds enough slack.
    tighter = tightened(question, tasks, slacks, number)
    parted = separated(question, tighter or tasks, unknowns, slacks, number) if question.is_planned else None
    return parted or (None if tighter is None else (tighter, unknowns))


def _again(question: FreeQuestion, tasks: Tasks, unknowns: Unknowns) -> tuple[Tasks, Unknowns] | None:
    # Search within other bounds from a motion found before; return None if the bounds contradict each other.
    low, high = tasks.bounds(unknowns.level)
    if not (low < high).all():
        return None
    begun = ((again(tasks, unknowns, each[0]), *each) for each in ON)
    further = first_optimum(tasks, begun, question.settings.until)
    return None if further is None else (tasks, further)


def robust_proof(
    question: FreeQuestion, uncertainty: Uncertainty, tasks: Tasks, unknowns: Unknowns
) -> FreeProof | None:
    """The best motion for all robots within an uncertainty; the search starts from that of the planned robot."""
    all_robots, fewer = (for_all_robots(question, uncertainty, multiple) for multiple in (1.0, PART))
    try:
        full = _with_slack(all_robots, tasks, tasks, unknowns)
        part = None if full else _with_slack(fewer, tasks, tasks, unknowns)
        full = _with_slack(all_robots, tasks, *part) if part else full
    except (KeyboardInterrupt, OutOfTime):
        return None
    if full:
        return proved(all_robots, *full)
    return proved(fewer, *part) if part else None


def _with_slack(
    question: FreeQuestion, nominal: Tasks, tasks: Tasks, unknowns: Unknowns
) -> tuple[Tasks, Unknowns] | None:
    # Search from a motion found before for the best one that leaves slack for all robots within the planned bounds.
    best = None
    for number in range(1, WIDER + 1):
        stage(f"free motion: room for all robots {number}")
        wider = widened(question, nominal, motions_of(tasks, unknowns, question.poses.z0))
        further = _again(question, wider, unknowns)
        if further is None:
            break
        best = tasks, unknowns = further
    return best
