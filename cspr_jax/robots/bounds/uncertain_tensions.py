"""Tensions of all robots within an uncertainty, over a block of time, by their distance from the planned tensions.

Displacing spool j displaces ray j, of length l_j. The component along the ray only scales it; the component across
adds to the unit vector u_j a vector eps_j that is no longer than t_j. Let phi_j be the tensions at vectors
u_j + eps_j, which are tensions of the cables over sqrt(1 + eps_j^2), A the planned matrix, f tensions that balance the
planned robot, and B a right inverse of A in the middle of the block. Then phi = f + d balances the other robot where

    d = B (delta w - (A' - A) f) - B (A' - A_c) d,    so |d| <= b + (G + D) |d|,    b = |B delta w| + D |f|,

component by component: A' is the matrix of the other robot and A_c that of the planned robot in the middle of the
block, G bounds B (A - A_c), and D_kj = |part of g_kj across u_j| t_j, where g_kj is the derivative of row k of B A with
respect to u_j. Where x >= b + (G + D) x for some x > 0 the spectral radius of G + D is below 1; then such a d exists
with |d| <= x, and A' has full rank. Cauchy's inequality bounds B delta w for a displaced mass centre.

With as many cables as components a closer bound follows (docs/theory.md): until a first tension k reaches its smallest
value, d_k is bounded by the sum of D_kj phi_j, which is at most y w' for every y with y A' >= D_k.
"""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import jax.numpy as jnp
from jax import Array, lax

from cspr_jax.numerics.bounds.affine_bounds import AffineBounds, constant, cross, dot, norm, rotated
from cspr_jax.numerics.elementary import maximum_of, solved
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.bounds.state_bounds import CableBounds, StateBounds, balance_bounds, balanced_part
from cspr_jax.robots.bounds.witness_tensions import witness_tensions
from cspr_jax.robots.cables import AnyRobot, wrench_units
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.platform import PlatformRobot

# Relative surplus by which solutions of inequalities are enlarged, so that they hold in spite of rounding, and smallest
# change of tensions, over the largest tension.
SURPLUS = 1e-9
# Number of rounds in which the functionals y are corrected.
ROUNDS = 8
SPARE = 0.01  # relative surplus of each correction


class UncertainTensions(NamedTuple):
    """Tensions of all robots within an uncertainty, over one block.

    Fields:
        low: (n_cables,) bounds below tensions that balance each robot, N; -inf without bounds.
        high: (n_cables,) bounds above the same tensions, N; inf likewise.
    """

    low: Array
    high: Array


def with_mass(robot: AnyRobot, ratio: Float[Array, ""]) -> AnyRobot:
    """The robot with its mass and inertia multiplied by a ratio."""
    if isinstance(robot, PlatformRobot):
        return dataclasses.replace(robot, mass=robot.mass * ratio, inertia=robot.inertia * ratio)
    return dataclasses.replace(robot, mass=robot.mass * ratio)


def uncertain_tensions(
    robot: AnyRobot,
    state: StateBounds,
    cables: CableBounds,
    limits: tuple[Float[Array, "n_cables"], Float[Array, "n_cables"]],
    radii: tuple[Float[Array, ""], Float[Array, ""]],
) -> UncertainTensions:
    """Tensions of all robots that differ from a given one in positions of the spools and of the mass centre."""
    unit = 1.0 / wrench_units(robot)
    matrix, wrench = balance_bounds(robot, state, cables)
    matrix, wrench = matrix * unit[:, None], wrench * unit
    witness = witness_tensions(matrix, wrench, *limits)
    tensions, inverse = witness.tension, witness.inverse
    sine = radii[0] / cables.length.low()
    tilt = jnp.where((sine >= 0.0) & (sine < 1.0), sine, jnp.nan) / jnp.sqrt(1.0 - sine**2)
    block = _UnitBlock(inverse, matrix, _across(robot, state, cables, unit), tilt, tensions)
    centre = _centre_change(robot, state, inverse * unit[None], radii[1]) + SURPLUS * maximum_of(tensions.magnitude())
    within, displaced = block.changes(inverse)
    maximum = _solution(within + displaced, displaced @ tensions.magnitude() + centre)
    down, up = maximum, maximum
    if robot.n_cables == robot.dof:
        down, up = _closer(block, displaced, within @ maximum + centre, limits[0], centre)
        down, up = jnp.fmin(maximum, down), jnp.fmin(maximum, up)
    low, high = tensions.low() - down, tensions.high() + up
    is_known = jnp.isfinite(low).all() & jnp.isfinite(high).all()
    # Tensions at tilted unit vectors are tensions of the cables over the lengths of these vectors, at least 1.
    norms = jnp.sqrt(1.0 + tilt**2)
    low = jnp.where(low < 0.0, low * norms, low)
    return UncertainTensions(jnp.where(is_known, low, -jnp.inf), jnp.where(is_known, high * norms, jnp.inf))


