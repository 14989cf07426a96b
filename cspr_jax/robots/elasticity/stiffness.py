"""Stiffness and mass matrix of a robot on elastic cables, in one state with given tensions.

Let q be small displacements from the state: of the mass centre, and a rotation vector theta about it (or about the
joint), so that a body's rotation becomes exp(theta) R; only those that the pattern of motion has, in the order of
`Robot.wrench_matrix`. With unstretched lengths fixed, and V the weight's potential energy, the potential energy is

    U(q) = sum_i EA_i (l_i(q) - l0_i)^2 / (2 l0_i) + V(q)

and the stiffness matrix is its second derivative,

    K = sum_i (EA_i / l0_i) a_i a_i^T + sum_i f_i l_i'' + V''

with the columns a_i of the wrench matrix, minus the first derivatives of the lengths, and their second derivatives l''.
The first sum is the elastic part. The others are the geometric part, the derivative of the wrench at constant tensions.
V'' is zero but for a robot on a joint, since gravity acts at the mass centre. In coordinates such as these K is
symmetric; where the tensions balance the weight it is also minus the derivative of the wrench on the effector,
otherwise (in motion) its symmetric part.

Along the motion with constant rates q', a length has the second derivative q'^T l'' q', which `cable_motion` gives,
pulleys included; so l'' is half of the second derivative of that quadratic form.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.cables import AnyRobot, cable_motion
from cspr_jax.robots.elasticity.springs import spring_constants
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.platform import PlatformRobot, across_line
from cspr_jax.robots.model.state import State


class Stiffness(NamedTuple):
    """Stiffness of a robot in one state, and its inertia.

    Fields:
        elastic: (dof, dof) part of the springs; N/m, N and N m.
        geometric: (dof, dof) part of the tensions and of the weight.
        mass: (dof, dof) mass matrix; kg, kg m and kg m^2.
        lengths: (n_cables,) lengths of the stretched cables, m.
    """

    elastic: Array
    geometric: Array
    mass: Array
    lengths: Array

    @property
    def total(self) -> Array:
        """The stiffness matrix."""
        return self.elastic + self.geometric


def twists(robot: AnyRobot, state: State) -> Float[Array, "dof 6"]:
    """Velocity of the mass centre, or joint, and angular velocity for unit rates of each coordinate."""
    row = PATTERNS[robot.pattern]
    axes = np.eye(3)
    turning = jnp.asarray(axes[list(row.moments)] if row.moments else np.zeros((0, 3)))
    if row.along_line and isinstance(robot, PlatformRobot):
        turning = (state.rotation @ across_line(robot)).T
    moving = jnp.asarray(axes[list(row.forces)] if row.forces else np.zeros((0, 3)))
    linear = jnp.concatenate([moving, jnp.zeros_like(moving)], axis=1)
    angular = jnp.concatenate([jnp.zeros((len(turning), 3)), turning], axis=1)
    return jnp.concatenate([linear, angular])


def length_curvatures(robot: AnyRobot, state: State) -> Float[Array, "n_cables dof dof"]:
    """Second derivatives of the cable lengths in the coordinates of a state."""
    directions = twists(robot, state)

    def along(rates: Array) -> Array:
        twist = rates @ directions
        return cable_motion(robot, _moving(state, twist))[2]

    return 0.5 * jax.hessian(along)(jnp.zeros(robot.dof))


def mass_matrix(robot: AnyRobot, state: State) -> Float[Array, "dof dof"]:
    """Matrix by which accelerations of the coordinates multiply to wrenches."""
    directions = twists(robot, state)

    def supplied(accelerations: Array) -> Array:
        twist = accelerations @ directions
        static = _moving(state, jnp.zeros(6))
        return robot.inertial_wrench(static._replace(acceleration=twist[:3], angular_acceleration=twist[3:]))

    return jax.jacfwd(supplied)(jnp.zeros(robot.dof))


def pose_lengths(robot: AnyRobot, state: State) -> Float[Array, "n_cables"]:
    """Lengths of the cables, with what is wrapped around pulleys."""
    return cable_motion(robot, _moving(state, jnp.zeros(6)))[0]


def stiffness_at(robot: AnyRobot, state: State, tensions: Float[Array, "n_cables"]) -> Stiffness:
    """Stiffness and mass matrix of a robot with an axial stiffness, cables under some tensions."""
    columns = robot.wrench_matrix(state)
    lengths = pose_lengths(robot, state)
    springs = spring_constants(jnp.asarray(robot.axial_stiffness), lengths, tensions)
    geometric = jnp.sum(tensions[:, None, None] * length_curvatures(robot, state), axis=0)
    elastic = (columns * springs[None]) @ columns.T
    return Stiffness(elastic, geometric + _weight_curvature(robot, state), mass_matrix(robot, state), lengths)


def _moving(state: State, twist: Array) -> State:
    # The same pose with constant rates.
    zero = jnp.zeros(3)
    if state.rotation is None:
        return State(state.position, twist[:3], zero)
    return State(state.position, twist[:3], zero, state.rotation, twist[3:], zero)


def _weight_curvature(robot: AnyRobot, state: State) -> Array:
    # Only about a joint does the mass centre rise to second order.
    if not isinstance(robot, PlatformRobot) or not PATTERNS[robot.pattern].is_jointed or robot.centre_of_mass is None:
        return jnp.zeros((robot.dof, robot.dof))
    arm = state.rotation @ robot.centre_of_mass
    down = jnp.zeros(3).at[2].set(1.0)
    # For a rotation vector theta the arm's second derivative is theta x (theta x arm), along z down.
    lowered = 0.5 * (jnp.outer(down, arm) + jnp.outer(arm, down)) - jnp.dot(arm, down) * jnp.eye(3)
    return -robot.mass * robot.gravity * lowered
