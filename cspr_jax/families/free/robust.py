"""Bounds of a search that leave slack for all robots within an uncertainty.

Tensions and cable speeds of other robots differ from those of the planned one by amounts that depend little on the
motion. So bounds of the planned robot are tightened at each sample by the proved loss of slack along the motion found
before; after a few rounds these losses are those of the resulting motion.

Near the plane of the spools losses do depend on the motion: they grow as the inverse of the depth below the plane, and
with the tensions themselves. Where they are a large fraction of the tensions, a point mass stays deeper.
"""

import dataclasses

import numpy as np

from cspr_jax.curves.spline import Spline, chained
from cspr_jax.families.free.problem import FreeQuestion
from cspr_jax.families.free.search.tasks import Tasks
from cspr_jax.robots.bounds.state_bounds import StateBounds
from cspr_jax.robots.model.limits import Uncertainty
from cspr_jax.robots.model.point_mass import plane_normal
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.verification.criteria import criteria
from cspr_jax.verification.piece_slacks import all_robots_slacks, short_blocks

# The search leaves slack for this multiple of an uncertainty, so that blocks of the proof need not be very short.
MULTIPLE = 1.02
LARGEST = 0.5  # largest loss of a slack, over half the range of the bounded value
FRACTION = 0.25  # above this loss of a tension over the largest one, the motion must stay deeper
DEEPER = 4.0  # largest factor by which depths grow in a round
ABOVE = 0.5  # largest depth required, over that of the poses
# Flags of tensions, and of the depth on which their losses depend.
DEPENDING = Verdict.SLACK_CABLE, Verdict.ABOVE_SPOOLS


def for_all_robots(question: FreeQuestion, uncertainty: Uncertainty, multiple: float) -> FreeQuestion:
    """A question about all robots within a multiple of an uncertainty."""
    fraction = MULTIPLE * multiple
    sizes = (
        fraction * uncertainty.spool_positions,
        fraction * uncertainty.mass_centre,
        uncertainty.mass_factor**fraction,
    )
    limits = dataclasses.replace(question.problem.limits, uncertainty=Uncertainty(*sizes))
    return dataclasses.replace(question, problem=question.problem._replace(limits=limits))


def widened(question: FreeQuestion, tasks: Tasks, motions: list[Spline]) -> Tasks:
    """Tasks with bounds that leave slack for all robots within an uncertainty."""
    problem, limits, states = question.problem, question.limits, _states(tasks, motions)
    before, after = (all_robots_slacks(problem, states, multiple) for multiple in (0.0, 1.0))
    half, count = 0.5 * (limits.high - limits.low), before.shape[1]
    maximum = LARGEST * np.where(np.isfinite(half) & (half > 0.0), half, 1.0)
    with np.errstate(invalid="ignore"):
        lost = np.maximum(np.nan_to_num(before - after, nan=0.0, posinf=np.inf), 0.0)
        rise, drop = (
            np.max(np.where(side > 0.0, np.minimum(lost[..., None] * side, maximum), 0.0), axis=1).reshape(
                tasks.low.shape
            )
            for side in (limits.rises[:count], limits.falls[:count])
        )
    depths = _depths(question, states, before, lost, tasks.basis.tau.size)
    low = tasks.low + rise if depths is None else np.maximum(tasks.low + rise, depths.reshape(tasks.low.shape))
    return dataclasses.replace(tasks, low=low, high=tasks.high - drop)


def _states(tasks: Tasks, motions: list[Spline]) -> StateBounds:
    # Return bounds of the states at all samples.
    tau = tasks.basis.tau.ravel()
    durations = np.array([float(motion.knots[-1]) for motion in motions])
    ends = np.cumsum(durations)[:, None]
    blocks = short_blocks(durations[:, None] * tau, (durations / len(tasks.basis.tau))[:, None])
    start, end = (np.clip(side, 0.0, durations[:, None]) + ends - durations[:, None] for side in blocks)
    return chained(motions).bounds(start.ravel(), end.ravel())


def _depths(
    question: FreeQuestion, states: StateBounds, slacks: np.ndarray, lost: np.ndarray, samples: int
) -> np.ndarray | None:
    # Return lower bounds of the depth below the spools in the columns of all values (k, n_values), from slacks and
    # losses (k, n_criteria); `samples` is the number of samples of each segment. None if no depth is required.
    problem, limits = question.problem, question.limits
    all_criteria = criteria(problem.robot, problem.limits, question.scene)
    taut, below = ([k for k, criterion in enumerate(all_criteria) if criterion.flag == flag] for flag in DEPENDING)
    if states.rotation is not None or not taut:
        return None
    tensions = slacks[:, taut] + [all_criteria[k].allowed for k in taut]
    deeper = np.minimum(lost[:, taut].max(1) / (FRACTION * np.abs(tensions).max(1)), DEEPER)
    depth = np.asarray(states.position.middle) @ np.asarray(plane_normal(problem.robot))
    # The poses are fixed, so the required depths may not exceed a fraction of theirs.
    of_segments = depth.reshape(-1, samples)
    ends = np.repeat(np.minimum(of_segments[:, 0], of_segments[:, -1]), samples)
    change = limits.rises[below].sum(0)
    return np.where(change > 0.0, np.minimum(deeper * depth, ABOVE * ends)[:, None] * change, -np.inf)