class _UnitBlock(NamedTuple):
    # Right inverse (n_cables, dof) of the matrix in the middle; bounds of the matrix, of its derivatives with respect
    # to unit vectors, across cables (dof, n_cables, 3), and of the planned tensions; tilts (n_cables,).
    inverse: Array
    matrix: AffineBounds
    across: AffineBounds
    tilt: Array
    tensions: AffineBounds

    def changes(self, rows: Array) -> tuple[Array, Array]:
        # Bound changes of rows (m, dof) times the matrix, within the block and with displaced spools, (m, n_cables).
        dof, count = self.matrix.middle.shape
        left = jnp.abs(self.matrix.middle @ self.inverse - jnp.eye(dof))
        rounding = jnp.where(maximum_of(jnp.sum(left, axis=1)) < 0.5 * SURPLUS, SURPLUS, jnp.nan)
        radius = self.matrix.radius + rounding * jnp.sum(jnp.abs(self.matrix.middle), axis=0, keepdims=True)
        within = jnp.abs(rows @ self.matrix.linear) + jnp.abs(rows) @ radius
        directions = rotated(self.across.each(lambda x: x.reshape(dof, -1).T[None]), rows)
        return within, norm(directions.each(lambda x: x.reshape(len(rows), count, 3))).high() * self.tilt[None]


def _closer(block: _UnitBlock, displaced: Array, rest: Array, minimum: Array, centre: Array) -> tuple[Array, Array]:
    # Bound decrease and increase of each tension, (n_cables,); NaN where a tension may fall below its smallest value.
    diagonal = jnp.diagonal(displaced)
    less, up = _largest_sum(block, jnp.stack([displaced - jnp.diag(diagonal), displaced]), centre)
    down, up = less + diagonal * minimum + rest, up + rest
    is_valid = (block.tensions.low() - down > minimum).all() & (minimum >= 0.0).all()
    return jnp.where(is_valid, down, jnp.nan), jnp.where(is_valid, up, jnp.nan)


def _largest_sum(block: _UnitBlock, weights: Array, centre: Array) -> Array:
    # Bound weighted sums of the tensions, none below 0, of any robot within the uncertainty; NaN: no bound was found.
    shape, weights = weights.shape[:2], weights.reshape(-1, weights.shape[2])
    high, floor = block.tensions.high(), SURPLUS * maximum_of(weights, axis=1, keepdims=True)

    def corrected(_, more: Array) -> Array:
        return sum(block.changes((weights + more) @ block.inverse)) * (1.0 + SPARE) + floor

    more = lax.fori_loop(0, ROUNDS, corrected, jnp.zeros_like(weights))
    within, shifted = block.changes((weights + more) @ block.inverse)
    total = (weights + more) @ (high + centre) + within @ high
    return jnp.where((within + shifted <= more).all(1), total, jnp.nan).reshape(shape)


def centre_wrench(robot: AnyRobot, state: StateBounds, centre: Float[Array, "3"]) -> AffineBounds:
    """Bounds of what a displaced mass centre adds to the wrench that cables must supply."""
    if not isinstance(robot, PlatformRobot):
        return constant(jnp.zeros(robot.dof))
    linear = rotated(_centre_influence(robot, state), centre)
    force = rotated(_acceleration_matrix(state), centre) * robot.mass
    return linear + _wrench_of(robot, state, None, cross(constant(centre), force))


