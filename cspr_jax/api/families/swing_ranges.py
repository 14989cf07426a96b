"""Launches from swings to many landing points from Python."""

from __future__ import annotations

from cspr_jax.api.arguments.checks import checked
from cspr_jax.api.arguments.kernel_arguments import release_ranges, starts_and_ends
from cspr_jax.errors import InputError
from cspr_jax.errors.arguments import PointOrPoints, Points, ReleaseRange
from cspr_jax.families.ellipses.swing_range import SwingRange, other_limit
from cspr_jax.families.ellipses.swing_range import swing_range as slowest_releases
from cspr_jax.maps.release_box import box_of
from cspr_jax.motion.given_limits import limits_over
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.point_mass import PointMassRobot
from cspr_jax.robots.statics.kernel_axes import prepared


@checked(motion="ellipse")
def swing_range(
    robot: PointMassRobot,
    targets: Points,
    *,
    start: PointOrPoints,
    release_x: ReleaseRange = None,
    release_y: ReleaseRange = None,
    release_z: ReleaseRange = None,
    limits: Limits | None = None,
) -> SwingRange:
    """Launches of least speed to landing points, from ellipses about positions of rest at their natural frequencies.

    Args:
        robot: point mass on any number of cables, with all spools in one plane.
        targets: (n, 3) landing points in the robot's axes, m.
        start: (3,) or (n, 3) centres of the ellipses, where the robot rests at first, in the robot's axes, m.
        release_x: smallest and largest x of the release, m; None: twice the robot's radius to each side of the centroid
            of the spools.
        release_y: smallest and largest y of the release, m; None: as for x.
        release_z: smallest and largest z of the release, m; None: from the centroid to four times the robot's radius
            below it.
        limits: a floor, z in the robot's axes, and no other limit; None: those of the robot.

    Returns:
        the launches, in the robot's axes. Formulas prove that they are feasible and that none is slower at the
        same time of flight. Times of flight are searched: a slower launch at another time is not excluded.

    Raises:
        InputError: the wrong kind of robot, spools in several planes, pulleys, limits other than a floor, shapes that
            do not fit, values that are not finite, or bounds that leave no release.
    """
    starts, ends = starts_and_ends(robot, start, targets)
    ranges = release_ranges(release_x, release_y, release_z)
    with double_precision():
        prepared_robot, frame = prepared(robot, pulleys=True)
        names = limits_over(robot, limits)
        if other_limit(names) is not None:
            raise InputError("limits", other_limit(names), "a floor alone")
        box = box_of(prepared_robot, frame, ranges)
        floor = None if names.floor is None else float(names.floor)
        releases = slowest_releases(prepared_robot, frame.inward(starts), frame.inward(ends), box, floor)
        return releases.placed(frame)
