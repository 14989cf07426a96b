"""The estimate: Levenberg and Marquardt's iteration with poses eliminated, and the search for mistakes.

Weights of a robust loss (Huber, or Cauchy) find mistakes: measurements whose residual over its standard deviation is
above `MISTAKE`. They are left out of the final least squares, so that covariances mean what they say.
"""

from __future__ import annotations

import dataclasses
from typing import Literal

import numpy as np
from scipy.special import ndtri

from cspr_jax.errors import InputError
from cspr_jax.machine.calibration.elimination import (
    Reduced,
    degrees_of_freedom,
    pose_steps,
    predicted_variances,
    reduced,
    redundancies,
    step_of,
    toward_nominal,
)
from cspr_jax.machine.calibration.predictions import Linearised, Predictor
from cspr_jax.machine.calibration.setups import EffectorPoses, Setup
from cspr_jax.machine.calibration.starting_poses import moved_poses
from cspr_jax.numerics.shapes import Bool, Float
from cspr_jax.robots.model.point_mass import spool_radius

Loss = Literal["squares", "huber", "cauchy"]
# Widths of the losses in standard deviations: 95 % of the precision of least squares where errors are normal.
WIDTHS = {"huber": 1.345, "cauchy": 2.385}
# Standard deviations beyond which a measurement is a mistake: of ten thousand good ones, none in 170 cases of 171.
MISTAKE = 5.0
# Redundancies below this one say nothing about a mistake.
UNTESTABLE = 1e-3
ITERATIONS = 60
# Reweightings, with few iterations each, and rounds in which mistakes are left out or taken back.
REWEIGHTINGS, FEW, ROUNDS = 20, 2, 8
# Steps, over the largest distance of a spool from the centroid, that end the iteration.
SMALLEST_STEP = 1e-12
# The same where the cost changes by no more than rounding, as a fraction.
STALLED, MINIMAL = 1e-9, 1e-13
# Increase of the cost, in squares of standard deviations and as a fraction, that counts as none.
ROUNDING = 1e-7
LARGEST_DAMPING = 1e12
# Fewest measurements beyond what they determine that tell mistakes from noise.
FEWEST = 10
# Change of weights that ends the reweighting.
SETTLED = 1e-3
# Residuals below this fraction of the robot's size may be rounding, where no standard deviation is given.
RESOLUTION = 1e-10
# Median of the magnitudes of normal errors, over their standard deviation.
MEDIAN = float(ndtri(0.75))


@dataclasses.dataclass(frozen=True)
class Estimate:
    """An estimate of all parameters and poses.

    Fields:
        setup: the calibrated setup.
        poses: the poses of the measurements.
        total: (p,) change of the parameters from the nominal setup, m.
        reduced: the problem of the parameters at the estimate, without mistakes.
        measured: the same without what is known of the nominal numbers.
        residuals: (k, m) residuals over their nominal standard deviations, of mistakes too.
        standardised: (k, m) residuals over their own standard deviations, NaN where a mistake would not show.
        redundancies: (k, m) share of an error that its residual shows.
        is_used: (k, m) measurements that exist.
        is_mistaken: (k, m) measurements that are left out as mistakes.
        degrees: number of measurements beyond what they determine.
        noise: factor from nominal to estimated standard deviations; NaN if nothing is left to estimate it from.
        cost: sum of the squares of the residuals, without mistakes.
        is_converged: whether steps became as small as rounding allows.
    """

    setup: Setup
    poses: EffectorPoses
    total: np.ndarray
    reduced: Reduced
    measured: Reduced
    residuals: np.ndarray
    standardised: np.ndarray
    redundancies: np.ndarray
    is_used: np.ndarray
    is_mistaken: np.ndarray
    degrees: int
    noise: float
    cost: float
    is_converged: bool

    def gauged(
        self, covariance: Float[np.ndarray, "p p"], is_of_machine: Bool[np.ndarray, "p"]
    ) -> Float[np.ndarray, "p p"]:
        """A covariance of what can be seen, as that of the estimate, which stays near the nominal robot."""
        nearest = np.eye(len(covariance)) + toward_nominal(self.reduced.null_space, is_of_machine)
        return nearest @ covariance @ nearest.T


@dataclasses.dataclass
class _Iterate:
    """An iterate with its weighted problem."""

    setup: Setup
    poses: EffectorPoses
    total: np.ndarray
    linearised: Linearised
    extra: tuple[np.ndarray, np.ndarray]


