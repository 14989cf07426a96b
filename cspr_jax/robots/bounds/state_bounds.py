"""Bounds of states over a block of time, and of lengths of cables, their rates and the wrench balance.

Formulas are those of `robots.statics.force_balance`, `robots.statics.wrench_balance` and `robots.model.platform`, in
affine bounds.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from cspr_jax.numerics.bounds.affine_bounds import (
    AffineBounds,
    constant,
    cross,
    dot,
    joined,
    norm_squared,
    rotated,
    selected,
    squared,
)
from cspr_jax.numerics.bounds.function_bounds import reciprocal_root
from cspr_jax.robots.bounds.pulley_bounds import pulley_bounds
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.platform import PlatformRobot, across_line


class StateBounds(NamedTuple):
    """Bounds of the states of one block; see `robots.model.state.State`.

    Fields:
        position: (3,) of the mass centre, m.
        velocity: (3,) m/s.
        acceleration: (3,) m/s^2.
        rotation: (3, 3) from platform to fixed axes; None for a point mass.
        angular_velocity: (3,) fixed axes, rad/s; None for a point mass.
        angular_acceleration: (3,) fixed axes, rad/s^2; None for a point mass.
    """

    position: AffineBounds
    velocity: AffineBounds
    acceleration: AffineBounds
    # Typed as arrays are in `State`: platforms always have them.
    rotation: AffineBounds = None  # type: ignore[assignment]
    angular_velocity: AffineBounds = None  # type: ignore[assignment]
    angular_acceleration: AffineBounds = None  # type: ignore[assignment]


def backwards(state: StateBounds) -> StateBounds:
    """Bounds of the states of the same motion with time reversed."""
    rates = ("velocity", "angular_velocity")
    changed = {name: -bounds if name in rates else bounds for name, bounds in state._asdict().items() if bounds}
    return StateBounds(**{name: bounds._replace(linear=-bounds.linear) for name, bounds in changed.items()})


def at_rest(state: StateBounds) -> StateBounds:
    """Bounds of the same poses without a motion."""
    poses = ("position", "rotation")
    changed = {name: bounds for name, bounds in state._asdict().items() if bounds is not None}
    zeros = {name: jax.tree.map(np.zeros_like, bounds) for name, bounds in changed.items() if name not in poses}
    return state._replace(**zeros)


class CableBounds(NamedTuple):
    """Bounds of the cables of one block.

    Fields:
        direction: (n_cables, 3) unit vectors from the effector to the spools.
        arm: (n_cables, 3) attachment points from the mass centre, fixed axes, m; None for a point mass.
        length: (n_cables,) m.
        rate: (n_cables,) m/s.
        acceleration: (n_cables,) m/s^2.
        exit: (n_cables, 3) points at which the cables leave, m.
    """

    direction: AffineBounds
    arm: AffineBounds | None
    length: AffineBounds
    rate: AffineBounds
    acceleration: AffineBounds
    exit: AffineBounds


def attachments(
    robot: AnyRobot, state: StateBounds
) -> tuple[AffineBounds | None, AffineBounds, AffineBounds, AffineBounds]:
    """Bounds of the attachment points."""
    target, velocity, acceleration = (_expanded(bounds) for bounds in state[:3])
    if not isinstance(robot, PlatformRobot):
        return None, target, velocity, acceleration
    arm = rotated(state.rotation.each(lambda x: x[None]), robot.platform_points)
    swing = cross(_expanded(state.angular_velocity), arm)
    acceleration = (
        acceleration
        + cross(_expanded(state.angular_acceleration), arm)
        + cross(_expanded(state.angular_velocity), swing)
    )
    return arm, target + arm, velocity + swing, acceleration


def cable_bounds(robot: AnyRobot, state: StateBounds) -> CableBounds:
    """Bounds of the cables, with or without pulleys."""
    arm, target, velocity, point_acceleration = attachments(robot, state)
    ray = target + -robot.base_points
    square = norm_squared(ray)
    inverse = reciprocal_root(square)
    rate = dot(ray, velocity) * inverse
    acceleration = (norm_squared(velocity) + dot(ray, point_acceleration) - squared(rate)) * inverse
    direction, base = -(ray * inverse.each(lambda x: x[:, None])), constant(jnp.asarray(robot.base_points))
    straight = CableBounds(direction, arm, square * inverse, rate, acceleration, base)
    if robot.pulleys is None:
        return straight
    wrapped = pulley_bounds(robot.pulleys, ray, velocity)
    rate = dot(wrapped.direction, velocity)
    slower = squared(rate) + wrapped.swivel
    acceleration = dot(wrapped.direction, point_acceleration) + (norm_squared(velocity) - slower) * wrapped.inverse
    wheel = jnp.asarray(robot.pulleys.radius) > 0.0
    values = (wrapped.length, rate, acceleration)
    length, rate, acceleration = (selected(wheel, f, g) for f, g in zip(values, straight[2:5], strict=True))
    wheel = wheel[:, None]
    direction, leaving = (
        selected(wheel, -wrapped.direction, direction),
        selected(wheel, wrapped.exit + base.middle, base),
    )
    return CableBounds(direction, arm, length, rate, acceleration, leaving)


def balance_bounds(robot: AnyRobot, state: StateBounds, cables: CableBounds) -> tuple[AffineBounds, AffineBounds]:
    """Bounds of the wrench balance: wrenches of unit tensions, and the wrench that the cables must supply."""
    force = (state.acceleration + jnp.asarray([0.0, 0.0, -1.0]) * robot.gravity) * robot.mass
    row = PATTERNS[robot.pattern]
    forces = cables.direction.each(jnp.transpose)
    if not isinstance(robot, PlatformRobot) or cables.arm is None:
        axes = np.array(row.forces)
        return forces.each(lambda x: x[axes]), force.each(lambda x: x[axes])
    moments = cross(cables.arm, cables.direction).each(jnp.transpose)
    moment = _spin_moment(robot, state)
    if row.is_jointed and robot.centre_of_mass is not None:
        moment = moment + cross(rotated(state.rotation, robot.centre_of_mass), force)
    matrix = balanced_part(robot, state.rotation, forces, moments)
    wrench = balanced_part(robot, state.rotation, *(bounds.each(lambda x: x[:, None]) for bounds in (force, moment)))
    return matrix, wrench.each(lambda x: x[:, 0])


def _expanded(bounds: AffineBounds) -> AffineBounds:
    return bounds.each(lambda x: x[None])


def _spin_moment(robot: PlatformRobot, state: StateBounds) -> AffineBounds:
    # Rate of the angular momentum: computed in platform axes, in which the inertia is constant, then rotated back.
    inertia = robot.inertia
    if PATTERNS[robot.pattern].is_jointed and robot.centre_of_mass is not None:
        arm = jnp.asarray(robot.centre_of_mass)
        inertia = inertia + robot.mass * (jnp.dot(arm, arm) * jnp.eye(3) - jnp.outer(arm, arm))
    back = state.rotation.each(jnp.transpose)
    velocity, acceleration = rotated(back, state.angular_velocity), rotated(back, state.angular_acceleration)
    return rotated(state.rotation, rotated(inertia, acceleration) + cross(velocity, rotated(inertia, velocity)))


def balanced_part(
    robot: PlatformRobot, rotation: AffineBounds, force: AffineBounds, moment: AffineBounds
) -> AffineBounds:
    """Bounds of the components of wrenches that the cables balance."""
    row = PATTERNS[robot.pattern]
    if row.along_line:
        across = rotated(rotation.each(lambda x: x[None]), across_line(robot).T)
        turning = _products(across, moment)
    else:
        turning = moment.each(lambda x: x[np.array(row.moments)])
    return joined([force.each(lambda x: x[np.array(row.forces, int)]), turning], axis=0)


def _products(rows: AffineBounds, columns: AffineBounds) -> AffineBounds:
    # Product of (m, 3) and (3, n).
    return dot(rows.each(lambda x: x[:, None]), columns.each(lambda x: x.T[None]))
