"""Durations of Bezier segments with more cables than degrees of freedom: found by samples, then proved.

Where the control points do not depend on the duration, the force that the cables must supply at each point is affine in
u = (pi / T)^2. Tensions within limits for two values of u can be interpolated for those between, and speeds and
accelerations of cables fall as T grows. So the feasible durations are one interval: all durations between two proved
ones are feasible. Where the second control point follows from the acceleration at the start, (15), the curve changes
with T, and only the durations tried are decided.
"""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from cspr_jax.families.beziers.duration_roots import Ends
from cspr_jax.families.beziers.motion import Bezier
from cspr_jax.families.beziers.redundant_verdicts import proofs, slacks_at, verdicts_and_proofs
from cspr_jax.motion.amplitudes import named
from cspr_jax.motion.problem import Problem, touchable
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.elementary import minimum_of
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.limits import NO_LIMITS
from cspr_jax.robots.model.point_mass import PointMassRobot, spool_radius
from cspr_jax.schema.verdicts import Verdict

BATCH, SAMPLES = 512, 65
# Number of durations tried first, and the shortest and longest, over the time of a fall by the distance; they are in
# geometric progression.
TRIED = 257
SHORTEST = 1e-2
LONGEST = 100.0
FINER = 33  # durations of a finer search between the neighbours of the best one
ROUNDS = 4  # largest number of finer searches
# Ends of intervals are bisected to this fraction of a duration.
CLOSE = 1e-9


@jax.jit
def _sampled(problem: Problem, motions: Bezier) -> jax.Array:
    # Return the smallest slack of each segment, (n,).
    tau = jnp.linspace(0.0, 1.0, SAMPLES)
    minimum = jax.vmap(lambda motion: minimum_of(jax.vmap(lambda t: slacks_at(problem, motion, t))(tau)))(motions)
    return jnp.where(jnp.isnan(minimum), -jnp.inf, minimum)


class _Segment:
    # A segment with various durations.

    def __init__(self, problem: Problem, ends: Ends, z0: float) -> None:
        self._problem, self._ends, self._z0 = problem, ends, z0

    def _motions(self, times: np.ndarray) -> Bezier:
        start, end, *rest = (np.repeat(x, len(times), axis=0) for x in self._ends)
        return Bezier(start, Ends(start, end, *rest).middles(times), end, times, np.full(len(times), self._z0))

    def sampled(self, times: np.ndarray) -> np.ndarray:
        return in_batches(partial(_sampled, touchable(self._problem)), self._motions(times), batch_size=BATCH)

    def is_proved(self, time: float) -> bool:
        return bool(verdicts_and_proofs(self._problem, self._motions(np.array([time])))[0].verdict[0] == 0)

    def is_static(self) -> bool:
        (proof,) = proofs(self._problem, self._motions(np.ones(1)), at_rest=True)
        return proof.verdict == Verdict.FEASIBLE

    def edge(self, good: float, bad: float) -> float:
        # Bisect between a proved duration and one that is not; return the last proved one.
        while abs(bad - good) > CLOSE * good:
            middle = 0.5 * (good + bad)
            good, bad = (middle, bad) if self.is_proved(middle) else (good, middle)
        return good


def taut_durations(robot: PointMassRobot, ends: Ends, z0: float) -> Float[np.ndarray, "1 2"] | None:
    """Durations that keep every cable taut; None if they may not be one interval."""
    if ends.middle_change.any():
        return None
    segment = _Segment(Problem(robot, NO_LIMITS, named("quintic")), ends, z0)
    times, values = _sampled_durations(segment, robot, ends, 0.0)
    first = _first_proved(segment, times, values)
    if first is None:
        return np.empty((0, 2))
    low = _least_duration(segment, times, first)
    if segment.is_static():
        return np.array([[low, np.inf]])
    positive = np.flatnonzero(values > 0.0).tolist()
    last = next(i for i in reversed(positive) if i == first or segment.is_proved(times[i]))
    return np.array([[low, segment.edge(times[last], times[last + 1]) if last + 1 < len(times) else times[last]]])


def least_proved_duration(problem: Problem, ends: Ends, z0: float, slowest: float) -> float:
    """Least feasible duration of a segment."""
    segment = _Segment(problem, ends, z0)
    times, values = _sampled_durations(segment, problem.robot, ends, slowest)
    first = _first_proved(segment, times, values)
    return float(times[values.argmax()]) if first is None else _least_duration(segment, times, first)


def _sampled_durations(
    segment: _Segment, robot: PointMassRobot, ends: Ends, slowest: float
) -> tuple[np.ndarray, np.ndarray]:
    # Return durations and their smallest sampled slacks; where no coarse slack is positive, refine about the best one.
    radius, gravity = float(spool_radius(robot)), float(robot.gravity)
    distance = max(
        float(np.linalg.norm(ends.end - ends.start) + np.linalg.norm(ends.middle - ends.start)), 1e-9 * radius
    )
    longest = LONGEST * np.sqrt(max(distance, radius) / gravity)
    times = np.geomspace(SHORTEST * np.sqrt(distance / gravity), max(longest, slowest), TRIED)
    values = segment.sampled(times)
    for _ in range(ROUNDS):
        if (values > 0.0).any():
            break
        best = int(values.argmax())
        times = np.geomspace(times[max(best - 1, 0)], times[min(best + 1, len(times) - 1)], FINER)
        values = segment.sampled(times)
    return times, values


def _first_proved(segment: _Segment, times: np.ndarray, values: np.ndarray) -> int | None:
    return next((i for i in np.flatnonzero(values > 0.0).tolist() if segment.is_proved(times[i])), None)


def _least_duration(segment: _Segment, times: np.ndarray, first: int) -> float:
    return segment.edge(float(times[first]), float(times[first - 1])) if first else 0.0
