"""Poses whose cable lengths differ least from given ones, by damped Gauss-Newton steps; many poses at once.

The derivative of the lengths is minus the transposed wrench matrix, whose moments count over a length of the platform,
so that all unknowns are metres. Steps solve (J^T W J + mu D) y = -J^T W r by Cholesky's factors; mu falls where a step
lowers the sum of squares, else the step is taken back and mu rises (Levenberg 1944, Marquardt 1963). Each pose is a
lane: arrays end in the number of poses, and a lane that has ended no longer changes.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from cspr_jax.numerics.batches import in_batches, in_parts
from cspr_jax.numerics.linear import lanes
from cspr_jax.numerics.linear.lanes import Vector
from cspr_jax.numerics.shapes import Bool, Float, Int
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.platform import PlatformRobot, across_line
from cspr_jax.runtime.persistent_jit import persistent_jit
from cspr_jax.workspaces.poses import geometry

BATCH = 1024
PART = 1 << 14
# Steps of a first pass, and of a second one, over the poses that the first has left.
FEW_STEPS, MOST_STEPS = 8, 100
# Damping to begin with, its factors after a lower and after a higher sum of squares, and where it has no effect.
DAMPING, LOWER, HIGHER, MOST_DAMPING = 1e-4, 0.05, 10.0, 1e12
# Steps below this, over the robot's size, end the search: the next ones are rounding.
SHORT = 1e-12
# Steps below this end the search where they no longer lower the sum of squares.
SHORT_WITHOUT_GAIN = 1e-7
TINY = 1e-300
# Least of the damped diagonal, over the largest entry, so that factors exist where a direction has no effect.
FLOOR = 1e-14


class Fits(NamedTuple):
    """Poses of least squares.

    Fields:
        positions: (n, 3) mass centre, or joint, m.
        quaternions: (n, 4).
        residuals: (n, n_cables) lengths of the cables in the pose minus given ones, m.
        steps: (n,) number of steps.
        has_ended: (n,) whether the steps have converged.
    """

    positions: np.ndarray
    quaternions: np.ndarray
    residuals: np.ndarray
    steps: np.ndarray
    has_ended: np.ndarray


class _Lanes(NamedTuple):
    position: Array
    quaternion: Array
    residual: Array
    columns: tuple[Array, ...]
    cost: Array
    damping: Array
    steps: Array
    is_over: Array
    has_ended: Array


def fitted(
    robot: AnyRobot,
    lengths: Float[np.ndarray, "n n_cables"],
    positions: Float[np.ndarray, "n 3"],
    quaternions: Float[np.ndarray, "n 4"],
    weights: Float[np.ndarray, "n_cables"],
    sizes: tuple[float, float],
) -> Fits:
    """Poses of least squares near starts; `sizes` are lengths of the robot and of the platform, m."""
    first = _pass(robot, (lengths, positions, quaternions), weights, sizes, FEW_STEPS)
    left = np.flatnonzero(~first.has_ended & np.isfinite(first.residuals).all(1))
    if not len(left):
        return first
    cases = lengths[left], first.positions[left], first.quaternions[left]
    second = _pass(robot, cases, weights, sizes, MOST_STEPS)
    for name, old, new in zip(Fits._fields, first, second, strict=True):
        old[left] = new + old[left] if name == "steps" else new
    return first


def _pass(robot: AnyRobot, cases: tuple[np.ndarray, ...], weights: np.ndarray, sizes, max_steps: int) -> Fits:
    settings = (weights, *(np.asarray(extent) for extent in sizes), np.asarray(max_steps, np.int32))

    def kernel(batch):
        return _fit(robot, *(np.ascontiguousarray(x.T) for x in batch), *settings)

    def part(rows: slice):
        return in_batches(kernel, tuple(x[rows] for x in cases), batch_size=BATCH, axis=-1)

    parts = in_parts(part, len(cases[0]), PART)
    return Fits(*(np.ascontiguousarray(np.concatenate(pieces, axis=-1).T) for pieces in zip(*parts, strict=True)))


@persistent_jit
def _fit(
    robot: AnyRobot,
    lengths: Float[Array, "n_cables k"],
    positions: Float[Array, "3 k"],
    quaternions: Float[Array, "4 k"],
    weights: Float[Array, "n_cables"],
    extent: Float[Array, ""],
    radius: Float[Array, ""],
    max_steps: Int[Array, ""],
) -> tuple[Float[Array, "3 k"], Float[Array, "4 k"], Float[Array, "n_cables k"], Int[Array, "k"], Bool[Array, "k"]]:
    evaluate = partial(_evaluated, robot, lengths, weights, radius)
    residual, columns, cost = evaluate(positions, quaternions)
    zero = jnp.zeros_like(cost)
    start = _Lanes(
        *(positions, quaternions, residual, columns, cost),
        *(zero + DAMPING, jnp.zeros(cost.shape, jnp.int32), ~jnp.isfinite(cost), jnp.zeros(cost.shape, bool)),
    )

    def is_on(current: _Lanes) -> Array:
        return ~jnp.all(current.is_over)

    def step(current: _Lanes) -> _Lanes:
        move = _step(current, weights)
        position, quaternion = moved(robot, current.position, current.quaternion, move, radius)
        residual, columns, cost = evaluate(position, quaternion)
        is_lower = (cost < current.cost) & ~current.is_over
        length = jnp.sqrt(sum(x * x for x in move))
        is_short = length <= SHORT * extent
        has_ended = is_short | (~is_lower & (length <= SHORT_WITHOUT_GAIN * extent) & (current.damping <= DAMPING))
        damping = jnp.where(is_lower, current.damping * LOWER, current.damping * HIGHER)
        is_over = has_ended | (current.steps + 1 >= max_steps) | (damping > MOST_DAMPING) | ~jnp.isfinite(length)

        def chosen(new: Array, old: Array) -> Array:
            return jnp.where(jnp.broadcast_to(is_lower, old.shape), new, old)

        return _Lanes(
            *(
                chosen(position, current.position),
                chosen(quaternion, current.quaternion),
                chosen(residual, current.residual),
            ),
            tuple(chosen(new, old) for new, old in zip(columns, current.columns, strict=True)),
            chosen(cost, current.cost),
            jnp.where(current.is_over, current.damping, damping),
            current.steps + (~current.is_over).astype(jnp.int32),
            current.is_over | is_over,
            current.has_ended | (has_ended & ~current.is_over),
        )

    end = lax.while_loop(is_on, step, start)
    return end.position, end.quaternion, end.residual, end.steps, end.has_ended


def _evaluated(robot, lengths, weights, radius, position, quaternion) -> tuple[Array, tuple[Array, ...], Array]:
    residual = geometry.length_lanes(robot, tuple(position), tuple(quaternion)) - lengths
    columns, _ = geometry.wrench_columns(robot, tuple(position), _turning(robot, quaternion), radius)
    return residual, tuple(columns), jnp.sum(weights[:, None] * residual**2, axis=0)


def _turning(robot: AnyRobot, quaternion: Array) -> Vector | None:
    return tuple(quaternion) if isinstance(robot, PlatformRobot) else None


def _step(current: _Lanes, weights: Array) -> list[Array]:
    # Solution of the damped normal equations, lane by lane.
    columns = current.columns
    weighted = [weights[:, None] * column for column in columns]
    # Minus the gradient: J is minus columns.
    right = [jnp.sum(column * current.residual, axis=0) for column in weighted]
    matrix = [[jnp.sum(weighted[i] * columns[j], axis=0) for j in range(i + 1)] for i in range(len(columns))]
    floor = FLOOR * lanes.largest([matrix[i][i] for i in range(len(columns))]) + TINY
    for i in range(len(columns)):
        matrix[i][i] = matrix[i][i] * (1.0 + current.damping) + floor
    return _solved(matrix, right)


def _solved(matrix: list[list[Array]], right: list[Array]) -> list[Array]:
    # By Cholesky's factors of a positive definite matrix, given by its lower triangle.
    count = len(right)
    factor: list[list[Array]] = []
    inverse: list[Array] = []
    for i in range(count):
        row: list[Array] = []
        for j in range(i):
            row.append((matrix[i][j] - sum(row[k] * factor[j][k] for k in range(j))) * inverse[j])
        pivot = matrix[i][i] - sum(x * x for x in row)
        # Rounding may leave a direction without effect a pivot that is not positive.
        inverse.append(1.0 / jnp.sqrt(jnp.maximum(pivot, FLOOR * matrix[i][i])))
        factor.append(row)
    middle: list[Array] = []
    for i in range(count):
        middle.append((right[i] - sum(factor[i][k] * middle[k] for k in range(i))) * inverse[i])
    solution: list[Array] = [middle[0]] * count
    for i in reversed(range(count)):
        below = sum(factor[k][i] * solution[k] for k in range(i + 1, count))
        solution[i] = (middle[i] - below) * inverse[i]
    return solution


def moved(
    robot: AnyRobot, position: Array, quaternion: Array, move: list[Array], radius: Array
) -> tuple[Float[Array, "3 k"], Float[Array, "4 k"]]:
    """Poses after small motions: a shift, and a rotation vector in fixed axes times the radius, one lane a pose."""
    row = PATTERNS[robot.pattern]
    zero = jnp.zeros_like(move[0])
    shift = [move[row.forces.index(i)] if i in row.forces else zero for i in range(3)]
    position = position + jnp.stack(shift)
    if not isinstance(robot, PlatformRobot):
        return position, quaternion
    turns = [x / radius for x in move[len(row.forces) :]]
    if row.along_line:
        rotation = lanes.rotation_matrix(tuple(quaternion))
        axes = [lanes.rotated(rotation, tuple(zero + x for x in axis)) for axis in across_line(robot).T]
        vector = lanes.combined(list(zip(turns, axes, strict=True)))
    else:
        vector = tuple(turns[row.moments.index(i)] if i in row.moments else zero for i in range(3))
    return position, _rotated(tuple(quaternion), vector)


def _rotated(quaternion: Vector, vector: Vector) -> Float[Array, "4 k"]:
    # Rotation vectors may be large far from a solution: sine and cosine, not their first terms.
    square = lanes.dot(vector, vector)
    angle = jnp.sqrt(jnp.where(square > 0.0, square, 1.0))
    sine = jnp.where(square > 1e-12, jnp.sin(0.5 * angle) / angle, 0.5)
    scalar = jnp.where(square > 1e-12, jnp.cos(0.5 * angle), 1.0 - square / 8.0)
    rotated = lanes.product((scalar, *(sine * part for part in vector)), quaternion)
    norm = jnp.sqrt(sum(part * part for part in rotated))
    return jnp.stack([part / norm for part in rotated])
