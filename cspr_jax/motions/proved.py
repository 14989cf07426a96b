"""Summaries of proofs of motions: feasible, refuted or undecided over its whole time, and margins.

It serves searches of families that have no faster proof of their own.
"""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from cspr_jax.motions.block_slacks import BlockSlacks, block_slacks
from cspr_jax.motions.criteria import Criterion, criteria
from cspr_jax.motions.limits import limits_set
from cspr_jax.motions.motion import BoundedMotion
from cspr_jax.motions.problem import Problem
from cspr_jax.motions.time_proof import TimeProof, time_proof
from cspr_jax.schema.verdicts import Verdict, conjunction

Slacks = Callable[[np.ndarray, np.ndarray], BlockSlacks]


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


def proved(
    problem: Problem, motion: BoundedMotion, slacks: Slacks | None = None, rows: list[Criterion] | None = None
) -> ProofSummary:
    """Decide whether a motion is feasible.

    Args:
        motion: from the centroid of the spools, z down.
        slacks: bounds of slacks over blocks, from their starts and ends, (k,) s each; None: those of `block_slacks`.
        rows: the criteria of these slacks; None: those of `motions.criteria`.

    Returns:
        the proof.
    """
    robot, limits, duration = problem.robot, problem.limits, float(motion.duration())
    if not (np.isfinite(duration) and duration > 0.0):
        return ProofSummary(Verdict.NOT_FINITE.value, np.nan, np.nan, np.nan, np.nan)
    rows = criteria(robot, limits) if rows is None else rows
    proof = time_proof(slacks or partial(block_slacks, robot, limits, motion.bounds), duration)
    failing = [
        (row.flag.value, float(part[0].mean())) for row, part in zip(rows, proof.failing, strict=True) if len(part)
    ]
    verdict = np.bitwise_or.reduce([flag for flag, _ in failing] + [0])
    verdict |= 0 if (proof.low > 0.0).all() else Verdict.UNDECIDED.value
    of_tensions = np.array([row.unit == "N" for row in rows])
    return ProofSummary(
        int(conjunction(np.array(verdict))),
        float(proof.high[of_tensions].min()),
        float(proof.low[of_tensions].min()),
        _room(problem, float(motion.z0), rows, proof),
        min((instant for _, instant in failing), default=np.nan),
        float(proof.high[[row.flag == Verdict.CABLE_CABLE for row in rows]].min(initial=np.inf)),
    )


def _room(problem: Problem, z0: float, rows: list[Criterion], proof: TimeProof) -> float:
    # Return the smallest slack of the limits that have one, as it is attained.
    of_flag = {row.flag: row for row in limits_set(problem.limits) if row.quantity != "tension"}
    room = np.inf
    for row, high in zip(rows, proof.high, strict=True):
        if row.flag in of_flag:
            limit = np.asarray(getattr(problem.limits, of_flag[row.flag].name))
            size = float(limit[row.cables[0]]) if row.cables else z0
            room = min(room, float(high) / size)
    return room
