"""The rigid platform on cables: geometry, mass, inertia, limits, wrenches; its axes are as of `robots.point_mass`."""

import dataclasses
import itertools

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.arithmetic.elementary import leaf
from cspr_jax.errors import InputError
from cspr_jax.robots.limits import NO_LIMITS, Limits
from cspr_jax.robots.point_mass import (
    LARGEST_LENGTH,
    STANDARD_GRAVITY,
    Axis,
    check_axis,
    check_numbers,
    checked_points,
)
from cspr_jax.robots.state import State

RIGID = 6  # degrees of freedom
# Points nearer to each other than this part of the largest distance are one point.
SAME = 1e-9
# Rounding that is allowed to an inertia tensor: of its symmetry, and of a flat body's I1 + I2 = I3.
INERTIA_TOLERANCE = 1e-9


@dataclasses.dataclass(frozen=True)
class PlatformRobot:
    """A rigid platform on six cables or more.

    Fields:
        base_points: (n_cables, 3) where the cables leave their spools, in cable order; m.
        platform_points: (n_cables, 3) where they are attached, from the mass centre, in platform axes, which are
            parallel to the fixed ones in the reference orientation; m.
        mass: () kg.
        inertia: (3, 3) about the mass centre, platform axes, kg m^2.
        gravity: () downwards, m/s^2.
        joints: for each cable the first one that is attached at the same point; known when a function is compiled, so
            that the point is computed once. Who replaces points so that others coincide replaces it too.
        limits: limits beyond taut cables.
        name: for people.
        z_axis: where z points, "down" or "up"; known when a function is compiled.
        dof: degrees of freedom; known when a function is compiled.
    """

    base_points: Array
    platform_points: Array
    mass: Array
    inertia: Array
    gravity: Array
    joints: tuple[int, ...]
    limits: Limits = NO_LIMITS
    name: str = ""
    z_axis: Axis = "down"
    dof: int = RIGID

    @property
    def n_cables(self) -> int:
        """Number of cables."""
        return self.base_points.shape[-2]

    def wrench_matrix(self, state: State) -> Array:
        """Wrenches of unit tensions; see `Robot.wrench_matrix`."""
        cables, arms = rays(self, state.position, state.rotation)
        pulls = -cables / jnp.linalg.norm(cables, axis=1, keepdims=True)
        return jnp.concatenate([pulls, jnp.cross(arms, pulls)], axis=1).T

    def inertial_wrench(self, state: State) -> Array:
        """Wrench that the cables must supply; see `Robot.inertial_wrench`."""
        return self.mass * wrench_per_mass(self, state)


jax.tree_util.register_dataclass(
    PlatformRobot,
    ["base_points", "platform_points", "mass", "inertia", "gravity", "limits"],
    ["joints", "z_axis", "dof"],
    drop_fields=["name"],
)


