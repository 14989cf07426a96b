"""Geometry of many poses: unit vectors of the cables, columns of the wrench matrix, weights.

Arrays are (n_cables, n): one row a cable, one lane a pose. Points of robots may have a lane for each pose, too. Rotated
arms, unit vectors, columns and later steps are compiled separately: in one call XLA would compute each length three
times, and loops over values that the call itself has stored are three times as slow as loops over its arguments.
"""

from __future__ import annotations

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.numerics.elementary import maximum_of
from cspr_jax.numerics.linear import lanes
from cspr_jax.numerics.linear.lanes import Vector
from cspr_jax.numerics.linear.rotations import matrix
from cspr_jax.numerics.shapes import Bool, Float
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.platform import PlatformRobot, across_line
from cspr_jax.robots.model.pulleys import Pulleys, exit_lanes, exits
from cspr_jax.robots.model.state import State

TINY = 1e-300  # m, radius in place of 0, at which derivatives are no numbers


def wrench_columns(
    robot: AnyRobot, position: Vector, quaternion: Vector | None, length: Float[Array, ""]
) -> tuple[list[Array], Array]:
    """Columns of the wrench matrix, and their errors in units of rounding."""
    arms = None if quaternion is None else turned_arms(robot, quaternion)
    units, loss = unit_vectors(robot, position, arms)
    if isinstance(robot, PlatformRobot):
        return _columns(robot, units, arms, quaternion, length), loss
    return [units[i] for i in PATTERNS[robot.pattern].forces], loss


@jax.jit
def turned_arms(robot: AnyRobot, quaternion: Vector) -> Vector | None:
    """Arms from the mass centre, or from the joint, to the attachment points."""
    if not isinstance(robot, PlatformRobot):
        return None
    shape = len(robot.base_points), len(quaternion[0])
    rotation = [[_along(x, shape) for x in row] for row in lanes.rotation_matrix(quaternion)]
    return lanes.rotated(rotation, _down(robot.platform_points, shape))


def _along(lane: Array, shape: tuple[int, int]) -> Array:
    return jnp.broadcast_to(lane[None], shape)


def _down(points: Array, shape: tuple[int, int]) -> Vector:
    # Points (n_cables, 3) of one robot, or (n_cables, 3, n) of the robot of each pose.
    return tuple(jnp.broadcast_to(points[:, i, None] if points.ndim == 2 else points[:, i], shape) for i in range(3))


def unit_vectors(robot: AnyRobot, position: Vector, arms: Vector | None) -> tuple[Vector, Array]:
    """Unit vectors of the cables, from the effector to the spools; with pulleys, along the free cables."""
    return _units(robot, position, arms, _inverse_lengths(robot, position, arms))


def _rays(robot: AnyRobot, position: Vector, arms: Vector | None) -> tuple[Vector, Vector]:
    # Attachment points of the cables, and rays from there to the base points.
    shape = len(robot.base_points), len(position[0])
    if arms is None and isinstance(robot, PlatformRobot):
        arms = _down(robot.platform_points, shape)
    target, base = [_along(x, shape) for x in position], _down(robot.base_points, shape)
    if arms is not None:
        target = [x + arm for x, arm in zip(target, arms, strict=True)]
    return target, tuple(base[i] - target[i] for i in range(3))


@jax.jit
def _inverse_lengths(robot: AnyRobot, position: Vector, arms: Vector | None) -> Array:
    _, ray = _rays(robot, position, arms)
    return 1.0 / jnp.sqrt(lanes.dot(ray, ray))


@jax.jit
def _units(robot: AnyRobot, position: Vector, arms: Vector | None, inverse: Array) -> tuple[Vector, Array]:
    target, ray = _rays(robot, position, arms)
    far = maximum_of(jnp.abs(robot.base_points), axis=(0, 1)) + lanes.largest([jnp.abs(x) for x in position])
    loss = jnp.maximum(1.0, far * lanes.largest(list(inverse)))
    if robot.pulleys is None:
        return tuple(x * inverse for x in ray), loss
    shape = inverse.shape[0], inverse.shape[1]
    base, axes = _down(robot.base_points, shape), _down(robot.pulleys.axes, shape)
    exit_of_cable = exit_lanes(base, axes, jnp.broadcast_to(robot.pulleys.radius[:, None], shape), target).direction
    return tuple(-x for x in exit_of_cable), loss


@jax.jit
def _columns(
    robot: PlatformRobot, units: Vector, arms: Vector | None, quaternion: Vector | None, length: Array
) -> list[Array]:
    row, shape = PATTERNS[robot.pattern], (units[0].shape[0], units[0].shape[1])
    moment = lanes.cross(_down(robot.platform_points, shape) if arms is None else arms, units)
    if row.along_line:
        axes = [_down(jnp.broadcast_to(axis, (shape[0], 3)), shape) for axis in across_line(robot).T]
        if quaternion is not None:
            rotation = [[_along(x, shape) for x in line] for line in lanes.rotation_matrix(quaternion)]
            axes = [lanes.rotated(rotation, axis) for axis in axes]
        about: Sequence[Array] = [lanes.dot(axis, moment) for axis in axes]
    else:
        about = [moment[i] for i in row.moments]
    return [*(units[i] for i in row.forces), *(component / length for component in about)]


