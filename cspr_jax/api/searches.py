"""Searches from Python: arrays of targets in, answers out.

In the axes of the robot, and in float64 whatever jax is set to. They give NumPy arrays, which cannot be differentiated.
"""

import numpy as np

from cspr_jax.arithmetic.elementary import double_precision
from cspr_jax.errors import InputError
from cspr_jax.feasibility.problem import Problem
from cspr_jax.problem import centred, limits_over
from cspr_jax.robots.limits import Limits
from cspr_jax.robots.point_mass import LARGEST_LENGTH, PointMassRobot, is_planar, rest_point
from cspr_jax.search.answers import Answers
from cspr_jax.search.point_mass_arcs import minimum_arcs as _minimum_arcs
from cspr_jax.trajectories.amplitudes import Amplitude, named


def minimum_arcs(
    robot: PointMassRobot,
    targets: np.ndarray,
    *,
    start: np.ndarray | None = None,
    z0: np.ndarray | float,
    amplitude: Amplitude | None = None,
    limits: Limits | None = None,
    max_arcs: int = 30,
) -> Answers:
    """Smallest number of arcs to each of many targets, with duration, margin and verdict.

    Args:
        robot: a point mass on three cables.
        targets: (n, 3) in the robot's axes, m.
        start: (3,) or (n, 3) in the robot's axes, m; None: at rest in P0. A start within 1e-9 of the robot's size
            (the largest distance of a spool from the centroid of all) of P0 is at rest there too.
        z0: () or (n,) depth of P0 below the centroid of the spools, m.
        amplitude: None: the quintic (2.50).
        limits: over those of the robot, one by one; the floor is z in the robot's axes. None: those of the robot.
        max_arcs: largest number of arcs tried.

    Returns:
        the answers, (n,) each.

    Raises:
        InputError: another kind of robot, shapes that do not fit, values that are not finite, z0 not positive,
            max_arcs below 1, limits that contradict each other, or an amplitude function that breaks (2.49).
    """
    if not isinstance(robot, PointMassRobot) or is_planar(robot):
        raise InputError("robot", getattr(robot, "name", robot), "a point mass on three cables")
    ends = _points("targets", targets)
    if np.shape(z0) not in ((), (len(ends),)):
        raise InputError("z0", f"shape {np.shape(z0)}", f"a number > 0, or ({len(ends)},) of them")
    depth = np.broadcast_to(np.asarray(z0, float), (len(ends),)).copy()
    given = None if start is None else np.asarray(start, float)
    if given is not None and given.shape not in ((3,), ends.shape):
        raise InputError("start", f"shape {given.shape}", f"finite numbers of shape (3,) or {ends.shape}")
    with double_precision():
        own, frame = centred(robot)
        starts = rest_point(depth) if given is None else frame.inward(_points("start", np.atleast_2d(given)))
        problem = Problem(own, limits_over(robot, limits), amplitude or named("quintic"))
        starts = np.broadcast_to(starts, ends.shape).copy()
        return _minimum_arcs(problem, starts, frame.inward(ends), depth, max_arcs=max_arcs)


def _points(key: str, given) -> np.ndarray:
    points = np.asarray(given, float)
    if points.ndim != 2 or points.shape[1] != 3 or not len(points):
        raise InputError(key, f"shape {points.shape}", "finite numbers of shape (n, 3), n >= 1")
    fits = (np.abs(points) <= LARGEST_LENGTH).all(1)
    if not fits.all():
        raise InputError(key, points[~fits][0].tolist(), "finite numbers, at most 1e6 m")
    return points
