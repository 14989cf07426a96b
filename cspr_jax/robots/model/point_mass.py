"""Point-mass robots: geometry, mass, gravity, limits, wrenches.

A robot that is loaded or built has the axes of its file. Kernels take it with the origin at the centroid of its spools
and with z down, as `robots.statics.kernel_axes.centred` gives it.
"""

from __future__ import annotations

import dataclasses
import functools
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.errors import InputError
from cspr_jax.errors.arguments import PointOfEachCable, Positive
from cspr_jax.numerics.elementary import as_float64, maximum_of
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.limits import NO_LIMITS, Limits
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.pulleys import Pulleys, exits
from cspr_jax.robots.model.robot import Robot
from cspr_jax.robots.model.spool_plane import AT_P0 as AT_P0
from cspr_jax.robots.model.spool_plane import SMALLEST_LEVEL_RATIO, is_on_line, is_vertical, spread
from cspr_jax.robots.model.state import State
from cspr_jax.robots.model.winches import Winches

STANDARD_GRAVITY = 9.81
# Degrees of freedom of a point mass in space, in the plane y = 0, and on a vertical guide.
SPATIAL = 3
PLANAR = 2
GUIDED = 1
LARGEST_LENGTH = 1e6  # m; products of larger lengths could overflow or lose digits
# Spools closer to a plane than this, over their spread, lie in it.
IN_PLANE = 1e-9
# Two spools count as level if their heights differ by less than this fraction of their distance.
LEVEL = 1e-9

Axis = Literal["down", "up"]


@dataclasses.dataclass(frozen=True)
class PointMassRobot:
    """A point mass on three cables or more, on two or more in the plane y = 0, or on a vertical guide.

    Fields:
        base_points: (n_cables, 3) points at which the cables leave their spools, or enter their pulleys, in cable
            order; m.
        mass: () mass of the effector, kg.
        gravity: () downwards, m/s^2.
        limits: limits beyond taut cables.
        name: name, for texts.
        z_axis: direction of z, "down" or "up"; static in compiled functions.
        dof: degrees of freedom: 3 in space, 2 in the plane y = 0, 1 on a guide; static in compiled functions.
        pulleys: pulleys between base points and cables; None: the cables leave from the base points.
        cable_diameter: () m; None: 0.
        axial_stiffness: (n_cables,) EA of the cables, N; None: they do not stretch.
        winches: winches of the cables; None: not known.
    """

    base_points: Array
    mass: Array
    gravity: Array
    limits: Limits = NO_LIMITS
    name: str = ""
    z_axis: Axis = "down"
    dof: int = SPATIAL
    pulleys: Pulleys | None = None
    cable_diameter: Array | None = None
    axial_stiffness: Array | None = None
    winches: Winches | None = None

    @property
    def pattern(self) -> str:
        """Name of a row of `robots.model.patterns`."""
        return f"{self.dof}T"

    @property
    def n_cables(self) -> int:
        """Number of cables."""
        return self.base_points.shape[-2]

    def wrench_matrix(self, state: State) -> Array:
        """Wrenches of unit tensions; see `Robot.wrench_matrix`."""
        return cable_units(self, state.position[None]).T[self._directions]

    def inertial_wrench(self, state: State) -> Array:
        """Wrench that the cables must supply; see `Robot.inertial_wrench`."""
        return self.mass * relative_acceleration(self, state.acceleration)[self._directions]

    @property
    def _directions(self) -> np.ndarray:
        # Axes along which the effector moves, such as x and z in the plane y = 0.
        return np.array(PATTERNS[self.pattern].forces)


# The name is no field of the pytree, so that functions are not compiled again for robots of other names.
jax.tree_util.register_dataclass(
    PointMassRobot,
    ["base_points", "mass", "gravity", "limits", "pulleys", "cable_diameter", "axial_stiffness", "winches"],
    ["z_axis", "dof"],
    drop_fields=["name"],
)


def point_mass_robot(
    base_points: PointOfEachCable,
    *,
    mass: Positive,
    gravity: Positive = STANDARD_GRAVITY,
    name: str = "robot",
    z_axis: Axis = "down",
    limits: Limits | None = None,
    pattern: str = "3T",
) -> PointMassRobot:
    """A point mass on cables, with its geometry checked.

    Args:
        base_points: (n_cables, 3) spool points, m. In space three or more, whose plane (for more than three that of
            least squares) is not vertical; in the plane y = 0 two or more, not on a vertical line, and if two, level;
            on a guide one or more.
        mass: kg, positive.
        gravity: m/s^2, positive.
        z_axis: where z points, "down" or "up".
        limits: limits beyond taut cables; None: none.
        pattern: "3T" in space, "2T" in the plane y = 0, "1T" along a vertical guide.

    Returns:
        the robot, float64 NumPy leaves.

    Raises:
        InputError: wrong shape, not finite, spools that lie otherwise, mass or gravity not positive, an unknown z_axis
            or pattern.
    """
    row = PATTERNS.get(pattern)
    if row is None or row.is_body:
        raise InputError("pattern", pattern, '"1T", "2T" or "3T"')
    points = (checked_coordinates if row.dof == GUIDED else checked_points)("base_points", base_points, row.dof)
    if row.dof == SPATIAL and is_vertical(points):
        raise InputError("base_points", points.tolist(), "spools whose plane is not vertical")
    if row.is_planar:
        _check_planar(points)
    check_numbers(mass, gravity)
    check_axis(z_axis)
    return PointMassRobot(
        as_float64(points), as_float64(mass), as_float64(gravity), limits or NO_LIMITS, name, z_axis, row.dof
    )


