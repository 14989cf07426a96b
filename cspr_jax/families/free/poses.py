"""Poses between which a free motion is searched for, as tasks of the search, and motions from its results."""

from __future__ import annotations

import dataclasses
from functools import partial
from typing import NamedTuple

import jax
import numpy as np
from jax import Array

from cspr_jax.curves.spline import Spline
from cspr_jax.errors import InputError
from cspr_jax.families.free.search.basis import Basis
from cspr_jax.families.free.search.determinants import determinant
from cspr_jax.families.free.search.equations import DEPTH, ValueBounds, coordinates
from cspr_jax.families.free.search.objectives import Objective
from cspr_jax.families.free.search.tasks import Tasks, Unknowns
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.linear import rotations
from cspr_jax.numerics.linear.rotations import CONJUGATE, products
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.point_mass import plane_normal, spool_radius
from cspr_jax.robots.statics.wrench_balance import at_rest
from cspr_jax.verification.criteria import pose_conditions

# Along a segment, determinant and depth below the spools stay above these fractions of the smaller value at its ends.
REGULAR, SHALLOW = 1e-2, 0.5


class FreePoses(NamedTuple):
    """Poses through which a motion goes, in the axes of the kernels.

    Fields:
        positions: (k, 3) positions of the mass centre, m.
        quaternions: (k, 4) orientations, unit, scalar first; None for a point mass.
        velocities: (k, 3) m/s, angular velocities are zero; or (k, 6) with angular velocities last, rad/s, at poses
            whose accelerations are free or whose orientation is that of all others.
        accelerations: (k, 3) m/s^2, of platforms (k, 6) with angular accelerations last, rad/s^2; a row with NaN is
            free.
        z0: depth of P0, m; searches start from swings about P0.
        rests_anywhere: whether the motion, of one segment, comes to rest at any pose; the last one is near it.
    """

    positions: np.ndarray
    quaternions: np.ndarray | None
    velocities: np.ndarray
    accelerations: np.ndarray
    z0: float
    rests_anywhere: bool = False


class _Joined(NamedTuple):
    # Segments in coordinates: ends and velocities (s, 2, d), references (s, 4), turns (s, 2, d, d), and accelerations
    # (s + 1, d).
    ends: np.ndarray
    velocities: np.ndarray
    references: np.ndarray
    turns: np.ndarray
    accelerations: np.ndarray


def check_searched(problem: Problem) -> None:
    """Refuse problems for which the search cannot find free motions."""
    robot, maximum = problem.robot, problem.limits.tension_max
    pattern = PATTERNS[robot.pattern]
    if pattern.is_jointed or pattern.along_line:
        raise InputError("pattern", robot.pattern, '"1T", "2T", "3T", "1R2T" or "3R3T" for free motions')
    if maximum is None or not np.isfinite(np.asarray(maximum)).all():
        raise InputError("tension_max", None, "a number, N: without it the least time is that of impulses")


def _joined(problem: Problem, poses: FreePoses) -> _Joined:
    along, about = coordinates(problem.robot.pattern)
    count, d = len(poses.positions) - 1, len(along) + len(about)
    ends = np.zeros((count, 2, d))
    ends[..., : len(along)] = np.stack([poses.positions[:-1], poses.positions[1:]], axis=1)[..., along]
    turns, references = np.tile(np.eye(d), (count, 2, 1, 1)), np.tile([1.0, 0.0, 0.0, 0.0], (count, 1))
    velocities, linear = np.zeros_like(ends), poses.accelerations[:, along]
    rates = np.stack([poses.velocities[:-1], poses.velocities[1:]], axis=1)
    velocities[..., : len(along)] = rates[..., along]
    if poses.quaternions is None:
        return _Joined(ends, velocities, references, turns, linear)
    start, end = poses.quaternions[:-1], poses.quaternions[1:]
    end = np.where(np.sum(start * end, axis=1, keepdims=True) < 0.0, -end, end)
    # Relative to the mean of both orientations, Rodrigues vectors are not longer than 1.
    references = (start + end) / np.linalg.norm(start + end, axis=1, keepdims=True)
    for side, quaternions in enumerate((start, end)):
        turning = products(quaternions, references * CONJUGATE)
        vector = turning[:, 1:] / turning[:, :1]
        ends[:, side, len(along) :] = vector[:, about]
        for i, v in enumerate(vector):
            across = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
            to_angular_velocity = 2.0 / (1.0 + v @ v) * (np.eye(3) + across)
            turns[i, side, len(along) :, len(along) :] = np.linalg.inv(to_angular_velocity[np.ix_(about, about)])
        if rates.shape[-1] > 3:
            turning = turns[:, side, len(along) :, len(along) :] @ rates[:, side, 3 + about, None]
            velocities[:, side, len(along) :] = turning[..., 0]
    accelerations = np.concatenate([linear, poses.accelerations[:, 3 + about]], axis=1)
    return _Joined(ends, velocities, references, turns, accelerations)


def determinants(problem: Problem, poses: FreePoses) -> Float[np.ndarray, "k"]:
    """Determinants at poses of a platform with as many cables as degrees of freedom; see `determinants.determinant`."""
    return np.asarray(_determinants(problem.robot, as_float64(poses.positions), as_float64(poses.quaternions)))


@jax.jit
def _determinants(robot: AnyRobot, positions: Array, quaternions: Array) -> Array:
    states = jax.vmap(at_rest)(positions, jax.vmap(rotations.matrix)(quaternions))
    return jax.vmap(partial(determinant, robot))(states)


def half_swing(problem: Problem, poses: FreePoses) -> float:
    """Duration of half a swing about P0, the unit of durations in the objective."""
    return float(np.pi * np.sqrt(poses.z0 / float(problem.robot.gravity)))


