"""Harmonic ellipses of point masses from Python: single motions, and frequencies and margins of many by formulas."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from cspr_jax.api.arguments.checks import checked
from cspr_jax.api.arguments.kernel_arguments import check_in_plane, check_point_mass
from cspr_jax.errors import InputError
from cspr_jax.errors.arguments import Frequencies, Frequency, Phase, Point, PointOrPoints, Points, Turns
from cspr_jax.families.ellipses import harmonics
from cspr_jax.families.ellipses.frequencies import chosen_frequency
from cspr_jax.families.ellipses.harmonics import Ellipse
from cspr_jax.families.ellipses.hull import SpoolHull, hull_of
from cspr_jax.families.ellipses.motion import EllipseMotion, turning
from cspr_jax.motion.amplitudes import named
from cspr_jax.motion.given_limits import limits_over
from cspr_jax.motion.motion import Placed
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.numerics.linear.frames import Frame
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.point_mass import PLANAR, PointMassRobot
from cspr_jax.robots.statics.kernel_axes import prepared


@checked(traced=True)
def ellipse(
    robot: PointMassRobot,
    centre: Point,
    a: PointOrPoints,
    b: PointOrPoints,
    *,
    frequency: Frequency = "natural",
    phase: Phase = 0.0,
    turns: Turns = 1.0,
    limits: Limits | None = None,
) -> Placed[EllipseMotion]:
    """Motion centre + a cos(angle) + b sin(angle) at a constant angular rate.

    Args:
        robot: point mass on any number of cables.
        centre: (3,) centre in the robot's axes, m.
        a: (3,) vector from the centre to the point at the angle 0, m.
        b: (3,) vector from the centre to the point a quarter of a turn later, m; zeros for an oscillation along a line.
        frequency: () rad/s, or "natural", "best" (of largest margin), "fastest" or "slowest" (within all limits).
        phase: () angle at the start, rad.
        turns: () number of turns.
        limits: replace those of the robot, for "fastest" and "slowest"; None: those of the robot.

    Returns:
        the motion, in the robot's axes; jax may trace all arguments except a frequency in words.

    Raises:
        InputError: the robot has the wrong kind, y is not 0 on a planar one, or no frequency fits a word.
    """
    _check_robot(robot, centre=centre, a=a, b=b)
    prepared_robot, frame = prepared(robot, pulleys=True)
    if isinstance(frequency, str):
        with double_precision():
            problem = Problem(prepared_robot, limits_over(robot, limits, families=("ellipse",)), named("quintic"))
            ellipse = Ellipse(frame.inward(centre), frame.rotated(a), frame.rotated(b))
            frequency = chosen_frequency(problem, ellipse, frequency)
    ellipse = Ellipse(*(jnp.asarray(x, float) for x in (frame.inward(centre), frame.rotated(a), frame.rotated(b))))
    return Placed(turning(ellipse, jnp.asarray(frequency, float), jnp.asarray(phase, float), turns), frame)


@checked(motion="ellipse")
def ellipse_frequencies(robot: PointMassRobot, centres: Points, a: PointOrPoints, b: PointOrPoints) -> list[np.ndarray]:
    """Frequencies at which all cables stay taut on ellipses, by formulas.

    Args:
        robot: point mass on two or more cables, with all spools in one plane.
        centres: (n, 3) centres in the robot's axes, m.
        a: (3,) or (n, 3) vectors from the centre to the point at the angle 0, m.
        b: (3,) or (n, 3) vectors from the centre to the point a quarter of a turn later, m.

    Returns:
        for each ellipse its open intervals, (k, 2) rad/s: k is 0 if no frequency is feasible, else 1; the upper end is
        inf if nothing bounds it.

    Raises:
        InputError: the wrong kind of robot, spools in several planes, pulleys, y not 0 on a planar robot, or shapes
            that do not fit.
    """
    with double_precision():
        hull, items = _many(robot, centres, a, b)
        ends = np.stack(harmonics.of_many(harmonics.frequency_interval, hull, items), axis=1)
    intervals = list(ends[:, None])
    for i in np.flatnonzero(np.isnan(ends[:, 0])).tolist():
        intervals[i] = np.empty((0, 2))
    return intervals


@checked(motion="ellipse")
def ellipse_margins(
    robot: PointMassRobot, centres: Points, a: PointOrPoints, b: PointOrPoints, frequencies: Frequencies
) -> np.ndarray:
    """Margins of motions on ellipses, by formulas: positive exactly if all cables stay taut.

    Args:
        robot: point mass on two or more cables, with all spools in one plane.
        centres: (n, 3) centres in the robot's axes, m.
        a: (3,) or (n, 3) vectors from the centre to the point at the angle 0, m.
        b: (3,) or (n, 3) vectors from the centre to the point a quarter of a turn later, m.
        frequencies: () or (n,) rad/s.

    Returns:
        (n,) the smaller of the smallest normalised pseudotension, which is 1 at rest below the centroid of the spools,
        and the smallest depth over that of the centre.

    Raises:
        InputError: as for `ellipse_frequencies`.
    """
    with double_precision():
        hull, items = _many(robot, centres, a, b)
        count = len(items.centre)
        if np.shape(frequencies) not in ((), (count,)):
            raise InputError("frequencies", f"shape {np.shape(frequencies)}", f"a number in rad/s, or ({count},)")
        rates = np.broadcast_to(np.asarray(frequencies, float), (count,))
        return harmonics.of_many(harmonics.least_margin, hull, items, rates)


def _check_robot(robot: PointMassRobot, **vectors) -> None:
    check_point_mass(robot)
    for key, vector in vectors.items():
        if not isinstance(vector, jax.core.Tracer):
            check_in_plane(key, np.reshape(vector, (-1, 3)), is_planar=robot.dof == PLANAR)


def _many(robot: PointMassRobot, centres, a, b) -> tuple[SpoolHull, Ellipse]:
    _check_robot(robot, centres=centres, a=a, b=b)
    prepared_robot, frame = prepared(robot, pulleys=True)
    positions, count = np.asarray(centres, float), len(centres)
    return hull_of(prepared_robot), Ellipse(
        frame.inward(positions), _axes("a", a, count, frame), _axes("b", b, count, frame)
    )


def _axes(key: str, axes, count: int, frame: Frame) -> np.ndarray:
    if np.shape(axes) not in ((3,), (count, 3)):
        raise InputError(key, f"shape {np.shape(axes)}", f"(3,) or ({count}, 3) m")
    return np.broadcast_to(frame.rotated(axes), (count, 3))
