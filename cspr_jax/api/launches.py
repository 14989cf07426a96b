"""Launches from Python: where an object can be thrown by one Bezier segment."""

from collections.abc import Sequence

import numpy as np

from cspr_jax.api.argument_checks import checked
from cspr_jax.api.arguments import check_point_mass, kernel_problem, points_of
from cspr_jax.arithmetic.elementary import double_precision
from cspr_jax.beziers.launch_range import POPULATION, LaunchRange
from cspr_jax.beziers.launch_range import launch_range as searched
from cspr_jax.beziers.release_bounds import bounds_of
from cspr_jax.errors import InputError
from cspr_jax.robots.limits import Limits
from cspr_jax.robots.point_mass import PLANAR, PointMassRobot


@checked
def launch_range(
    robot: PointMassRobot,
    targets: np.ndarray,
    *,
    start: np.ndarray,
    release_x: Sequence[float] | None = None,
    release_y: Sequence[float] | None = None,
    release_z: Sequence[float] | None = None,
    max_duration: float | None = None,
    population: int = POPULATION,
    limits: Limits | None = None,
) -> LaunchRange:
    """Launches of least speed to landing places, by one Bezier segment from rest, launch paper (26) and (29).

    Args:
        robot: a point mass on three cables, or on two in a plane.
        targets: (n, 3) where the object is to land, in the robot's axes, m.
        start: (3,) or (n, 3) where the segments start at rest, likewise.
        release_x: least and largest x of the release, m; None: twice the robot's size to each side of the centroid of
            the spools.
        release_y: likewise.
        release_z: likewise; None: from the centroid down to four times the robot's size below it.
        max_duration: longest segment tried, s; None: 40 times the root of the robot's size over gravity.
        population: of the search, at least 16; one twice as large takes four times as long.
        limits: over those of the robot, one by one; the floor is z in the robot's axes. None: those of the robot.

    Returns:
        the launches, in the robot's axes. Those found are proved feasible; that there is no other is not proved.

    Raises:
        InputError: another kind of robot, more cables than degrees of freedom, limits that contradict each other,
            shapes that do not fit, values that are not finite, bounds that leave no release.
    """
    check_point_mass(robot)
    ends, starts = points_of("targets", targets), points_of("start", np.atleast_2d(np.asarray(start, float)))
    if len(starts) not in (1, len(ends)):
        raise InputError("start", f"shape {starts.shape}", f"finite numbers of shape (3,) or {ends.shape}")
    if robot.dof == PLANAR and (ends[:, 1].any() or starts[:, 1].any()):
        raise InputError("targets", "y not 0", "y = 0: the plane of a planar robot")
    ranges = {"release_x": release_x, "release_y": release_y, "release_z": release_z}
    for name, values in ranges.items():
        if values is not None and not values[0] <= values[1]:
            raise InputError(name, list(values), "[least, largest], the first not above the second, at most 1e6 m")
    with double_precision():
        problem, frame = kernel_problem(robot, "quintic", limits, free_end=None)
        bounds = bounds_of(problem, frame, list(ranges.values()), max_duration)
        first = np.broadcast_to(frame.inward(starts), ends.shape).copy()
        return searched(problem, first, frame.inward(ends), bounds, int(population)).placed(frame)