def divided(problem: Problem, poses: FreePoses) -> Float[np.ndarray, "n 3"]:
    """Segments whose ends lie on opposite sides of singular poses.

    A motion between them must pass a singular pose, where the cables cannot balance every wrench, so it has no proof.
    """
    if not pose_conditions(problem.robot)[0]:
        return np.zeros((0, 3))
    values = determinants(problem, poses)
    crossings = np.flatnonzero(values[:-1] * values[1:] < 0.0)
    return np.stack([crossings, values[crossings], values[crossings + 1]], axis=1)


def _sides(values: np.ndarray, part: float, cap: float = np.inf) -> np.ndarray:
    # Return bounds (2, s) of a value that is zero at singular poses, from its values (k,) at the poses: along a segment
    # it keeps the sign of both ends, and at least `part` of the smaller magnitude, or `cap` if that is less.
    ends = np.stack([values[:-1], values[1:]])
    minimum = np.minimum(part * np.abs(ends).min(0), cap)
    return np.stack([np.where((ends > 0.0).all(0), minimum, -np.inf), np.where((ends < 0.0).all(0), -minimum, np.inf)])


def _depths(problem: Problem, poses: FreePoses) -> np.ndarray:
    # Return the depths (k,) of the poses below the spool plane, over the robot's radius.
    return poses.positions @ np.asarray(plane_normal(problem.robot)) / float(spool_radius(problem.robot))


def tasks_of(
    problem: Problem, basis: Basis, bounds: ValueBounds, objective: Objective, poses: FreePoses, longest: float | None
) -> Tasks:
    """The task of a motion through all poses."""
    ends, velocities, references, turns, accelerations = _joined(problem, poses)
    is_free = np.isnan(accelerations).any(1)
    is_free[-1] |= poses.rests_anywhere
    shape = 1, len(ends), *basis.tau.shape, len(bounds.low)
    low, high = (np.broadcast_to(side, shape).copy() for side in (bounds.low, bounds.high))
    if bounds.determinant is not None:
        sides = _sides(determinants(problem, poses), REGULAR)
        low[0, ..., bounds.determinant], high[0, ..., bounds.determinant] = sides[..., None, None]
    if bounds.depth is not None:
        sides = _sides(_depths(problem, poses), SHALLOW, DEPTH)
        low[0, ..., bounds.depth], high[0, ..., bounds.depth] = sides[..., None, None]
    return Tasks(
        robot=problem.robot,
        limits=problem.limits,
        basis=basis,
        ends=ends[None],
        velocities=velocities[None],
        references=references[None],
        turns=turns[None],
        accelerations=np.where(is_free[:, None], 0.0, accelerations)[None],
        is_free=is_free[None],
        low=low,
        high=high,
        scale=np.full(1, half_swing(problem, poses)),
        objective=objective,
        longest=None if longest is None else np.asarray(longest, float),
        rests_anywhere=poses.rests_anywhere,
    )


def segments_of(tasks: Tasks) -> Tasks:
    """Segments of tasks as tasks of their own, in one batch."""

    def one(part: np.ndarray) -> np.ndarray:
        return part.reshape(-1, 1, *part.shape[2:])

    def ends(part: np.ndarray) -> np.ndarray:
        pairs = np.stack([part[:, :-1], part[:, 1:]], axis=2)
        return pairs.reshape(-1, *pairs.shape[2:])

    count = tasks.ends.shape[1]
    return dataclasses.replace(
        tasks,
        ends=one(tasks.ends),
        velocities=one(tasks.velocities),
        references=one(tasks.references),
        turns=one(tasks.turns),
        accelerations=ends(tasks.accelerations),
        is_free=ends(tasks.is_free),
        low=one(tasks.low),
        high=one(tasks.high),
        scale=np.repeat(tasks.scale, count),
    )


def quaternions_of(tasks: Tasks, samples: Float[np.ndarray, "l s ... d"]) -> Float[np.ndarray, "l s ... 4"] | None:
    """Orientations of the platforms of tasks."""
    along, about = coordinates(tasks.robot.pattern)
    if not len(about):
        return None
    turning = np.zeros((*samples.shape[:-1], 4))
    turning[..., 0] = 1.0
    turning[..., 1 + about] = samples[..., len(along) :]
    turning /= np.linalg.norm(turning, axis=-1, keepdims=True)
    segments = zip(turning.reshape(-1, *turning.shape[2:]), tasks.references.reshape(-1, 4), strict=True)
    return np.stack([products(one.reshape(-1, 4), at[None]) for one, at in segments]).reshape(turning.shape)


def motions_of(tasks: Tasks, unknowns: Unknowns, z0: float) -> list[Spline]:
    """Motions along all segments of a task."""
    along, about = coordinates(tasks.robot.pattern)
    controls = tasks.basis.in_intervals(tasks.controls(unknowns)[0])
    tables = np.einsum("mbk,smkd->smbd", tasks.basis.pieces, controls)
    motions = []
    for table, reference, duration in zip(tables, tasks.references[0], unknowns.duration[0].tolist(), strict=True):
        position = np.zeros((*table.shape[:2], 3))
        position[..., along] = table[..., : len(along)]
        quaternion = None
        if len(about):
            turning = np.zeros((*table.shape[:2], 4))
            turning[..., 0] = 1.0
            turning[..., 1 + about] = table[..., len(along) :]
            quaternion = as_float64(products(turning.reshape(-1, 4), reference[None]).reshape(turning.shape))
        knots = np.linspace(0.0, duration, len(table) + 1)
        motions.append(Spline(as_float64(knots), as_float64(position), quaternion, as_float64(z0)))
    return motions
