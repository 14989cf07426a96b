"""Half-planes of path acceleration u = s'' and squared path speed x = s'^2 that limit a motion along a path.

At one point of a path the acceleration is p' u + p'' x, so that the wrench that the cables must supply is
a u + b x + r, with the momentum a of a unit path speed, its derivative b along the path, and the weight r. Each face of
the set of wrenches that the cables can give, each limit of a cable's acceleration, and each tangent of the largest
Cartesian acceleration is one half-plane (Bobrow, Dubowsky and Gibson 1985; Verscheure et al. 2009; Pham and Pham 2018).
"""

from __future__ import annotations

from typing import NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.families.paths.least_time.motor_bounds import LinearBounds, MotorTensions, ReferenceMotion, motor_tensions
from cspr_jax.numerics.elementary import minimum_of
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.bounds.state_bounds import StateBounds
from cspr_jax.robots.bounds.witness_tensions import right_inverse
from cspr_jax.robots.cables import AnyRobot, cable_motion, wrench_units
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.state import State
from cspr_jax.robots.statics.wrench_sets import spanning, tension_range
from cspr_jax.robots.tensions.nearest_face import beside_faces, one_sided_faces
from cspr_jax.robots.tensions.tension_distribution import all_tensions

# Number of tangents to the largest Cartesian acceleration: half a polygon around the circle, on the side of p''.
TANGENTS = 24
# Squared norms are at least this, so that quotients stay finite.
TINY = 1e-30
StateKind = TypeVar("StateKind", State, StateBounds)


class HalfPlanes(NamedTuple):
    """Half-planes u_coefficient u + x_coefficient x <= bound at one point; those of tensions are dimensionless.

    Fields:
        u: (..., n_rows) coefficients of the path acceleration.
        x: (..., n_rows) coefficients of the squared path speed.
        bound: (..., n_rows) bounds.
        margin_loss: (..., n_rows) decrease of the bound for a margin of 1: of 1 N for tensions, of the full limit for
            accelerations.
        cap: (...) largest x that limits of speeds allow, inf for none.
    """

    u: Array
    x: Array
    bound: Array
    margin_loss: Array
    cap: Array


def face_count(robot: AnyRobot) -> int:
    """Number of half-planes that bound tensions; they come first."""
    return 2 * len(spanning(robot.n_cables, robot.dof))


class UnitWrenches(NamedTuple):
    """Parts of the wrench that the cables must supply on a path, over the units of wrenches, (dof,) N each.

    Fields:
        matrix: (dof, n_cables) wrenches of unit tensions.
        momentum: momentum at unit path speed.
        momentum_rate: derivative of `momentum` along the path.
        rest: wrench that holds the weight.
    """

    matrix: Array
    momentum: Array
    momentum_rate: Array
    rest: Array


def static_state(state: StateKind, *, accelerated: bool) -> StateKind:
    """State on a path at path speed zero, with path acceleration zero or one."""
    none = state.velocity * 0.0
    changes = {"velocity": none, "acceleration": state.velocity if accelerated else none}
    if state.rotation is not None:
        changes |= {"angular_velocity": none, "angular_acceleration": state.angular_velocity if accelerated else none}
    return state._replace(**changes)


@jax.jit
def unit_wrenches(robot: AnyRobot, state: State) -> UnitWrenches:
    """Parts of the wrench balance at one point."""
    unit = wrench_units(robot)
    rest = robot.inertial_wrench(static_state(state, accelerated=False)) / unit
    momentum = robot.inertial_wrench(static_state(state, accelerated=True)) / unit - rest
    momentum_rate = robot.inertial_wrench(state) / unit - rest
    return UnitWrenches(robot.wrench_matrix(state) / unit[:, None], momentum, momentum_rate, rest)


