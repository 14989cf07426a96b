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


def path_half_planes(robot: AnyRobot, limits: Limits, state: State, speed: Float[Array, ""]) -> HalfPlanes:
    """Half-planes at one point."""
    parts = [_of_tensions(robot, limits, unit_wrenches(robot, state))]
    cap = jnp.square(speed) / jnp.maximum(jnp.sum(state.velocity**2), TINY)
    _, rate, acceleration = cable_motion(robot, state)
    if limits.cable_acceleration_max is not None:
        maximum = jnp.broadcast_to(jnp.asarray(limits.cable_acceleration_max), rate.shape)
        both = (jnp.concatenate([side, -side]) for side in (rate, acceleration))
        parts.append((*both, *[jnp.concatenate([maximum, maximum])] * 2))
    if limits.cable_speed_max is not None:
        cap = jnp.minimum(cap, jnp.min(jnp.square(limits.cable_speed_max) / jnp.maximum(rate**2, TINY)))
    if limits.acceleration_max is not None:
        parts.append(_tangents(state.velocity, state.acceleration, limits.acceleration_max))
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