class Adjustment:
    """A calibration in progress."""

    def __init__(self, predictor: Predictor, setup: Setup, poses: EffectorPoses) -> None:
        """Begin at a setup and poses."""
        self.predictor, self.parameters = predictor, predictor.parameters
        self.radius = float(spool_radius(setup.robot))
        self.best = self._at(setup, poses, np.zeros(self.parameters.count))
        if not np.isfinite(self.cost(self.best, np.ones_like(self.best.linearised.residuals))):
            raise InputError("lengths", None, "poses that the nominal robot can take", problem="no poses fit them")

    def _at(self, setup: Setup, poses: EffectorPoses, total: np.ndarray) -> _Iterate:
        distances, prior = self._distances(setup), self._prior(total)
        extra = np.concatenate([distances[0], prior[0]]), np.concatenate([distances[1], prior[1]])
        return _Iterate(setup, poses, total, self.predictor(setup, poses), extra)

    def _prior(self, total: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        # The nominal numbers count as measurements with their known deviation, which is that of the numbers themselves.
        prior = self.predictor.measurements.prior
        weights = np.abs(self.parameters.units) / prior
        is_known = self.parameters.is_of_machine & np.isfinite(prior)
        return np.diag(weights)[is_known], (total * weights)[is_known]

    def _distances(self, setup: Setup) -> tuple[np.ndarray, np.ndarray]:
        # Residuals of distances between spools, whitened, and their derivatives.
        data, points = self.predictor.measurements.distances, np.asarray(setup.robot.base_points)
        rays = points[data.first] - points[data.second]
        lengths = np.linalg.norm(rays, axis=1)
        units = rays / lengths[:, None]
        maps = self.parameters.of_cables[:, :3]
        moved = np.einsum("qi,qip->qp", units, maps[data.first] - maps[data.second])
        return moved / data.deviation[:, None], (lengths - data.distance) / data.deviation

    @staticmethod
    def cost(iterate: _Iterate, weights: Float[np.ndarray, "k m"]) -> float:
        """Sum of the squares of the residuals."""
        if not (np.isfinite(iterate.linearised.by_parameters).all() and np.isfinite(iterate.linearised.by_pose).all()):
            return np.inf  # a cable without length has no direction
        with np.errstate(invalid="ignore", over="ignore"):
            return float(np.sum(weights * iterate.linearised.residuals**2) + np.sum(iterate.extra[1] ** 2))

    def reduced(self, weights: Float[np.ndarray, "k m"], damping: float = 0.0, *, has_prior: bool = True) -> Reduced:
        """The problem of the parameters at the best iterate, for some weights."""
        count = None if has_prior else len(self.predictor.measurements.distances.distance)
        root, problem = np.sqrt(weights), self.best.linearised
        each = root[:, :, None]
        weighted = Linearised(problem.residuals * root, problem.by_parameters * each, problem.by_pose * each)
        return reduced(weighted, self.best.extra[0][:count], self.best.extra[1][:count], damping)

    def solve(self, weights: Float[np.ndarray, "k m"], iterations: int = ITERATIONS) -> bool:
        """Move to the minimum for some weights; tell whether steps became as small as rounding allows."""
        damping, cost = 0.0, self.cost(self.best, weights)
        for _ in range(iterations):
            problem = self.reduced(weights, damping)
            step = step_of(problem, damping)
            # Along what cannot be seen, as close to the nominal robot as possible.
            step = step + toward_nominal(problem.null_space, self.parameters.is_of_machine) @ (self.best.total + step)
            moves = pose_steps(problem, step)
            trial = self._at(
                self.parameters.moved(self.best.setup, step),
                moved_poses(self.best.poses, self.predictor.axes, moves),
                self.best.total + step,
            )
            trial_cost = self.cost(trial, weights)
            if trial_cost <= cost * (1.0 + ROUNDING) + ROUNDING:
                moved = max(np.abs(step).max(), np.abs(moves).max(initial=0.0))
                is_small = moved <= SMALLEST_STEP * self.radius
                is_minimal = not damping and abs(cost - trial_cost) <= MINIMAL * cost and moved <= STALLED * self.radius
                self.best, cost = trial, trial_cost
                damping = damping / 10.0 if damping > 1.0 else 0.0
                if is_small or is_minimal:
                    return True
            else:
                damping = max(10.0 * damping, 1e-3 * float(problem.values[0]))
                if damping > LARGEST_DAMPING:
                    return False
        return False

    def standardised(self, weights: Float[np.ndarray, "k m"]) -> tuple[np.ndarray, np.ndarray, float]:
        """Residuals over their standard deviations, redundancies, and the noise that their median says."""
        problem = self.reduced(weights)
        shown = np.clip(redundancies(problem), 0.0, None)
        # A measurement of weight 0 is predicted by the others: its residual has both errors.
        is_out = self.predictor.is_used & (weights == 0.0)
        if is_out.any():
            shown = np.where(is_out, 1.0 + predicted_variances(self.best.linearised, problem), shown)
        is_tested = self.predictor.is_used & (shown > UNTESTABLE)
        values = np.where(is_tested, self.best.linearised.residuals / np.sqrt(np.where(is_tested, shown, 1.0)), np.nan)
        counted = values[is_tested & ~is_out]
        noise = float(np.median(np.abs(counted))) / MEDIAN if len(counted) else np.nan
        return values, shown, noise

    def can_find_mistakes(self) -> bool:
        """Tell whether there are enough measurements to find mistakes among them."""
        used = self.predictor.is_used
        return degrees_of_freedom(self.reduced(used.astype(float)), used, len(self.best.extra[1])) >= FEWEST

    def scale(self, noise: float) -> float:
        """Standard deviation of the whitened residuals, from their median if none was given."""
        deviations = self.predictor.measurements.deviations
        resolution = RESOLUTION * self.radius / min(deviations.length, deviations.position)
        return 1.0 if deviations.are_given else max(noise, resolution)

    def mistakes(self, weights: Float[np.ndarray, "k m"], before: Bool[np.ndarray, "k m"]) -> Bool[np.ndarray, "k m"]:
        """Mistakes among the measurements: those of before that still are, and the worst other one of each pose."""
        values, _, noise = self.standardised(weights)
        ratio = np.abs(np.nan_to_num(values)) / self.scale(noise)
        others = np.where(before, 0.0, ratio)
        is_worst = others == others.max(axis=1, keepdims=True)
        return (ratio > MISTAKE) & (before | is_worst) & self.predictor.is_used


def estimated(adjustment: Adjustment, loss: Loss) -> Estimate:
    """The least squares of all measurements that are no mistakes."""
    used = adjustment.predictor.is_used
    mistaken = np.zeros_like(used)
    is_converged = adjustment.solve(used.astype(float))
    if loss != "squares" and adjustment.can_find_mistakes():
        mistaken = adjustment.mistakes(_reweighted(adjustment, loss), mistaken)
        for iteration in range(ROUNDS):
            is_converged = adjustment.solve((used & ~mistaken).astype(float))
            update = adjustment.mistakes((used & ~mistaken).astype(float), mistaken)
            update = update if iteration < ROUNDS // 2 else update | mistaken
            if (update == mistaken).all() or iteration == ROUNDS - 1:
                break
            mistaken = update
    return _answer(adjustment, mistaken, is_converged)


def _reweighted(adjustment: Adjustment, loss: Loss) -> Float[np.ndarray, "k m"]:
    # Weights of a robust loss at its minimum, by repeated least squares.
    used = adjustment.predictor.is_used
    weights, width = used.astype(float), WIDTHS[loss]
    for _ in range(REWEIGHTINGS):
        values, _, noise = adjustment.standardised(weights)
        ratio = np.abs(np.nan_to_num(values)) / (width * adjustment.scale(noise))
        update = used / (1.0 + ratio**2) if loss == "cauchy" else used / np.maximum(ratio, 1.0)
        change, weights = np.abs(update - weights).max(), update
        adjustment.solve(weights, FEW)
        if change < SETTLED:
            break
    return weights


def _answer(adjustment: Adjustment, mistaken: Bool[np.ndarray, "k m"], is_converged: bool) -> Estimate:
    used, best = adjustment.predictor.is_used, adjustment.best
    weights = (used & ~mistaken).astype(float)
    problem = adjustment.reduced(weights)
    degrees = degrees_of_freedom(problem, used & ~mistaken, len(best.extra[1]))
    cost = adjustment.cost(best, weights)
    noise = float(np.sqrt(cost / degrees)) if degrees > 0 else np.nan
    values, shown, _ = adjustment.standardised(weights)
    return Estimate(
        setup=best.setup,
        poses=best.poses,
        total=best.total,
        reduced=problem,
        measured=adjustment.reduced(weights, has_prior=False),
        residuals=best.linearised.residuals,
        standardised=values,
        redundancies=shown,
        is_used=used,
        is_mistaken=mistaken,
        degrees=degrees,
        noise=noise,
        cost=cost,
        is_converged=is_converged,
    )