def path_half_planes(
    robot: AnyRobot, limits: Limits, state: State, speed: Float[Array, ""], reference: ReferenceMotion | None = None
) -> HalfPlanes:
    """Half-planes at one point; with a reference, those of motors come last."""
    wrenches = unit_wrenches(robot, state)
    parts = [_of_tensions(robot, limits, wrenches)]
    cap = jnp.square(speed) / jnp.maximum(jnp.sum(state.velocity**2), TINY)
    _, rate, acceleration = cable_motion(robot, state)
    if limits.cable_acceleration_max is not None:
        maximum = jnp.broadcast_to(jnp.asarray(limits.cable_acceleration_max), rate.shape)
        both = (jnp.concatenate([side, -side]) for side in (rate, acceleration))
        parts.append((*both, *[jnp.concatenate([maximum, maximum])] * 2))
    if limits.cable_speed_max is not None:
        cap = jnp.minimum(cap, minimum_of(jnp.square(limits.cable_speed_max) / jnp.maximum(rate**2, TINY)))
    if limits.acceleration_max is not None:
        parts.append(_tangents(state.velocity, state.acceleration, limits.acceleration_max))
    if reference is not None:
        motors = motor_tensions(robot, limits, state, reference)
        of_motors = _of_motors if robot.n_cables == robot.dof else _of_motors_together
        parts.append(of_motors(robot, limits, wrenches, motors, reference))
    u, x, bounds, margin_loss = (jnp.concatenate(column) for column in zip(*parts, strict=True))
    return HalfPlanes(u, x, bounds, margin_loss, cap)


class TensionFaces(NamedTuple):
    """Faces of the set of wrenches that the cables can give, as conditions on tensions t: along t >= minimum.

    Fields:
        along: (n_faces, n_cables) products of the inward normals with the cables' wrenches.
        minimum: (n_faces,) smallest products for tensions within limits, N; -inf if a face bounds nothing.
    """

    along: Array
    minimum: Array


def tension_faces(robot: AnyRobot, limits: Limits, matrix: Float[Array, "dof n_cables"]) -> TensionFaces:
    """Faces at one point."""
    count, dof = robot.n_cables, robot.dof
    low, high = tension_range(robot, limits)
    is_beside = (beside_faces(count, dof)[..., None] == np.arange(count)).astype(float)
    kernel = all_tensions(matrix, jnp.zeros(dof)).kernel if count > dof else jnp.zeros((0, count))
    one_sided = jnp.sum(one_sided_faces(matrix, kernel)[..., None] * is_beside, axis=1)
    along = jnp.concatenate([one_sided, -one_sided])
    minimum = jnp.where(along > 0.0, along * low[None], jnp.where(along < 0.0, along * high[None], 0.0)).sum(1)
    return TensionFaces(along, jnp.where((along != 0.0).any(1), minimum, -jnp.inf))


def _of_tensions(robot: AnyRobot, limits: Limits, wrenches: UnitWrenches) -> tuple[Array, ...]:
    # Make one half-plane for each face, over the weight.
    faces, weight = tension_faces(robot, limits, wrenches.matrix), robot.mass * robot.gravity
    inverse, bounds = right_inverse(wrenches.matrix), jnp.isfinite(faces.minimum)
    momentum, momentum_rate, rest = (jnp.sum(faces.along * (inverse @ x)[None], axis=1) / weight for x in wrenches[1:])
    maximum = rest - jnp.where(bounds, faces.minimum, 0.0) / weight
    margin_loss = jnp.sum(jnp.abs(faces.along), axis=1) / weight
    # Replace a face without a bound by 0 <= 1.
    momentum, momentum_rate, margin_loss = (jnp.where(bounds, x, 0.0) for x in (-momentum, -momentum_rate, margin_loss))
    return momentum, momentum_rate, jnp.where(bounds, maximum, 1.0), margin_loss


def _linear_tensions(wrenches: UnitWrenches) -> LinearBounds:
    # Tensions that balance a wrench that is linear in u and x.
    inverse = right_inverse(wrenches.matrix)
    return LinearBounds(inverse @ wrenches.momentum, inverse @ wrenches.momentum_rate, inverse @ wrenches.rest)


