"""The whole calibration of a robot: start, estimate, what it says about robot and poses, in the axes of the file."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from cspr_jax.errors import InputError
from cspr_jax.machine.calibration.directions import Direction, terms, unseen_directions
from cspr_jax.machine.calibration.elimination import UNSEEN
from cspr_jax.machine.calibration.least_squares import Adjustment, Estimate, Loss, estimated
from cspr_jax.machine.calibration.measurements import Measurements
from cspr_jax.machine.calibration.next_poses import CANDIDATES, NextPoses, candidates, next_poses
from cspr_jax.machine.calibration.parameters import SPOOL, Parameters, checked_groups, parameters_of
from cspr_jax.machine.calibration.predictions import Predictor, predictor
from cspr_jax.machine.calibration.radii import radius_of
from cspr_jax.machine.calibration.setups import Setup, setup_of
from cspr_jax.machine.calibration.starting_poses import aligned_tracker, starting_poses
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.linear.frames import Frame
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.point_mass import spool_radius

# Probability with which all spools are within the uncertainty.
PROBABILITY = 0.95


@dataclasses.dataclass(frozen=True)
class Calibrated:
    """A calibration in the kernels' axes of the nominal robot.

    Fields:
        nominal: setup at which it began.
        predictor: residuals of the measurements.
        estimate: the estimate.
        directions: directions that the measurements do not see.
        frame: axes of the file.
        fixed: (3,) coordinates along which the effector does not move.
    """

    nominal: Setup
    predictor: Predictor
    estimate: Estimate
    directions: tuple[Direction, ...]
    frame: Frame
    fixed: np.ndarray

    @property
    def parameters(self) -> Parameters:
        """The parameters."""
        return self.predictor.parameters

    @property
    def noise(self) -> float:
        """Factor on the given or usual standard deviations: 1 if they were given, else estimated."""
        return 1.0 if self.predictor.measurements.deviations.are_given else self.estimate.noise

    @property
    def covariance(self) -> Float[np.ndarray, "p p"]:
        """Covariance of the parameters as near the nominal robot as what cannot be seen allows, m^2."""
        return self.estimate.gauged(self.estimate.reduced.covariance, self.parameters.is_of_machine) * self.noise**2

    def reported_covariance(self) -> Float[np.ndarray, "r r"]:
        """Covariance of the robot's numbers, without the tracker's axes, in the units and axes of the file."""
        units, shown = (
            self.parameters.units,
            [i for i, row in enumerate(self.parameters.rows) if row.group != "tracker"],
        )
        return (self.covariance * units[:, None] * units)[np.ix_(shown, shown)]

    @property
    def degrees(self) -> float:
        """Degrees of freedom of the noise; inf if it was given."""
        return np.inf if self.predictor.measurements.deviations.are_given else float(self.estimate.degrees)

    def spool_covariances(self, covariance: Float[np.ndarray, "p p"]) -> Float[np.ndarray, "n 3 3"]:
        """Covariance of each spool, m^2."""
        maps = self.parameters.of_cables[:, SPOOL]
        return maps @ covariance @ np.swapaxes(maps, 1, 2)

    def spool_radii(self) -> Float[np.ndarray, "n"]:
        """Radii about all spools that hold all of them with `PROBABILITY`; inf where one is not seen, m."""
        n_cables = self.nominal.robot.n_cables
        if not np.isfinite(self.noise):
            return np.full(n_cables, np.inf)
        probability = 1.0 - (1.0 - PROBABILITY) / n_cables
        radii = [radius_of(each, probability, self.degrees) for each in self.spool_covariances(self.covariance)]
        return np.where(self._is_unseen(), np.inf, radii)

    def _is_unseen(self) -> np.ndarray:
        # Spools that move along the null space other than by motions of all of them as one body.
        maps, null_space = self.parameters.of_cables[:, SPOOL], self.estimate.reduced.null_space
        moves = np.einsum("iap,qp->iaq", maps, null_space)
        base = np.asarray(self.estimate.setup.robot.base_points)
        bodies = [np.broadcast_to(axis, base.shape) for axis in np.eye(3)]
        bodies += [np.cross(axis, base) for axis in np.eye(3)]
        columns = np.stack([body.ravel() for body in bodies], axis=1)
        flat = moves.reshape(base.size, len(null_space))
        left = flat - columns @ np.linalg.lstsq(columns, flat, rcond=UNSEEN**2)[0]
        return np.linalg.norm(left.reshape(moves.shape), axis=(1, 2)) > UNSEEN

    def weakest(self) -> tuple[float, str]:
        """Standard deviation along the direction that is seen worst, m, and the direction in words."""
        problem = self.estimate.reduced
        if not problem.is_seen.any():
            return np.inf, ""
        last = int(np.flatnonzero(problem.is_seen)[-1])
        words = terms(self.parameters, problem.vectors[last] * self.parameters.units)
        return self.noise / float(problem.values[last]), words

    def robot(self, nominal: AnyRobot) -> AnyRobot:
        """The calibrated robot in the axes of the file, where `nominal` is."""
        setup, signs = self.estimate.setup, self.frame.signs
        inner: Any = setup.robot
        before: Any = self.nominal.robot
        moved = (inner.base_points - np.asarray(before.base_points)) * signs
        changes: dict[str, Any] = {"base_points": as_float64(nominal.base_points + moved)}
        if isinstance(nominal, PlatformRobot):
            moved = (inner.platform_points - np.asarray(before.platform_points)) * signs
            points = np.asarray(nominal.platform_points + moved)
            changes["platform_points"] = as_float64(points)
            changes["joints"] = tuple(int((points == point).all(1).argmax()) for point in points)
        if nominal.pulleys is not None:
            changes["pulleys"] = dataclasses.replace(nominal.pulleys, radius=inner.pulleys.radius)
        if nominal.winches is not None:
            drum: dict[str, Any] = {"drum_radius": inner.winches.drum_radius}
            if self.predictor.measurements.are_angles:
                drum["zero_length"] = as_float64(nominal.winches.zero_length + setup.offsets)
            changes["winches"] = dataclasses.replace(nominal.winches, **drum)
        return dataclasses.replace(nominal, **changes)

    def next_poses(self, limits: Limits, count: int) -> NextPoses:
        """Poses to measure next, as this robot would hold them within limits, measured as most poses were."""
        measured = self.estimate.poses.positions
        robot = dataclasses.replace(self.estimate.setup.robot, limits=limits)
        choice = candidates(robot, limits, self.fixed, measured, CANDIDATES)
        counts = self.estimate.is_used.sum(axis=0)
        return next_poses(self.predictor, self.estimate, choice, count, counts > 0.5 * counts.max())


def calibrated(
    robot: AnyRobot,
    frame: Frame,
    measurements: Measurements,
    free: Sequence[str],
    loss: Loss,
    target: Float[np.ndarray, "3"],
) -> Calibrated:
    """Calibrate a robot, centred, z down, from measurements in these axes."""
    has_positions = bool(np.isfinite(measurements.positions).any())
    groups = checked_groups(robot, free, are_angles=measurements.are_angles, has_positions=has_positions)
    row, setup = PATTERNS[robot.pattern], setup_of(robot, target, are_angles=measurements.are_angles)
    parameters = parameters_of(setup, groups, frame.signs, float(spool_radius(robot)))
    guess = predictor(setup, parameters, measurements, row.forces or (0, 1, 2))
    _check_redundancy(guess)
    fixed = _fixed(robot, measurements, has_positions)
    has_tracker = "tracker" in groups
    poses = starting_poses(guess, setup, fixed, by_tracker=not has_tracker)
    if has_tracker:
        setup = aligned_tracker(setup, poses, measurements.positions)
    adjustment = Adjustment(guess, setup, poses)
    result = estimated(adjustment, loss)
    directions = unseen_directions(parameters, result.setup, result.measured.null_space)
    return Calibrated(setup, guess, result, directions, frame, fixed)


def _check_redundancy(guess: Predictor) -> None:
    # Poses must be measured beyond what determines them.
    per_pose, dof = guess.is_used.sum(axis=1), guess.axes.shape[1]
    if (per_pose <= dof).all() and not len(guess.measurements.distances.distance):
        largest = int(per_pose.max())
        raise InputError(
            "measurements",
            None,
            f"must be more than {dof} at some poses, the degrees of freedom: more cables, or positions of a tracker",
            problem=f"{largest} at most at a pose",
        )


def _fixed(robot: AnyRobot, measurements: Measurements, has_positions: bool) -> Float[np.ndarray, "3"]:
    # Coordinates of a guide or a joint: those measured on average, else those of the spools' centroid.
    row, fixed = PATTERNS[robot.pattern], np.zeros(3)
    if row.is_jointed and not has_positions:
        raise InputError(
            "positions", None, "must be given for a robot on a joint: those of the joint", problem="missing"
        )
    if has_positions and (row.is_jointed or row.dof == 1):
        measured = measurements.positions
        seen = np.isfinite(measured).any(axis=0)
        fixed[seen] = np.nanmedian(measured[:, seen], axis=0)
        fixed[list(row.forces)] = 0.0
    return fixed
