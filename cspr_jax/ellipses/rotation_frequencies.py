"""Natural frequencies of rotation of a platform about its rest in a pose.

At rest the cables pull with forces tau_k b_k, b_k from attachment point to spool. Where a platform turns by a small
angle delta about its mass centre while these tau_k, tensions over lengths, stay what they are, the moment changes by
-K delta with

    K = sum_k tau_k ((r_k . b_k) I - r_k b_k^T),

r_k the attachment points from the mass centre: as the force of a pendulum changes with its displacement at constant
tension over length. With the inertia J, J delta'' = -K delta has three natural frequencies, each with an axis. At
these a rotation asks for no change of the tensions to first order, as a translation does at sqrt(g / D).
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import scipy.linalg

from cspr_jax.motions.problem import Problem
from cspr_jax.robots.cables import tensions
from cspr_jax.robots.platform import PlatformRobot
from cspr_jax.robots.state import State


class RotationFrequencies(NamedTuple):
    """Natural frequencies of rotation.

    Fields:
        frequencies: (3,) rad/s, the lowest first; NaN where the rest is not stable.
        axes: (3, 3) in rows, the axis of each, fixed axes, unit vectors.
    """

    frequencies: np.ndarray
    axes: np.ndarray


def rotation_frequencies(problem: Problem, position: np.ndarray, rotation: np.ndarray) -> RotationFrequencies:
    """Natural frequencies of rotation of a platform in a pose.

    Args:
        problem: of a platform; on redundant cables the tensions are centred between their limits.
        position: (3,) of the mass centre, from the centroid of the spools, z down, m.
        rotation: (3, 3) from platform to fixed axes.

    Returns:
        the frequencies.
    """
    stiffness, inertia = (np.asarray(x) for x in _stiffness(problem, jnp.asarray(position), jnp.asarray(rotation)))
    if not np.isfinite(stiffness).all():
        return RotationFrequencies(np.full(3, np.nan), np.eye(3))
    squares, axes = scipy.linalg.eigh(0.5 * (stiffness + stiffness.T), inertia)
    frequencies = np.sqrt(np.where(squares > 0.0, squares, np.nan))
    return RotationFrequencies(frequencies, (axes / np.linalg.norm(axes, axis=0)).T)


@jax.jit
def _stiffness(problem: Problem, position: jax.Array, rotation: jax.Array) -> Any:
    robot: PlatformRobot = problem.robot
    nothing = jnp.zeros(3)
    state = State(position, nothing, nothing, rotation, nothing, nothing)
    arms = robot.platform_points @ rotation.T
    rays = robot.base_points - position - arms
    tau = tensions(robot, state, problem.limits) / jnp.linalg.norm(rays, axis=1)
    along = jnp.sum(tau * jnp.sum(arms * rays, axis=1))
    stiffness = along * jnp.eye(3) - jnp.einsum("k,ki,kj->ij", tau, arms, rays)
    return stiffness, rotation @ robot.inertia @ rotation.T
