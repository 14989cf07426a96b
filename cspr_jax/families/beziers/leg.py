"""Leg of Bezier segments, at rest at every pose; an object may be released on one of them."""

import dataclasses
from typing import NamedTuple, cast

import jax
import jax.numpy as jnp
import numpy as np

from cspr_jax.config.keys.launch import LaunchTable
from cspr_jax.errors import ConfigError, shown
from cspr_jax.families.beziers.launches.launches import Launch, launched
from cspr_jax.families.beziers.margins import depths_of
from cspr_jax.families.beziers.motion import Bezier, end_acceleration
from cspr_jax.families.beziers.segments import BezierAnswers, answers_of, joined_segments
from cspr_jax.families.beziers.sequences import Anchored, duration_bounds, least_total, segments_of
from cspr_jax.launch.flight import parabola_of
from cspr_jax.launch.landings import Throw
from cspr_jax.launch.launch_result import LaunchResult, launch_result
from cspr_jax.motion.answers import Answers
from cspr_jax.motion.leg import JoinedLeg, Leg, each
from cspr_jax.motion.motion import Motion
from cspr_jax.motion.problem import Problem, search_problem
from cspr_jax.motion.waypoints import Waypoints
from cspr_jax.robots.model.point_mass import AT_P0, spool_radius
from cspr_jax.verification.verifier import of_family

# Accelerations up to this fraction of gravity count as zero.
AT_REST = 1e-9
# A duration within this factor of the shortest one that the search tries counts as that one.
ABOVE_SHORTEST = 1.0 + 1e-6


class _Chosen(NamedTuple):
    # Positions, durations (None: each the least, in order) and the first control point; the release, if there is one.
    points: np.ndarray
    durations: list[float | None]
    first: np.ndarray
    release: float = np.nan
    flight_time: float = np.nan


