"""Poses from readings of a nominal robot, to start from, and the axes of a tracker that has its own."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from cspr_jax.errors import InputError
from cspr_jax.machine.calibration.predictions import Predictor
from cspr_jax.machine.calibration.setups import EffectorPoses, Setup, small_rotations
from cspr_jax.numerics.linear.frames import IDENTITY
from cspr_jax.numerics.linear.rotations import products
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.point_mass import spool_radius

# Depths below the centroid of the spools from which poses are sought, over the largest distance of a spool from it.
DEPTHS = (0.5, 0.1, 1.0, 2.0)
ITERATIONS = 40
# Damping that a search begins with, over the mean square of its derivatives, and the one at which it gives up.
FIRST_DAMPING, LARGEST_DAMPING = 1e-3, 1e9
# Steps of a pose, over the robot's size, that end its search: the estimate goes on from there.
SMALL_STEP = 1e-6
# Mean errors of lengths below this fraction of the robot's size are those of a pose, not of a wrong minimum.
CLOSE = 1e-3
# Mean errors this many times as large as those of a good quarter of the poses are those of a wrong minimum; such poses
# are sought again from several poses with similar readings.
WRONG, NEIGHBOURS = 4.0, 6
# Errors of lengths, over the robot's size, that are always small enough.
RESOLUTION = 1e-6
# Costs that differ by this fraction, and a little, count as equal: the first start is taken.
ALIKE, NEGLIGIBLE = 1e-3, 1e-12
# Positions whose second spread is below this fraction of the first lie on a line.
ON_LINE = 1e-6


def moved_poses(poses: EffectorPoses, axes: Float[np.ndarray, "6 d"], steps: Float[np.ndarray, "k d"]) -> EffectorPoses:
    """Poses after steps of their coordinates."""
    moves = steps @ axes.T
    return EffectorPoses(poses.positions + moves[:, :3], products(poses.quaternions, small_rotations(moves[:, 3:])))


def starting_poses(
    predictor: Predictor, setup: Setup, fixed: Float[np.ndarray, "3"], *, by_tracker: bool
) -> EffectorPoses:
    """Poses at which the nominal setup predicts what was measured, as nearly as it can.

    `fixed` holds the coordinates along which the effector does not move; without `by_tracker`, readings alone count.
    """
    data, row = predictor.measurements, PATTERNS[setup.robot.pattern]
    used = predictor.is_used.copy()
    used[:, setup.robot.n_cables :] &= by_tracker
    radius, count = float(spool_radius(setup.robot)), data.count
    best, lowest = EffectorPoses(np.tile(fixed, (count, 1)), np.tile(IDENTITY, (count, 1))), np.full(count, np.inf)

    def improve(starts: EffectorPoses) -> np.ndarray:
        # Better poses from other starts; the mean errors of lengths that are left, m.
        nonlocal best, lowest
        poses, costs = _nearest(predictor, setup, starts, used)
        better = costs < lowest * (1.0 - ALIKE) - NEGLIGIBLE
        best = EffectorPoses(*(np.where(better[:, None], *pair) for pair in zip(poses, best, strict=True)))
        lowest = np.where(better, costs, lowest)
        return np.sqrt(lowest / np.maximum(used.sum(1), 1)) * data.deviations.length

    for depth in DEPTHS:
        positions, quaternions = np.tile(fixed, (count, 1)), np.tile(IDENTITY, (count, 1))
        if 2 in row.forces:
            positions[:, 2] = depth * radius
        if by_tracker:
            seen = np.isfinite(data.positions) & np.isin(np.arange(3), row.forces)
            positions = np.where(seen, data.positions, positions)
            quaternions = np.where(np.isfinite(data.quaternions), data.quaternions, quaternions)
        errors = improve(EffectorPoses(positions, quaternions))
        if (errors <= CLOSE * radius).all():
            break
    for iteration in range(NEIGHBOURS):
        typical = np.quantile(errors[np.isfinite(errors)], 0.25) if np.isfinite(errors).any() else 0.0
        is_wrong = ~(errors <= WRONG * typical + RESOLUTION * radius)
        if not is_wrong.any() or is_wrong.all():
            break
        errors = improve(_neighbours(best, np.nan_to_num(data.readings * setup.per_reading), is_wrong, iteration))
    return best


def _neighbours(poses: EffectorPoses, readings: np.ndarray, is_wrong: np.ndarray, rank: int) -> EffectorPoses:
    # In place of wrong poses, right ones whose readings are near: the nearest, or the one of that rank.
    right = np.flatnonzero(~is_wrong)
    distances = np.linalg.norm(readings[is_wrong][:, None] - readings[right], axis=2)
    chosen = np.arange(len(readings))
    chosen[is_wrong] = right[np.argsort(distances, axis=1)[:, min(rank, len(right) - 1)]]
    return EffectorPoses(*(part[chosen] for part in poses))


def _nearest(
    predictor: Predictor, setup: Setup, poses: EffectorPoses, used: np.ndarray
) -> tuple[EffectorPoses, np.ndarray]:
    # Levenberg and Marquardt's iteration of each pose alone.
    def problem(poses: EffectorPoses) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        at_poses = predictor(setup, poses)
        residuals = np.where(used, at_poses.residuals, 0.0)
        costs = np.sum(residuals**2, axis=1)
        return residuals, np.where(used[:, :, None], at_poses.by_pose, 0.0), np.where(np.isfinite(costs), costs, np.inf)

    residuals, derivatives, costs = problem(poses)
    damping, is_done = np.full(len(costs), FIRST_DAMPING), np.zeros(len(costs), bool)
    for _ in range(ITERATIONS):
        squares = np.swapaxes(derivatives, 1, 2) @ derivatives
        mean_square = np.trace(squares, axis1=1, axis2=2) / squares.shape[1] + NEGLIGIBLE
        damped = squares + (damping * mean_square)[:, None, None] * np.eye(squares.shape[1])
        is_number = np.isfinite(damped).all((1, 2)) & np.isfinite(residuals).all(1)
        damped = np.where(is_number[:, None, None], damped, np.eye(squares.shape[1]))
        right = np.einsum("kij,ki->kj", derivatives, residuals)
        steps = -np.linalg.solve(damped, np.where(is_number[:, None], right, 0.0)[:, :, None])[:, :, 0]
        trial = moved_poses(poses, predictor.axes, steps)
        new_residuals, new_derivatives, new_costs = problem(trial)
        better = new_costs < costs
        poses = EffectorPoses(*(np.where(better[:, None], *pair) for pair in zip(trial, poses, strict=True)))
        residuals = np.where(better[:, None], new_residuals, residuals)
        derivatives = np.where(better[:, None, None], new_derivatives, derivatives)
        is_done |= (np.abs(steps).max(axis=1) <= SMALL_STEP * float(spool_radius(setup.robot))) & (damping < 1.0)
        costs = np.where(better, new_costs, costs)
        damping = np.where(better, damping / 10.0, np.minimum(damping * 10.0, LARGEST_DAMPING))
        if (is_done | (damping >= LARGEST_DAMPING)).all():
            break
    return poses, costs


def aligned_tracker(setup: Setup, poses: EffectorPoses, positions: Float[np.ndarray, "k 3"]) -> Setup:
    """A setup whose tracker sees poses at measured positions, as nearly as a rotation allows."""
    row = PATTERNS[setup.robot.pattern]
    seen = np.isfinite(positions[:, list(row.forces)]).all(1)
    if np.count_nonzero(seen) < 3:
        error = f"{np.count_nonzero(seen)} poses with positions"
        raise InputError("tracker", None, "must be three or more, to find the axes of a tracker", problem=error)
    rotations = Rotation.from_quat(poses.quaternions[seen], scalar_first=True)
    inner, outer = poses.positions[seen] + rotations.apply(setup.target), np.nan_to_num(positions[seen])
    centre, outer_centre = inner.mean(0), outer.mean(0)
    spreads = np.linalg.svd(outer - outer_centre, compute_uv=False)
    if not spreads[1] > ON_LINE * spreads[0]:
        raise InputError("tracker", None, "must not be on one line, to find the axes of a tracker", problem="positions")
    rotation = Rotation.align_vectors(outer - outer_centre, inner - centre)[0]
    return setup._replace(orientation=rotation.as_quat(scalar_first=True), shift=outer_centre - rotation.apply(centre))
