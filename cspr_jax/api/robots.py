"""Robots from Python: from numbers, as in a robot file, or from other robots."""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import numpy as np

from cspr_jax.api.arguments.checks import checked
from cspr_jax.build.robots import load_robot as _load_robot
from cspr_jax.errors import InputError
from cspr_jax.errors.arguments import Inertia, PointOfEachCable, Positive
from cspr_jax.motion.given_limits import pair_limits
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.robots.cables import with_cables as _with_cables
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.parallel_pairs import ParallelPairs, parallel_pairs
from cspr_jax.robots.model.platform import RIGID, PlatformRobot, platform_robot
from cspr_jax.robots.model.point_mass import STANDARD_GRAVITY, Axis, PointMassRobot
from cspr_jax.robots.model.point_mass import point_mass_robot as _point_mass_robot

load_robot = checked(name="load_robot", module=__name__)(_load_robot)
platform = checked(traced=True, name="platform", module=__name__)(platform_robot)
point_mass_robot = checked(traced=True, name="point_mass_robot", module=__name__)(_point_mass_robot)
with_cables = checked(traced=True, name="with_cables", module=__name__)(_with_cables)


@checked(traced=True)
def point_mass(
    base_points: PointOfEachCable,
    *,
    mass: Positive,
    gravity: Positive = STANDARD_GRAVITY,
    z_axis: Axis = "down",
    planar: bool = False,
    name: str = "robot",
    limits: Limits | None = None,
    pattern: str | None = None,
) -> PointMassRobot:
    """A point mass on cables.

    Args:
        base_points: (n_cables, 3) spool points, m: at least three; two if planar; one on a guide.
        mass: mass, kg, positive.
        gravity: gravity, m/s^2, positive.
        z_axis: direction of the z axis, "down" or "up".
        planar: whether everything lies in the plane y = 0.
        limits: limits in addition to taut cables; None: no limits.
        pattern: "1T" along a vertical guide, "2T" in the plane y = 0 or "3T" in space; None: "2T" if planar, else "3T".

    Returns:
        the robot.

    Raises:
        InputError: the numbers would not be accepted in a robot file.
    """
    pattern_name = pattern or ("2T" if planar else "3T")
    if planar and pattern_name != "2T":
        raise InputError("pattern", pattern, '"2T", or None, beside planar')
    return _point_mass_robot(
        base_points, mass=mass, gravity=gravity, name=name, z_axis=z_axis, limits=limits, pattern=pattern_name
    )


@checked(traced=True)
def parallel_pair_robot(
    spool_radius: Positive,
    platform_radius: Positive,
    *,
    mass: Positive,
    inertia: Inertia | None = None,
    gravity: Positive = STANDARD_GRAVITY,
    z_axis: Axis = "down",
    name: str = "robot",
    limits: Limits | None = None,
) -> PlatformRobot:
    """A platform on six cables in three parallel pairs, Machines 11 (2), 2023, 224, (30) and (31).

    Args:
        spool_radius: radius R, m, of the circle through the middles of the pairs' spools, a level equilateral triangle.
        platform_radius: radius r, m, of the circle through the points of the platform.
        mass: mass, kg, positive.
        inertia: (3, 3) about the mass centre in platform axes, kg m^2; None: that of a uniform disc of radius r.
        gravity: gravity, m/s^2, positive.
        z_axis: direction of the z axis, "down" or "up".
        limits: limits in addition to taut cables; None: no limits.

    Returns:
        the robot; if one winch drives each pair, it moves as the point mass of `three_cable_equivalent`.

    Raises:
        InputError: a radius is not positive, or the numbers would not be accepted in a robot file.
    """
    positions, half = 2.0 * np.pi / 3.0 * np.arange(3.0), 0.5 * platform_radius
    middles = spool_radius * np.stack([np.cos(positions), np.sin(positions), 0.0 * positions], axis=1)
    high = np.sqrt(3.0) * half
    firsts = np.array([[-half, -high, 0.0], [platform_radius, 0.0, 0.0], [-half, high, 0.0]])
    points = np.stack([firsts, -firsts], axis=1)
    disc = 0.25 * mass * platform_radius**2 * np.diag([1.0, 1.0, 2.0])
    return platform_robot(
        (middles[:, None] + points).reshape(6, 3),
        points.reshape(6, 3),
        mass=mass,
        inertia=disc if inertia is None else inertia,
        gravity=gravity,
        name=name,
        z_axis=z_axis,
        limits=limits,
    )


@checked(traced=True)
def three_cable_equivalent(robot: PlatformRobot) -> PointMassRobot:
    """Point mass on three cables, equivalent to a platform on six in parallel pairs; see `robots.model.parallel_pairs`.

    Args:
        robot: platform whose axes are parallel to the fixed axes when the cables of its pairs are parallel.

    Returns:
        the robot, in the same axes; its tensions are those of pairs, and its limits imply those of all six cables.

    Raises:
        InputError: cables that do not form such pairs, a mass centre that is not between the points of a pair,
            contradictory limits, or winches that differ within a pair.
    """
    if not isinstance(robot, PlatformRobot) or robot.pattern != RIGID or robot.pulleys is not None:
        raise InputError("robot", getattr(robot, "name", robot), "a rigid platform on six cables without pulleys")
    pairs = parallel_pairs(robot.base_points, robot.platform_points)
    equivalent = _point_mass_robot(
        pairs.exit_points,
        mass=float(robot.mass),
        gravity=float(robot.gravity),
        name=robot.name,
        z_axis=robot.z_axis,
        limits=pair_limits(robot.limits, pairs),
    )
    return dataclasses.replace(equivalent, **_of_pairs(robot, pairs))


def _of_pairs(robot: PlatformRobot, pairs: ParallelPairs) -> dict[str, Any]:
    # Parallel cables of one length add their stiffness, and one winch drives both.
    changes: dict[str, Any] = {}
    if robot.axial_stiffness is not None:
        changes["axial_stiffness"] = as_float64(np.asarray(robot.axial_stiffness)[pairs.cables].sum(1))
    if robot.winches is not None:
        first, second = (jax.tree.map(lambda x, k=k: np.asarray(x)[pairs.cables[:, k]], robot.winches) for k in (0, 1))
        if not all(jax.tree.leaves(jax.tree.map(np.array_equal, first, second))):
            problem = "cables of a pair are on one winch, but their numbers differ"
            raise InputError("robot.winches", None, "equal for both", problem=problem)
        changes["winches"] = first
    return changes