class Beziers(Leg):
    """Any positions, joined by Bezier segments; see `Leg`."""

    knows_motor_speeds = True

    def __init__(self, waypoints: Waypoints) -> None:
        """Refuse numbers of arcs, which Bezier segments do not have."""
        super().__init__(waypoints)
        self._refuse("arcs")
        if waypoints.plan_file.least == "total" and None not in self._durations:
            raise ConfigError(waypoints.path, 'least = "total": must be absent where every duration is given')
        launch = waypoints.plan_file.launch
        # Index of the launching segment, if it is in this leg.
        self._at = None if launch is None or not 0 <= launch.segment - waypoints.first < len(self) else launch.segment

    def join(self, problem: Problem, z0: float) -> tuple[Answers, list[Motion]]:
        """Join the positions; see `Leg.join`."""
        points, frame, searched = self._points(problem, z0), self.waypoints.frame, search_problem(problem)
        # Normalise by the depth of P0, else by that of the first pose.
        depth = z0 if np.isfinite(z0) else float(depths_of(problem.robot, points[:1])[0])
        chosen = self._chosen(searched, points, depth)
        segments = joined_segments(searched, chosen.points, chosen.durations, chosen.first, depth)
        self._refuse_unbounded(problem, segments.motions.time, chosen.points)
        answers, motions = answers_of(of_family(problem), segments), segments.motions
        self._check_rests(problem, motions, chosen.first - points[0])
        if self._at is not None:
            answers.release[self._at - self.waypoints.first] = chosen.release
            answers.flight_time[self._at - self.waypoints.first] = chosen.flight_time
        shown_points = np.asarray(frame.outward(answers.control_points))
        return dataclasses.replace(answers, control_points=shown_points), each(motions, len(self))

    def result(self, problem: Problem, joined: JoinedLeg, tension_min: np.ndarray, start: float) -> LaunchResult | None:
        """Release and flight of the object that the leg launches; see `Leg.result`."""
        table, frame, answers = (
            self.waypoints.plan_file.launch,
            self.waypoints.frame,
            cast(BezierAnswers, joined.answers),
        )
        if table is None or self._at is None:
            return None
        at = self._at - self.waypoints.first
        motion, release = cast(Bezier, joined.motions[at]), float(answers.release[at])
        return launch_result(
            table,
            frame,
            problem.robot,
            Throw((motion,), np.asarray(release), np.asarray(frame.inward(table.target))),
            time=start + float(answers.duration[:at].sum()) + release,
            flight_time=float(answers.flight_time[at]),
            tension_min=float(tension_min[at]),
            control_points=answers.control_points[at],
        )

    def _chosen(self, problem: Problem, points: np.ndarray, depth: float) -> _Chosen:
        waypoints, durations, launch = self.waypoints, self._durations, self.waypoints.plan_file.launch
        if launch is not None and self._at is not None:
            question = _question(waypoints, launch, points, depth, float(problem.robot.gravity))
            best = launched(problem, question, durations, launch.choose)
            first = segments_of(best.sequence, jnp.asarray(best.durations)).middle[0]
            positions, times, first = jax.tree.map(np.asarray, (best.sequence.points, best.durations, first))
            return _Chosen(positions, times.tolist(), first, float(best.release), float(best.time))
        control_point = waypoints.plan_file.first_control_point if waypoints.first == 0 else None
        first = points[0] if control_point is None else np.asarray(waypoints.frame.inward(control_point))
        if waypoints.plan_file.least == "total":
            sequence = Anchored(points, np.asarray(0), first, np.asarray(depth))
            durations = least_total(problem, sequence, durations).tolist()
        return _Chosen(points, durations, first)

    @property
    def _durations(self) -> list[float | None]:
        durations = (pose.duration for pose in self.waypoints.poses[1:])
        return [time if isinstance(time, float) else None for time in durations]

    def _points(self, problem: Problem, z0: float) -> np.ndarray:
        points, waypoints = self.waypoints.points(z0), self.waypoints
        if self._at is not None:  # the launch determines it
            points[self._at - waypoints.first + 1] = np.nan
        near = np.linalg.norm(np.diff(points, axis=0), axis=1) <= AT_P0 * float(spool_radius(problem.robot))
        for i in (np.flatnonzero(near) + 1).tolist():
            control_point = waypoints.plan_file.first_control_point if waypoints.first == 0 else None
            if control_point is None or control_point == waypoints.poses[0].position:
                raise ConfigError(
                    waypoints.path,
                    f"{waypoints.name(i)}.position: must be another than that of {waypoints.name(i - 1)}, for "
                    "a segment that "
                    "starts without acceleration",
                )
        return points

    def _refuse_unbounded(self, problem: Problem, times: np.ndarray, points: np.ndarray) -> None:
        # Redundant cables without largest tensions may give any acceleration, so there is no least duration.
        if problem.robot.n_cables == problem.robot.dof:
            return
        is_searched = self.waypoints.plan_file.least == "total" or self._at is not None
        shortest = np.exp(duration_bounds(problem, points)[0]) if is_searched else 0.0
        is_free = np.array([time is None for time in self._durations])[: len(times)]
        for i in np.flatnonzero(is_free & ~(times > shortest * ABOVE_SHORTEST)).tolist():
            raise ConfigError(
                self.waypoints.path,
                f"{self.waypoints.name(i + 1)}.duration: must be a number without tension_max and limits "
                "of speeds, since "
                "nothing bounds the acceleration of the segment",
            )

    def _check_rests(self, problem: Problem, motions, first: np.ndarray) -> None:
        # A pose that stays at rest has no acceleration.
        times = np.asarray(motions.time)[:, None]
        ends = end_acceleration(motions.middle, motions.end, times)
        starts = (np.pi / times[:1]) ** 2 * first[None]
        norms = np.linalg.norm(np.concatenate([starts, ends]), axis=1)
        for i in np.flatnonzero(norms > AT_REST * float(problem.robot.gravity)).tolist():
            if self.waypoints.poses[i].rest:
                raise ConfigError(
                    self.waypoints.path,
                    f"{self.waypoints.name(i)}.rest = {shown(True)}: must be absent where the acceleration is "
                    "not zero: "
                    f"it is {norms[i]:.3g} m/s^2",
                )


def _question(waypoints: Waypoints, table: LaunchTable, points: np.ndarray, depth: float, gravity: float) -> Launch:
    # Return the requirements of the [launch] table; `depth` is the one at which slacks are normalised.
    parabola = parabola_of(table, waypoints.frame, gravity, waypoints.path)
    duration = waypoints.poses[table.segment - waypoints.first + 1].duration
    if table.release is not None and isinstance(duration, float) and not table.release < duration:
        raise ConfigError(
            waypoints.path,
            f"launch.release = {shown(table.release)}: must be below the duration of the segment, {shown(duration)} s",
        )
    at = np.asarray(table.segment - waypoints.first)
    return Launch(points, at, *parabola, table.release, np.asarray(depth))
