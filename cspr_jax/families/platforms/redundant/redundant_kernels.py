"""Compiled states of motions on more than six cables, and the wrenches that they need, at many times."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from cspr_jax.families.platforms.end_acceleration import end_state
from cspr_jax.families.platforms.platform_segment import PlatformMotion, PlatformSegment
from cspr_jax.motion.limits import other_slacks
from cspr_jax.motion.platform_kind import PlatformMotionKind
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.elementary import minimum_of
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.contacts.interference import cable_directions, gaps
from cspr_jax.robots.model.platform import PlatformRobot


class PoseSamples(NamedTuple):
    """Poses, wrenches and slacks of motions at n times.

    Fields:
        position: (n, 3) m.
        quaternion: (n, 4).
        wrench: (n, 6) wrench that the cables must supply, N and N m.
        slacks: (n, n_rows) slacks of limits other than those of tensions, and the smallest distance between cables, m.
    """

    position: Array
    quaternion: Array
    wrench: Array
    slacks: Array


@partial(jax.jit, static_argnames="kind")
def samples_of(
    problem: Problem,
    pairs: Float[Array, "n_pairs 2"],
    items: tuple[PlatformSegment, Array, Array],
    *,
    kind: PlatformMotionKind,
) -> PoseSamples:
    """Poses, wrenches and slacks of motions, at one time each."""
    robot, limits = problem.robot, problem.limits

    def one(segment, arcs, tau):
        motion = PlatformMotion(segment, problem.amplitude, arcs, kind)
        state = motion.state(tau)
        distances = jnp.linalg.norm(gaps(robot, pairs, state.position, state.rotation), axis=1)
        nearest = minimum_of(distances, initial=jnp.inf)
        slacks = jnp.stack([*other_slacks(robot, limits, state, motion.z0), nearest])
        return PoseSamples(state.position, state.quaternion, robot.inertial_wrench(state), slacks)

    return jax.vmap(one)(*items)


@partial(jax.jit, static_argnames="kind")
def cable_vectors(
    problem: Problem,
    pairs: Float[Array, "n_pairs 2"],
    items: tuple[PlatformSegment, Array, Array],
    *,
    kind: PlatformMotionKind,
) -> tuple[Float[Array, "n n_pairs 3"], Float[Array, "n n_cables 3"]]:
    """Vectors between cables, and directions of cables, of motions at one time each."""

    def one(segment, arcs, tau):
        state = PlatformMotion(segment, problem.amplitude, arcs, kind).state(tau)
        where = state.position, state.rotation
        return gaps(problem.robot, pairs, *where), cable_directions(problem.robot, *where)

    return jax.vmap(one)(*items)


@jax.jit
def end_wrenches(
    robot: PlatformRobot, position: Float[Array, "3"], quaternion: Float[Array, "4"], z0: Float[Array, ""]
) -> tuple[Float[Array, "6 n_cables"], Float[Array, "2 6"]]:
    """Wrenches at one end of a segment, by beta-hat."""
    states = [end_state(robot, position, quaternion, z0, jnp.asarray(value)) for value in (0.0, 1.0)]
    return robot.wrench_matrix(states[0]), jnp.stack([robot.inertial_wrench(state) for state in states])
