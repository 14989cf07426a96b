"""Demands of motions on the robot: tensions, heights, cable lengths and speeds, at their extremes."""

import dataclasses
from collections.abc import Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.arithmetic.batches import in_batches
from cspr_jax.arithmetic.minima import narrowed
from cspr_jax.motions.motion import Motion, common_shape
from cspr_jax.robots import cables
from cspr_jax.robots.limits import NO_LIMITS, Limits
from cspr_jax.robots.point_mass import plane_normal
from cspr_jax.robots.tension_rule_table import CENTRED
from cspr_jax.runtime.persistent_jit import persistent_jit
from cspr_jax.runtime.stages import stage

# Samples of an arc, at least, and instants computed at a time.
SAMPLES, BATCH = 64, 512
# Largest number of samples that is held at a time.
ROOM = 200_000


@dataclasses.dataclass(frozen=True)
class Demands:
    """Demands of n motions on the robot, refined between samples; (n,) each.

    Fields:
        tension_min: smallest tension of any cable, N.
        tension_max: largest tension of any cable, N.
        mu_min: smallest tension per mass and length, 1/s^2.
        depth_min: smallest depth of the mass centre below the spool plane, along the vertical, m.
        lowest: largest z, z down, m.
        length_max: largest length of a cable, with what lies on its pulley, m.
        speed_max: largest speed of a cable, m/s.
        acceleration_max: largest acceleration of a cable, m/s^2.
        are_found: whether the rule of redundant cables found tensions within their limits at all instants; 1 or 0.
        samples: number of instants at which the motion was sampled.
    """

    tension_min: np.ndarray
    tension_max: np.ndarray
    mu_min: np.ndarray
    depth_min: np.ndarray
    lowest: np.ndarray
    length_max: np.ndarray
    speed_max: np.ndarray
    acceleration_max: np.ndarray
    are_found: np.ndarray
    samples: np.ndarray


# A largest value is the smallest value of the negative.
_SIGNS = np.array([1.0, -1.0, 1.0, 1.0, -1.0, -1.0, -1.0, -1.0, 1.0])
_NAMES = [field.name for field in dataclasses.fields(Demands)][:-1]


@persistent_jit(static_argnames="rule")
def _values(robot, limits: Limits, arguments, *, rule: str) -> Array:
    return jax.vmap(partial(_at_instant, robot, limits, rule))(*arguments)


@persistent_jit(static_argnames="rule")
def _values_of_one(robot, limits: Limits, motion: Motion, tau: Array, *, rule: str) -> Array:
    return jax.vmap(partial(_at_instant, robot, limits, rule, motion))(tau)


def _at_instant(robot, limits: Limits, rule: str, motion: Motion, tau: Array) -> Array:
    state = motion.state(tau)
    if robot.n_cables > robot.dof:
        chosen = cables.shared(robot, state, limits, rule)
        force, are_found = chosen.tensions, jnp.where(chosen.is_within, 1.0, 0.0)
    else:
        force, are_found = cables.tensions(robot, state), jnp.asarray(1.0)
    length, rate, rate_slope = cables.cable_motion(robot, state)
    extremes = [
        jnp.min(force),
        -jnp.max(force),
        jnp.min(force / length) / robot.mass,
        plane_normal(robot) @ state.position,
        -state.position[2],
        -jnp.max(length),
        -jnp.max(jnp.abs(rate)),
        -jnp.max(jnp.abs(rate_slope)),
        are_found,
    ]
    return jnp.stack(extremes)


def demands(
    robot: Any,
    motions: Sequence[Motion],
    samples: Sequence[int],
    limits: Limits = NO_LIMITS,
    rule: str = CENTRED,
) -> Demands:
    """Demands of motions on the robot, narrowed down where a value is extreme.

    Args:
        robot: centred.
        motions: n of them, from the centroid of the spools, z down.
        samples: for each motion, the number of equidistant instants from 0 to 1 to begin with.
        limits: limits that the rule for redundant cables takes into account.
        rule: rule that chooses the tensions of redundant cables, a name of `robots.tension_rule_table`.

    Returns:
        the demands.
    """
    table = np.empty((len(motions), len(_NAMES)))
    alike: dict[Any, list[int]] = {}
    for i, (motion, count) in enumerate(zip(motions, samples, strict=True)):
        # Motions of one structure and one number of samples are computed together.
        shapes = tuple(np.shape(leaf) for leaf in jax.tree.leaves(motion))
        alike.setdefault((jax.tree.structure(motion), shapes, count), []).append(i)
    for (*_, count), members in alike.items():
        size = max(ROOM // count, 1)
        for first in range(0, len(members), size):
            stage(f"demands of {len(motions)} segments")
            batch = members[first : first + size]
            table[batch] = _of_alike(robot, limits, rule, [motions[i] for i in batch], count)
    columns = (table * _SIGNS + 0.0).T  # no -0
    return Demands(**dict(zip(_NAMES, columns, strict=True)), samples=np.array(samples))


def _of_alike(robot: Any, limits: Limits, rule: str, motions: list[Motion], count: int) -> np.ndarray:
    tau = np.linspace(0.0, 1.0, count)
    if len(motions) == 1:
        # One motion may have very many pieces, and is not copied for each instant.
        of_one = partial(_values_of_one, robot, limits, common_shape(motions[0]), rule=rule)

        def along(tau: np.ndarray) -> np.ndarray:
            return in_batches(of_one, tau.ravel(), size=BATCH).reshape(*tau.shape, -1)

        return narrowed(along, tau, along(tau[None]))
    kernel = partial(_values, robot, limits, rule=rule)
    stacked = jax.tree.map(lambda *leaves: np.stack([np.asarray(leaf, float) for leaf in leaves]), *motions)

    def at(tau: np.ndarray) -> np.ndarray:
        row = np.repeat(np.arange(len(tau)), tau.shape[1])
        items = jax.tree.map(lambda leaf: leaf[row], stacked)
        values = in_batches(kernel, (items, tau.ravel()), size=BATCH)
        return values.reshape(*tau.shape, -1)

    return narrowed(at, tau, at(np.tile(tau, (len(motions), 1))))
