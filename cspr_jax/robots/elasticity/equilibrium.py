"""A robot settles elsewhere if drums pay out other unstretched lengths than those that hold it in its pose."""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import Array, lax

from cspr_jax.numerics.elementary import length, solved
from cspr_jax.numerics.linear.rotations import matrix
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.elasticity.springs import spring_tensions, unstretched_lengths
from cspr_jax.robots.elasticity.stiffness import pose_lengths, stiffness_at, twists
from cspr_jax.robots.model.state import State

# Lengths change in steps, each followed by iterations of Newton's method.
STEPS = 16
ITERATIONS = 4


class Settled(NamedTuple):
    """A robot in equilibrium on elastic cables.

    Fields:
        state: pose, with velocities and accelerations of the state from which it settled.
        tensions: (n_cables,) N; 0 or less where a cable is slack, which then is no equilibrium.
        missed: () norm of the wrench that is not balanced, N.
    """

    state: State
    tensions: Array
    missed: Array


@jax.jit
def settled(
    robot: AnyRobot, state: State, tensions: Float[Array, "n_cables"], unstretched: Float[Array, "n_cables"]
) -> Settled:
    """Equilibrium with unstretched lengths, near a state with tensions; inertial forces stay those of the state."""
    stiffness = jnp.asarray(robot.axial_stiffness)
    start = unstretched_lengths(pose_lengths(robot, state), tensions, stiffness)

    def missing(pose: State, lengths: Array) -> tuple[Array, Array]:
        forces = spring_tensions(stiffness, pose_lengths(robot, pose), lengths)
        return robot.inertial_wrench(pose) - robot.wrench_matrix(pose) @ forces, forces

    def iterate(pose: State, index: Array) -> tuple[State, None]:
        lengths = start + (index // ITERATIONS + 1) / STEPS * (unstretched - start)
        error, forces = missing(pose, lengths)
        total = stiffness_at(robot, pose, forces).total
        return displaced(robot, pose, -solved(total, error[:, None])[0][:, 0]), None

    last, _ = lax.scan(iterate, state, jnp.arange(STEPS * ITERATIONS))
    error, forces = missing(last, unstretched)
    return Settled(last, forces, jnp.linalg.norm(error))


def displaced(robot: AnyRobot, state: State, coordinates: Float[Array, "dof"]) -> State:
    """A state in another pose, by small coordinates as those of `robots.elasticity.stiffness`."""
    twist = coordinates @ twists(robot, state)
    if state.rotation is None:
        return state._replace(position=state.position + twist[:3])
    angle = length(twist[3:])
    half = 0.5 * angle
    # sin(x) / x, also at 0.
    ratio = 0.5 * jnp.sinc(half / jnp.pi)
    turn = matrix(jnp.concatenate([jnp.cos(half)[None], ratio * twist[3:]]))
    return state._replace(position=state.position + twist[:3], rotation=turn @ state.rotation)
