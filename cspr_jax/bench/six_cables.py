"""Six-cable checks: the six tensions and the sign of the determinant at one tau of a transition from rest.

The MSSM moves to one position with random orientations, numbers of arcs and beta-hat. The NumPy version computes the
printed formulas, (3.1) to (3.11), (3.44) and (3.80), on whole arrays, and solves with `np.linalg.solve`.
"""

from __future__ import annotations

import math
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.bench.timing import best, operations
from cspr_jax.build.robots import load_robot
from cspr_jax.families.platforms.platform_segment import PlatformSegment, pose_segment
from cspr_jax.families.platforms.six_cable_proof.screen import smallest_tensions
from cspr_jax.motion import amplitudes
from cspr_jax.motion.platform_kind import PlatformMotionKind
from cspr_jax.numerics.batches import device_batch_size, in_batches, in_threads, padded
from cspr_jax.numerics.linear.frames import IDENTITY
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.point_mass import rest_point
from cspr_jax.robots.statics.reference_pose import aligned

TRAJECTORIES = 65_536
SAMPLES = 128
LANES = 2048
NUMPY_TRAJECTORIES = 128
FEWEST_ARCS, MAX_ARCS = 4, 15
TARGET = (1.5 * 0.86, 0.0, 1.7)
FROM_REST, QUINTIC = PlatformMotionKind(from_rest=True), amplitudes.named("quintic")


class SixCableWork(NamedTuple):
    """Transitions from rest, all to `TARGET`.

    Fields:
        robot: the MSSM with six cables.
        axis: (n, 3) unit vectors of the axes of rotation.
        angle: (n,) angles of rotation, rad.
        arcs: (n,) numbers of arcs.
        beta_hat: (n,) beta-hat of the target.
    """

    robot: PlatformRobot
    axis: np.ndarray
    angle: np.ndarray
    arcs: np.ndarray
    beta_hat: np.ndarray


def work(count: int) -> SixCableWork:
    """Draw random transitions."""
    rng = np.random.default_rng(0)
    axis = rng.normal(size=(3, count))
    axis /= np.linalg.norm(axis, axis=0)
    angle, arcs = rng.uniform(0.0, 2.0, count), rng.integers(FEWEST_ARCS, MAX_ARCS + 1, count)
    robot = load_robot("laval-mssm")
    return SixCableWork(aligned(robot)[0], axis.T, angle, arcs, rng.uniform(-15.0, 0.0, count))


class Batch(NamedTuple):
    """Segments with the same number of arcs, padded to a fixed number of lanes.

    Fields:
        arcs: number of arcs.
        real: number of segments that are not padding.
        segments: arrays (lanes, ...), on the device.
    """

    arcs: int
    real: int
    segments: PlatformSegment


def batches(work: SixCableWork) -> list[Batch]:
    """Batches of the work, grouped by number of arcs."""
    half = work.angle[:, None] / 2.0
    quaternions = np.concatenate([np.cos(half), np.sin(half) * work.axis], axis=1)
    portions, lanes = [], device_batch_size(LANES)
    for arcs in np.unique(work.arcs):
        cases = np.flatnonzero(work.arcs == arcs)
        kernel = partial(_segments, work.robot, np.asarray(arcs % 2 == 1))
        segments = in_batches(kernel, (quaternions[cases], work.beta_hat[cases]), batch_size=LANES)
        for start in range(0, len(cases), lanes):
            portion = jax.tree.map(lambda x, s=start: x[s : s + lanes], segments)
            portions.append(Batch(int(arcs), len(portion.rate), jax.device_put(padded(portion, lanes))))
    return portions


@jax.jit
def _segments(robot: PlatformRobot, odd, items) -> PlatformSegment:
    depth = jnp.asarray(TARGET[2])
    rest = jnp.stack([0.0 * depth, 0.0 * depth, depth]), jnp.array(IDENTITY)

    def one(quaternion, beta_hat):
        return pose_segment(robot, rest, (jnp.asarray(TARGET), quaternion), depth, (beta_hat, beta_hat), odd=odd)

    return jax.vmap(one)(*items)


def rate(robot: PlatformRobot, portions: list[Batch], *, single_precision: bool) -> tuple[float, float]:
    """Checks a second."""

    def call(batch):
        return jax.block_until_ready(tensions(robot, batch, single_precision=single_precision))

    lowest = [np.asarray(call(batch)) for batch in portions]
    total = sum(batch.real for batch in portions)
    taut = sum(int((x[: batch.real] > 0.0).sum()) for x, batch in zip(lowest, portions, strict=True))
    return total * SAMPLES / best(partial(in_threads, call, portions)), taut / total


