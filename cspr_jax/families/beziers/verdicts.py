"""Verdicts of Bezier segments: exact for taut cables, proved for limits."""

from __future__ import annotations

from functools import partial

import jax
import numpy as np

from cspr_jax.families.beziers.limits import limit_slacks
from cspr_jax.families.beziers.margins import cubics, smallest_margins
from cspr_jax.families.beziers.motion import Bezier
from cspr_jax.motion.limits import limits_set
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.shapes import Float
from cspr_jax.numerics.tolerances import FORMULAS_UNDECIDED
from cspr_jax.robots.model.point_mass import rest_point
from cspr_jax.robots.statics.force_balance import pseudotensions
from cspr_jax.schema.verdicts import FLAGS, Verdict
from cspr_jax.verification.proved_verdicts import SPEEDS, Verdicts, plain_slack, with_touched

# Number of segments computed at a time: for a plan, and for arrays.
BATCH, MANY = 256, 8192


@jax.jit
def _margins(robot, motions: Bezier):
    return jax.vmap(lambda motion: smallest_margins(robot, motion))(motions)


@jax.jit
def _pseudotensions(robot, motions: Bezier):
    def one(motion):
        rest = pseudotensions(robot, rest_point(motion.z0), motion.start * 0.0)
        return cubics(robot, motion) * rest[:, None]

    return jax.vmap(one)(motions)


def verdicts(problem: Problem, motions: Bezier) -> Verdicts:
    """Verdicts of Bezier segments: exact for taut cables, proved for limits and on redundant cables."""
    if problem.robot.n_cables > problem.robot.dof:
        from cspr_jax.families.beziers.redundant_verdicts import verdicts_and_proofs

        return verdicts_and_proofs(problem, motions)[0]

    def verdicts_of(allowed: Problem, indices: np.ndarray) -> Verdicts:
        return verdicts_within(allowed, jax.tree.map(lambda x: np.asarray(x)[indices], motions))

    return with_touched(problem, verdicts_within(problem, motions), verdicts_of)


def verdicts_within(problem: Problem, motions: Bezier) -> Verdicts:
    """Verdicts with as many cables as degrees of freedom; motions that touch a limit are not feasible."""
    batch = BATCH if len(motions.time) <= BATCH else MANY
    margins = in_batches(partial(_margins, problem.robot), motions, batch_size=batch)
    slack = np.concatenate([margins.taut, margins.below[:, None]], axis=1)
    doubt = np.concatenate([margins.taut_rounding, margins.below_rounding[:, None]], axis=1)
    flags = [Verdict.SLACK_CABLE.value] * margins.taut.shape[1] + [Verdict.ABOVE_SPOOLS.value]
    bound, limit_margin = slack - doubt, np.full(len(slack), np.inf)
    broken = np.bitwise_or.reduce(np.where(slack < -doubt, flags, 0), axis=1)
    is_open = ~(bound > 0.0).all(1)
    limits = limits_set(problem.limits)
    finite = np.isfinite(slack).all(1)
    if limits:
        kappa = in_batches(partial(_pseudotensions, problem.robot), motions, batch_size=batch)
        proved = limit_slacks(problem, motions, kappa, bound[:, -1] > 0.0)
        is_known = np.isfinite(proved.attained)
        broken |= np.bitwise_or.reduce(
            np.where(is_known & (proved.attained < -FORMULAS_UNDECIDED), [limit.flag.value for limit in limits], 0),
            axis=1,
        )
        is_open |= ~(proved.bound > FORMULAS_UNDECIDED).all(1)
        shown = [
            plain_slack(limit.name, x, (*SPEEDS, "acceleration_max"))
            for limit, x in zip(limits, proved.attained.T, strict=True)
        ]
        limit_margin = np.min(shown, axis=0)
    verdict = np.where(broken > 0, broken, np.where(is_open, Verdict.UNDECIDED.value, 0))
    verdict = np.where(finite, verdict, Verdict.NOT_FINITE.value).astype(FLAGS)
    return Verdicts(verdict, slack.min(1), bound.min(1), limit_margin)


def smallest_slacks(problem: Problem, results: Verdicts) -> Float[np.ndarray, "n"]:
    """Smallest slack of each segment, of tensions and limits, dimensionless."""
    robot, margin = problem.robot, results.margin
    if robot.n_cables > robot.dof:
        margin = margin * robot.n_cables / float(robot.mass * robot.gravity)
    # Above the spools limits of tensions have no margin, and the depth decides.
    minimum = np.where(np.isneginf(results.limit_margin), margin, np.minimum(margin, results.limit_margin))
    return np.where(np.isnan(minimum), -np.inf, minimum)