def scales(robot: AnyRobot) -> Bool[np.ndarray, "dof"]:
    """Mask of those components of a wrench that are moments."""
    row = PATTERNS[robot.pattern]
    return np.arange(robot.dof) >= len(row.forces)


def at_rest(position: Float[Array, "3"], quaternion: Float[Array, "4"]) -> State:
    """State of an effector at rest."""
    zero = jnp.zeros_like(position)
    return State(position, zero, zero, matrix(quaternion), zero, zero, quaternion)


@jax.jit
def wrench_matrices(
    robot: AnyRobot, positions: Float[Array, "n 3"], quaternions: Float[Array, "n 4"]
) -> Float[Array, "n dof n_cables"]:
    """Wrench matrices of poses."""
    return jax.vmap(lambda p, q: robot.wrench_matrix(at_rest(p, q)))(positions, quaternions)


@jax.jit
def exit_points(
    robot: AnyRobot, pulleys: Pulleys, positions: Float[Array, "n 3"], quaternions: Float[Array, "n 4"]
) -> Float[Array, "n n_cables 3"]:
    """Points at which cables leave their pulleys."""
    targets = attachments(robot, positions, quaternions)
    return jax.vmap(lambda x: jnp.asarray(exits(robot.base_points, pulleys.axes, pulleys.radius, x).point))(targets)


@jax.jit
def cable_lengths(
    robot: AnyRobot, positions: Float[Array, "n 3"], quaternions: Float[Array, "n 4"]
) -> Float[Array, "n n_cables"]:
    """Lengths of the cables from their base points, including the arcs on pulleys."""
    targets, pulleys = attachments(robot, positions, quaternions), robot.pulleys
    if pulleys is None:
        return jnp.linalg.norm(robot.base_points[None] - targets, axis=2)
    exit_of_cable = jax.vmap(lambda x: exits(robot.base_points, pulleys.axes, pulleys.radius, x))(targets)
    return exit_of_cable.wrapped + exit_of_cable.free


def length_lanes(robot: AnyRobot, position: Vector, quaternion: Vector) -> Float[Array, "n_cables n"]:
    """Lengths of the cables, one lane a pose: the fast form of `cable_lengths`."""
    target, ray = _rays(robot, position, turned_arms(robot, quaternion))
    straight = jnp.sqrt(lanes.dot(ray, ray))
    if robot.pulleys is None:
        return straight
    shape = straight.shape[0], straight.shape[1]
    base, axes = _down(robot.base_points, shape), _down(robot.pulleys.axes, shape)
    radius = jnp.broadcast_to(robot.pulleys.radius[:, None], shape)
    is_wheel = radius > 0.0
    around = exit_lanes(base, axes, jnp.where(is_wheel, radius, TINY), target)
    return jnp.where(is_wheel, around.wrapped + around.free, straight)


@jax.jit
def attachments(
    robot: AnyRobot, positions: Float[Array, "n 3"], quaternions: Float[Array, "n 4"]
) -> Float[Array, "n n_cables 3"]:
    """Attachment points of the cables at poses."""
    arms = jnp.zeros((len(positions), *robot.base_points.shape), positions.dtype)
    if isinstance(robot, PlatformRobot):
        points = robot.platform_points
        arms = jax.vmap(lambda quaternion: points @ matrix(quaternion).T)(quaternions)
    return positions[:, None] + arms


@jax.jit
def weights(robot: AnyRobot, positions: Float[Array, "n 3"], quaternions: Float[Array, "n 4"]) -> Float[Array, "n dof"]:
    """Wrenches that hold a robot at rest."""
    return jax.vmap(lambda p, q: robot.inertial_wrench(at_rest(p, q)))(positions, quaternions)


def mass_centres(
    robot: AnyRobot, origins: Float[np.ndarray, "n 3"], quaternions: np.ndarray | None
) -> Float[np.ndarray, "n 3"]:
    """Positions of the mass centre, or of the joint of a robot on a joint, as the kernels take them."""
    row = PATTERNS[robot.pattern]
    if not isinstance(robot, PlatformRobot) or row.is_jointed or robot.centre_of_mass is None:
        return origins
    arm = np.asarray(robot.centre_of_mass)
    if quaternions is None:
        return origins + arm
    scalar, axis = quaternions[:, :1], quaternions[:, 1:]
    twice = 2.0 * np.cross(axis, np.broadcast_to(arm, axis.shape))
    return origins + arm + scalar * twice + np.cross(axis, twice)