def tensions(robot: PlatformRobot, batch: Batch, *, single_precision: bool) -> Float[Array, "lanes"]:
    """Smallest normalised tension of each trajectory."""
    tau, arcs = np.linspace(0.0, 1.0, SAMPLES), float(batch.arcs)
    return smallest_tensions(
        robot, QUINTIC, arcs, tau, batch.segments, kind=FROM_REST, single_precision=single_precision
    )[0]


def operations_a_check(robot: PlatformRobot, batch: Batch) -> float | None:
    """Arithmetic operations of one check."""
    lowered = smallest_tensions.lower(
        robot, QUINTIC, float(batch.arcs), np.zeros(1), batch.segments, kind=FROM_REST, single_precision=True
    )
    return operations(lowered, len(batch.segments.rate))


def numpy_rate(work: SixCableWork) -> float:
    """Checks a second of the NumPy version."""
    first_cases = SixCableWork(work.robot, *(x[:NUMPY_TRAJECTORIES] for x in work[1:]))
    return len(first_cases.arcs) * SAMPLES / best(partial(_numpy_checks, first_cases))


def _numpy_checks(task: SixCableWork) -> np.ndarray:
    # Return the smallest tension per mass and length of each trajectory, (n,); -inf where the determinant changes sign.
    tau, theta = np.linspace(0.0, 1.0, SAMPLES), math.pi * task.arcs[:, None]
    a, a1 = 10 * tau**3 - 15 * tau**4 + 6 * tau**5, 30 * tau**2 - 60 * tau**3 + 30 * tau**4
    a2, a3 = 60 * tau - 180 * tau**2 + 120 * tau**3, 60 - 360 * tau + 360 * tau**2
    gravity, sign = float(task.robot.gravity), (-1.0) ** task.arcs[:, None]
    squared = theta**2 * TARGET[2] / gravity
    c, s, c3, s3 = np.cos(theta * tau), np.sin(theta * tau), np.cos(3 * theta * tau), np.sin(3 * theta * tau)
    h = task.beta_hat[:, None]
    law = ((9 + h) * c - (1 + h) * c3) / 8
    law1, law2 = theta * (3 * (1 + h) * s3 - (9 + h) * s) / 8, theta**2 * (9 * (1 + h) * c3 - (9 + h) * c) / 8
    signed_angle = (sign * task.angle[:, None])[..., None]
    angle = signed_angle * (a * law)[..., None]
    angular_speed, angular_acceleration = (
        signed_angle * (a1 * law + a * law1)[..., None],
        signed_angle * (a2 * law + 2 * a1 * law1 + a * law2)[..., None],
    )
    fraction = (sign * (a * c - a1 * s / theta))[..., None]
    fraction_acceleration = (-sign * ((a * theta**2 + a2) * c + (a1 * theta + a3 / theta) * s) / squared)[..., None]
    rest, far = rest_point(TARGET[2]), np.array([*TARGET[:2], 0.0])
    position, acceleration = rest + fraction * far, fraction_acceleration * far - np.array([0.0, 0.0, gravity])
    e = task.axis[:, None, :]
    skew = np.cross(np.eye(3), task.axis[:, None, :])[:, None]
    rotation = np.eye(3) + np.sin(angle)[..., None] * skew + (1 - np.cos(angle))[..., None] * skew @ skew
    weight = np.einsum("ntij,jk,nlk->nti", rotation, np.asarray(task.robot.inertia / task.robot.mass), e)
    moment = (angular_acceleration * weight + angular_speed**2 * np.cross(e, weight)) / squared[..., None]
    arms = np.einsum("ntij,kj->ntki", rotation, np.asarray(task.robot.platform_points))
    rays = position[:, :, None] + arms - np.asarray(task.robot.base_points)
    matrix = -np.concatenate([rays, np.cross(arms, rays)], axis=3).swapaxes(2, 3)
    tensions = np.linalg.solve(matrix, np.concatenate([acceleration, moment], axis=2)[..., None])[..., 0]
    is_same = np.linalg.det(matrix) * np.linalg.det(matrix[:, :1]) > 0.0
    return np.where(is_same, tensions.min(2), -np.inf).min(1)