def _across(robot: AnyRobot, state: StateBounds, cables: CableBounds, unit: Array) -> AffineBounds:
    # Derivatives of the wrenches of unit tensions with respect to unit vectors, across these, (dof, n_cables, 3).
    units = jnp.tile(jnp.eye(3), (robot.n_cables, 1))
    forces = constant(units.T)
    if isinstance(robot, PlatformRobot) and cables.arm is not None:
        arms = cables.arm.each(lambda x: jnp.repeat(x, 3, axis=0))
        forces = balanced_part(robot, state.rotation, forces, cross(arms, constant(units)).each(jnp.transpose))
    else:
        forces = forces.each(lambda x: x[jnp.array(PATTERNS[robot.pattern].forces)])
    changes = (forces * unit[:, None]).each(lambda x: x.reshape(robot.dof, robot.n_cables, 3))
    units_of_cables = cables.direction.each(lambda x: x[None])
    along = dot(changes, units_of_cables)
    return changes - units_of_cables * along.each(lambda x: x[..., None])


def _wrench_of(
    robot: PlatformRobot, state: StateBounds, force: AffineBounds | None, moment: AffineBounds
) -> AffineBounds:
    # Components (dof,) that the cables balance, of a force and a moment (3,).
    force = constant(jnp.zeros(3)) if force is None else force
    parts = (bounds.each(lambda x: x[:, None]) for bounds in (force, moment))
    return balanced_part(robot, state.rotation, *parts).each(lambda x: x[:, 0])


def _acceleration_matrix(state: StateBounds) -> AffineBounds:
    # Matrix (3, 3) from points of the platform to their accelerations relative to the mass centre.
    axes = constant(jnp.eye(3))
    rate, acceleration = (
        bounds.each(lambda x: x[None]) for bounds in (state.angular_velocity, state.angular_acceleration)
    )
    return (cross(acceleration, axes) + cross(rate, cross(rate, axes))).each(jnp.transpose)


def _centre_influence(robot: PlatformRobot, state: StateBounds) -> AffineBounds:
    # Derivative (dof, 3) of the wrench with respect to the position of the mass centre.
    acceleration_matrix, axes = _acceleration_matrix(state) * robot.mass, constant(jnp.eye(3))
    force = (state.acceleration + jnp.asarray([0.0, 0.0, -1.0]) * robot.gravity) * robot.mass
    moment: AffineBounds | None = None
    if PATTERNS[robot.pattern].is_jointed and robot.centre_of_mass is not None:
        arm = rotated(state.rotation, robot.centre_of_mass)
        force = force + rotated(acceleration_matrix, arm)
        moment = cross(arm.each(lambda x: x[None]), acceleration_matrix.each(jnp.transpose))
    turning = cross(axes, force.each(lambda x: x[None]))
    moment = turning if moment is None else turning + moment
    return balanced_part(robot, state.rotation, acceleration_matrix, moment.each(jnp.transpose))


def _centre_change(robot: AnyRobot, state: StateBounds, inverse: Array, radius: Array) -> Array:
    # Bound the changes of tensions, (n_cables,) N, by a displaced mass centre.
    if not isinstance(robot, PlatformRobot):
        return jnp.zeros(robot.n_cables)
    influence = _centre_influence(robot, state).each(lambda x: x.T[None])
    moments = balanced_part(robot, state.rotation, constant(jnp.zeros((3, 3))), constant(jnp.eye(3)))
    turning = rotated(moments.each(lambda x: x.T[None]), inverse)
    acceleration_matrix = jnp.linalg.norm(_acceleration_matrix(state).magnitude()) * robot.mass
    return radius * (norm(rotated(influence, inverse)).high() + radius * acceleration_matrix * norm(turning).high())


def _solution(matrix: Array, right: Array) -> Array:
    # Find a positive x with x >= matrix x + right; NaN where there is none.
    x = solved(jnp.eye(len(right)) - matrix, right[:, None])[0][:, 0] * (1.0 + SURPLUS)
    holds = (x > 0.0).all() & (right > 0.0).all() & (matrix @ x + right <= x).all()
    return jnp.where(holds, x, jnp.nan)
