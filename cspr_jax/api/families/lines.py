"""Straight lines of point masses from Python: single motions in pure jax, and least durations of many."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from cspr_jax.api.arguments.checks import checked
from cspr_jax.api.arguments.kernel_arguments import check_point_mass, starts_and_ends
from cspr_jax.errors import InputError
from cspr_jax.errors.arguments import Duration, DurationOrNone, Point, PointOrPoints, Points, Positive
from cspr_jax.errors.suggestions import one_of
from cspr_jax.families.lines.least_time import LeastTimes, least_times
from cspr_jax.families.lines.motion import LAWS, TimedLine, fixed_law, s_curve
from cspr_jax.motion.amplitudes import named
from cspr_jax.motion.given_limits import limits_over
from cspr_jax.motion.motion import Placed
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.point_mass import PointMassRobot
from cspr_jax.robots.statics.kernel_axes import prepared


@checked(traced=True)
def straight_line(
    robot: PointMassRobot,
    start: Point,
    end: Point,
    *,
    duration: Duration,
    law: str = "s-curve",
    acceleration_time: DurationOrNone = None,
) -> Placed[TimedLine]:
    """Motion along a straight line from rest to rest, Boralugoda (7) to (9) and Table 3.2.

    Args:
        robot: point mass on any number of cables.
        start: (3,) start point in the robot's axes, m.
        end: (3,) end point in the robot's axes, m.
        duration: () duration T, s.
        law: "s-curve", "quintic" or "cubic".
        acceleration_time: () time p for which the S-curve accelerates, s; None: half of the duration.

    Returns:
        the motion, in the robot's axes.

    Raises:
        InputError: the wrong kind of robot, or an unknown law.
    """
    check_point_mass(robot)
    if law not in LAWS:
        raise InputError("law", law, one_of(law, LAWS))
    frame, time = prepared(robot)[1], jnp.asarray(duration, float)
    first, last = (jnp.asarray(frame.inward(point), float) for point in (start, end))
    ratio = jnp.asarray(0.5) if acceleration_time is None else jnp.asarray(acceleration_time, float) / time
    shape = s_curve(ratio) if law == "s-curve" else fixed_law(law)
    return Placed(TimedLine(first, last - first, shape, time), frame)


@checked(motion="straight_line")
def least_time(
    robot: PointMassRobot,
    targets: Points,
    *,
    start: PointOrPoints,
    max_acceleration: Positive | None = None,
    limits: Limits | None = None,
) -> LeastTimes:
    """Least durations along straight lines from rest to rest: of the S-model, and of any motion along the line.

    Args:
        robot: point mass on any number of cables.
        targets: (n, 3) end points in the robot's axes, m.
        start: (3,) or (n, 3) start points in the robot's axes, m.
        max_acceleration: largest magnitude of the acceleration, m/s^2; None: only taut cables bound it.
        limits: replace those of the robot, one by one; the floor is z in the robot's axes. None: those of the robot.

    Returns:
        the answers; feasible ones are proved. With limits, or if the spools are not in one plane, the least duration
        is found by a search.

    Raises:
        InputError: the wrong kind of robot, limits that contradict each other, shapes that do not fit, values that are
            not finite.
    """
    starts, ends = starts_and_ends(robot, start, targets)
    largest = np.inf if max_acceleration is None else max_acceleration
    with double_precision():
        prepared_robot, frame = prepared(robot)
        problem = Problem(prepared_robot, limits_over(robot, limits, families=("s-curve",)), named("quintic"))
        return least_times(problem, frame.inward(starts), frame.inward(ends), max_acceleration=largest)
