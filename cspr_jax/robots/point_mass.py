"""Point-mass robots: geometry, mass, gravity, limits.

A robot that is loaded or made has the axes of its file. Kernels take it from the centroid of its spools and with z
down, as `problem.centred` gives it.
"""

import dataclasses
from typing import Literal, Protocol

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.arithmetic.elementary import leaf
from cspr_jax.errors import InputError
from cspr_jax.robots.limits import NO_LIMITS, Limits

STANDARD_GRAVITY = 9.81
# Below these ratios three spools count as lying on a line, and their plane as vertical.
SMALLEST_AREA_RATIO = 1e-6
LARGEST_LENGTH = 1e6  # m; beyond, products of lengths lose their meaning
SMALLEST_LEVEL_RATIO = 1e-3
# Two spools count as level if their heights differ by less than this part of their distance.
LEVEL = 1e-9
# Of the size of a robot: points nearer to P0 than this are at rest there, and points nearer to a line through P0 on it.
AT_P0 = 1e-9

Axis = Literal["down", "up"]


@dataclasses.dataclass(frozen=True)
class PointMassRobot:
    """A point mass on three cables, or on two in the plane y = 0.

    Fields:
        base_points: (n_cables, 3) where the cables leave their spools, one a row, in cable order; m.
        mass: () of the effector, kg.
        gravity: () downwards, m/s^2.
        limits: limits beyond taut cables.
        name: for people.
        z_axis: where z points, "down" or "up"; known when a function is compiled.
    """

    base_points: Array
    mass: Array
    gravity: Array
    limits: Limits = NO_LIMITS
    name: str = ""
    z_axis: Axis = "down"


# The name stays outside: compiled functions do not see it, and are not compiled again for another one.
jax.tree_util.register_dataclass(
    PointMassRobot, ["base_points", "mass", "gravity", "limits"], ["z_axis"], drop_fields=["name"]
)


def point_mass_robot(
    base_points,
    *,
    mass: float,
    gravity: float = STANDARD_GRAVITY,
    name: str = "robot",
    z_axis: Axis = "down",
    limits: Limits | None = None,
) -> PointMassRobot:
    """A point-mass robot, its geometry checked.

    Args:
        base_points: (3, 3) spool points, one a row, m. Any triangle whose plane is not vertical, anywhere.
        mass: kg, positive.
        gravity: m/s^2, positive.
        name: for people.
        z_axis: where z points, "down" or "up".
        limits: limits beyond taut cables; None: none.

    Returns:
        the robot, float64 NumPy leaves.

    Raises:
        InputError: wrong shape, not finite, spools on a line, a vertical spool plane, mass or gravity not positive,
            another z_axis.
    """
    points = np.asarray(base_points, float)
    if points.shape != (3, 3) or not (np.abs(points) <= LARGEST_LENGTH).all():
        raise InputError("base_points", base_points, "three points of three coordinates, at most 1e6 m")
    check_numbers(mass, gravity)
    check_axis(z_axis)
    sides = np.roll(points, -1, 0) - points
    normal = np.cross(sides[0], sides[1])
    size = np.linalg.norm(normal)
    if not size > SMALLEST_AREA_RATIO * (np.linalg.norm(sides, axis=1).max() ** 2):
        raise InputError("base_points", points.tolist(), "three spools that are not on one line")
    if not abs(normal[2]) > SMALLEST_LEVEL_RATIO * size:
        raise InputError("base_points", points.tolist(), "three spools whose plane is not vertical")
    return PointMassRobot(leaf(points), leaf(mass), leaf(gravity), limits or NO_LIMITS, name, z_axis)


