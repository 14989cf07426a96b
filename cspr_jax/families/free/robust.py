"""Bounds of a search that leave slack for all robots within an uncertainty.

Tensions and speeds of cables of other robots differ from those of the planned one by amounts that depend little on the
motion. So bounds of the planned robot tighten at each sample by the proved loss of slack along the motion found before;
after a few rounds the losses are those of the motion itself.

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

# Multiple of an uncertainty for which the search leaves slack, so that blocks of the proof need not be very short.
MULTIPLE = 1.02
LARGEST = 0.5  # loss of a slack, at most, over half the range of the value that it bounds
FRACTION = 0.25  # loss of a tension over the largest one, above which the motion must stay deeper below the spools
DEEPER = 4.0  # factor by which depths grow in a round, at most
ABOVE = 0.5  # largest depth that is asked for, over that of the poses
# Tensions, and the depth on which their losses depend.
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
    """Bounds that leave slack for all robots within an uncertainty."""
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
    # At all samples.
    tau = tasks.basis.tau.ravel()
    durations = np.array([float(motion.knots[-1]) for motion in motions])
    ends = np.cumsum(durations)[:, None]
    blocks = short_blocks(durations[:, None] * tau, (durations / len(tasks.basis.tau))[:, None])
    start, end = (np.clip(side, 0.0, durations[:, None]) + ends - durations[:, None] for side in blocks)
    return chained(motions).bounds(start.ravel(), end.ravel())


def _depths(
    question: FreeQuestion, states: StateBounds, slacks: np.ndarray, lost: np.ndarray, samples: int
) -> np.ndarray | None:
    # Lower bounds of the depth below the spools, among those of all values (k, n_values), from slacks and losses
    # (k, n_criteria); `samples` is the number of samples of each segment.
    problem, limits = question.problem, question.limits
    all_criteria = criteria(problem.robot, problem.limits, question.scene)
    taut, below = ([k for k, criterion in enumerate(all_criteria) if criterion.flag == flag] for flag in DEPENDING)
    if states.rotation is not None or not taut:
        return None
    tensions = slacks[:, taut] + [all_criteria[k].allowed for k in taut]
    deeper = np.minimum(lost[:, taut].max(1) / (FRACTION * np.abs(tensions).max(1)), DEEPER)
    depth = np.asarray(states.position.middle) @ np.asarray(plane_normal(problem.robot))
    # The poses stay where they are, so depths are limited by those of the ends.
    of_segments = depth.reshape(-1, samples)
    ends = np.repeat(np.minimum(of_segments[:, 0], of_segments[:, -1]), samples)
    change = limits.rises[below].sum(0)
    return np.where(change > 0.0, np.minimum(deeper * depth, ABOVE * ends)[:, None] * change, -np.inf)
