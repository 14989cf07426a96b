"""Answers of motions whose states have bounds: proved feasible, refuted, or undecided, over their whole time.

They serve every family that has no faster proof of its own; see `motions.time_proof`.
"""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from cspr_jax.motions.answers import Answers
from cspr_jax.motions.block_slacks import BlockSlacks, Criterion, block_slacks, criteria
from cspr_jax.motions.limits import limits_set
from cspr_jax.motions.motion import BoundedMotion
from cspr_jax.motions.problem import Problem
from cspr_jax.motions.time_proof import TimeProof, time_proof
from cspr_jax.schema.verdicts import FLAGS, Verdict, conjunction

Slacks = Callable[[np.ndarray, np.ndarray], BlockSlacks]


class MotionProof(NamedTuple):
    """Proof of one motion, in short.

    Fields:
        verdict: flags of `Verdict`; 0 if every criterion is proved.
        margin: upper bound of the least margin of tensions, N.
        bound: lower bound of the same.
        room: smallest slack of the limits over their values, of the floor over z0; inf without limits.
        instant: s, at which the motion fails the criterion that it fails first; NaN if it is not refuted.
    """

    verdict: int
    margin: float
    bound: float
    room: float
    instant: float


def proved(
    problem: Problem, motion: BoundedMotion, slacks: Slacks | None = None, rows: list[Criterion] | None = None
) -> MotionProof:
    """Decide whether a motion is feasible.

    Args:
        motion: from the centroid of the spools, z down.
        slacks: bounds of slacks over blocks, from their starts and ends, (k,) s each; None: those of `block_slacks`.
        rows: the criteria of these slacks; None: those of `block_slacks.criteria`.

    Returns:
        the proof.
    """
    robot, limits, duration = problem.robot, problem.limits, float(motion.duration())
    if not (np.isfinite(duration) and duration > 0.0):
        return MotionProof(Verdict.NOT_FINITE.value, np.nan, np.nan, np.nan, np.nan)
    rows = criteria(robot, limits) if rows is None else rows
    proof = time_proof(slacks or partial(block_slacks, robot, limits, motion.bounds), duration)
    failing = [
        (row.flag.value, float(part[0].mean())) for row, part in zip(rows, proof.failing, strict=True) if len(part)
    ]
    verdict = np.bitwise_or.reduce([flag for flag, _ in failing] + [0])
    verdict |= 0 if (proof.low > 0.0).all() else Verdict.UNDECIDED.value
    of_tensions = np.array([row.unit == "N" for row in rows])
    return MotionProof(
        int(conjunction(np.array(verdict))),
        float(proof.high[of_tensions].min()),
        float(proof.low[of_tensions].min()),
        _room(problem, float(motion.z0), rows, proof),
        min((instant for _, instant in failing), default=np.nan),
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


def proved_answers(problem: Problem, motions: list[BoundedMotion]) -> Answers:
    """Answers of motions, margins in newtons.

    Args:
        motions: n of them, from the centroid of the spools, z down.

    Returns:
        the answers, without numbers of arcs.
    """
    proofs = [proved(problem, motion) for motion in motions]
    none, nothing = np.zeros(len(motions), int), np.full(len(motions), np.nan)
    verdict, margin, bound, room, _ = (np.array(column) for column in zip(*proofs, strict=True))
    return Answers(
        arcs=none,
        tried_arcs=none,
        verdict=verdict.astype(FLAGS),
        duration=np.array([float(motion.duration()) for motion in motions]),
        margin=margin,
        margin_bound=bound,
        limit_margin=room,
        feasible_at_infinity=nothing,
        tolerated=nothing,
        not_tolerated=nothing,
    )
