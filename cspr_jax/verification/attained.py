"""Smallest slacks that a motion attains, and their times: minima within the blocks that a proof leaves for them.

The proof bounds each smallest slack and gives the blocks that may contain it. Samples within these blocks, at their
ends and on both sides of joints give attained slacks; the search is refined around the smallest samples until the time
is known to a millionth of the duration or better.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from cspr_jax.motion.answers import FEWER, AnyAnswers
from cspr_jax.motion.formulas import HasFormulas
from cspr_jax.motion.motion import BESIDE, Motion
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.search.minima import followed, lowest_samples, vertex_values
from cspr_jax.numerics.shapes import Bool, Num
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.runtime.exact_arithmetic import has_exact
from cspr_jax.schema.verdicts import FLAGS, NO_REASON, Verdict
from cspr_jax.verification.bounds.block_parts import TimeBlocks
from cspr_jax.verification.bounds.block_slacks import block_slacks
from cspr_jax.verification.criteria import levels
from cspr_jax.verification.proved_answers import MotionProof, margins_of, proof_of
from cspr_jax.verification.robustness.motion_tolerances import states_as_bounds

STARTS, FOLLOWED = 6, 2  # numbers of samples for each criterion around which the first, and further rounds refine
ROUNDS = 7  # rounds of sampling, each eight times as fine as the one before
# Largest number of blocks that are sampled for a criterion: those with the smallest upper bounds.
MOST_BLOCKS = 1000
Slacks = Callable[[np.ndarray], np.ndarray]


def with_attained(
    problem: Problem,
    answers: AnyAnswers,
    motions: Sequence[Motion],
    scene: Scene | None = None,
    arcs: Num[np.ndarray, "n"] | None = None,
) -> AnyAnswers:
    """Answers with a proof of every segment that is not feasible, with attained slacks instead of upper bounds.

    Margins of proofs are attained ones, too. Of a segment whose number of arcs is free, 0 in `arcs`, one refused motion
    says nothing about those of other numbers.
    """
    proofs, before = np.array(answers.proof), [Verdict.FEASIBLE] * len(motions)
    for i, motion in enumerate(motions):
        is_known = proofs[i] is not None and not (not proofs[i].parts.usual and not proofs[i].verdict)
        if not is_known and not answers.feasible[i]:
            proofs[i] = proof_of(problem, motion, scene)
        if proofs[i] is not None:
            before[i] = proofs[i].verdict
            proofs[i] = attained(problem, motion, proofs[i], scene)
    is_alone = (answers.tried_arcs == 0) | (0 if arcs is None else arcs > 0)
    answers = _with_verdicts(dataclasses.replace(answers, proof=proofs), before, is_alone)
    if answers.margin_unit != "N" or not all(proofs):
        return answers
    moves = np.isfinite(answers.duration)
    margins: dict[str, Any] = {
        name: np.where(moves, column, np.nan) for name, column in margins_of(list(proofs)).items()
    }
    return dataclasses.replace(answers, **margins)


def _with_verdicts(answers: AnyAnswers, before: list[Verdict], is_alone: Bool[np.ndarray, "n"]) -> AnyAnswers:
    # Take the verdicts of proofs where families, or bounds, leave them open or err; not where robots are uncertain.
    verdict, arcs = answers.verdict.copy(), answers.arcs.copy()
    for i, proof in enumerate(answers.proof):
        reasons, is_claimed = Verdict(int(verdict[i])) & ~NO_REASON, not verdict[i] & ~FEWER
        if proof is None or not np.isnan(answers.tolerated[i]) or reasons not in (Verdict.UNDECIDED, before[i]):
            continue
        if proof.is_feasible and reasons:
            verdict[i], arcs[i] = verdict[i] & FEWER, answers.tried_arcs[i]
        elif is_claimed or (reasons and is_alone[i]):
            verdict[i] = (verdict[i] & FLAGS(NO_REASON.value)) | FLAGS(proof.verdict.value)
    return dataclasses.replace(answers, verdict=verdict, arcs=arcs)


def attained(problem: Problem, motion: Motion, case: MotionProof, scene: Scene | None = None) -> MotionProof:
    """The proof with smallest slacks, and times, that the motion attains; open criteria are decided exactly."""
    case = _sampled(problem, motion, case, scene)
    if not (has_exact() and isinstance(motion, HasFormulas) and np.isfinite(float(motion.duration()))):
        return case
    if not case.doubtful.any():
        return case
    from cspr_jax.verification.exact.decisions import decided  # few motions are open

    return decided(problem, motion, case, scene)


def _sampled(problem: Problem, motion: Motion, case: MotionProof, scene: Scene | None) -> MotionProof:
    # The proof with samples in place of upper bounds.
    proof, duration = case.proof, float(motion.duration())
    columns = np.flatnonzero(case.nearest)
    if proof.near is None or not len(columns) or not np.isfinite(duration):
        return case

    def slacks(tau: np.ndarray) -> np.ndarray:
        times = tau[0]
        states = states_as_bounds(motion, times)
        bounds = problem.robot, problem.limits, lambda *_: states, times, times, scene
        return block_slacks(*bounds, parts=case.parts).high[None, :, columns]

    columns = columns[columns < proof.near.slacks.low.shape[1]]  # the last columns are feeds, from another proof
    smallest, tau = _minima(slacks, _blocks(proof.near, proof.high, columns, duration), np.asarray(motion.breaks()))
    high, when = proof.high.copy(), proof.when.copy()
    # A limit may be touched between two neighbouring floats, where no sample attains it.
    level = levels(case.criteria)[columns]
    is_seen = np.isfinite(smallest) & ~((high[columns] < level) & (smallest >= level))
    high[columns[is_seen]], when[columns[is_seen]] = smallest[is_seen], duration * tau[is_seen]
    return case._replace(proof=dataclasses.replace(proof, high=high, when=when))


def _blocks(near: TimeBlocks, high: np.ndarray, columns: np.ndarray, duration: float) -> tuple[np.ndarray, np.ndarray]:
    # Starts and ends (2, k) of the blocks to sample, tau, and the criteria (k, m) whose smallest slacks they may hold.
    may_hold = near.slacks.low[:, columns] <= high[columns]
    upper = np.where(may_hold, near.slacks.high[:, columns], np.inf)
    for column in np.flatnonzero(may_hold.sum(0) > MOST_BLOCKS):
        may_hold[np.argsort(upper[:, column], kind="stable")[MOST_BLOCKS:], column] = False
    chosen = may_hold.any(1)
    return np.stack([near.start[chosen], near.end[chosen]]) / duration, may_hold[chosen]


def _minima(slacks: Slacks, blocks: tuple[np.ndarray, np.ndarray], joints: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    # Smallest slack of each of m criteria, and its tau, from samples in blocks and then around the smallest ones.
    edges, may_hold = blocks
    inner = joints[(np.searchsorted(edges[0], joints, "right") > np.searchsorted(edges[1], joints))]
    knots = np.unique(np.concatenate([*edges, inner, inner * (1.0 - BESIDE)]))
    tau = np.clip(np.sort(np.concatenate([knots, 0.5 * (knots[1:] + knots[:-1])])), 0.0, 1.0)
    # For each criterion, ignore samples between blocks, and in blocks that cannot contain its smallest slack.
    inside = np.zeros((len(tau) + 1, len(may_hold[0])), int)
    np.add.at(inside, np.searchsorted(tau, edges[0]), may_hold)
    np.subtract.at(inside, np.searchsorted(tau, edges[1], side="right"), may_hold)
    values = np.where(inside.cumsum(0)[:-1] > 0, slacks(tau[None])[0], np.inf)
    starts = lowest_samples(values, vertex_values(tau, values), STARTS)
    smallest, when = followed(slacks, tau[None], starts[None], ROUNDS, FOLLOWED)
    return smallest[0], when[0]
