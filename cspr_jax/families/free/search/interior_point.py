"""Search for the best motions: a primal-dual interior-point method for many motions at once.

Bounds are kept by barriers. Residuals of the equations are penalised (an augmented Lagrangian, with the multipliers of
the last optimum), so that from every start the search can descend to a motion without residuals; the weights of the
barriers and the softness of the equations fall together. Steps are Newton's, shortened until the merit falls.
"""

from __future__ import annotations

import dataclasses
import time
from typing import NamedTuple

import numpy as np

from cspr_jax.families.free.search.condensation import Softness, times, transposed
from cspr_jax.families.free.search.newton import newton_step
from cspr_jax.families.free.search.points import REGULAR, Levels, SearchPoints, descended
from cspr_jax.families.free.search.tasks import OUTER, Tasks, Unknowns, wide
from cspr_jax.numerics.shapes import Bool, Float

# Weight of the barriers at the start and at the end; it falls to the smaller of a fraction and a power of itself.
BARRIERS = (1e-1, 3e-8)
BARRIER_FALL = 0.2
BARRIER_POWER = 1.5
# Softness of the equations at the start and at the end, and the factor by which it falls.
SOFTNESS, SOFTNESS_FALL = (1.0, 1e-6), 0.2
CLOSE = 10.0  # the weight of the barriers falls once errors of Newton's equations are below this multiple
MISSED = 1e-6  # largest residual of the equations at an optimum
STEPS, PATIENCE = 250, 80  # largest number of steps, in all and with one weight of the barriers
# Least distance of values from their bounds at the start: the smaller of this fraction of the range and this number.
INSIDE, AWAY = 0.1, 1e-2
# Multipliers of bounds differ at most by this factor from the weight of the barriers over the gap.
MAX_RATIO = 1e10


class OutOfTime(Exception):
    """The time of a search ended before it converged."""


class Ending(NamedTuple):
    """Times, by `time.monotonic`, at which searches end that have not converged.

    Fields:
        until: time at which all end, s.
        enough: time from which one optimum for each task is enough, s.
        of_task: (l,) indices of the tasks; () if one optimum is never enough.
    """

    until: float = np.inf
    enough: float = np.inf
    of_task: np.ndarray = np.zeros(0, int)

    def is_over(self, is_optimal: Bool[np.ndarray, "l"]) -> bool:
        """Tell whether searches must end now."""
        time_now = time.monotonic()
        return time_now > self.until or (
            time_now > self.enough and bool(np.isin(self.of_task, self.of_task[is_optimal]).all())
        )


NEVER = Ending()


class Optima(NamedTuple):
    """Results of searches.

    Fields:
        unknowns: unknowns of all motions.
        is_optimal: (l,) whether the search has converged.
        steps: (l,) number of steps.
        is_stopped: whether Ctrl-C, or a time limit, ended the search.
    """

    unknowns: Unknowns
    is_optimal: np.ndarray
    steps: np.ndarray
    is_stopped: bool = False


def _sharpened(points: SearchPoints, levels: Levels) -> tuple[Levels, np.ndarray]:
    # Reduce weights and softness of searches that are close to their optimum; return them with the errors.
    barrier, (softness, metric, level) = levels
    while True:
        levels = Levels(barrier, Softness(softness, metric, level))
        errors = points.errors(levels)
        is_close = errors < CLOSE * barrier
        level = np.where(_wide(is_close, level), points.unknowns.multipliers, level)
        softness = np.where(is_close, np.maximum(SOFTNESS[1], SOFTNESS_FALL * softness), softness)
        metric = np.where(_wide(is_close, metric), points.metric(), metric)
        is_close &= barrier > BARRIERS[1]
        if not is_close.any():
            return Levels(barrier, Softness(softness, metric, level)), errors
        smaller = np.minimum(BARRIER_FALL * barrier, barrier**BARRIER_POWER)
        barrier = np.where(is_close, np.maximum(BARRIERS[1], smaller), barrier)


def _wide(flags: np.ndarray, values: np.ndarray) -> np.ndarray:
    return flags.reshape(-1, *[1] * (values.ndim - 1))


def optima(
    tasks: Tasks,
    start: Unknowns,
    barrier: float = BARRIERS[0],
    softness: float = SOFTNESS[0],
    ending: Ending = NEVER,
    *,
    keeps: bool = False,
) -> Optima:
    """Search for the best motions."""
    count, points = len(start.duration), SearchPoints.of(tasks, start)
    soft = Softness(np.full(count, softness), points.metric(), start.multipliers.copy())
    result = Optima(Unknowns(*(values.copy() for values in start)), np.zeros(count, bool), np.zeros(count, int))
    try:
        is_stopped = not _sought(points, Levels(np.full(count, barrier), soft), result, ending)
    except KeyboardInterrupt:
        if not keeps:
            raise
        is_stopped = True
    if is_stopped and not keeps:
        raise OutOfTime
    return result._replace(is_stopped=is_stopped)


