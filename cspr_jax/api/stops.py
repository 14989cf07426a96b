"""Stops from Python: proved ways to rest from the instants of a plan, also when cables have broken."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Annotated, Any

import jax
import numpy as np

from cspr_jax.api.arguments.checks import checked
from cspr_jax.api.files.pictured import Pictured
from cspr_jax.api.files.replays import PlanOrFile
from cspr_jax.api.plans import NAME, Plan, plan
from cspr_jax.build.problems import build_problem
from cspr_jax.build.robots import build_robot
from cspr_jax.build.scenes import scene_of
from cspr_jax.config.missing_cables import too_few, without_cables
from cspr_jax.config.robot import RobotFile
from cspr_jax.curves.files import reference_of
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.errors.arguments import Cables, Integer, Times
from cspr_jax.errors.suggestions import with_suggestions
from cspr_jax.machine.stops.candidates import ProvedStop
from cspr_jax.machine.stops.fastest import ConsecutiveMotions, Emergency, fastest_stops
from cspr_jax.motion.given_limits import check_no_means
from cspr_jax.motion.motion import Placed
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.numerics.linear.frames import Frame, frame_of
from cspr_jax.numerics.linear.rotations import CONJUGATE, products
from cspr_jax.outputs import stop_report
from cspr_jax.robots.model.patterns import PATTERNS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

USUAL_COUNT = 50
LARGEST_INSTANTS = 10_000
InstantCount = Annotated[int, Integer(1, LARGEST_INSTANTS)]


@with_suggestions
@dataclasses.dataclass(frozen=True)
class Stops(Pictured, stop_report.StopsAlong):
    """Stops along a plan; see `cspr_jax.outputs.stop_report.StopsAlong` for the fields."""

    def _figure(self) -> Figure:
        from cspr_jax.outputs.plots.motions.stops import stops_figure  # loads matplotlib

        with double_precision():
            return stops_figure(self)


@checked()
def stops(
    given: PlanOrFile,
    *,
    instants: InstantCount = USUAL_COUNT,
    times: Times | None = None,
    without: Cables | None = None,
) -> Stops:
    """Find the fastest proved stop from each of some instants of a plan.

    A stop begins with position, velocity and acceleration of the instant and ends at rest; all cables stay taut and all
    limits of the plan are kept, by proof. Plans with `motor_torque_rms_max` or feeds of G-code are refused: these are
    not proved of stops. After cables have broken the acceleration may jump at the start, since tensions do.

    Args:
        given: a feasible plan, a plan file, or a dictionary, as for `plan`.
        instants: number of equidistant instants, from the start of the plan on, its end left out.
        times: (n,) the instants instead, increasing, s.
        without: cables that break at the instant, from 0 on; None: the robot keeps all.

    Returns:
        a stop for each instant, or that none was found, which proves nothing.

    Raises:
        ConfigError: the plan has a mistake, is not feasible, launches an object, or has an uncertainty or feeds; or
            there are no such cables.
        InputError: times outside of the plan, or a plan with `motor_torque_rms_max`.
    """
    planned = given if isinstance(given, Plan) else plan(given)
    _check(planned)
    length = float(planned.answers.duration.sum())
    at = np.linspace(0.0, length, instants, endpoint=False) if times is None else np.asarray(times, float)
    if ((at < 0.0) | (at > length)).any():
        raise InputError("times", times, f"between 0 and {length:.6g}, the duration of the plan, in s")
    gone = tuple(sorted({int(i) for i in without or ()}))
    with double_precision():
        robot_file, left = _left(planned, gone, list(without or ()))
        emergency = None if left else _emergency(planned, robot_file, jumps=bool(gone))
        if isinstance(emergency, str) or emergency is None:
            return Stops(planned, tuple(_none(time) for time in at.tolist()), gone, left or str(emergency))
        motions = [motion for leg in planned.legs for motion in leg.motions]
        sequence = ConsecutiveMotions(
            motions, planned.answers.duration, planned.frame, _reference(planned.robot_file, planned)
        )
        solutions = fastest_stops(emergency, sequence, at)
        rows = [
            _planned_stop(time, stop, emergency, sequence) for time, stop in zip(at.tolist(), solutions, strict=True)
        ]
    return Stops(planned, tuple(rows), gone)


def _check(planned: Plan) -> None:
    if not planned.feasible:
        raise ConfigError(NAME, "not stopped, since a segment is not proved feasible: must be a feasible plan")
    if planned.outcomes:
        raise ConfigError(NAME, "launch: must be absent in a plan that is to be stopped")
    if not all(leg.motions for leg in planned.legs):
        raise ConfigError(NAME, "its motion is too long to be held: must be a shorter one")
    if planned.problem.limits.uncertainty is not None:
        raise ConfigError(NAME, "uncertainty: must be absent in a plan that is to be stopped: stops are proved without")
    allowed = "absent, in [winch] of the robot too: it bounds a mean over a full plan, which a stop is not"
    check_no_means(planned.problem.limits, f"{NAME}: ", allowed)
    if any(feeds is not None for feeds in planned.feeds):
        raise ConfigError(NAME, "feeds: must be absent in a plan that is to be stopped: stops are proved without")


def _left(planned: Plan, gone: tuple[int, ...], broken: list[int]) -> tuple[RobotFile, str]:
    # The robot without the cables that break, and what is left where there are too few, or none that can be used.
    if not gone:
        return planned.robot_file, ""
    full, both = planned.robot_file.full, [*planned.robot_file.missing_cables, *broken]
    count = len(full.base_points)
    are_cables = len(set(both)) == len(both) and min(both) >= 0 and max(both) < count
    if are_cables and count - len(both) < PATTERNS[full.own_pattern].dof:
        return full, f"{too_few(full, count - len(both))}; {stop_report.NONE}"
    try:
        return without_cables(full, both, NAME), ""
    except ConfigError as error:
        if not are_cables:
            raise
        return full, _nothing_left(error)


def _nothing_left(error: ConfigError) -> str:
    return f"{str(error).removeprefix(f'{NAME}: ')}; {stop_report.NONE}"


def _emergency(planned: Plan, robot_file: RobotFile, *, jumps: bool) -> Emergency | str:
    # The robot that stops, or why one without its cables cannot be used.
    spec, frame = planned.keys, planned.frame
    problem: Problem = planned.problem
    if jumps:
        frame = frame_of(robot_file.base_points, robot_file.z_axis)
        try:
            problem = build_problem(robot_file, spec, spec, NAME, epsilon=0.2, any_cables=True, pulleys=True)
        except ConfigError as error:
            return _nothing_left(error)
    scene = scene_of(problem.robot, robot_file, frame, spec, NAME, trajectory=spec)
    return Emergency(problem, scene, frame, _reference(robot_file, planned), _depth(planned, frame), jumps)


def _depth(planned: Plan, frame: Frame) -> float:
    # Depth of P0 below the centroid of the robot that stops.
    depth = planned.z0
    if not np.isfinite(depth):
        depth = float(np.asarray(planned.frame.depth(planned.points[:, 2])).mean())
    depth = float(frame.depth(planned.frame.height(depth)))
    radius = float(np.linalg.norm(np.asarray(planned.problem.robot.base_points), axis=1).mean())
    return depth if depth > 0.0 else radius


def _reference(robot_file: RobotFile, planned: Plan) -> np.ndarray:
    return reference_of(build_robot(robot_file, planned.keys, NAME))


def _none(time: float) -> stop_report.PlannedStop:
    nowhere = np.full(3, np.nan)
    return stop_report.PlannedStop(time, "", np.nan, nowhere, None, np.nan, None)


def _planned_stop(
    time: float, stop: ProvedStop | None, emergency: Emergency, sequence: ConsecutiveMotions
) -> stop_report.PlannedStop:
    if stop is None:
        return _none(time)
    motion = Placed(stop.motion, emergency.frame)
    end: Any = jax.tree.map(np.asarray, motion.state(1.0))
    quaternion = end.quaternion
    if quaternion is not None:
        # Orientations are relative to the reference orientation of the robot that the plan moves.
        relative = emergency.frame.rotated_quaternions(quaternion)[None]
        between = products(emergency.reference[None], (sequence.reference * CONJUGATE)[None])
        quaternion = emergency.frame.rotated_quaternions(products(relative, between)[0])
    return stop_report.PlannedStop(
        time, stop.kind, stop.duration, end.position, quaternion, stop.proof.margin_bound, motion
    )
