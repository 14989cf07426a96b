"""Natural frequencies of rotation of a platform about its pose at rest.

At rest the cables pull with forces tau_k (c_k - r_k), r_k and c_k from the mass centre to attachment point and spool.
Where a platform moves by a small u and rotates by a small delta while these tau_k, tensions over lengths, stay
constant, force and moment about the mass centre change by

    -(sum tau_k) u + S x delta,    -S x u - sum_k tau_k ((r_k . c_k) delta - r_k (c_k . delta)),    S = sum_k tau_k r_k,

as the force of a pendulum changes with its displacement. With mass and inertia this system has six natural modes; a
small oscillation at their frequencies needs no change of tau_k to first order. Where S is zero, as in a symmetric
reference pose, three modes are translations at sqrt(sum tau_k / m) and three are rotations about the mass centre;
elsewhere the three modes with the largest fraction of kinetic energy in rotation count as rotations.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import scipy.linalg

from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.cables import tensions
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.state import State


class RotationFrequencies(NamedTuple):
    """Natural frequencies of rotation.

    Fields:
        frequencies: (3,) rad/s, in ascending order; NaN where the rest is not stable.
        modes: (3, 6) displacement of the mass centre, m, then a rotation vector of length 1 rad, fixed axes.
    """

    frequencies: np.ndarray
    modes: np.ndarray


def rotation_frequencies(
    problem: Problem, position: Float[np.ndarray, "3"], rotation: Float[np.ndarray, "3 3"]
) -> RotationFrequencies:
    """Natural frequencies of rotation of a platform in a pose."""
    stiffness, inertia = (np.asarray(x) for x in _matrices(problem, jnp.asarray(position), jnp.asarray(rotation)))
    if not np.isfinite(stiffness).all():
        return RotationFrequencies(np.full(3, np.nan), np.full((3, 6), np.nan))
    squares, modes = scipy.linalg.eigh(0.5 * (stiffness + stiffness.T), inertia)
    # Modes are scaled so that their kinetic energy is 1/2 at unit speed: return the fractions due to rotation.
    fractions = np.einsum("im,ij,jm->m", modes[3:], inertia[3:, 3:], modes[3:])
    chosen = np.sort(np.argsort(-fractions)[:3])
    frequencies = np.sqrt(np.where(squares > 0.0, squares, np.nan))[chosen]
    turning = modes[:, chosen] / np.linalg.norm(modes[3:, chosen], axis=0)
    return RotationFrequencies(frequencies, turning.T)


@jax.jit
def _matrices(problem: Problem, position: jax.Array, rotation: jax.Array) -> Any:
    # Return stiffness and inertia over (u, delta), (6, 6) each.
    robot: PlatformRobot = problem.robot
    nothing = jnp.zeros(3)
    state = State(position, nothing, nothing, rotation, nothing, nothing)
    arms = robot.platform_points @ rotation.T
    spools = robot.base_points - position[None]
    tau = tensions(robot, state, problem.limits) / jnp.linalg.norm(spools - arms, axis=1)
    along, (x, y, z), zero = jnp.sum(tau * jnp.sum(arms * spools, axis=1)), tau @ arms, jnp.zeros(())
    skew = jnp.stack([jnp.stack([zero, -z, y]), jnp.stack([z, zero, -x]), jnp.stack([-y, x, zero])])
    turning = along * jnp.eye(3) - jnp.einsum("k,ki,kj->ij", tau, arms, spools)
    stiffness = jnp.block([[jnp.sum(tau) * jnp.eye(3), -skew], [skew, turning]])
    empty = jnp.zeros((3, 3))
    return stiffness, jnp.block([[robot.mass * jnp.eye(3), empty], [empty, rotation @ robot.inertia @ rotation.T]])
