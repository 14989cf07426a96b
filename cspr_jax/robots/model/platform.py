"""Bodies on cables, of any pattern of motion: geometry, mass, inertia, limits, wrenches.

Axes are those of `robots.model.point_mass`. `robots.model.patterns` says which forces and moments the cables balance.
All other components are zero for a planar platform or a rod, and a joint carries them where there is one.
"""

from __future__ import annotations

import dataclasses
import itertools

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.errors import InputError
from cspr_jax.errors.arguments import Coordinates3, Inertia, PointOfEachCable, Positive
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.body_geometry import checked_centre, checked_inertia, checked_platform, is_same
from cspr_jax.robots.model.limits import NO_LIMITS, Limits
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.point_mass import (
    STANDARD_GRAVITY,
    Axis,
    cable_units,
    check_axis,
    check_numbers,
    checked_coordinates,
    checked_points,
)
from cspr_jax.robots.model.pulleys import Pulleys
from cspr_jax.robots.model.state import State
from cspr_jax.robots.model.winches import Winches

RIGID = "3R3T"


@dataclasses.dataclass(frozen=True)
class PlatformRobot:
    """A body on cables: a rigid platform, or one of another pattern that turns.

    Fields:
        base_points: (n_cables, 3) points at which the cables leave their spools, or enter their pulleys, in cable
            order; m.
        platform_points: (n_cables, 3) points at which they are attached, from the mass centre, or from the joint of a
            robot on a joint, in platform axes, which are parallel to the fixed ones in the reference orientation; m.
        mass: () kg.
        inertia: (3, 3) about the mass centre, platform axes, kg m^2.
        gravity: () downwards, m/s^2.
        joints: for each cable the first cable that is attached at the same point; static, so that compiled functions
            compute the point once. Code that replaces points must replace this field too if other points coincide.
        limits: limits beyond taut cables.
        name: name, for texts.
        z_axis: direction of z, "down" or "up"; static in compiled functions.
        pattern: name of a row of `robots.model.patterns`; static in compiled functions.
        centre_of_mass: (3,) mass centre from the origin of the platform frame, platform axes, m; None: at the origin.
        pulleys: pulleys between base points and cables; None: the cables leave from the base points.
        cable_diameter: () m; None: 0.
        axial_stiffness: (n_cables,) EA of the cables, N; None: they do not stretch.
        winches: winches of the cables; None: not known.
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
    pattern: str = RIGID
    centre_of_mass: Array | None = None
    pulleys: Pulleys | None = None
    cable_diameter: Array | None = None
    axial_stiffness: Array | None = None
    winches: Winches | None = None

    @property
    def dof(self) -> int:
        """Degrees of freedom."""
        return PATTERNS[self.pattern].dof

    @property
    def n_cables(self) -> int:
        """Number of cables."""
        return self.base_points.shape[-2]

    def wrench_matrix(self, state: State) -> Array:
        """Wrenches of unit tensions; see `Robot.wrench_matrix`."""
        arms = self.platform_points @ state.rotation.T
        forces = cable_units(self, state.position[None] + arms)
        return self._balanced(state.rotation, forces.T, jnp.cross(arms, forces).T)

    def inertial_wrench(self, state: State) -> Array:
        """Wrench that the cables must supply; see `Robot.inertial_wrench`."""
        if self.pattern == RIGID:
            return self.mass * wrench_per_mass(self, state)
        force = self.mass * state.acceleration.at[2].add(-self.gravity)
        moment = _spin_moment(self, state)
        if PATTERNS[self.pattern].is_jointed and self.centre_of_mass is not None:
            moment = moment + jnp.cross(state.rotation @ self.centre_of_mass, force)
        return self._balanced(state.rotation, force, moment)

    def _balanced(self, rotation: Array, force: Array, moment: Array) -> Array:
        # Keep the components of forces and moments, (3, ...) each, that the cables balance.
        row = PATTERNS[self.pattern]
        turning = (rotation @ across_line(self)).T @ moment if row.along_line else moment[np.array(row.moments)]
        return jnp.concatenate([force[np.array(row.forces, int)], turning])


jax.tree_util.register_dataclass(
    PlatformRobot,
    [
        *("base_points", "platform_points", "mass", "inertia", "gravity", "limits", "centre_of_mass", "pulleys"),
        *("cable_diameter", "axial_stiffness", "winches"),
    ],
    ["joints", "z_axis", "pattern"],
    drop_fields=["name"],
)


def platform_robot(  # noqa: PLR0913
    base_points: PointOfEachCable,
    platform_points: PointOfEachCable,
    *,
    mass: Positive,
    inertia: Inertia,
    centre_of_mass: Coordinates3 | None = None,
    gravity: Positive = STANDARD_GRAVITY,
    name: str = "robot",
    z_axis: Axis = "down",
    limits: Limits | None = None,
    pattern: str = RIGID,
) -> PlatformRobot:
    """A platform on cables, its geometry and inertia checked.

    Args:
        base_points: (n_cables, 3) spool points, m, at least as many as degrees of freedom; y = 0 if planar.
        platform_points: (n_cables, 3) attachment points in platform axes, m; y = 0 if planar, on one line with the mass
            centre for a rod, from the joint for a robot on a joint.
        mass: kg, positive.
        inertia: (3, 3) about the mass centre, platform axes, kg m^2; symmetric, positive definite, of a real body.
        centre_of_mass: (3,) mass centre in platform axes, m; None: their origin.
        gravity: gravity, m/s^2, positive.
        z_axis: direction of the z axis, "down" or "up".
        limits: limits beyond taut cables; None: none.
        pattern: "3R3T" in space; "1R2T" in the plane y = 0; "2R3T" for a rod, with platform_points on one line; "3R"
            about a fixed joint, the origin of the platform axes.

    Returns:
        the robot, float64 NumPy leaves.

    Raises:
        InputError: wrong shape, too few points, different numbers of both, not finite, points that the pattern rules
            out, two cables between the same two points, an inertia tensor that no body has, mass or gravity not
            positive, an unknown z_axis or pattern.
    """
    row = PATTERNS.get(pattern)
    if row is None or not row.is_body:
        bodies = " or ".join(f'"{name}"' for name, row in PATTERNS.items() if row.is_body)
        raise InputError("pattern", pattern, bodies)
    base = (checked_coordinates if row.is_planar else checked_points)("base_points", base_points, row.dof)
    platform = checked_platform(platform_points, len(base), row)
    if row.is_planar and (base[:, 1] != 0.0).any():
        raise InputError("base_points", base.tolist(), "points with y = 0: the plane of a planar robot")
    centre = checked_centre((0.0, 0.0, 0.0) if centre_of_mass is None else centre_of_mass, platform, row)
    check_numbers(mass, gravity)
    check_axis(z_axis)
    tensor = checked_inertia(inertia, row)
    for first, second in itertools.combinations(range(len(base)), 2):
        if is_same(base, first, second) and is_same(platform, first, second):
            raise InputError(
                "platform_points",
                platform.tolist(),
                f"no cables {first + 1} and {second + 1} between the same two points",
            )
    joints = tuple(int((platform == point).all(1).argmax()) for point in platform)
    points = platform if row.is_jointed else platform - centre
    numbers = (as_float64(base), as_float64(points), as_float64(mass), as_float64(tensor), as_float64(gravity))
    return PlatformRobot(*numbers, joints, limits or NO_LIMITS, name, z_axis, pattern, as_float64(centre))


def platform_radius(robot: PlatformRobot) -> Float[Array, ""]:
    """Root mean square of the distances of the attachment points from the mass centre, or from the joint, m."""
    return jnp.sqrt(jnp.mean(jnp.sum(robot.platform_points**2, axis=1)))


def across_line(robot: PlatformRobot) -> Float[Array, "3 2"]:
    """Two axes of a rod, normal to the line of its attachment points and to each other."""
    offsets = robot.platform_points - robot.platform_points[:1]
    line = offsets[jnp.argmax(jnp.sum(offsets**2, axis=1))]
    line = line / jnp.linalg.norm(line)
    first = jnp.cross(line, jnp.eye(3, dtype=line.dtype)[jnp.argmin(jnp.abs(line))])
    first = first / jnp.linalg.norm(first)
    return jnp.stack([first, jnp.cross(line, first)], axis=1)


def _spin_moment(robot: PlatformRobot, state: State) -> Array:
    # Rate of the angular momentum about the mass centre, (3.8), or about a joint; N m.
    inertia = state.rotation @ robot.inertia @ state.rotation.T
    if PATTERNS[robot.pattern].is_jointed and robot.centre_of_mass is not None:
        arm = state.rotation @ robot.centre_of_mass
        inertia = inertia + robot.mass * (jnp.dot(arm, arm) * jnp.eye(3) - jnp.outer(arm, arm))
    moment = inertia @ state.angular_acceleration
    return moment + jnp.cross(state.angular_velocity, inertia @ state.angular_velocity)


def rays(
    robot: PlatformRobot, position: Float[Array, "3"], rotation: Float[Array, "3 3"]
) -> tuple[Float[Array, "n_cables 3"], Float[Array, "n_cables 3"]]:
    """Cables as vectors from spool to platform, (3.1), and their attachment points from the mass centre."""
    arms = robot.platform_points @ rotation.T
    return position[None] + arms - robot.base_points, arms


def wrench_per_mass(robot: PlatformRobot, state: State) -> Float[Array, "6"]:
    """Right-hand side of (3.11): the wrench that the cables must supply, per mass."""
    moment = _spin_moment(robot, state) / robot.mass
    return jnp.concatenate([state.acceleration.at[2].add(-robot.gravity), moment])


def separate_pairs(robot: PlatformRobot) -> tuple[tuple[int, int], ...]:
    """Pairs of cables that can meet: those that share neither spool nor platform point."""
    base, platform = np.asarray(robot.base_points), np.asarray(robot.platform_points)
    return tuple(
        (i, j)
        for i, j in itertools.combinations(range(robot.n_cables), 2)
        if not is_same(base, i, j) and not is_same(platform, i, j)
    )
