"""Object that a plan releases: what its file asks, and the release and flight that were found."""

import dataclasses
from typing import Any

import numpy as np

from cspr_jax.beziers.landings import LaunchErrors, Scatter, Throw, scatter
from cspr_jax.beziers.launch import flown
from cspr_jax.beziers.launches import Launch
from cspr_jax.errors import ConfigError, shown
from cspr_jax.motions.waypoints import Waypoints

# A place of release counts as on a parabola that it misses by less than this part of its distance from the target.
ON_PARABOLA = 1e-6


@dataclasses.dataclass(frozen=True)
class Released:
    """Release of an object and its flight, in the axes of the robot file.

    Fields:
        segment: number of the segment, from 0 on.
        position: (3,) at the release, m.
        velocity: (3,) likewise, m/s.
        time: of the release, since the start of the plan, s.
        control_points: (3, 3) of the segment, m.
        landing: (3,) where the flight ends, m.
        flight_time: s.
        tension_min: smallest tension on the segment, N.
        scatter: of the landings, of a plan that names errors.
    """

    segment: int
    position: np.ndarray
    velocity: np.ndarray
    time: float
    control_points: np.ndarray
    landing: np.ndarray
    flight_time: float
    tension_min: float
    scatter: Scatter | None = None

    def to_dict(self) -> dict[str, Any]:
        """The launch as a plan's JSON has it.

        Returns:
            plain values.
        """
        table = {
            "segment": self.segment,
            "release": {"position": self.position.tolist(), "velocity": self.velocity.tolist(), "time": self.time},
            "control_points": self.control_points.tolist(),
            "landing": self.landing.tolist(),
            "flight_time": self.flight_time,
            "tension_min": self.tension_min,
        }
        return table if self.scatter is None else table | {"scatter": self.scatter.to_dict()}


def question_of(stops: Waypoints, points: np.ndarray, depth: float, gravity: float) -> Launch:
    """Question that the [launch] table of a plan asks.

    Args:
        stops: the poses of the leg that holds the segment.
        points: (n + 1, 3) their places, z down, m.
        depth: at which slacks are normalised, m.
        gravity: m/s^2.

    Returns:
        the question.

    Raises:
        ConfigError: a place off the parabola, or a release that is not within the segment.
    """
    table, frame = stops.keys.launch, stops.frame
    if table is None:
        raise ValueError("a plan without [launch]")
    target = np.asarray(frame.inward(table.target))
    point = None if table.point is None else np.asarray(frame.inward(table.point))
    velocity = None if table.velocity is None else np.asarray(frame.turned(np.asarray(table.velocity)))
    time = table.time
    if point is not None and velocity is not None:
        time, velocity = _flight_time(stops, point, target, velocity, gravity), None
    duration = stops.poses[table.segment - stops.first + 1].duration
    if table.release is not None and isinstance(duration, float) and not table.release < duration:
        raise ConfigError(
            stops.path,
            f"launch.release = {shown(table.release)}: must be below the duration of the segment, {shown(duration)} s",
        )
    at = np.asarray(table.segment - stops.first)
    return Launch(points, at, target, point, velocity, time, table.release, np.asarray(depth))


def _flight_time(
    stops: Waypoints, point: np.ndarray, target: np.ndarray, velocity: np.ndarray, gravity: float
) -> float:
    # Find the time of flight on the parabola through the target, from the roots at which it is nearest to the point.
    down = 0.5 * gravity * np.array([0.0, 0.0, 1.0])
    way = target - point
    # |way - velocity t + down t^2|^2, by powers of t, the highest first.
    square = [down @ down, -2.0 * down @ velocity, velocity @ velocity + 2.0 * way @ down, -2.0 * way @ velocity]
    roots = np.roots(np.array(square) * [4.0, 3.0, 2.0, 1.0])
    times = roots.real[(np.abs(roots.imag) < 1e-6 * np.abs(roots)) & (roots.real > 0.0)]
    apart = [float(np.linalg.norm(way - velocity * t + down * t**2)) for t in times]
    size = max(float(np.linalg.norm(way)), 1e-300)
    if not apart or not min(apart) <= ON_PARABOLA * size:
        nearest = f"which passes it by {min(apart):.3g} m" if apart else "which never comes near it before the target"
        raise ConfigError(
            stops.path,
            f"launch.point = {shown(stops.keys.launch and stops.keys.launch.point)}: must lie on the parabola that "
            f"reaches the target with launch.velocity, {nearest}",
        )
    return float(times[int(np.argmin(apart))])


def released(plan: Any) -> Released | None:
    """Release of a plan's object.

    Args:
        plan: a `Plan`.

    Returns:
        the release; None of a plan that launches nothing.
    """
    if plan.keys.launch is None:
        return None
    segment = plan.keys.launch.segment
    motion, answers, at = _launching(plan)
    release, flight_time = float(answers.release[at]), float(answers.flight_time[at])
    state = motion.state(np.asarray(release / float(motion.time)))
    landing, _ = flown(state.position, state.velocity, plan.problem.robot.gravity, flight_time)
    return Released(
        segment=segment,
        position=np.asarray(plan.frame.outward(np.asarray(state.position))),
        velocity=np.asarray(plan.frame.turned(np.asarray(state.velocity))),
        time=float(plan.answers.duration[:segment].sum()) + release,
        control_points=answers.control_points[at],
        landing=np.asarray(plan.frame.outward(np.asarray(landing))),
        flight_time=flight_time,
        tension_min=float(plan.demands.tension_min[segment]),
        scatter=None
        if plan.keys.launch.errors is None
        else scattered(plan, LaunchErrors(**vars(plan.keys.launch.errors))),
    )


def scattered(plan: Any, errors: LaunchErrors) -> Scatter:
    """Scatter of the landings of a plan's launch.

    Args:
        plan: a `Plan` with a launch.

    Returns:
        the scatter.
    """
    motion, answers, at = _launching(plan)
    target = np.asarray(plan.frame.inward(plan.keys.launch.target))
    kernel_scatter = scatter(plan.problem.robot, Throw(motion, np.asarray(answers.release[at]), target), errors)
    # Axes of the file are turned against those of the kernels about x.
    signs = np.asarray(plan.frame.turned(np.ones(3)))[:2]
    both = np.outer(signs, signs)
    return Scatter(kernel_scatter.landings * signs, kernel_scatter.covariance * both, kernel_scatter.first_order * both)


def _launching(plan: Any) -> tuple[Any, Any, int]:
    # Motion of the launching segment, answers of its leg, and its number there.
    at = plan.keys.launch.segment
    for leg in plan.legs:
        if at < len(leg.motions):
            return leg.motions[at], leg.answers, at
        at -= len(leg.motions)
    raise IndexError(plan.keys.launch.segment)
