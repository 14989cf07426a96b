"""Verdicts of Bezier segments with more cables than degrees of freedom: general proofs, and samples for searches.

Redundant cables have no pseudotensions that the motion determines. Instead, tensions that balance it are enclosed over
blocks of time (`verification.time_proof`); the margin is the largest distance that all tensions can keep from their
limits, in newtons.
"""

from __future__ import annotations

import itertools
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.families.beziers.motion import Bezier, many_bounds
from cspr_jax.motion.limits import other_slacks
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.bounds.state_bounds import StateBounds
from cspr_jax.robots.statics.wrench_sets import tension_range
from cspr_jax.robots.tensions.tension_distribution import centred
from cspr_jax.schema.limits import LIMITS
from cspr_jax.schema.verdicts import FLAGS, Verdict
from cspr_jax.verification.proved_answers import MotionProof, proofs_of
from cspr_jax.verification.proved_verdicts import Verdicts

TOGETHER = 64  # number of segments proved at a time
# Searches cap margins over weight / n_cables at this value: without largest tensions margins are unbounded.
LARGEST = 1e6
LIMIT_FLAGS = [row.flag for row in LIMITS if row.quantity != "tension"]


def proofs(problem: Problem, motions: Bezier, *, at_rest: bool = False) -> list[MotionProof]:
    """Proofs of segments."""

    def bounds(first: int, motion: np.ndarray, start: np.ndarray, end: np.ndarray) -> StateBounds:
        states = many_bounds(motions, motion + first, start, end)
        zero = jax.tree.map(np.zeros_like, states.velocity)
        return states._replace(velocity=zero, acceleration=zero) if at_rest else states

    firsts, times = range(0, len(motions.time), TOGETHER), np.asarray(motions.time)
    parts = [proofs_of(problem, partial(bounds, i), times[i : i + TOGETHER]) for i in firsts]
    return list(itertools.chain.from_iterable(parts))


def verdicts_and_proofs(problem: Problem, motions: Bezier) -> tuple[Verdicts, Float[np.ndarray, "n"]]:
    """Verdicts of segments, with their proofs."""
    motions = jax.tree.map(np.asarray, motions)
    count = len(motions.time)
    leaves = np.concatenate([x.reshape(count, -1) for x in jax.tree.leaves(motions)], axis=1)
    valid = np.flatnonzero(np.isfinite(leaves).all(1) & (motions.time > 0.0))
    verdict = np.full(count, Verdict.NOT_FINITE.value, FLAGS)
    margin, bound, limit_margin = (np.full(count, np.nan) for _ in range(3))
    each = np.empty(count, object)
    each[valid] = proofs(problem, jax.tree.map(lambda x: x[valid], motions))
    for i in valid.tolist():
        verdict[i], margin[i], bound[i] = each[i].verdict, each[i].margin, each[i].margin_bound
        limit_margin[i] = _limit_slack(each[i], float(motions.z0[i]))
    return Verdicts(verdict, margin, bound, limit_margin), each


def _limit_slack(proof: MotionProof, z0: float) -> float:
    # Return the smallest relative slack of all limits but those of tensions; the floor is relative to z0.
    slacks = zip(proof.criteria, proof.proof.high.tolist(), strict=True)
    each = (slack / (row.allowed if row.cables else z0) for row, slack in slacks if row.flag in LIMIT_FLAGS)
    return min(each, default=np.inf)


def slacks_at(problem: Problem, motion: Bezier, tau: Float[Array, ""]) -> Float[Array, "n_slacks"]:
    """Slacks at one normalised time, for searches."""
    robot, state = problem.robot, motion.state(tau)
    matrix, wrench = robot.wrench_matrix(state), robot.inertial_wrench(state)
    margin = centred(matrix, wrench, *tension_range(robot, problem.limits))[1]
    fraction = jnp.minimum(margin * robot.n_cables / (robot.mass * robot.gravity), LARGEST)
    return jnp.stack([fraction, *other_slacks(robot, problem.limits, state, motion.z0)])
