"""The fastest motions of many pairs of poses: searched on few intervals, then on many, proved and tightened."""

import dataclasses
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline

from cspr_jax.curves.several import SeveralSplines
from cspr_jax.curves.spline import Spline
from cspr_jax.free.basis import DEGREE, Basis, basis
from cspr_jax.free.free_motion import FEWEST, FINE, ON, ROUNDS, tightened
from cspr_jax.free.instants import ValueBounds, bounds
from cspr_jax.free.neighbours import Neighbours
from cspr_jax.free.poses import FreePoses, check_searched, motions_of, tasks_of
from cspr_jax.free.search import again, optima, started
from cspr_jax.free.tasks import Tasks, Unknowns
from cspr_jax.motions.criteria import criteria
from cspr_jax.motions.problem import Problem
from cspr_jax.motions.proved_answers import MotionProof, ProvedAnswers, answers_of, judge_all_robots, proofs_of
from cspr_jax.robots.clearance import Scene

# Intervals of the first searches, and of the motions in the end, each for pairs for which the ones before led to no
# proved motion: a search that gets stuck on some intervals does not on others. Plans have more intervals, and motions
# that are some parts in a thousand faster. Instants of each interval.
MESHES, INSTANTS = ((12, 32), (16, 28), (24, 36)), 4


# Numbers of pairs, and their motions with proofs.
_Found = tuple[np.ndarray, list[Spline], list[MotionProof]]


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
    problem: Problem, scene: Scene | None, pairs: Sequence[FreePoses], meshes: Sequence[tuple[int, int]] = MESHES
) -> ManyFreeMotions:
    """Search for the fastest motions of many pairs of poses, and prove them.

    Args:
        scene: bodies that can meet; they are judged with the motions, and do not change them.
        pairs: two poses each, at least one pair.
        meshes: intervals of the first searches, and of the motions in the end, even.

    Returns:
        the motions.

    Raises:
        InputError: a robot for which no free motion is sought, or a cable without a largest tension.
    """
    check_searched(problem)
    limits = bounds(problem.robot, problem.limits, criteria(problem.robot, problem.limits, scene))
    found = dict[int, tuple[Spline, MotionProof]]()
    for mesh in meshes:
        left = [k for k in range(len(pairs)) if k not in found or found[k][1].verdict]
        if left:
            rows, motions, proofs = _on_mesh(problem, scene, limits, [pairs[k] for k in left], mesh)
            for k, motion, proof in zip(rows.tolist(), motions, proofs, strict=True):
                if left[k] not in found or not proof.verdict:
                    found[left[k]] = motion, proof
    rows = np.array(sorted(found), int)
    motions = [found[k][0] for k in rows.tolist()]
    answers = answers_of([found[k][1] for k in rows.tolist()], np.array([float(one.knots[-1]) for one in motions]))
    judge_all_robots(problem, answers, motions, scene)
    return ManyFreeMotions(rows, motions, answers)


def _on_mesh(
    problem: Problem, scene: Scene | None, limits: ValueBounds, pairs: Sequence[FreePoses], mesh: tuple[int, int]
) -> _Found:
    def on(intervals: int, instants: int) -> Tasks:
        return _stacked([tasks_of(problem, basis(intervals, instants), limits, pair) for pair in pairs])

    coarse, fine = on(mesh[0], FEWEST), on(mesh[1], INSTANTS)
    search = Neighbours(coarse, [pair.z0 for pair in pairs])
    search.search()
    rows = np.flatnonzero(np.isfinite(search.duration))
    if not len(rows):
        return rows, [], []
    begun = _refined(coarse.basis, fine.taken(rows), search.controls[rows], search.duration[rows], FINE[0][0])
    unknowns, is_optimal = _first_optima(fine.taken(rows), begun, FINE)
    tasks, unknowns, rows = fine.taken(rows[is_optimal]), unknowns.taken(is_optimal), rows[is_optimal]
    return rows, *_proved(problem, scene, limits, tasks, unknowns, [pairs[k].z0 for k in rows.tolist()])


def _stacked(tasks: Sequence[Tasks]) -> Tasks:
    # Tasks of the same numbers of segments as one.
    values = {field.name: getattr(tasks[0], field.name) for field in dataclasses.fields(Tasks)}
    names = [name for name, value in values.items() if isinstance(value, np.ndarray)]
    joined = {name: np.concatenate([getattr(one, name) for one in tasks]) for name in names}
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
    problem: Problem,
    scene: Scene | None,
    limits: ValueBounds,
    tasks: Tasks,
    unknowns: Unknowns,
    depths: list[float],
) -> tuple[list[Spline], list[MotionProof]]:
    # Motions, tightened and searched again until all are proved, or no more helps.
    def motion(k: int) -> Spline:
        one = np.array([k])
        return motions_of(tasks.taken(one), unknowns.taken(one), depths[k])[0]

    motions, proofs = [motion(k) for k in range(len(depths))], np.empty(len(depths), object)
    left = np.arange(len(depths))
    for number in range(1, ROUNDS + 1):
        if len(left):
            several = SeveralSplines([motions[k] for k in left.tolist()])
            parts = several.bounds, several.durations, scene, several.jumps
            proofs[left] = proofs_of(problem, *parts, intervals=False)
        left = np.array([k for k in left.tolist() if proofs[k].verdict], int)
        tighter = None
        if len(left) and number < ROUNDS:
            tighter = tightened(problem, scene, tasks.taken(left), [motions[k] for k in left.tolist()], limits)
        if tighter is None:
            break
        further, is_optimal = _first_optima(tighter, unknowns.taken(left), ON)
        left = left[is_optimal]
        tasks.low[left], tasks.high[left] = tighter.low[is_optimal], tighter.high[is_optimal]
        for leaf, values in zip(unknowns, further, strict=True):
            leaf[left] = values[is_optimal]
        for k in left.tolist():
            motions[k] = motion(k)
    return motions, proofs.tolist()