def _sought(points: SearchPoints, levels: Levels, result: Optima, ending: Ending) -> bool:
    # Store motions in the result as their searches end, and tell whether all ended in time.
    indices = np.arange(len(result.steps))
    regularization, waited = np.zeros(len(indices)), np.zeros(len(indices))
    for number in range(STEPS + 1):
        before = levels.barrier
        levels, errors = _sharpened(points, levels)
        waited = np.where(levels.barrier < before, 0, waited + 1)
        is_optimal = (levels.barrier <= BARRIERS[1]) & (errors < CLOSE * BARRIERS[1]) & (points.missed() < MISSED)
        is_late = ending.is_over(result.is_optimal)
        is_over = is_optimal | (number == STEPS) | (waited > PATIENCE) | is_late
        for results, values in zip(result.unknowns, points.unknowns.take(is_over), strict=True):
            results[indices[is_over]] = values
        result.is_optimal[indices[is_over]], result.steps[indices[is_over]] = is_optimal[is_over], number
        if is_over.all():
            return not is_late
        if is_over.any():
            indices, regularization, waited = indices[~is_over], regularization[~is_over], waited[~is_over]
            points, levels = points.take(~is_over), levels.take(~is_over)
        step = newton_step(
            points.tasks,
            points.unknowns,
            points.equations,
            points.residual,
            levels.barrier,
            levels.soft,
            regularization,
        )
        regularization = np.where(step.regularization > 0.0, step.regularization, regularization)
        points = _safeguarded(descended(points, step, levels), levels.barrier)
    return True


def _safeguarded(points: SearchPoints, barrier: np.ndarray) -> SearchPoints:
    # Keep multipliers of bounds near the weight of the barriers over the gap.
    unknowns, multipliers = points.unknowns, []
    for multiplier, gap in zip(
        (unknowns.low_multipliers, unknowns.high_multipliers), points.tasks.gaps(unknowns), strict=True
    ):
        near = wide(barrier) / gap
        multipliers.append(np.where(np.isfinite(gap), np.clip(multiplier, near / MAX_RATIO, near * MAX_RATIO), 0.0))
    return dataclasses.replace(
        points, unknowns=unknowns._replace(low_multipliers=multipliers[0], high_multipliers=multipliers[1])
    )


def again(tasks: Tasks, unknowns: Unknowns, barrier: float) -> Unknowns:
    """Unknowns of earlier motions, from which a search within other bounds starts."""
    low, high = tasks.bounds(unknowns.level)
    inside = np.minimum(np.sqrt(barrier), INSIDE * (high - low))
    return _with_multipliers(
        tasks, unknowns._replace(values=np.clip(unknowns.values, low + inside, high - inside)), barrier
    )


def _with_multipliers(tasks: Tasks, unknowns: Unknowns, barrier: float) -> Unknowns:
    low, high = (np.where(np.isfinite(gap), barrier / gap, 0.0) for gap in tasks.gaps(unknowns))
    return unknowns._replace(low_multipliers=low, high_multipliers=high)


def started(
    tasks: Tasks, controls: np.ndarray, duration: Float[np.ndarray, "l s"], barrier: float = BARRIERS[0]
) -> Unknowns:
    """Unknowns of motions from which a search starts."""
    count, cables, dof = duration.shape[1], tasks.robot.n_cables, tasks.robot.dof
    acceleration = tasks.accelerations.copy()
    for side, index, sign in ((0, OUTER - 1, 3.0), (1, -OUTER, -3.0)):
        step = controls[:, :, index] - tasks.ends[:, :, side]
        step = step - sign * tasks.basis.velocity_step * duration[..., None] * tasks.velocities[:, :, side]
        second = step / (tasks.basis.acceleration_step * duration[..., None] ** 2)
        near = np.linalg.solve(tasks.turns[:, :, side], second[..., None])[..., 0]
        is_free = tasks.is_free[:, side : count + side, None]
        if side and tasks.rests_anywhere:
            near = controls[:, :, -1] - tasks.ends[:, :, 1]
        acceleration[:, side : count + side] = np.where(is_free, near, acceleration[:, side : count + side])
    shape = tasks.low.shape
    values, empty = np.zeros(shape), np.zeros((*shape[:-1], shape[-1] - cables + dof))
    level, inner = np.full(duration.shape, tasks.objective.start), controls[:, :, OUTER:-OUTER].copy()
    unknowns = Unknowns(inner, duration.copy(), acceleration, level, values, empty, values, values)
    equations, residual = tasks.equations(unknowns)
    # Take the tensions that balance the motion and are nearest to the middle of their range.
    low, high = tasks.bounds(level)
    middle = 0.5 * (low[..., :cables] + high[..., :cables])
    matrix = equations.matrix
    lacking = -residual[..., :dof] - times(matrix, middle)
    metric = matrix @ transposed(matrix) + REGULAR * np.eye(dof)
    tensions = middle + times(transposed(matrix), np.linalg.solve(metric, lacking[..., None])[..., 0])
    values = np.concatenate([tensions, -residual[..., dof:]], axis=-1)
    inside = np.minimum(AWAY, INSIDE * (high - low))
    return _with_multipliers(tasks, unknowns._replace(values=np.clip(values, low + inside, high - inside)), barrier)
