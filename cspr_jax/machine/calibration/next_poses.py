"""Poses that would tell most: the next ones in turn with the largest determinant of the information (D-optimal)."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import numpy as np

from cspr_jax.errors import InputError
from cspr_jax.machine.calibration.elimination import reduced
from cspr_jax.machine.calibration.least_squares import Estimate
from cspr_jax.machine.calibration.measurements import Measurements
from cspr_jax.machine.calibration.predictions import Predictor, readings_of, tracked_poses
from cspr_jax.machine.calibration.setups import EffectorPoses, turning_axes
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.shapes import Bool, Float
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.point_mass import spool_radius
from cspr_jax.workspaces.requirements import FEASIBLE, check_cables, requirement
from cspr_jax.workspaces.search import WorkspaceSearch
from cspr_jax.workspaces.static_poses import RestPoses

CANDIDATES = 1024
# Largest turn about each axis from the orientation of the file, rad: half of the candidates have none.
LARGEST_TURN = 0.35
# Smallest and largest tensions where the robot has no such limits, over the weight.
LOADS = (0.01, 10.0)


class NextPoses(NamedTuple):
    """Poses to measure next.

    Fields:
        poses: the poses, kernels' axes.
        readings: (n, n_cables) what the cables would read there.
        covariance: (p, p) of the parameters with them, for whitened residuals of variance 1, m^2.
    """

    poses: EffectorPoses
    readings: np.ndarray
    covariance: np.ndarray


def candidates(
    robot: AnyRobot, limits: Limits, fixed: Float[np.ndarray, "3"], measured: Float[np.ndarray, "k 3"], count: int
) -> EffectorPoses:
    """Poses at rest with taut cables within the limits, all over the workspace."""
    from scipy.stats import qmc  # it takes a second to import

    check_cables(robot)
    row, base = PATTERNS[robot.pattern], np.asarray(robot.base_points)
    low, high = np.minimum(base.min(0), measured.min(0)), np.maximum(base.max(0), measured.max(0))
    # Without a floor, no lower than poses that were measured.
    high[2] = float(measured[:, 2].max() if limits.floor is None else limits.floor)
    low[2] = min(low[2], high[2])
    spread = qmc.Halton(6, seed=0).random(count)
    positions = np.tile(fixed, (count, 1))
    along = list(row.forces)
    positions[:, along] = (low + spread[:, :3] * (high - low))[:, along]
    axes = turning_axes(robot)
    small = (2.0 * spread[:, 3 : 3 + len(axes)] - 1.0) * np.tan(0.5 * LARGEST_TURN) @ axes
    small[::2] = 0.0
    quaternions = np.concatenate([np.ones((count, 1)), small], axis=1)
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    search = WorkspaceSearch(robot, requirement(robot, FEASIBLE, _tensions(robot, limits)))
    inside = RestPoses(robot, {FEASIBLE: search}, None, limits, of_mass_centre=True)(positions, quaternions)
    is_inside = inside["verdict"] == 0
    return EffectorPoses(positions[is_inside], quaternions[is_inside])


def _tensions(robot: AnyRobot, limits: Limits) -> Limits:
    # Limits of tensions, by the weight where the robot has none: neither nearly slack cables nor tensions without end.
    weight = float(robot.mass * robot.gravity)
    low, high = (np.full(robot.n_cables, factor * weight) for factor in LOADS)
    low = low if limits.tension_min is None else np.asarray(limits.tension_min)
    high = high if limits.tension_max is None else np.asarray(limits.tension_max)
    return dataclasses.replace(
        limits, tension_min=as_float64(np.minimum(low, 0.5 * high)), tension_max=as_float64(high)
    )


def next_poses(
    predictor: Predictor, estimate: Estimate, choice: EffectorPoses, count: int, is_measured: Bool[np.ndarray, "m"]
) -> NextPoses:
    """Choose poses to measure next among candidates, one after the other; `is_measured` says what is measured there."""
    setup, are_angles = estimate.setup, predictor.measurements.are_angles
    readings = np.zeros((0, setup.robot.n_cables))
    if len(choice.positions):
        readings = np.asarray(readings_of(setup, choice, are_angles=are_angles))
    is_number = np.isfinite(readings).all(axis=-1)
    choice, readings = EffectorPoses(*(x[is_number] for x in choice)), readings[is_number]
    if len(readings) < count:
        error = f"{len(readings)} of {CANDIDATES} poses at rest are within the limits"
        raise InputError("next", None, f"must be fewer than {count}, or limits wider", problem=error)
    points, turns = tracked_poses(setup, choice)
    there = Measurements(readings, np.asarray(points), np.asarray(turns), are_angles, predictor.measurements.deviations)
    used = np.broadcast_to(is_measured, (len(readings), len(is_measured)))
    problem = dataclasses.replace(predictor, measurements=there, is_used=used)(setup, choice)
    n_parameters = predictor.parameters.count
    separated = reduced(problem, np.zeros((0, n_parameters)), np.zeros(0))
    rows = separated.rows * separated.is_free[:, :, None]
    # A weak prior: every number is known to within the robot's size.
    information = estimate.reduced.information + np.eye(n_parameters) / float(spool_radius(setup.robot)) ** 2
    chosen = list[int]()
    for _ in range(count):
        inverse = np.linalg.inv(information)
        gains = np.linalg.slogdet(np.eye(rows.shape[1]) + rows @ inverse @ np.swapaxes(rows, 1, 2))[1]
        gains[chosen] = -np.inf
        chosen.append(int(gains.argmax()))
        information = information + rows[chosen[-1]].T @ rows[chosen[-1]]
    added = np.sum([rows[i].T @ rows[i] for i in chosen], axis=0) + estimate.reduced.information
    covariance = estimate.gauged(_covariance(estimate, added), predictor.parameters.is_of_machine)
    return NextPoses(EffectorPoses(*(x[chosen] for x in choice)), readings[chosen], covariance)


def _covariance(estimate: Estimate, information: np.ndarray) -> np.ndarray:
    # Covariance along what has been seen; what has not is held.
    seen = estimate.reduced.vectors[estimate.reduced.is_seen]
    return seen.T @ np.linalg.inv(seen @ information @ seen.T) @ seen
