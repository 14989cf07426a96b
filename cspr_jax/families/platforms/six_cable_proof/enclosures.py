"""Enclosures of a platform's motion, for bounds over slightly different robots; vectors are in platform axes."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.families.platforms.platform_segment import PlatformSegment, take_segments
from cspr_jax.families.platforms.platform_segment_lanes import StateLanes, squared_duration, state
from cspr_jax.families.platforms.six_cable_proof.complex_bounds import (
    EllipseBounds,
    ellipse_bounds,
    middle_of,
    phase_beside,
)
from cspr_jax.families.platforms.six_cable_proof.tension_proof import Certifier
from cspr_jax.motion.platform_kind import PlatformMotionKind
from cspr_jax.motion.problem import Problem, touchable
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.elementary import unit_vectors
from cspr_jax.numerics.linear.lanes import materialized
from cspr_jax.numerics.shapes import Float, Num
from cspr_jax.robots.contacts.interference import between, contacts, nearest
from cspr_jax.robots.contacts.interference_lanes import residual
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.statics.wrench_lanes import CABLES
from cspr_jax.verification.bounds.blocks import Blocks, parts_of_arcs
from cspr_jax.verification.bounds.enclosures import Distances, Enclosure, Rates, largest_moves
from cspr_jax.verification.robustness.tolerances import Tolerated, tolerated
from cspr_jax.verification.robustness.uncertainty import requirements_of

# Nearest points count as between the ends of cables, and cables as not parallel, only beyond these tolerances.
INSIDE, PARALLEL = 1e-6, 1e-6
# Number of blocks of an arc at first; larger blocks are hardly ever enough.
PARTS = 32
# Radius of the discs in complex time on which changes of accelerations are bounded, over the time in which the phase of
# the oscillation changes by 1 rad.
RADIUS = 0.4


class _Moving(NamedTuple):
    # States in the middles of n blocks, in fixed axes and normalised time; bounds on the blocks (`near`), and on discs
    # about all of their times (`wide`).
    state: StateLanes
    squared: Array
    near: EllipseBounds
    wide: EllipseBounds


@partial(jax.jit, static_argnames="kind")
def _moving(problem: Problem, one: Array, items, *, kind: PlatformMotionKind) -> _Moving:
    segments, arcs, start, stop = items
    middle, half = middle_of(problem.amplitude, 0.5 * (start + stop)), 0.5 * (stop - start)
    current = state(segments, arcs, phase_beside(middle, segments.sense, arcs, jnp.zeros_like(half)), kind)
    near, wide = (
        ellipse_bounds(segments, arcs, middle, (half + radius, radius), kind)
        for radius in (jnp.zeros_like(half), RADIUS / (math.pi * arcs))
    )
    return materialized(_Moving(current, squared_duration(segments, arcs), near, wide), one)


@partial(jax.jit, static_argnames="pairs")
def _contacts(platform, points: Array, rays: Array, *, pairs: tuple) -> tuple[Array, Array, Array]:
    # Return the fractions of cable lengths at which pairs of cables are nearest (n, n_pairs, 2), the shortest vectors
    # between them (n, n_pairs, 3), and the residuals of projections of cables onto the sectors of their corners (n, 6,
    # 3).
    sides, normal = platform
    one, two = ([sides[:, side, k] for k in range(3)] for side in range(2))
    left = jax.vmap(lambda ray: jnp.stack(residual((one, two), normal, -ray.T), axis=1))(rays)
    if not pairs:
        return jnp.zeros((len(rays), 0, 2)), jnp.zeros((len(rays), 0, 3)), left
    i, j = (np.array([pair[k] for pair in pairs]) for k in range(2))
    lines = points[i][None] - rays[:, i], rays[:, i], points[j][None] - rays[:, j], rays[:, j]
    return jnp.stack(nearest(*lines), axis=2), between(*lines), left


class _Middle(NamedTuple):
    # Values in the middles of k blocks, in platform axes and time: rays, their rates in platform axes, velocity and
    # acceleration of the attachment points (k, 6, 3); force and moment per mass (k, 3), acceleration matrix
    # (k, 3, 3).
    rays: np.ndarray
    ray_rate: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    force: np.ndarray
    moment: np.ndarray
    acceleration_matrix: np.ndarray


class _Within(NamedTuple):
    # Changes of rays along their tangents up to the ends of k blocks (k, 6, 3), and bounds of changes within these
    # blocks: of velocities and accelerations of the attachment points, of rays from their tangents, of rays (k, 6), of
    # force and acceleration matrix (k,).
    tangent: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    deviation: np.ndarray
    moved: np.ndarray
    force: np.ndarray
    acceleration_matrix: np.ndarray


def _middle(robot: PlatformRobot, current: StateLanes, squared: np.ndarray) -> _Middle:
    vectors = current.position, current.velocity, current.acceleration, current.omega, current.angular_acceleration
    position, velocity, acceleration, omega, angular_acceleration = (np.stack(x, axis=1) for x in vectors)
    rotation = np.stack([np.stack(row, axis=1) for row in current.rotation], axis=1)
    base, arms = np.asarray(robot.base_points), np.asarray(robot.platform_points)

    def in_platform(vectors: np.ndarray) -> np.ndarray:
        return np.einsum("kji,k...j->k...i", rotation, vectors)

    time = np.sqrt(squared)
    away, velocity, acceleration = (
        in_platform(position[:, None] - base),
        in_platform(velocity),
        in_platform(acceleration),
    )
    omega = in_platform(omega) / time[:, None]
    angular_acceleration = in_platform(angular_acceleration) / squared[:, None]
    velocity, acceleration = velocity / time[:, None], acceleration / squared[:, None]
    acceleration_matrix = _skew(angular_acceleration) + _skew(omega) @ _skew(omega)
    inertia = np.asarray(robot.inertia) / float(robot.mass)
    moment = angular_acceleration @ inertia.T + np.cross(omega, omega @ inertia.T)
    return _Middle(
        away + arms,
        velocity[:, None] - np.cross(omega[:, None], away),
        velocity[:, None] + np.cross(omega[:, None], arms),
        acceleration[:, None] + np.einsum("kij,nj->kni", acceleration_matrix, arms),
        acceleration - float(robot.gravity) * rotation[:, 2],
        moment,
        acceleration_matrix,
    )


def _skew(vectors: np.ndarray) -> np.ndarray:
    return np.cross(vectors[:, None], np.eye(3)[None]).swapaxes(1, 2)


def _within(robot: PlatformRobot, middle: _Middle, moving: _Moving, half: np.ndarray, arcs: np.ndarray) -> _Within:
    # Bound changes in real time by `near`; where a derivative has no bound, use Cauchy's inequality and values on
    # discs.
    near, wide, squared = (
        *(EllipseBounds(*(x[:, None] for x in y)) for y in (moving.near, moving.wide)),
        moving.squared[:, None],
    )
    half, radius, time = half[:, None], RADIUS / (math.pi * arcs[:, None]), np.sqrt(squared)
    arms = np.linalg.norm(np.asarray(robot.platform_points), axis=1)
    away = np.linalg.norm(middle.rays - np.asarray(robot.platform_points), axis=2) + half * near.speed
    jerk = wide.second_derivative / radius
    force = jerk / squared + near.omega * (near.second_derivative / squared + float(robot.gravity))
    acceleration_matrix = (wide.angular_acceleration / radius + 3.0 * near.omega * near.angular_acceleration) / squared
    tip_velocity = near.speed + arms * near.omega
    turning = near.angular_acceleration + near.omega**2
    tip_acceleration = near.second_derivative + arms * turning
    tip_jerk = jerk + arms * wide.rotation_norm * (wide.angular_acceleration + wide.omega**2) / radius
    deviation = 0.5 * half**2 * (near.second_derivative + 2.0 * near.omega * near.speed + turning * away)
    tangent = middle.ray_rate * (half * time)[..., None]
    return _Within(
        tangent,
        half * (tip_acceleration + near.omega * tip_velocity) / time,
        half * (tip_jerk + near.omega * tip_acceleration) / squared,
        deviation,
        largest_moves(tangent, deviation),
        *(half * x for x in (force, acceleration_matrix)),
    )


class _Columns:
    # Columns of `Distances`, appended one by one.

    def __init__(self, count: int) -> None:
        self._count, self._columns = count, list[tuple]()

    def add(self, bound, change, spools: float, current, current_loss, tilted=(0.0, 0.0, 0.0)) -> None:
        self._columns.append((bound, change, *tilted, current, current_loss, spools))

    def distances(self) -> Distances:
        *each, spools = zip(*self._columns, strict=True)
        bound, change, tilt, tilt_norm, swing, current, current_loss = (
            np.stack([np.broadcast_to(x, self._count) for x in column], axis=1) for column in each
        )
        return Distances(bound, change, tilt, tilt_norm, swing, np.array(spools), current, current_loss)


def _distances(problem: Problem, pairs: tuple, middle: _Middle, within: _Within, met) -> Distances:
    robot, (fractions, gaps, left) = problem.robot, met
    columns, tips = _Columns(len(middle.rays)), np.asarray(robot.platform_points)
    for n, pair in enumerate(pairs):
        _add_gap(columns, gaps[:, n], fractions[:, n], middle, within, tips, pair)
    for k in range(CABLES):
        e, height = unit_vectors(left[:, k]), np.linalg.norm(left[:, k], axis=1)
        change = np.abs(np.sum(e * within.tangent[:, k], axis=1)) + within.deviation[:, k]
        columns.add(-np.sum(e * middle.rays[:, k], axis=1), change, 1.0, height, 1.0)
    longest = touchable(problem).limits.cable_length_max
    for k, length in enumerate([] if longest is None else np.asarray(longest).tolist()):
        slack = length - np.linalg.norm(middle.rays[:, k], axis=1)
        columns.add(slack, within.moved[:, k], 1.0, slack, 1.0)
    return columns.distances()


def _add_gap(columns: _Columns, gaps, fractions, middle: _Middle, within: _Within, tips: np.ndarray, pair) -> None:
    # Add the distance of two cables from the four pairs of their ends; in platform axes only the spools move.
    i, j = pair
    e, gap = unit_vectors(gaps), np.linalg.norm(gaps, axis=1)
    tilt = _tilted(middle.rays[:, i], middle.rays[:, j], fractions)
    tilt_norm = np.linalg.norm(tilt, axis=1)
    along = [np.sum(e * within.tangent[:, k], axis=1) for k in pair]
    for first, last in itertools.product((1.0, 0.0), repeat=2):
        separation = (tips[j] - last * middle.rays[:, j]) - (tips[i] - first * middle.rays[:, i])
        change = (
            np.abs(first * along[0] - last * along[1]) + first * within.deviation[:, i] + last * within.deviation[:, j]
        )
        swing = tilt_norm * (first * within.moved[:, i] + last * within.moved[:, j])
        tilted = np.sum(tilt * separation, axis=1), tilt_norm, swing
        columns.add(np.sum(e * separation, axis=1), change, first + last, gap, 2.0 - fractions.sum(1), tilted)


def _tilted(first: np.ndarray, last: np.ndarray, fractions: np.ndarray) -> np.ndarray:
    # Return vectors that grow by 1 along each cable towards its spool, as displacements do, at the nearest points
    # between the ends of the cables; there both cables are normal to the shortest vector.
    directions = np.stack([first, -last], axis=1)
    inner = (fractions > INSIDE) & (fractions < 1.0 - INSIDE)
    gram = (
        np.einsum("kia,kja->kij", directions, directions) * inner[:, :, None] * inner[:, None]
        + np.eye(2) * ~inner[:, None]
    )
    determinant = gram[:, 0, 0] * gram[:, 1, 1] - gram[:, 0, 1] ** 2
    is_regular = determinant > PARALLEL * gram[:, 0, 0] * gram[:, 1, 1]
    safe = np.where(is_regular[:, None, None], gram, np.eye(2))
    weight = np.linalg.solve(safe, (1.0 * inner)[..., None])[..., 0] * (inner & is_regular[:, None])
    return np.einsum("ki,kia->ka", weight, directions)


class Robustness:
    """Multiples of an uncertainty that motions of one robot on six cables tolerate.

    Args:
        problem: robot, limits with an uncertainty, and amplitude function.
        batch: number of blocks computed at a time.
        count_samples: called with the number of computed samples.
    """

    def __init__(
        self, problem: Problem, kind: PlatformMotionKind, *, batch: int, count_samples: Callable[[int], None]
    ) -> None:
        """Find which cables can touch each other or the platform."""
        self._problem, self._kind, self._batch = problem, kind, batch
        near = contacts(problem.robot)
        self._pairs = tuple((int(i), int(j)) for i, j in near.pairs)
        self._platform = near.sides, near.normal
        self._certifier = Certifier(problem, kind, batch=batch, count_samples=count_samples)
        self._knots = np.asarray(problem.amplitude.knots)

    def tolerated(self, segments: PlatformSegment, arcs: Float[np.ndarray, "n"], *, full: bool = True) -> Tolerated:
        """Multiples that motions tolerate."""
        blocks = parts_of_arcs(arcs, self._knots, PARTS)
        requirements = requirements_of(self._problem, np.asarray(segments.rate) / CABLES)
        return tolerated(blocks, arcs, requirements, partial(self.enclosure, segments, arcs), full=full)

    def enclosure(self, segments: PlatformSegment, arcs: Num[np.ndarray, "n"], blocks: Blocks) -> Enclosure:
        """Enclosure of blocks of motions."""
        problem, block_arcs = self._problem._replace(limits=Limits()), arcs[blocks.row].astype(float)
        items = take_segments(segments, blocks.row), block_arcs, blocks.start, blocks.stop
        kernel = partial(_moving, problem, np.ones(()), kind=self._kind)
        moving = in_batches(kernel, items, batch_size=self._batch)
        half = 0.5 * (blocks.stop - blocks.start)
        middle = _middle(problem.robot, moving.state, moving.squared)
        within = _within(problem.robot, middle, moving, half, block_arcs)
        points = np.asarray(problem.robot.platform_points)
        touching = partial(_contacts, self._platform, points, pairs=self._pairs)
        met = in_batches(lambda x: touching(*x), (middle.rays,), batch_size=self._batch)
        low, high = self._certifier.ranges(blocks, segments, arcs)
        scale = np.asarray(segments.rate)[blocks.row, None] / CABLES
        return Enclosure(
            rays=middle.rays,
            arms=points,
            force=middle.force,
            moment=middle.moment,
            acceleration_matrix=middle.acceleration_matrix,
            tangent=within.tangent,
            deviation=within.deviation,
            force_change=within.force[:, 0],
            acceleration_matrix_change=within.acceleration_matrix[:, 0],
            low=scale * low,
            high=scale * high,
            distances=_distances(self._problem, self._pairs, middle, within, met),
            rates=Rates(middle.velocity, middle.acceleration, within.velocity, within.acceleration),
        )
