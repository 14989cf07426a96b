"""Half-planes of path acceleration u = s'' and squared path speed x = s'^2 in which a motion along a path stays.

At one place of a path the acceleration is p' u + p'' x, so that the wrench that the cables must supply is
a u + b x + r, with the momentum a of a unit path speed, its derivative b along the path, and the weight r. Each face of
the set of wrenches that the cables can give, each limit of a cable's acceleration, and each tangent of the largest
Cartesian acceleration is one half-plane (Bobrow, Dubowsky and Gibson 1985; Verscheure et al. 2009; Pham and Pham 2018).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, TypeVar

import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.robots.bounds.state_bounds import StateBounds
from cspr_jax.robots.bounds.witness_tensions import right_inverse
from cspr_jax.robots.cables import AnyRobot, cable_motion, wrench_units
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.state import State
from cspr_jax.robots.statics.wrench_sets import spanning, tension_range
from cspr_jax.robots.tensions.nearest_face import beside_faces, one_sided_faces
from cspr_jax.robots.tensions.tension_distribution import all_tensions

if TYPE_CHECKING:
    from jaxtyping import Float

# Tangents of the largest Cartesian acceleration: half of a polygon around the circle, in which p'' lies.
TANGENTS = 24
# Squared sizes that are taken to be no smaller, so that quotients stay finite.
TINY = 1e-30
StateKind = TypeVar("StateKind", State, StateBounds)


class Rows(NamedTuple):
    """Half-planes u_share u + x_share x <= most of one place; of n_rows, without units where they bound tensions.

    Fields:
        u: (..., n_rows) share of the path acceleration.
        x: (..., n_rows) share of the squared path speed.
        most: (..., n_rows) bound.
        size: (..., n_rows) what the bound loses for a margin of 1: N of tensions, all of its value of accelerations.
        cap: (...) largest x that speeds allow, inf for none.
    """

    u: Array
    x: Array
    most: Array
    size: Array
    cap: Array


def face_count(robot: AnyRobot) -> int:
    """Number of the half-planes that bound tensions: the first ones."""
    return 2 * len(spanning(robot.n_cables, robot.dof))


class UnitWrenches(NamedTuple):
    """Parts of the wrench that the cables must supply on a path, over the units of wrenches, (dof,) N each.

    Fields:
        matrix: (dof, n_cables) wrenches of unit tensions.
        momentum: of a unit path speed.
        second_derivative: its derivative along the path.
        rest: what holds the weight.
    """

    matrix: Array
    momentum: Array
    second_derivative: Array
    rest: Array


def still(state: StateKind, *, pushed: bool) -> StateKind:
    """State of a path that stands still, or sets off from there at a unit path acceleration."""
    none = state.velocity * 0.0
    changes = {"velocity": none, "acceleration": state.velocity if pushed else none}
    if state.rotation is not None:
        changes |= {"angular_velocity": none, "angular_acceleration": state.angular_velocity if pushed else none}
    return state._replace(**changes)


def unit_wrenches(robot: AnyRobot, state: State) -> UnitWrenches:
    """Parts of the wrench balance at one place."""
    unit = wrench_units(robot)
    rest = robot.inertial_wrench(still(state, pushed=False)) / unit
    momentum = robot.inertial_wrench(still(state, pushed=True)) / unit - rest
    second_derivative = robot.inertial_wrench(state) / unit - rest
    return UnitWrenches(robot.wrench_matrix(state) / unit[:, None], momentum, second_derivative, rest)


def path_rows(robot: AnyRobot, limits: Limits, state: State, speed: Float[Array, ""]) -> Rows:
    """Half-planes of one place."""
    parts = [_of_tensions(robot, limits, unit_wrenches(robot, state))]
    cap = jnp.square(speed) / jnp.maximum(jnp.sum(state.velocity**2), TINY)
    _, rate, second_derivative = cable_motion(robot, state)
    if limits.cable_acceleration_max is not None:
        maximum = jnp.broadcast_to(jnp.asarray(limits.cable_acceleration_max), rate.shape)
        both = (jnp.concatenate([side, -side]) for side in (rate, second_derivative))
        parts.append((*both, *[jnp.concatenate([maximum, maximum])] * 2))
    if limits.cable_speed_max is not None:
        cap = jnp.minimum(cap, jnp.min(jnp.square(limits.cable_speed_max) / jnp.maximum(rate**2, TINY)))
    if limits.acceleration_max is not None:
        parts.append(_tangents(state.velocity, state.acceleration, limits.acceleration_max))
    u, x, most_of, size = (jnp.concatenate(column) for column in zip(*parts, strict=True))
    return Rows(u, x, most_of, size, cap)


class TensionFaces(NamedTuple):
    """Faces of the set of wrenches that the cables can give, by what they say of tensions t: along t >= least.

    Fields:
        along: (n_faces, n_cables) products of the normals, which point inside, with the cables.
        least: (n_faces,) smallest products with tensions within their limits, N; -inf of a face that bounds nothing.
    """

    along: Array
    least: Array


def tension_faces(robot: AnyRobot, limits: Limits, matrix: Float[Array, "dof n_cables"]) -> TensionFaces:
    """Faces at one place."""
    count, dof = robot.n_cables, robot.dof
    low, high = tension_range(robot, limits)
    is_beside = (beside_faces(count, dof)[..., None] == np.arange(count)).astype(float)
    kernel = all_tensions(matrix, jnp.zeros(dof)).kernel if count > dof else jnp.zeros((0, count))
    one_sided = jnp.sum(one_sided_faces(matrix, kernel)[..., None] * is_beside, axis=1)
    along = jnp.concatenate([one_sided, -one_sided])
    minimum = jnp.where(along > 0.0, along * low[None], jnp.where(along < 0.0, along * high[None], 0.0)).sum(1)
    return TensionFaces(along, jnp.where((along != 0.0).any(1), minimum, -jnp.inf))


def _of_tensions(robot: AnyRobot, limits: Limits, wrenches: UnitWrenches) -> tuple[Array, ...]:
    # One half-plane a face, over the weight.
    faces, weight = tension_faces(robot, limits, wrenches.matrix), robot.mass * robot.gravity
    inverse, bounds = right_inverse(wrenches.matrix), jnp.isfinite(faces.least)
    momentum, second_derivative, rest = (
        jnp.sum(faces.along * (inverse @ x)[None], axis=1) / weight for x in wrenches[1:]
    )
    maximum = rest - jnp.where(bounds, faces.least, 0.0) / weight
    size = jnp.sum(jnp.abs(faces.along), axis=1) / weight
    # A face without a bound is 0 <= 1.
    momentum, second_derivative, size = (jnp.where(bounds, x, 0.0) for x in (-momentum, -second_derivative, size))
    return momentum, second_derivative, jnp.where(bounds, maximum, 1.0), size


def tangent_directions(velocity: Float[Array, "3"], acceleration: Float[Array, "3"]) -> Float[Array, "n_tangents 3"]:
    """Directions in which the Cartesian acceleration is bounded, in the plane of p' and p''."""
    along = velocity / jnp.sqrt(jnp.maximum(jnp.sum(velocity**2), TINY))
    second_derivative = acceleration - jnp.dot(acceleration, along) * along
    across = second_derivative / jnp.sqrt(jnp.maximum(jnp.sum(second_derivative**2), TINY))
    angles = np.linspace(0.0, np.pi, TANGENTS + 1)
    return np.cos(angles)[:, None] * along[None] + np.sin(angles)[:, None] * across[None]


def _tangents(velocity: Array, acceleration: Array, most: Array) -> tuple[Array, ...]:
    directions = tangent_directions(velocity, acceleration)
    bounds = most * jnp.ones(TANGENTS + 1)
    return directions @ velocity, directions @ acceleration, bounds, bounds
