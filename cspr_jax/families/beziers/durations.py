"""Intervals of durations of Bezier segments that keep every cable taut, and the least duration under limits."""

from __future__ import annotations

import itertools
import math
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from cspr_jax.families.beziers.duration_roots import Ends, critical_durations
from cspr_jax.families.beziers.margins import smallest_margins
from cspr_jax.families.beziers.motion import Bezier
from cspr_jax.families.beziers.verdicts import BATCH, verdicts_within
from cspr_jax.motion.limits import limits_set
from cspr_jax.motion.problem import Problem, touchable
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.elementary import minimum_of
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.point_mass import PointMassRobot, plane_normal, spool_radius
from cspr_jax.robots.statics.force_balance import adjugate
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.verification.proved_verdicts import Verdicts

# Bisections between a feasible and an infeasible duration: as many as float64 has digits.
HALVINGS = 60
# Under limits, this many durations are tried in each interval that keeps every cable taut, in geometric progression,
# up to this multiple of the shortest.
TRIED, WIDEST = 129, 100.0
# The longest duration tried is this multiple of the time that the speed or acceleration limits need for the distance.
AMPLE = 20.0


@jax.jit
def _proved_margins(robot: PointMassRobot, motions: Bezier):
    def one(motion):
        margins = smallest_margins(robot, motion)
        below = margins.below - margins.below_rounding
        return jnp.minimum(minimum_of(margins.taut - margins.taut_rounding), below)

    return jax.vmap(one)(motions)


def proved_margins(
    robot: PointMassRobot, ends: Ends, durations: Float[np.ndarray, "n"], z0: Float[np.ndarray, "n"]
) -> Float[np.ndarray, "n"]:
    """Smallest slacks less their rounding errors: a segment is proved feasible where they are positive."""
    motions = Bezier(ends.start, ends.middles(durations), ends.end, durations, z0)
    margins = in_batches(partial(_proved_margins, robot), motions, batch_size=BATCH)
    return np.where(np.isfinite(margins), margins, -np.inf)


def feasible_durations(robot: PointMassRobot, ends: Ends, z0: Float[np.ndarray, "n"]) -> list[np.ndarray | None]:
    """Durations that keep every cable taut below the spools; with redundant cables, at any depth."""
    if robot.n_cables > robot.dof:
        from cspr_jax.families.beziers.redundant_durations import taut_durations

        each = [Ends(*(x[i : i + 1] for x in ends)) for i in range(len(z0))]
        return [taut_durations(robot, one, float(z)) for one, z in zip(each, z0, strict=True)]
    rows, arms = (np.asarray(x) for x in jax.jit(adjugate)(robot))
    roots = critical_durations(rows, arms, np.asarray(plane_normal(robot)), float(robot.gravity), ends)
    segment, tests = _between(roots)
    pick = Ends(*(x[segment] for x in ends))
    is_good = proved_margins(robot, pick, tests, z0[segment]) > 0.0
    changes = np.flatnonzero((segment[1:] == segment[:-1]) & (is_good[1:] != is_good[:-1]))
    changed_ends = Ends(*(x[changes] for x in pick))
    good, bad = np.where(is_good[changes], [tests[changes], tests[changes + 1]], [tests[changes + 1], tests[changes]])
    for _ in range(HALVINGS):
        middle = 0.5 * (good + bad)
        if not len(changes) or ((middle == good) | (middle == bad)).all():
            break
        holds = proved_margins(robot, changed_ends, middle, z0[segment[changes]]) > 0.0
        good, bad = np.where(holds, middle, good), np.where(holds, bad, middle)
    return [_intervals(segment == i, is_good, changes, good) for i in range(len(roots))]


