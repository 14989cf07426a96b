"""Bezier segments of point masses from Python: single motions in pure jax; verdicts, durations, launches of many."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import jax.numpy as jnp
import numpy as np

from cspr_jax.api.arguments.checks import checked
from cspr_jax.api.arguments.kernel_arguments import (
    check_in_plane,
    check_point_mass,
    kernel_problem,
    points_of,
    release_ranges,
    starts_and_ends,
)
from cspr_jax.errors import InputError
from cspr_jax.errors.arguments import (
    Duration,
    Durations,
    Point,
    PointOrPoints,
    Points,
    Population,
    Positive,
    ReleaseRange,
)
from cspr_jax.families.beziers.duration_roots import Ends
from cspr_jax.families.beziers.durations import feasible_durations
from cspr_jax.families.beziers.launches.launch_range import POPULATION, LaunchRange
from cspr_jax.families.beziers.launches.launch_range import launch_range as search_launches
from cspr_jax.families.beziers.launches.release import bounds_of
from cspr_jax.families.beziers.margins import depths_of
from cspr_jax.families.beziers.motion import Bezier
from cspr_jax.families.beziers.verdicts import verdicts
from cspr_jax.motion.motion import Placed
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.point_mass import PLANAR, PointMassRobot, plane_normal
from cspr_jax.robots.model.robot import check_moved
from cspr_jax.robots.statics.kernel_axes import prepared
from cspr_jax.schema.columns import Columns


@dataclasses.dataclass(frozen=True)
class BezierVerdicts(Columns):
    """Verdicts of n Bezier segments, (n,) each.

    Fields:
        verdict: flags of `Verdict`; 0 if proved feasible.
        margin: the smaller of the smallest pseudotension over its value at rest in P0, and the smallest depth below the
            spools over the depth of the start; on more cables than degrees of freedom, the smallest distance that all
            tensions can keep from their limits, N.
        margin_bound: proved lower bound of the margin: the margin less its rounding error; for redundant cables, by the
            proof of the motion.
        limit_margin: smallest slack of the limits on the segment, dimensionless; inf without limits.
    """

    verdict: np.ndarray
    margin: np.ndarray
    margin_bound: np.ndarray
    limit_margin: np.ndarray

    @property
    def feasible(self) -> np.ndarray:
        """Tell whether each segment is proved feasible, (n,)."""
        return self.verdict == 0


@checked(traced=True)
def bezier(
    robot: PointMassRobot, start: Point, control_point: Point, end: Point, *, duration: Duration
) -> Placed[Bezier]:
    """Motion along a Bezier curve of the second order from rest to rest, launch paper (9), (13).

    Args:
        robot: point mass on any number of cables.
        start: (3,) first control point in the robot's axes, m.
        control_point: (3,) second control point, m.
        end: (3,) third control point, m.
        duration: () duration T, s.

    Returns:
        the motion, in the robot's axes.

    Raises:
        InputError: the robot has the wrong kind.
    """
    check_point_mass(robot)
    prepared_robot, frame = prepared(robot)
    first, middle, last = (jnp.asarray(frame.inward(point), float) for point in (start, control_point, end))
    return Placed(
        Bezier(first, middle, last, jnp.asarray(duration, float), plane_normal(prepared_robot) @ first), frame
    )


@checked(motion="bezier")
def bezier_verdicts(
    robot: PointMassRobot,
    starts: Points,
    control_points: Points,
    ends: Points,
    *,
    durations: Durations,
    limits: Limits | None = None,
) -> BezierVerdicts:
    """Verdicts of Bezier segments: exact for taut cables, proved for limits and on redundant cables.

    Args:
        robot: point mass on three cables, or on two in a plane; or on more.
        starts: (n, 3) first control points in the robot's axes, m.
        control_points: (n, 3) second control points, m.
        ends: (n, 3) third control points, m.
        durations: (n,) positive, s.
        limits: replace those of the robot, one by one; the floor is z in the robot's axes. None: those of the robot.

    Returns:
        the verdicts.

    Raises:
        InputError: the wrong kind of robot, limits that contradict each other, shapes that do not fit, values that are
            not finite.
    """
    check_point_mass(robot)
    points = _points(robot, {"starts": starts, "control_points": control_points, "ends": ends})
    times = np.asarray(durations, float)
    if times.shape != (len(points[0]),):
        raise InputError("durations", f"shape {times.shape}", f"finite numbers > 0 of shape ({len(points[0])},)")
    with double_precision():
        problem, frame = kernel_problem(robot, "quintic", limits, free_end=None, any_cables=True)
        first, middle, last = (np.asarray(frame.inward(x)) for x in points)
        answers = verdicts(problem, Bezier(first, middle, last, times, depths_of(problem.robot, first)))
        return BezierVerdicts(answers.verdict, answers.margin, answers.bound, answers.limit_margin)


@checked(motion="bezier")
def bezier_durations(
    robot: PointMassRobot,
    starts: Points,
    ends: Points,
    *,
    control_points: Points | None = None,
    accelerations: Points | None = None,
) -> list[np.ndarray]:
    """Durations of Bezier segments that keep every cable taut below the spools, by roots of polynomials.

    On more cables than degrees of freedom, the durations are one interval with proved ends; the spools may be anywhere.

    Args:
        robot: point mass on three cables, or on two in a plane; or on more.
        starts: (n, 3) first control points in the robot's axes, m.
        ends: (n, 3) third control points, m.
        control_points: (n, 3) second control points, m; None: the accelerations determine them, (15).
        accelerations: (n, 3) accelerations at the starts, in the robot's axes, m/s^2; None: zero. On more cables than
            degrees of freedom they must be zero: otherwise the curve depends on the duration, and any set of durations
            may be feasible.

    Returns:
        for each segment (n_intervals, 2) s: the ends of each interval of durations that are proved feasible; the last
        end is inf if all longer durations are feasible, the first 0 if redundant cables can give any acceleration.

    Raises:
        InputError: the wrong kind of robot, shapes that do not fit, values that are not finite, both control points and
            accelerations, or accelerations on redundant cables.
    """
    check_point_mass(robot)
    check_moved(robot)
    if robot.n_cables > robot.dof and accelerations is not None and np.asarray(accelerations, float).any():
        raise InputError("accelerations", "not 0", "absent, or 0, on more cables than degrees of freedom")
    if control_points is not None and accelerations is not None:
        raise InputError("accelerations", "given", "cannot be combined with control_points")
    arguments = {"starts": starts, "ends": ends}
    arguments |= {} if control_points is None else {"control_points": control_points}
    arguments |= {} if accelerations is None else {"accelerations": accelerations}
    points = dict(zip(arguments, _points(robot, arguments), strict=True))
    with double_precision():
        prepared_robot, frame = prepared(robot)
        first, last = (np.asarray(frame.inward(points[name])) for name in ("starts", "ends"))
        middle = first if control_points is None else np.asarray(frame.inward(points["control_points"]))
        vectors = np.zeros_like(first) if accelerations is None else np.asarray(frame.rotated(points["accelerations"]))
        depth = depths_of(prepared_robot, first)
        intervals = feasible_durations(prepared_robot, Ends(first, last, middle, vectors), depth)
        return [durations for durations in intervals if durations is not None]


@checked(motion="bezier")
def launch_range(
    robot: PointMassRobot,
    targets: Points,
    *,
    start: PointOrPoints,
    release_x: ReleaseRange = None,
    release_y: ReleaseRange = None,
    release_z: ReleaseRange = None,
    max_duration: Positive | None = None,
    population: Population = POPULATION,
    limits: Limits | None = None,
) -> LaunchRange:
    """Launches of least speed to landing points, by one Bezier segment from rest, launch paper (26) and (29).

    Args:
        robot: point mass on three cables, or on two in a plane; or on more.
        targets: (n, 3) landing points in the robot's axes, m.
        start: (3,) or (n, 3) positions where the segments start at rest, in the robot's axes, m.
        release_x: smallest and largest x of the release, m; None: twice the robot's radius to each side of the centroid
            of the spools.
        release_y: smallest and largest y of the release, m; None: as for x.
        release_z: smallest and largest z of the release, m; None: from the centroid to four times the robot's radius
            below it.
        max_duration: longest duration tried, s; None: 40 times the root of the robot's radius over gravity.
        population: number of launches that the search improves, at least 16; twice as many take four times as long.
        limits: replace those of the robot, one by one; the floor is z in the robot's axes. None: those of the robot.

    Returns:
        the launches, in the robot's axes. Launches found are proved feasible; that there are no others is not proved.

    Raises:
        InputError: the wrong kind of robot, limits that contradict each other, shapes that do not fit, values that are
            not finite, or bounds that leave no release.
    """
    starts, ends = starts_and_ends(robot, start, targets)
    ranges = release_ranges(release_x, release_y, release_z)
    with double_precision():
        problem, frame = kernel_problem(robot, "quintic", limits, free_end=None, any_cables=True)
        bounds = bounds_of(problem, frame, ranges, max_duration)
        launches = search_launches(problem, frame.inward(starts), frame.inward(ends), bounds, int(population))
        return launches.placed(frame)


def _points(robot: PointMassRobot, arguments: Mapping[str, Any]) -> list[np.ndarray]:
    arrays = [points_of(name, points) for name, points in arguments.items()]
    for name, points in zip(arguments, arrays, strict=True):
        if points.shape != arrays[0].shape:
            raise InputError(name, f"shape {points.shape}", f"finite numbers of shape {arrays[0].shape}")
        check_in_plane(name, points, is_planar=robot.dof == PLANAR)
    return arrays
