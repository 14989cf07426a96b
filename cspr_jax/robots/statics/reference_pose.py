"""The reference orientation of a platform, and whether it is at rest there, thesis sections 3.4.3 and 3.9.

The plane of the attachment points is level, and the rotation about the vertical minimises the sum of squares of the
cables' level components. The thesis minimises the sum of the level components of unit vectors along the cables instead,
with the same result for the symmetric robots that it treats. For others its minimum can have unequal tensions (NIST
RoboCrane at a depth of its spools' radius), whereas the squares make tensions equal, (3.14), at every depth. The
reference orientation is computed, not assumed, and so is the sign of det J.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.errors import InputError
from cspr_jax.numerics.elementary import as_float64, double_precision, maximum_of
from cspr_jax.numerics.linear.lanes import about_axis
from cspr_jax.numerics.linear.rotations import about_vertical
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.point_mass import rest_point
from cspr_jax.robots.statics import wrench_balance

# Axes that differ from the reference axes by less than this count as equal to them.
ALIGNED = 1e-6
# A cable counts as slack if its tension is a smaller fraction than this of the mean tension.
SMALLEST_TENSION = 1e-6

_CHANGE_LINES = (
    "must be held in all directions: cable i runs from base_points[i] to platform_points[i]; let two neighbouring "
    "spools share a platform point, or two platform points a spool, so that the cables make triangles"
)
_CHANGE_LOAD = (
    "must hang with every cable taut: move centre_of_mass nearer to the middle of platform_points, check the order of "
    "the cables in base_points and platform_points, or make z0 larger"
)


class Reference(NamedTuple):
    """A robot at rest in its reference orientation.

    Fields:
        robot: the robot, its platform axes parallel to the fixed ones in the reference orientation.
        rotation: (3, 3) from the axes of the robot file to these platform axes.
        determinant: value of `robots.statics.wrench_balance.normalised_determinant` in P0, whose sign must not change.
        tensions: (n_cables,) tensions at rest in P0, over their mean.
    """

    robot: PlatformRobot
    rotation: np.ndarray
    determinant: float
    tensions: np.ndarray


def aligned(robot: PlatformRobot) -> tuple[PlatformRobot, Float[np.ndarray, "3 3"]]:
    """A robot whose platform axes are parallel to the fixed ones in the reference orientation.

    A platform on more cables than degrees of freedom can rest in many orientations. Its reference orientation is the
    one in which its axes are parallel to the axes of the robot file; the same holds for platforms that cannot turn
    about all axes.
    """
    if robot.n_cables > robot.dof or robot.pattern != "3R3T":
        return robot, np.eye(3)
    if isinstance(robot.base_points, jax.core.Tracer):
        rotation = _traced(robot)
    else:
        rotation = _level_and_straight(robot)
        if np.abs(rotation - np.eye(3)).max() < ALIGNED:
            rotation = np.eye(3)
    points, inertia = as_float64(robot.platform_points) @ rotation.T, rotation @ as_float64(robot.inertia) @ rotation.T
    inertia = 0.5 * (inertia + inertia.T)  # rounding leaves it almost symmetric
    centre = None if robot.centre_of_mass is None else as_float64(as_float64(robot.centre_of_mass) @ rotation.T)
    rotated = dataclasses.replace(
        robot, platform_points=as_float64(points), inertia=as_float64(inertia), centre_of_mass=centre
    )
    return rotated, rotation


def reference_pose(robot: PlatformRobot, z0: float) -> Reference:
    """The reference orientation of a robot, checked."""
    rotated, rotation = aligned(robot)
    center = rest_point(np.asarray(z0, float))
    with double_precision():
        determinant, tensions = (np.asarray(x) for x in _standing(rotated, center))
    pose = f"the reference pose (platform level and at rest, z0 = {z0:g} m)"
    if not wrench_balance.is_regular(abs(determinant)):
        error = f"{pose} is singular (determinant {determinant:.1g}, at least {wrench_balance.SINGULAR:g} counts): "
        raise InputError("platform_points", None, _CHANGE_LINES, problem=error + _free(rotated, center))
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):  # tensions may all be zero, or not finite
        fraction = tensions / np.abs(tensions).mean()
    if not (np.isfinite(fraction) & (fraction > SMALLEST_TENSION)).all():
        slack = int(np.argmin(np.where(np.isfinite(fraction), fraction, -np.inf)))
        error = f"in {pose} cable {slack + 1} is slack: it would need {fraction[slack]:.3g} of the mean tension"
        raise InputError("platform_points", None, _CHANGE_LOAD, problem=error)
    return Reference(rotated, rotation, float(determinant), fraction)


def _free(robot: PlatformRobot, center: np.ndarray) -> str:
    # Find the small motion (shift and rotation) that changes no cable length, and describe its largest component.
    points = np.asarray(robot.platform_points)
    cables = np.asarray(robot.base_points) - center - points
    along = cables / np.linalg.norm(cables, axis=1, keepdims=True)
    radius = np.linalg.norm(points, axis=1).max()
    motion = np.linalg.svd(np.hstack([along, np.cross(points, along) / radius]))[2][-1]
    parts = {
        "be pushed sideways": np.linalg.norm(motion[:2]),
        "be lifted": abs(motion[2]),
        "turn about a level axis": np.linalg.norm(motion[3:5]),
        "turn about the vertical": abs(motion[5]),
    }
    return f"the platform can {max(parts, key=lambda name: parts[name])} while no cable changes its length"


@jax.jit
def _standing(robot: PlatformRobot, center: Array) -> tuple[Array, Array]:
    return wrench_balance.normalised_determinant(robot, center, jnp.eye(3)), wrench_balance.tensions(
        robot, wrench_balance.at_rest(center, jnp.eye(3))
    )


def _level_and_straight(robot: PlatformRobot) -> np.ndarray:
    # Lay the platform flat on either side, and turn it so that its points are nearest to the spools; keep the better.
    points, base = np.asarray(robot.platform_points), np.asarray(robot.base_points)
    normal = np.linalg.svd(points - points.mean(0))[2][2]
    sides = [_to_vertical(sign * normal) for sign in (1.0, -1.0)]
    torsions = [_straightest(points @ side.T, base) for side in sides]
    best = int(np.argmax([nearness for _, nearness in torsions]))
    return about_vertical(torsions[best][0]) @ sides[best]


def _traced(robot: PlatformRobot) -> Any:
    # The same for spools that jax traces: only the rotation about the vertical depends on these.
    points = np.asarray(robot.platform_points)
    normal = np.linalg.svd(points - points.mean(0))[2][2]
    both = []
    for side in (_to_vertical(sign * normal) for sign in (1.0, -1.0)):
        x, y, _ = (points @ side.T).T
        along = x @ robot.base_points[:, 0] + y @ robot.base_points[:, 1]
        across = x @ robot.base_points[:, 1] - y @ robot.base_points[:, 0]
        nearness = jnp.hypot(along, across)
        zero, one = jnp.zeros_like(along), jnp.ones_like(along)
        about_z = jnp.stack([along, -across, zero, across, along, zero, zero, zero, nearness]).reshape(3, 3) / nearness
        both.append((nearness, jnp.where(nearness > ALIGNED * one, about_z, jnp.eye(3)) @ side))
    (first, rotation), (second, other) = both
    chosen = jnp.where(first >= second, rotation, other)
    return jnp.where(maximum_of(jnp.abs(chosen - jnp.eye(3))) < ALIGNED, jnp.eye(3), chosen)


def _to_vertical(normal: np.ndarray) -> np.ndarray:
    # Smallest rotation that takes a unit vector to +z.
    axis = np.cross(normal, [0.0, 0.0, 1.0])
    sine, cosine = np.linalg.norm(axis), normal[2]
    if sine < ALIGNED:
        return np.diag([1.0, np.sign(cosine), np.sign(cosine)])
    return np.array(about_axis(axis / sine, as_float64(sine), as_float64(cosine)))


def _straightest(points: np.ndarray, base: np.ndarray) -> tuple[float, float]:
    # Torsion with the smallest sum of squares, and the sum of a . b with it, which measures how near the points are.
    along = float((points[:, :2] * base[:, :2]).sum())
    across = float((points[:, 0] * base[:, 1] - points[:, 1] * base[:, 0]).sum())
    nearness = math.hypot(along, across)
    is_any = nearness < ALIGNED * np.linalg.norm(points) * np.linalg.norm(base)
    return (0.0 if is_any else math.atan2(across, along)), nearness