def _of_motors(
    robot: AnyRobot, limits: Limits, wrenches: UnitWrenches, motors: MotorTensions, _: ReferenceMotion
) -> tuple[Array, ...]:
    # Make two half-planes for each limit, side of friction and cable, over the weight: of largest, then of smallest
    # tensions.
    tension, weight = _linear_tensions(wrenches), robot.mass * robot.gravity
    both = [
        LinearBounds(*(sign * (side - linear[None, None]) for linear, side in zip(tension, bound, strict=True)))
        for sign, bound in ((1.0, motors.high), (-1.0, motors.low))
    ]
    slack = LinearBounds(*(jnp.stack(parts).ravel() / weight for parts in zip(*both, strict=True)))
    loss = jnp.stack([motors.width] * 2).ravel() / weight
    has_bound = jnp.isfinite(slack.constant)
    u, x, loss = (jnp.where(has_bound, part, 0.0) for part in (-slack.u, -slack.x, loss))
    return u, x, jnp.where(has_bound, slack.constant, 1.0), loss


def _of_motors_together(
    robot: AnyRobot, limits: Limits, wrenches: UnitWrenches, motors: MotorTensions, reference: ReferenceMotion
) -> tuple[Array, ...]:
    # Make one half-plane for each face of the set of wrenches whose tensions lie within the narrowest of all bounds.
    weight, tension = robot.mass * robot.gravity, _linear_tensions(wrenches)
    static_low, static_high = (jnp.broadcast_to(jnp.asarray(x), robot.n_cables) for x in tension_range(robot, limits))
    low, high = (
        _narrowest(motors.low, static_low, reference, -1.0),
        _narrowest(motors.high, static_high, reference, 1.0),
    )
    along = tension_faces(robot, limits, wrenches.matrix).along
    ups, downs = jnp.maximum(along, 0.0), jnp.minimum(along, 0.0)
    has_bound = (along != 0.0).any(1) & ~(((downs != 0.0) & ~jnp.isfinite(high.constant)[None]).any(1))
    high = high._replace(constant=jnp.where(jnp.isfinite(high.constant), high.constant, 0.0))
    slack = LinearBounds(
        *(
            jnp.sum(along * linear[None] - ups * minimum[None] - downs * maximum[None], axis=1) / weight
            for linear, minimum, maximum in zip(tension, low, high, strict=True)
        )
    )
    loss = jnp.sum(jnp.abs(along), axis=1) / weight
    u, x, loss = (jnp.where(has_bound, part, 0.0) for part in (-slack.u, -slack.x, loss))
    return u, x, jnp.where(has_bound, slack.constant, 1.0), loss


def _narrowest(bounds: LinearBounds, static: Array, reference: ReferenceMotion, sign: float) -> LinearBounds:
    # The bound of each cable that is narrowest at the reference; sign 1 for largest, -1 for smallest tensions.
    count, none = bounds.u.shape[-1], jnp.zeros((1, bounds.u.shape[-1]))
    candidates = LinearBounds(
        *(
            jnp.concatenate([more, part.reshape(-1, count)])
            for more, part in zip((none, none, static[None]), bounds, strict=True)
        )
    )
    nearest = jnp.argmin(sign * candidates.at(reference), axis=0, keepdims=True)
    return LinearBounds(*(jnp.take_along_axis(part, nearest, axis=0)[0] for part in candidates))


def tangent_directions(velocity: Float[Array, "3"], acceleration: Float[Array, "3"]) -> Float[Array, "n_tangents 3"]:
    """Directions in which the Cartesian acceleration is bounded, in the plane of p' and p''."""
    along = velocity / jnp.sqrt(jnp.maximum(jnp.sum(velocity**2), TINY))
    normal = acceleration - jnp.dot(acceleration, along) * along
    across = normal / jnp.sqrt(jnp.maximum(jnp.sum(normal**2), TINY))
    angles = np.linspace(0.0, np.pi, TANGENTS + 1)
    return np.cos(angles)[:, None] * along[None] + np.sin(angles)[:, None] * across[None]


def _tangents(velocity: Array, acceleration: Array, acceleration_max: Array) -> tuple[Array, ...]:
    directions = tangent_directions(velocity, acceleration)
    bounds = acceleration_max * jnp.ones(TANGENTS + 1)
    return directions @ velocity, directions @ acceleration, bounds, bounds
