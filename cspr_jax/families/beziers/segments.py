"""Consecutive Bezier segments with continuous accelerations: given or least durations, and verdicts."""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import jax
import numpy as np

from cspr_jax.families.beziers.duration_roots import Ends
from cspr_jax.families.beziers.durations import feasible_durations, least_duration
from cspr_jax.families.beziers.motion import Bezier, end_acceleration
from cspr_jax.families.beziers.verdicts import verdicts
from cspr_jax.motion.answers import Answers
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.shapes import Float


@dataclasses.dataclass(frozen=True)
class BezierAnswers(Answers):
    """Answers of Bezier segments.

    Fields:
        control_points: (n, 3, 3) start, middle and end of each, m.
        taut_durations: (n,) for each segment, the durations that keep every cable taut while earlier segments stay
            unchanged: [[least, largest], ...] in s, inf if there is no largest; None if they are not computed.
        release: (n,) time of release of an object since the start of the segment, s; NaN without a release.
        flight_time: (n,) time of flight of the object, s; NaN without a release.
    """

    control_points: np.ndarray
    taut_durations: np.ndarray
    release: np.ndarray
    flight_time: np.ndarray

    def details(self, i: int) -> dict[str, Any]:
        """Details of a segment; see `Answers.details`."""
        durations = None if self.taut_durations[i] is None else self.taut_durations[i].tolist()
        return super().details(i) | {
            "control_points": self.control_points[i].tolist(),
            "taut_durations": durations,
            "least_duration": durations[0][0] if durations else None,
            "arcs": None,
            "tried_arcs": None,
        }


class Joined(NamedTuple):
    """Segments, with the intervals from which their durations were chosen.

    Fields:
        motions: the n segments, as NumPy leaves with a leading dimension n.
        taut_durations: for each segment, (n_intervals, 2) s; see `BezierAnswers`.
    """

    motions: Bezier
    taut_durations: list[np.ndarray | None]


def joined_segments(
    problem: Problem,
    points: Float[np.ndarray, "n+1 3"],
    durations: list[float | None],
    first_control_point: Float[np.ndarray, "3"],
    z0: float,
) -> Joined:
    """Segments through points, at rest at each, whose accelerations are continuous (15)."""
    motions, intervals, depth = [], [], np.array([z0])
    # The first segment is given its control point, all others the acceleration at their start.
    ends = Ends(points[:1], points[1:2], first_control_point[None], np.zeros((1, 3)))
    for i, duration in enumerate(durations):
        taut_durations = feasible_durations(problem.robot, ends, depth)[0]
        time = least_duration(problem, ends, taut_durations, z0) if duration is None else duration
        time = time if time > 0.0 else np.nan
        middle = ends.middles(np.array([time]))
        motions.append(Bezier(ends.start, middle, ends.end, np.array([time]), depth))
        intervals.append(taut_durations)
        if np.isnan(time):
            break
        if i + 1 < len(durations):
            acceleration = end_acceleration(middle, ends.end, time)
            ends = Ends(ends.end, points[i + 2 : i + 3], ends.end, acceleration)
    return Joined(jax.tree.map(lambda *parts: np.concatenate(parts), *motions), intervals)


def answers_of(problem: Problem, segments: Joined) -> BezierAnswers:
    """Answers of segments."""
    motions = segments.motions
    count, proofs = len(motions.time), None
    if problem.robot.n_cables > problem.robot.dof:
        from cspr_jax.families.beziers.redundant_verdicts import verdicts_and_proofs

        results, proofs = verdicts_and_proofs(problem, motions)
    else:
        results = verdicts(problem, motions)
    none, nothing = np.zeros(count, int), np.full(count, np.nan)
    intervals = np.empty(count, object)
    for i, durations in enumerate(segments.taut_durations):
        intervals[i] = durations
    return BezierAnswers(
        none,
        none,
        results.verdict,
        motions.time,
        results.margin,
        results.bound,
        results.limit_margin,
        *(nothing, nothing, nothing),
        np.stack([motions.start, motions.middle, motions.end], axis=1),
        intervals,
        *(np.full(count, np.nan) for _ in range(2)),
        margin_unit="1" if proofs is None else "N",
        proof=np.full(count, None) if proofs is None else proofs,
    )
