"""The fastest motions of many pairs of poses: searched on few intervals, then on many, proved and tightened."""

import dataclasses
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import BSpline

from cspr_jax.curves.spline import Spline, SplineBatch
from cspr_jax.families.free.free_motion import FEWEST, FINE
from cspr_jax.families.free.neighbours import Neighbours
from cspr_jax.families.free.poses import FreePoses, divided, motions_of
from cspr_jax.families.free.problem import FreeQuestion, FreeSettings, planned_problem, slacks_of, tightened
from cspr_jax.families.free.proofs import ON, ROUNDS, proved
from cspr_jax.families.free.search.basis import DEGREE, Basis
from cspr_jax.families.free.search.interior_point import again, optima, started
from cspr_jax.families.free.search.starts import Starts
from cspr_jax.families.free.search.tasks import Tasks, Unknowns
from cspr_jax.maps.proved_map import CONTACTS
from cspr_jax.motion.answers import Answers
from cspr_jax.motion.problem import Problem
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.verification.proved_answers import MotionProof, answers_of, proofs_of, verify_all_robots

# Numbers of intervals of the first search and of the final motion. Pairs without a proved motion on one mesh are tried
# on the next. Plans use more intervals, and their motions are some parts in a thousand faster.
MESHES = ((12, 32), (16, 28), (24, 36))
SAMPLES = 4  # samples of each interval
TRIED = 2  # number of pairs of weight and softness, from `FINE` and from `ON`, tried on one mesh


class ManyFreeMotions(NamedTuple):
    """The fastest motions found between pairs of poses.

    Fields:
        indices: (m,) indices of the pairs for which the search met all limits at its samples.
        motions: the m motions.
        answers: their verdicts: proved, refuted or undecided.
    """

    indices: np.ndarray
    motions: list[Spline]
    answers: Answers


def free_motions(
    problem: Problem,
    scene: Scene | None,
    pairs: Sequence[FreePoses],
    meshes: Sequence[tuple[int, int]] = MESHES,
    begin: Callable[[Tasks], Starts] | None = None,
) -> ManyFreeMotions:
    """Search for the fastest motions of many pairs of poses, and prove them; `begin` replaces the usual starts."""
    questions = [FreeQuestion.of(planned_problem(problem), scene, pair, FreeSettings()) for pair in pairs]
    best = dict[int, tuple[Spline, MotionProof]]()
    sought = [k for k, pair in enumerate(pairs) if not len(divided(problem, pair))]
    for mesh in meshes:
        left = [k for k in sought if k not in best or best[k][1].verdict]
        for i, motion, proof in _on_mesh([questions[k] for k in left], mesh, begin) if left else ():
            if left[i] not in best or not proof.verdict:
                best[left[i]] = motion, proof
    indices = sorted(best)
    motions = [best[k][0] for k in indices]
    answers = answers_of([best[k][1] for k in indices], np.array([float(one.knots[-1]) for one in motions]))
    verify_all_robots(problem, answers, motions, scene)
    return ManyFreeMotions(np.array(indices, int), motions, answers)


def _on_mesh(
    questions: Sequence[FreeQuestion], mesh: tuple[int, int], begin: Callable[[Tasks], Starts] | None
) -> Iterator[tuple[int, Spline, MotionProof]]:
    # Return the indices of the pairs with a motion, the motions, and their proofs.
    coarse, fine = (
        _stacked([question.tasks(intervals, samples) for question in questions])
        for intervals, samples in zip(mesh, (FEWEST, SAMPLES), strict=True)
    )
    search = Neighbours(coarse, [question.poses.z0 for question in questions])
    if begin is None:
        search.search()
    else:
        search.search_from(begin(coarse))
    solved = np.flatnonzero(np.isfinite(search.duration))
    if not len(solved):
        return
    begun = _refined(coarse.basis, fine.take(solved), search.controls[solved], search.duration[solved], FINE[0][0])
    unknowns, is_optimal = _first_optima(fine.take(solved), begun, FINE[:TRIED])
    solved = solved[is_optimal]
    yield from zip(
        solved.tolist(), *_proved(questions, solved, fine.take(solved), unknowns.take(is_optimal)), strict=True
    )


