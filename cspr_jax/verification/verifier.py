"""Proofs, with contacts, pulleys and winches, of motions whose families ignore these, and smallest numbers of arcs.

A family makes its motions for cables that leave from points, touch nothing and are wound by any winch. Among obstacles,
or with the shape of a platform, only contacts must then be proved, since the family has proved the rest; with limits of
winches, these; over pulleys, all criteria must be.
Where numbers of arcs are free, larger ones are tried until the motion is proved.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from cspr_jax.motion.answers import Answers, replaced
from cspr_jax.motion.limits import motor_limits_set, without_motors
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.shapes import Num
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.schema.verdicts import FLAGS, Verdict
from cspr_jax.verification.criteria import ALL, CriterionParts, criteria
from cspr_jax.verification.proved_answers import MotionProof, proofs_of, proofs_of_each
from cspr_jax.verification.robustness.motion_tolerances import motion_tolerances
from cspr_jax.verification.smallest_proved import FEWER, NONE, UNDECIDED, smallest_proved

# A function of indices of segments and of numbers of arcs, as in `Waypoints.arcs`, that gives answers and motions.
Join = Callable[[np.ndarray, np.ndarray], tuple[Answers, Any]]


class VerifiedSegments(NamedTuple):
    """Answers of n segments.

    Fields:
        answers: answers of the family, with verdicts and tolerated uncertainty of further proofs.
        proofs: proofs of the motions; None: the family refuses the motion, or has none.
        arcs: (n,) numbers of arcs with which the family gives these motions.
    """

    answers: Answers
    proofs: list[MotionProof | None]
    arcs: np.ndarray


class _Trial(NamedTuple):
    # Answers of the family, further proofs of its motions, and the combined verdicts (n,).
    answers: Answers
    proofs: list[MotionProof | None]
    verdict: np.ndarray


class Verifier(NamedTuple):
    """Verifier of motions that their family has not proved with contacts and pulleys.

    Fields:
        problem: the problem, whose robot may have pulleys, and whose limits may be those of winches.
        scene: bodies that can meet, in the robot's axes; None: the family has proved contacts.
        intervals: whether to find intervals of failure, as in `time_proofs`.
        are_plans: whether each motion is a full plan, so that it keeps the limit of the root mean square of torques.
    """

    problem: Problem
    scene: Scene | None
    intervals: bool = True
    are_plans: bool = False

    @property
    def has_pulleys(self) -> bool:
        """Tell whether the robot has pulleys."""
        return self.problem.robot.pulleys is not None

    @property
    def parts(self) -> CriterionParts:
        """Criteria that the family has not proved."""
        motors = bool(motor_limits_set(self.problem.limits))
        return ALL if self.has_pulleys else CriterionParts(usual=False, motors=motors, contacts=self.scene is not None)

    @property
    def _has_means(self) -> bool:
        return self.are_plans and self.problem.limits.motor_torque_rms_max is not None

    def smallest(self, join: Join, arcs: Num[np.ndarray, "n"], *, step: int, max_arcs: int) -> VerifiedSegments:
        """Smallest numbers of arcs whose motions are proved."""
        trial = self._trial(*join(np.arange(len(arcs)), arcs), self.intervals)
        answers, proofs, arcs = trial.answers, list(trial.proofs), arcs.copy()
        verdict, is_free = trial.verdict.copy(), (arcs == 0) & (step * max_arcs > 0)
        doubtful = is_free & ((trial.verdict | (0 if self.has_pulleys else answers.verdict)) & UNDECIDED != 0)
        # Over pulleys the number that the family chooses is not valid.
        rows = np.flatnonzero(is_free & (self.has_pulleys | (answers.feasible & (verdict != 0))))
        minimum = np.full(len(rows), step) if self.has_pulleys else answers.tried_arcs[rows] + step

        def further(index: np.ndarray, lower: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            nonlocal answers
            rows_tried = rows[index]
            trial = self._trial(*join(rows_tried, lower if self.has_pulleys else -lower), intervals=False)
            unsure = (trial.verdict | (0 if self.has_pulleys else trial.answers.verdict)) & UNDECIDED
            doubtful[rows_tried] |= unsure != 0
            proved = np.flatnonzero(trial.verdict == 0)
            answers = replaced(answers, rows_tried[proved], trial.answers, proved)
            for i, k in zip(rows_tried[proved].tolist(), proved.tolist(), strict=True):
                proofs[i] = trial.proofs[k]
            tried = lower if self.has_pulleys else np.where(trial.answers.feasible, trial.answers.tried_arcs, NONE)
            return tried, np.where(trial.verdict == 0, 0, trial.verdict | Verdict.NO_ARCS)

        smallest = smallest_proved(further, minimum, step=step, last=max_arcs).number
        is_none, done = smallest == NONE, rows[smallest != NONE]
        arcs[done], verdict[done] = smallest[~is_none], 0
        none = np.zeros(len(arcs), bool)
        none[rows[is_none]] = True
        if self.has_pulleys and not max_arcs:  # the family has refuted smaller numbers for cables from points
            doubtful |= (arcs == 0) & (answers.tried_arcs > max(step, 1))
        verdict = np.where(none, np.where(doubtful, Verdict.UNDECIDED, verdict | FLAGS(Verdict.NO_ARCS)), verdict)
        verdict = np.where(verdict == 0, np.where(doubtful, FEWER, answers.verdict & FEWER), verdict).astype(FLAGS)
        feasible = np.where(verdict & ~FEWER == 0, answers.tried_arcs, 0)
        return VerifiedSegments(dataclasses.replace(answers, verdict=verdict, arcs=feasible), proofs, arcs)

    def columns(self, join: Join, count: int, *, max_arcs: int) -> dict[str, np.ndarray]:
        """Columns of a map of motions with obstacles or winches, equal to the answers of plans of single cells."""
        answers, proofs, _ = self.smallest(join, np.zeros(count, int), step=1, max_arcs=max_arcs)
        if not self.parts.contacts:
            return answers.arrays()
        # Contacts are the last criteria but for means.
        case = self.problem.robot, self.problem.limits, self.scene
        contacts = slice(len(criteria(*case, self.parts._replace(contacts=False))), len(criteria(*case, self.parts)))
        clearance = np.array([np.nan if proof is None else proof.proof.high[contacts].min() for proof in proofs])
        return answers.arrays() | {"clearance": clearance}

    def _trial(self, answers: Answers, motions: Any, intervals: bool) -> _Trial:
        # Verify motions of a family; without pulleys only those that the family has proved.
        if not (any(self.parts) or self._has_means):  # the family has proved all but what a plan keeps as a whole
            proved = np.where(answers.feasible, 0, answers.verdict).astype(FLAGS)
            return _Trial(answers, [None] * len(proved), proved)
        is_verified = np.isfinite(answers.duration) & (self.has_pulleys | answers.feasible)
        rows, verdict = np.flatnonzero(is_verified), np.array(answers.verdict, FLAGS)
        proofs: list[MotionProof | None] = [None] * len(verdict)
        for i, proof in zip(rows.tolist(), self._proofs(motions, rows, intervals), strict=True):
            proofs[i], verdict[i] = proof, proof.verdict
        verdict[~is_verified & (verdict & ~FEWER == 0)] = Verdict.NOT_FINITE
        uncertainty: Any = self.problem.limits.uncertainty
        if uncertainty is not None and float(uncertainty.spool_positions) > 0.0:  # an uncertain mass moves no cable
            answers = self._for_all_robots(answers, motions, verdict, rows[verdict[rows] == 0])
        return _Trial(answers, proofs, verdict)

    def _proofs(self, motions: Any, rows: np.ndarray, intervals: bool) -> list[MotionProof]:
        how: Any = {"scene": self.scene, "parts": self.parts}
        if not len(rows):
            return []
        if isinstance(motions, list):
            proofs = proofs_of_each(self.problem, [motions[i] for i in rows], intervals=intervals, **how)
        else:
            batch = motions.take(rows)
            proofs = proofs_of(self.problem, batch.bounds, batch.durations, intervals=intervals, **how)
        if not self._has_means:
            return proofs
        from cspr_jax.verification.mean_torques import with_means_of_each  # few maps need it

        return with_means_of_each(self.problem, proofs, [motions[i] for i in rows])

    def _for_all_robots(self, answers: Answers, motions: Any, verdict: np.ndarray, rows: np.ndarray) -> Answers:
        # Verify contacts of feasible motions for all robots within an uncertainty; the family has verified the rest.
        proved, refuted = answers.tolerated.copy(), answers.not_tolerated.copy()
        for i in rows.tolist():
            ours = motion_tolerances(self.problem, motions[i], self.scene, contacts_alone=True)
            proved[i], refuted[i] = min(proved[i], float(ours.proved[0])), min(refuted[i], float(ours.refuted[0]))
            if proved[i] < 1.0:
                verdict[i] = Verdict.UNCERTAINTY if refuted[i] <= 1.0 else Verdict.UNDECIDED
        return dataclasses.replace(answers, tolerated=proved, not_tolerated=refuted)


def of_family(problem: Problem, *, motor_speeds: bool = False) -> Problem:
    """A problem without what families ignore, so that robots with and without winches share compiled functions."""
    limits, speeds_max = without_motors(problem.limits), problem.limits.motor_speed_max
    if not motor_speeds or speeds_max is None:
        return problem._replace(robot=dataclasses.replace(problem.robot, pulleys=None, winches=None), limits=limits)
    limits = dataclasses.replace(limits, motor_speed_max=speeds_max)
    return problem._replace(robot=dataclasses.replace(problem.robot, pulleys=None), limits=limits)