def _between(roots: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    # For each segment, choose one duration below all roots, one between neighbouring roots, and one above all.
    tests = []
    for critical in roots:
        times = critical if len(critical) else np.array([1.0])
        tests.append(np.concatenate([[0.5 * times[0]], np.sqrt(times[1:] * times[:-1]), [2.0 * times[-1]]]))
    return np.repeat(np.arange(len(roots)), [len(x) for x in tests]), np.concatenate(tests)


def _intervals(is_in_segment: np.ndarray, is_good: np.ndarray, changes: np.ndarray, edges: np.ndarray) -> np.ndarray:
    # Each change is an end of an interval; the last test of a segment says whether its last interval is unbounded.
    indices = np.flatnonzero(is_in_segment)
    inside = [float(edge) for change, edge in zip(changes, edges, strict=True) if is_in_segment[change]]
    starts = [0.0] if is_good[indices[0]] else []
    ends = [np.inf] if is_good[indices[-1]] else []
    return np.array([*starts, *inside, *ends]).reshape(-1, 2)


def least_duration(
    problem: Problem, ends: Ends, intervals: Float[np.ndarray, "n_intervals 2"] | None, z0: float
) -> float:
    """Least feasible duration of one segment.

    Without limits it is the shortest that keeps every cable taut. With limits, the first feasible one of many trial
    durations is narrowed down; a shorter one between two trials is not excluded.
    """
    if intervals is not None and len(intervals) and not limits_set(problem.limits):
        return float(intervals[0, 0])
    if intervals is None or problem.robot.n_cables > problem.robot.dof:
        from cspr_jax.families.beziers.redundant_durations import least_proved_duration

        return least_proved_duration(problem, ends, z0, slowest(problem, np.concatenate([ends.start, ends.end])))

    def verdicts_of(times: np.ndarray, allowed: Problem = problem) -> Verdicts:
        many = Ends(*(np.repeat(x, len(times), axis=0) for x in ends))
        motions = Bezier(many.start, many.middles(times), many.end, times, np.full(len(times), z0))
        return verdicts_within(allowed, motions)

    # Let limits be touched only if no duration stays clear of all of them.
    for allowed, (first, last) in itertools.product((problem, touchable(problem)), intervals):
        widest = max(WIDEST * first, slowest(problem, np.concatenate([ends.start, ends.end])))
        times = np.geomspace(first, min(last, widest), TRIED)
        good = np.flatnonzero(verdicts_of(times, allowed).verdict == 0)
        if len(good):
            return _narrowed(partial(verdicts_of, allowed=allowed), times, int(good[0]))
    # Nothing is feasible: return the duration that comes nearest to it.
    extent = np.abs(np.concatenate([ends.end - ends.start, ends.middle - ends.start])).sum()
    unit = np.sqrt(max(extent, np.abs(ends.start).sum() * 1e-3) / float(problem.robot.gravity))
    times = np.concatenate([np.geomspace(0.1, 100.0, 4 * TRIED) * unit, intervals.ravel()])
    times = times[np.isfinite(times)]
    results = verdicts_of(times)
    if limits_set(problem.limits):
        return float(times[_nearest(results)])
    return float(times[np.argmax(np.nan_to_num(results.margin, nan=-np.inf))])


def _nearest(results: Verdicts) -> int:
    # Prefer durations that keep cables taut below the spools, then those that break the fewest limits by the least.
    margin = np.nan_to_num(np.minimum(results.margin, results.limit_margin), nan=-np.inf)
    counts = np.sum([(results.verdict & flag.value) > 0 for flag in Verdict], axis=0)
    return int(np.lexsort((-margin, counts, ~(results.margin > 0.0)))[0])


def slowest(problem: Problem, points: Float[np.ndarray, "n+1 3"]) -> float:
    """Duration that is long enough for the limits of speeds and accelerations."""
    distance = float(np.nansum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    distance = distance or float(spool_radius(problem.robot))
    limits = problem.limits
    speeds, accelerations = (
        [float(np.min(np.asarray(limit))) for limit in pair if limit is not None]
        for pair in (
            (limits.cable_speed_max, limits.speed_max),
            (limits.cable_acceleration_max, limits.acceleration_max),
        )
    )
    times = [distance / speed for speed in speeds] + [
        math.sqrt(distance / acceleration) for acceleration in accelerations
    ]
    return AMPLE * max(times, default=0.0)


def _narrowed(verdicts_of, times: np.ndarray, first: int) -> float:
    good, bad = times[first], times[max(first - 1, 0)]
    for _ in range(HALVINGS):
        middle = 0.5 * (good + bad)
        if middle in (good, bad):
            break
        good, bad = (middle, bad) if verdicts_of(np.array([middle])).verdict[0] == 0 else (good, middle)
    return float(good)