planar_robot = functools.partial(point_mass_robot, pattern="2T")
guided_robot = functools.partial(point_mass_robot, pattern="1T")


def _check_planar(points: np.ndarray) -> None:
    if (points[:, 1] != 0.0).any():
        raise InputError("base_points", points.tolist(), "points with y = 0: the plane of a planar robot")
    width, _, height = np.ptp(points, axis=0)
    if not width > SMALLEST_LEVEL_RATIO * height:
        raise InputError("base_points", points.tolist(), "spools that are not on a vertical line")
    if len(points) == PLANAR and not height <= LEVEL * width:
        raise InputError("base_points", points.tolist(), "two spools on a level line")


def checked_points(key: str, points, count: int) -> Float[np.ndarray, "n 3"]:
    """Check points of a robot, and their number; if three or more are required, they must not lie on one line."""
    points = checked_coordinates(key, points, count)
    if count > PLANAR and is_on_line(points):
        raise InputError(key, points.tolist(), "points that are not on one line, or coincident")
    return points


def checked_coordinates(key: str, coordinates, count: int) -> Float[np.ndarray, "n 3"]:
    """Check points of any arrangement, and their number."""
    if isinstance(coordinates, jax.core.Tracer):
        raise InputError(key, "a traced array", "numbers; to differentiate, dataclasses.replace(robot, ...) takes both")
    points = np.asarray(coordinates, float)
    if points.ndim != 2 or points.shape[1] != 3 or not (np.abs(points) <= LARGEST_LENGTH).all():
        raise InputError(key, coordinates, f"{count} points or more of three coordinates, at most 1e6 m")
    if len(points) < count:
        raise InputError(key, coordinates, f"must be {count} or more, one a cable", problem=f"{len(points)} points")
    return points


def cable_units(robot: Robot, targets: Array) -> Float[Array, "n_cables 3"]:
    """Unit vectors of the cables, from the effector to the spools; with pulleys, along the free cables."""
    if robot.pulleys is not None:
        targets = jnp.broadcast_to(targets, robot.base_points.shape)
        leaving = exits(robot.base_points, robot.pulleys.axes, robot.pulleys.radius, targets)
        return -jnp.asarray(leaving.direction)
    rays = robot.base_points - targets
    return rays / jnp.linalg.norm(rays, axis=1, keepdims=True)


def relative_acceleration(robot: PointMassRobot, acceleration: Float[Array, "3"]) -> Float[Array, "3"]:
    """Acceleration relative to free fall, p'' - g."""
    return acceleration.at[2].add(-robot.gravity)


def check_numbers(mass: float, gravity: float) -> None:
    """Refuse an invalid mass or gravity."""
    for key, value in (("mass", mass), ("gravity", gravity)):
        if not (np.isfinite(value) and value > 0.0):
            raise InputError(key, value, "a finite number > 0")


def check_axis(z_axis: str) -> None:
    """Refuse an unknown direction of z."""
    if z_axis not in ("down", "up"):
        raise InputError("z_axis", z_axis, '"down" or "up"')


def is_planar(robot: PointMassRobot) -> bool:
    """Tell whether the robot moves in the plane y = 0."""
    return robot.dof == PLANAR


def rest_point(z0):
    """P0, where the effector hangs at rest: below the centroid of the spools."""
    xp = jnp if isinstance(z0, jax.Array) else np
    z0 = xp.asarray(z0)
    return xp.stack([xp.zeros_like(z0), xp.zeros_like(z0), z0], axis=-1)


@jax.jit
def spool_radius(robot: Robot) -> Float[Array, ""]:
    """Largest distance of a spool from the centroid of all spools."""
    return maximum_of(jnp.linalg.norm(robot.base_points, axis=1))


def in_one_plane(robot: PointMassRobot) -> bool:
    """Tell whether the spools lie in one plane, those of a planar robot on one line."""
    if robot.n_cables <= robot.dof:
        return True
    points = np.asarray(robot.base_points)
    spreads = spread(points[:, [0, 2]] if robot.dof == PLANAR else points)
    return bool(spreads[robot.dof - 1] <= IN_PLANE * spreads[0])


@jax.jit
def plane_normal(robot: Robot) -> Float[Array, "3"]:
    """Normal of the spool plane, scaled so that its vertical component is 1.

    For more than three spools it is the plane of least squares. The depth of p below the plane, along the vertical, is
    normal . p.
    """
    a = robot.base_points
    if robot.dof == robot.n_cables == PLANAR:  # level
        return jnp.zeros_like(a[0]).at[2].set(1.0)
    if robot.dof == PLANAR:
        x, _, z = a.T
        return jnp.stack([-jnp.dot(x, z) / jnp.dot(x, x), jnp.zeros_like(x[0]), jnp.ones_like(x[0])])
    if robot.n_cables > SPATIAL:
        x, y, z = a.T
        xx, xy, yy, xz, yz = jnp.dot(x, x), jnp.dot(x, y), jnp.dot(y, y), jnp.dot(x, z), jnp.dot(y, z)
        gradient = jnp.stack([xz * yy - yz * xy, yz * xx - xz * xy]) / (xx * yy - xy**2)
        return jnp.stack([-gradient[0], -gradient[1], jnp.ones_like(xx)])
    area = jnp.cross(a[0], a[1]) + jnp.cross(a[1], a[2]) + jnp.cross(a[2], a[0])
    return area / area[2]
