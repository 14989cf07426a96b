"""The limit of root mean squares of motor torques, which a plan keeps as a whole, not segment by segment."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from cspr_jax.motion.leg import JoinedLeg
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.shapes import Bool
from cspr_jax.numerics.tolerances import TOUCHED
from cspr_jax.schema.verdicts import FLAGS, Verdict

MEAN = FLAGS(Verdict.MOTOR_OVER_TORQUE_RMS.value)


def with_mean_torques(problem: Problem, legs: Sequence[JoinedLeg], scene: Callable[[], Any]) -> tuple[JoinedLeg, ...]:
    """Legs with verdicts and proofs that take `motor_torque_rms_max` into account.

    If the plan exceeds it, the segments with a larger root mean square of their own are at fault.
    """
    limit, motions = problem.limits.motor_torque_rms_max, [motion for leg in legs for motion in leg.motions]
    durations = np.concatenate([leg.answers.duration for leg in legs])
    if limit is None or not np.isfinite(durations).all():
        return tuple(legs)
    # Imported here, since few plans need it.
    from cspr_jax.verification.mean_torques import extended, mean_torques
    from cspr_jax.verification.proved_answers import proof_of

    largest, totals = np.asarray(limit), mean_torques(problem, motions)
    allowed = largest * (1.0 + TOUCHED)
    is_over = totals.rms_low > allowed
    is_open = ~(totals.rms_high <= allowed) & ~is_over
    at_fault = _at_fault(totals.rms_of_each, largest, is_over if is_over.any() else is_open)
    results, first = list[JoinedLeg](), 0
    for leg in legs:
        answers, rows = leg.answers, at_fault[first : first + len(leg.motions)]
        proofs, verdict = np.array(answers.proof), np.array(answers.verdict, FLAGS)
        for i in np.flatnonzero(rows & [proof is None for proof in proofs]).tolist():
            proofs[i] = proof_of(problem, leg.motions[i], scene())
        # A segment that is not at fault stays feasible, and so does its proof.
        for i in np.flatnonzero(rows | (not at_fault.any())).tolist():
            if proofs[i] is not None and not any(row.flag & MEAN for row in proofs[i].criteria):
                proofs[i] = extended(proofs[i], totals, largest)
        verdict[rows] |= MEAN if is_over.any() else FLAGS(Verdict.UNDECIDED.value)
        results.append(dataclasses.replace(leg, answers=dataclasses.replace(answers, proof=proofs, verdict=verdict)))
        first += len(leg.motions)
    return tuple(results)


def _at_fault(each: np.ndarray, limit: np.ndarray, of_motors: Bool[np.ndarray, "n_cables"]) -> np.ndarray:
    # Segments whose own torques exceed the limit of one of some motors; the worst one if bounds tell none.
    ratios = np.max((each / limit)[:, of_motors], axis=1, initial=0.0)
    if not of_motors.any():
        return np.zeros(len(each), bool)
    return ratios > 1.0 if (ratios > 1.0).any() else np.arange(len(each)) == ratios.argmax()