def platform_robot(
    base_points,
    platform_points,
    *,
    mass: float,
    inertia,
    centre_of_mass=(0.0, 0.0, 0.0),
    gravity: float = STANDARD_GRAVITY,
    name: str = "robot",
    z_axis: Axis = "down",
    limits: Limits | None = None,
) -> PlatformRobot:
    """A platform on cables, its geometry and inertia checked.

    Args:
        base_points: (n_cables, 3) spool points, six or more, m.
        platform_points: (n_cables, 3) attachment points in platform axes, m.
        mass: kg, positive.
        inertia: (3, 3) about the mass centre, platform axes, kg m^2; symmetric, positive definite, of a real body.
        centre_of_mass: (3,) in platform axes, m.
        gravity: m/s^2, positive.
        name: for people.
        z_axis: where z points, "down" or "up".
        limits: limits beyond taut cables; None: none.

    Returns:
        the robot, float64 NumPy leaves.

    Raises:
        InputError: wrong shape, fewer points, other numbers of both, not finite, points on a line, two cables between
            the same two points, an inertia tensor that no body has, mass or gravity not positive, another z_axis.
    """
    base = checked_points("base_points", base_points, RIGID)
    platform = checked_points("platform_points", platform_points, RIGID)
    if len(platform) != len(base):
        allowed = f"must be {len(base)}, as many as base_points"
        raise InputError("platform_points", None, allowed, fault=f"{len(platform)} points")
    centre = np.asarray(centre_of_mass, float)
    if centre.shape != (3,) or not (np.abs(centre) <= LARGEST_LENGTH).all():
        raise InputError("centre_of_mass", centre_of_mass, "three coordinates, at most 1e6 m")
    check_numbers(mass, gravity)
    check_axis(z_axis)
    tensor = _inertia(inertia)
    for first, second in itertools.combinations(range(len(base)), 2):
        if _is_same(base, first, second) and _is_same(platform, first, second):
            raise InputError(
                "platform_points",
                platform.tolist(),
                f"no cables {first + 1} and {second + 1} between the same two points",
            )
    joints = tuple(int((platform == point).all(1).argmax()) for point in platform)
    numbers = (leaf(base), leaf(platform - centre), leaf(mass), leaf(tensor), leaf(gravity))
    return PlatformRobot(*numbers, joints, limits or NO_LIMITS, name, z_axis)


def _is_same(points: np.ndarray, first: int, second: int) -> bool:
    span = np.ptp(points, axis=0).max()
    return bool(np.linalg.norm(points[first] - points[second]) <= SAME * span)


def _inertia(given) -> np.ndarray:
    tensor = np.asarray(given, float)
    if tensor.shape != (3, 3) or not np.isfinite(tensor).all():
        raise InputError("inertia", given, "three rows of three finite numbers, kg m^2")
    scale = np.abs(tensor).max()
    if np.abs(tensor - tensor.T).max() > INERTIA_TOLERANCE * scale:
        raise InputError("inertia", tensor.tolist(), "a symmetric tensor")
    tensor = 0.5 * (tensor + tensor.T)
    low, middle, high = np.linalg.eigvalsh(tensor)
    if not low > 0.0:
        raise InputError("inertia", tensor.tolist(), "a positive definite tensor")
    if high > (low + middle) * (1.0 + INERTIA_TOLERANCE):
        raise InputError(
            "inertia", tensor.tolist(), "a tensor of a real body: no principal moment above the sum of the other two"
        )
    return tensor


def rays(robot: PlatformRobot, position: Array, rotation: Array) -> tuple[Array, Array]:
    """Cables as vectors from spool to platform, (3.1), and their attachment points from the mass centre.

    Args:
        robot: the robot.
        position: (3,) m.
        rotation: (3, 3).

    Returns:
        (n_cables, 3) each, fixed axes, m.
    """
    arms = robot.platform_points @ rotation.T
    return position[None] + arms - robot.base_points, arms


def wrench_per_mass(robot: PlatformRobot, state: State) -> Array:
    """Right-hand side of (3.11): what the cables must supply per mass.

    Args:
        robot: the robot.
        state: the state.

    Returns:
        (6,) p'' - g, m/s^2, and the rate of the angular momentum (3.8) over the mass, m^2/s^2.
    """
    inertia = state.rotation @ robot.inertia @ state.rotation.T
    moment = inertia @ state.angular_acceleration
    moment = moment + jnp.cross(state.angular_velocity, inertia @ state.angular_velocity)
    return jnp.concatenate([state.acceleration.at[2].add(-robot.gravity), moment / robot.mass])


def pairs_apart(robot: PlatformRobot) -> tuple[tuple[int, int], ...]:
    """Pairs of cables that can meet: those that share neither spool nor platform point.

    Args:
        robot: the robot.

    Returns:
        pairs of indices from 0 on.
    """
    base, platform = np.asarray(robot.base_points), np.asarray(robot.platform_points)
    return tuple(
        (i, j)
        for i, j in itertools.combinations(range(robot.n_cables), 2)
        if not _is_same(base, i, j) and not _is_same(platform, i, j)
    )
