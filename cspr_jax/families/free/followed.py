"""Splines that follow motions of other families, at poses exactly.

Orientations are splines of quaternions of their own, and no Rodrigues vectors: motions of platforms may swing further
than half a turn from the orientation half-way, where these end.
"""

from __future__ import annotations

import dataclasses
from functools import partial
from typing import TYPE_CHECKING

import jax
import numpy as np
from jax import Array

from cspr_jax.curves.spline import Spline
from cspr_jax.families.free.poses import motions_of
from cspr_jax.families.free.search.instants import coordinates
from cspr_jax.families.free.search.interior_point import started
from cspr_jax.families.free.search.tasks import OUTER, Tasks
from cspr_jax.motion.motion import Motion, common_shape, states_at
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.linear.rotations import products
from cspr_jax.robots.cables import AnyRobot, tensions
from cspr_jax.robots.model.limits import Limits

if TYPE_CHECKING:
    from jaxtyping import Float

BATCH = 128


def followed(tasks: Tasks, motions: list[Motion], duration: Float[np.ndarray, "s"], z0: float) -> list[Spline]:
    """Splines of a task that follow motions."""
    along, about = coordinates(tasks.robot.pattern)
    places = [np.asarray(states_at(motion, tasks.basis.averages).position)[:, along] for motion in motions]
    controls = np.einsum("kj,sjd->skd", tasks.basis.fit, np.array(places))
    still = np.zeros((*controls.shape[:2], len(about)))
    unknowns = started(tasks, np.concatenate([controls, still], axis=2)[None], duration[None])
    splines = motions_of(tasks, unknowns, z0)
    if not len(about):
        return splines
    turnings = [_turning(tasks, i, *pair) for i, pair in enumerate(zip(motions, duration.tolist(), strict=True))]
    return [
        dataclasses.replace(spline, quaternion=as_float64(table))
        for spline, table in zip(splines, turnings, strict=True)
    ]


def _turning(tasks: Tasks, segment: int, motion: Motion, duration: float) -> np.ndarray:
    # Bernstein coefficients (m, 6, 4) of quaternions that do not jump to their negatives.
    basis, (along, about) = tasks.basis, coordinates(tasks.robot.pattern)
    quaternions = np.array(states_at(motion, basis.averages).quaternion)
    turns_over = np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0.0
    quaternions[1:] *= np.where(np.cumsum(turns_over) % 2 == 1, -1.0, 1.0)[:, None]
    controls, ends = basis.fit @ quaternions, states_at(motion, np.array([0.0, 1.0]))
    for side, place in ((0, segment), (-1, segment + 1)):
        spin = np.zeros(4)
        spin[1:] = np.asarray(ends.angular_acceleration)[side]
        if not tasks.is_free[0, place]:
            spin[1 + about] = tasks.accelerations[0, place, len(along) :]
        # A quaternion at rest has the second derivative of half its product with the angular acceleration.
        second_derivative = 0.5 * products(spin[None], quaternions[side][None])[0]
        outer = [quaternions[side]] * (OUTER - 1) + [
            quaternions[side] + basis.end_bend * duration**2 * second_derivative
        ]
        controls[np.arange(OUTER) if side == 0 else -1 - np.arange(OUTER)] = outer
    return np.einsum("mbk,mkd->mbd", basis.pieces, basis.in_intervals(controls))


def energy_along(tasks: Tasks, motion: Motion) -> float:
    """Integral of the sum of the squares of the tensions."""
    kernel = partial(_tensions, tasks.robot, tasks.limits, common_shape(motion))
    force = in_batches(kernel, tasks.basis.tau.ravel(), batch_size=BATCH)
    return float(motion.duration()) * float(np.sum(tasks.basis.shares.ravel() * np.sum(force**2, axis=1)))


@jax.jit
def _tensions(robot: AnyRobot, limits: Limits, motion: Motion, tau: Array) -> Array:
    return jax.vmap(lambda one: tensions(robot, motion.state(one), limits))(tau)