def planar_robot(
    base_points,
    *,
    mass: float,
    gravity: float = STANDARD_GRAVITY,
    name: str = "robot",
    z_axis: Axis = "down",
    limits: Limits | None = None,
) -> PointMassRobot:
    """A point mass on two cables, moving in the plane y = 0, its geometry checked.

    Args:
        base_points: (2, 3) spool points on a level line, y = 0; m.
        mass: kg, positive.
        gravity: m/s^2, positive.
        name: for people.
        z_axis: where z points, "down" or "up".
        limits: limits beyond taut cables; None: none.

    Returns:
        the robot, float64 NumPy leaves.

    Raises:
        InputError: wrong shape, not finite, y not 0, spools at one place or not on a level line, mass or gravity,
            another z_axis.
    """
    points = np.asarray(base_points, float)
    if points.shape != (2, 3) or not (np.abs(points) <= LARGEST_LENGTH).all():
        raise InputError("base_points", base_points, "two points of three coordinates, at most 1e6 m")
    check_numbers(mass, gravity)
    check_axis(z_axis)
    if (points[:, 1] != 0.0).any():
        raise InputError("base_points", points.tolist(), "points with y = 0: the plane of a planar robot")
    gap = np.abs(points[1] - points[0])
    if not gap[2] <= LEVEL * gap[0]:
        raise InputError("base_points", points.tolist(), "two spools apart from each other on a level line")
    return PointMassRobot(leaf(points), leaf(mass), leaf(gravity), limits or NO_LIMITS, name, z_axis)


def check_numbers(mass: float, gravity: float) -> None:
    """Refuse a mass or a gravity that is none.

    Args:
        mass: kg.
        gravity: m/s^2.

    Raises:
        InputError: not finite, or not positive.
    """
    for key, value in (("mass", mass), ("gravity", gravity)):
        if not (np.isfinite(value) and value > 0.0):
            raise InputError(key, value, "a finite number > 0")


def check_axis(z_axis: str) -> None:
    """Refuse a z axis that points nowhere.

    Args:
        z_axis: what was given.

    Raises:
        InputError: neither "down" nor "up".
    """
    if z_axis not in ("down", "up"):
        raise InputError("z_axis", z_axis, '"down" or "up"')


def is_planar(robot: PointMassRobot) -> bool:
    """Whether the robot has two cables and moves in the plane y = 0.

    Args:
        robot: the robot.

    Returns:
        the claim; a matter of shapes, so that compiled functions can ask.
    """
    return robot.base_points.shape[0] == 2


class HasSpools(Protocol):
    """Any robot, as far as its spools are concerned."""

    @property
    def base_points(self) -> Array:
        """(n_cables, 3) m."""


def rest_point(z0):
    """P0, where the effector hangs at rest: below the centroid of the spools.

    Args:
        z0: (...) depth, m.

    Returns:
        (..., 3) from the centroid, z down, m; NumPy of NumPy.
    """
    xp = jnp if isinstance(z0, jax.Array) else np
    z0 = xp.asarray(z0)
    return xp.stack([xp.zeros_like(z0), xp.zeros_like(z0), z0], axis=-1)


def spool_radius(robot: HasSpools) -> Array:
    """Largest distance of a spool from the centroid of all: the size of a robot.

    Args:
        robot: centred.

    Returns:
        () m.
    """
    return jnp.max(jnp.linalg.norm(robot.base_points, axis=1))


def plane_normal(robot: HasSpools) -> Array:
    """Normal of the spool plane, scaled so that its vertical component is 1.

    Of more than three spools it is the plane of least squares. The depth below the plane, measured along the
    vertical, is normal . p.

    Args:
        robot: centred.

    Returns:
        (3,) the third component is 1; (0, 0, 1) for level spools.
    """
    a = robot.base_points
    if a.shape[0] == 2:
        return jnp.zeros_like(a[0]).at[2].set(1.0)
    if a.shape[0] > 3:
        x, y, z = a.T
        xx, xy, yy, xz, yz = jnp.dot(x, x), jnp.dot(x, y), jnp.dot(y, y), jnp.dot(x, z), jnp.dot(y, z)
        slope = jnp.stack([xz * yy - yz * xy, yz * xx - xz * xy]) / (xx * yy - xy**2)
        return jnp.stack([-slope[0], -slope[1], jnp.ones_like(xx)])
    area = jnp.cross(a[0], a[1]) + jnp.cross(a[1], a[2]) + jnp.cross(a[2], a[0])
    return area / area[2]
