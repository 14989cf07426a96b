"""All criteria of a segment in one order: taut cables, depth below the spools, then the given limits."""

from __future__ import annotations

import itertools

import jax
from jax import Array

from cspr_jax.families.swings.hypocycloid import Segment
from cspr_jax.families.swings.proof.limit_slacks import count, limit_curvatures, limit_slacks
from cspr_jax.families.swings.proof.slacks import each_taut_bounds, interval_bounds, row_bounds, swing_state
from cspr_jax.motion.amplitudes import Amplitude
from cspr_jax.motion.limits import limits_set
from cspr_jax.numerics.linear.lanes import largest, smallest
from cspr_jax.numerics.shapes import Float, Num
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.point_mass import PointMassRobot
from cspr_jax.schema.verdicts import Verdict

# Number of criteria that are no limits: taut cables, and the depth below the spools.
BASIC = 2


def flags(limits: Limits) -> tuple[Verdict, ...]:
    """Flag of each criterion, raised if it is broken."""
    return (Verdict.SLACK_CABLE, Verdict.ABOVE_SPOOLS, *(row.flag for row in limits_set(limits)))


def counts(robot: PointMassRobot, limits: Limits) -> tuple[int, ...]:
    """Number of smooth functions whose minimum each criterion is."""
    return (robot.n_cables, 1, *(count(row, robot.n_cables) for row in limits_set(limits)))


@jax.jit
def smooth_slacks(
    robot: PointMassRobot,
    limits: Limits,
    amplitude: Amplitude,
    segment: Segment,
    arcs: Num[Array, ""],
    tau: Float[Array, ""],
) -> tuple[Float[Array, ""], ...]:
    """All slacks of all criteria at one time, which are smooth functions of tau."""
    state = swing_state(segment, amplitude, arcs, tau)
    terms = [*state.kappa, state.eta]
    for slack in limit_slacks(robot, limits, segment, arcs, tau, state):
        terms += slack
    return tuple(terms)


def slacks(
    robot: PointMassRobot,
    limits: Limits,
    amplitude: Amplitude,
    segment: Segment,
    arcs: Num[Array, ""],
    tau: Float[Array, ""],
) -> tuple[Float[Array, ""], ...]:
    """Smallest slack of each criterion at one time."""
    values = iter(smooth_slacks(robot, limits, amplitude, segment, arcs, tau))
    return tuple(smallest(list(itertools.islice(values, n))) for n in counts(robot, limits))


def curvatures(
    robot: PointMassRobot,
    limits: Limits,
    amplitude: Amplitude,
    segment: Segment,
    arcs: Num[Array, ""],
    start: Float[Array, ""],
    stop: Float[Array, ""],
) -> tuple[Float[Array, ""], ...]:
    """Bound of the second derivatives of each criterion's slacks over an interval."""
    over = interval_bounds(segment, amplitude, arcs, start, stop)
    kappa = each_taut_bounds(segment, arcs, over)
    eta = row_bounds(segment, arcs, over, segment.tilt)
    return (
        largest([bounds.curvature for bounds in kappa]),
        eta.curvature,
        *limit_curvatures(robot, limits, segment, arcs, over, kappa),
    )
