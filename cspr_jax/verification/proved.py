"""Summaries of proofs of motions: feasible, refuted or undecided over its whole time, and margins.

They serve searches of families that have no faster proof of their own.
"""

from typing import NamedTuple

import numpy as np

from cspr_jax.motion.motion import BoundedMotion
from cspr_jax.motion.problem import Problem
from cspr_jax.schema.limits import LIMITS
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.verification.proved_answers import TENSIONS, MotionProof, proof_of

# Flags of the limits beside those of tensions.
OTHERS = [row.flag for row in LIMITS if row.quantity != "tension"]


class ProofSummary(NamedTuple):
    """Proof of one motion, in short.

    Fields:
        verdict: flags of `Verdict`; 0 if every criterion is proved.
        margin: upper bound of the least margin of tensions, N.
        bound: lower bound of the same.
        room: smallest slack of the limits over their values, of the floor over z0; inf without limits.
        instant: s, at which the motion fails the criterion that it fails first; NaN if it is not refuted.
        clearance: upper bound of the least clearance of two cables, m; inf where none can meet.
    """

    verdict: int
    margin: float
    bound: float
    room: float
    instant: float
    clearance: float = np.inf


def proved(problem: Problem, motion: BoundedMotion) -> ProofSummary:
    """Decide whether a motion is feasible."""
    duration = float(motion.duration())
    if not (np.isfinite(duration) and duration > 0.0):
        return ProofSummary(Verdict.NOT_FINITE.value, np.nan, np.nan, np.nan, np.nan)
    return summary(proof_of(problem, motion), float(motion.z0))


def summary(case: MotionProof, z0: float) -> ProofSummary:
    """A proof in short."""
    proof = case.proof
    rooms = [
        float(high) / (row.allowed if row.cables else z0)
        for row, high in zip(case.criteria, proof.high, strict=True)
        if row.flag in OTHERS
    ]
    return ProofSummary(
        verdict=case.verdict.value,
        margin=case.least(proof.high, TENSIONS),
        bound=case.least(proof.low, TENSIONS),
        room=min(rooms, default=np.inf),
        instant=min((float(rows[0].mean()) for rows in proof.failing if len(rows)), default=np.nan),
        clearance=case.least(proof.high, Verdict.CABLE_CABLE),
    )