def _stacked(tasks: Sequence[Tasks]) -> Tasks:
    # Join tasks with equal numbers of segments, intervals and samples.
    values = {field.name: getattr(tasks[0], field.name) for field in dataclasses.fields(Tasks)}
    names = [name for name, value in values.items() if isinstance(value, np.ndarray) and value.ndim]
    joined: dict[str, Any] = {name: np.concatenate([getattr(one, name) for one in tasks]) for name in names}
    return dataclasses.replace(tasks[0], **joined)


def _refined(source: Basis, tasks: Tasks, controls: np.ndarray, duration: np.ndarray, barrier: float) -> Unknowns:
    # Start a search on another number of intervals from motions, (n, K, d).
    functions = BSpline(source.knots, np.eye(source.controls), DEGREE)(tasks.basis.averages)
    fitted = np.einsum("kj,ji,nid->nkd", tasks.basis.fit, functions, controls, optimize=True)
    return started(tasks, fitted[:, None], duration[:, None], barrier)


def _first_optima(tasks: Tasks, start: Unknowns, levels: Iterable[tuple[float, float]]) -> tuple[Unknowns, np.ndarray]:
    # Return for each task the optimum of the first search that converges, and whether one does.
    unknowns, is_optimal = Unknowns(*(values.copy() for values in start)), np.zeros(len(start.duration), bool)
    for barrier, softness in levels:
        open_tasks = np.flatnonzero(~is_optimal)
        if len(open_tasks):
            part = tasks.take(open_tasks)
            result = optima(part, again(part, start.take(open_tasks), barrier), barrier, softness)
            _put(unknowns, result.unknowns, result.is_optimal, open_tasks, is_optimal)
    return unknowns, is_optimal


def _put(
    unknowns: Unknowns, others: Unknowns, are_optimal: np.ndarray, rows: np.ndarray, is_optimal: np.ndarray
) -> None:
    # Replace the unknowns of some motions, in place.
    for array, values in zip(unknowns, others, strict=True):
        array[rows] = values
    is_optimal[rows] = are_optimal


def _proved(
    questions: Sequence[FreeQuestion], indices: np.ndarray, tasks: Tasks, unknowns: Unknowns
) -> tuple[list[Spline], list[MotionProof]]:
    # Return motions and proofs: tighten bounds and search again until all are proved, or no more can be.
    problem, scene, depths = questions[0].problem, questions[0].scene, [questions[k].poses.z0 for k in indices.tolist()]

    def motion(k: int) -> Spline:
        one = np.array([k])
        return motions_of(tasks.take(one), unknowns.take(one), depths[k])[0]

    motions, proofs = [motion(k) for k in range(len(indices))], np.empty(len(indices), object)
    left = np.arange(len(indices))
    for number in range(1, ROUNDS + 1):
        if len(left):
            splines = SplineBatch([motions[k] for k in left.tolist()])
            parts = splines.bounds, splines.durations, scene, splines.jumps
            proofs[left] = proofs_of(problem, *parts, intervals=False)
        left = np.array([k for k in left.tolist() if proofs[k].verdict], int)
        tighter = None
        if len(left) and number < ROUNDS:
            tighter = tightened(
                questions[0], tasks.take(left), slacks_of(questions[0], [motions[k] for k in left.tolist()]), number
            )
        if tighter is None:
            break
        further, is_optimal = _first_optima(tighter, unknowns.take(left), ON[:TRIED])
        left = left[is_optimal]
        tasks.low[left], tasks.high[left] = tighter.low[is_optimal], tighter.high[is_optimal]
        for array, values in zip(unknowns, further, strict=True):
            array[left] = values[is_optimal]
        for k in left.tolist():
            motions[k] = motion(k)
    for k in range(len(indices)):
        if proofs[k].verdict & CONTACTS:
            one = np.array([k])
            clear = _clear(questions[indices[k]], tasks.take(one), unknowns.take(one))
            motions[k], proofs[k] = clear or (motions[k], proofs[k])
    return motions, proofs.tolist()


def _clear(question: FreeQuestion, tasks: Tasks, unknowns: Unknowns) -> tuple[Spline, MotionProof] | None:
    # Search again for one motion, with planes that separate its bodies; each motion has its own planes. Return None
    # without a proof.
    proof = proved(question, tasks, unknowns)
    if proof.is_stopped:
        raise KeyboardInterrupt
    if not proof.answers.feasible.all():
        return None
    splines = SplineBatch(proof.motions)
    parts = splines.bounds, splines.durations, question.scene, splines.jumps
    return proof.motions[0], proofs_of(question.problem, *parts, intervals=False)[0]
