"""Searches of platforms from Python: from poses and orientations to answers; see `api.families.searches`."""

from __future__ import annotations

import dataclasses
from functools import partial
from typing import Any

import numpy as np

from cspr_jax.api.arguments.checks import MaxArcs, checked
from cspr_jax.api.arguments.kernel_arguments import batched, depths, kernel_problem, points_of, quaternions
from cspr_jax.api.families.searches import WithMotions
from cspr_jax.errors import InputError
from cspr_jax.errors.arguments import BetaHat, Definition, Depth, Depths, Divisions, Point, Points, Pose, Quaternions
from cspr_jax.errors.suggestions import one_of
from cspr_jax.families.platforms.answers import PlatformMotionAnswers
from cspr_jax.families.platforms.arcs import Candidates, segments_with
from cspr_jax.families.platforms.checkers import pose_checker
from cspr_jax.families.platforms.end_acceleration import AT_REST
from cspr_jax.families.platforms.motion_checker import MANY
from cspr_jax.families.platforms.orientations.accessible import DEFINITIONS, Accessible
from cspr_jax.families.platforms.orientations.accessible import accessible as search_accessible
from cspr_jax.families.platforms.orientations.attainable import attainable as search_attainable
from cspr_jax.families.platforms.platform_segment import PlatformMotion
from cspr_jax.families.platforms.pose_targets import pose_arcs, rest_poses, start_beta_hat
from cspr_jax.motion.amplitudes import Amplitude
from cspr_jax.motion.motion import Placed
from cspr_jax.motion.platform_kind import PlatformMotionKind
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.numerics.linear.frames import Frame
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.statics.reference_pose import reference_pose


@dataclasses.dataclass(frozen=True)
class PlatformAnswers(PlatformMotionAnswers, WithMotions):
    """Answers of `minimum_pose_arcs`; see `families.platforms.answers.PlatformMotionAnswers`."""


@checked(motion="platform_motion")
def minimum_pose_arcs(  # noqa: PLR0913
    robot: PlatformRobot,
    positions: Points,
    orientations: Quaternions | None = None,
    *,
    start: Pose | None = None,
    z0: Depths,
    beta_hat: BetaHat = None,
    amplitude: str | Amplitude = "quintic",
    limits: Limits | None = None,
    max_arcs: MaxArcs = 30,
    variable: bool = True,
) -> PlatformAnswers:
    """Smallest number of arcs of a platform to each of many poses, thesis chapter 3.

    Args:
        robot: platform on six cables or more. On more than six the margin is the distance that all tensions can keep
            from their limits, over weight / n_cables; searches use samples, and the chosen motion is proved.
        positions: (n, 3) positions of the mass centre in the robot's axes, m.
        orientations: (n, 4) unit quaternions in the robot's axes, scalar first, relative to the reference orientation;
            None: the reference orientation.
        start: position (3,) and quaternion (4,) of the start, with the preferred beta-hat; None: at rest in P0.
        z0: () or (n,) depth of P0 below the centroid of the spools, m.
        beta_hat: beta-hat at the poses, or "preferred" (3.91); None: several are tried, the preferred one first.
        amplitude: name of an amplitude function, or the function itself; it must satisfy (2.49).
        limits: as in `minimum_arcs`.
        max_arcs: largest number of arcs tried.
        variable: whether positions are hypocycloids of variable amplitude (3.44), or standard ones.

    Returns:
        the answers, (n,) each, proved.

    Raises:
        InputError: as for `minimum_arcs`; quaternions that are not of unit length; a robot that is singular or slack
            at rest.
    """
    if not isinstance(robot, PlatformRobot):
        raise InputError("robot", getattr(robot, "name", robot), "a platform")
    points = points_of("positions", positions)
    depth, turns = depths(z0, len(points)), quaternions("orientations", orientations, len(points))
    with double_precision():
        problem, frame = kernel_problem(robot, amplitude, limits, families=("hypocycloid",), any_cables=True)
        for each in np.unique(depth if robot.n_cables == robot.dof else depth[:0]):
            reference_pose(problem.robot, float(each))
        checker = pose_checker(problem, PlatformMotionKind(variable=variable, from_rest=start is None), batch=MANY)
        ends = (frame.inward(points), frame.rotated_quaternions(turns))
        if start is None:
            first, beta_hats = rest_poses(depth), np.full(len(depth), AT_REST)
        else:
            place, turn = points_of("start", [start[0]]), quaternions("start", [start[1]], 1)
            rows = np.zeros(len(depth), int)
            first = (frame.inward(place)[rows], frame.rotated_quaternions(turn)[rows])
            beta_hats = start_beta_hat(checker, first, depth)
        trial = Candidates(first, ends, depth, np.arange(len(depth)), (beta_hats, beta_hats))
        value = float(beta_hat) if isinstance(beta_hat, int) else beta_hat
        answers = pose_arcs(checker, trial, beta_hat=value, max_arcs=max_arcs)
    make = partial(_motions, problem, frame, trial, PlatformMotionKind(variable=variable))
    return PlatformAnswers(**vars(answers), make=make, problem=problem)


def _motions(
    problem: Problem, frame: Frame, trial: Candidates, kind: PlatformMotionKind, answers: PlatformMotionAnswers
) -> Placed[PlatformMotion]:
    chosen = trial._replace(beta_hats=tuple(answers.beta_hat.T))
    segments = segments_with(problem.robot, chosen, answers.tried_arcs)
    return batched(PlatformMotion, segments, problem, answers, frame, kind)


@checked(motion="platform_motion")
def accessible(
    robot: PlatformRobot, place: Point, *, definition: Definition = "scan", divisions: Divisions = 32
) -> Accessible:
    """Accessible orientations at a position: free paths lead to them from the reference orientation, section 3.11.

    Args:
        robot: rigid platform; on more than six cables, orientations are accessible by steps of full rank without
            contacts.
        place: (3,) position of the mass centre in the robot's axes, m.
        definition: how the set is sampled, as in [orientations] of a sweep file.
        divisions: number of steps in pi: angles have the step pi / divisions; even, 4 to 128.

    Returns:
        `angles` (n, 3) of tilt and torsion in the cylindrical frame of the position, rad; `volume` (n,), the fraction
        of SO(3) that each orientation represents.

    Raises:
        InputError: the wrong kind of robot, a position that is not finite, or a wrong definition or divisions.
    """
    problem, where = _of_place(robot, place, definition, divisions)
    with double_precision():
        return search_accessible(problem.robot, where, definition, divisions)


@checked(motion="platform_motion")
def attainable(
    robot: PlatformRobot,
    place: Point,
    *,
    z0: Depth | None = None,
    definition: Definition = "scan",
    divisions: Divisions = 32,
    amplitude: str | Amplitude = "quintic",
    limits: Limits | None = None,
    max_arcs: MaxArcs = 30,
) -> tuple[Accessible, PlatformMotionAnswers]:
    """Search the accessible orientations at a position that a motion from rest attains, section 3.12.3.

    Args:
        robot: rigid platform, as in `accessible`.
        place: (3,) position of the mass centre in the robot's axes, m.
        z0: depth of P0 below the centroid of the spools, m; None: the depth of the position.
        definition: as in `accessible`.
        divisions: as in `accessible`.
        amplitude: name of an amplitude function, or the function itself; it must satisfy (2.49).
        limits: as in `minimum_arcs`.
        max_arcs: largest number of arcs tried.

    Returns:
        the accessible orientations, and the answers (n,) of the motions to them.

    Raises:
        InputError: as for `accessible` and `minimum_arcs`, or no orientation is accessible.
    """
    problem, where = _of_place(robot, place, definition, divisions, amplitude, limits)
    with double_precision():
        inside = search_accessible(problem.robot, where, definition, divisions)
        count = len(inside.angles)
        if not count:
            raise InputError("place", np.asarray(place).tolist(), "a place where some orientation is accessible")
        checker = pose_checker(problem, PlatformMotionKind(from_rest=True), batch=MANY)
        depth = depths(where[2] if z0 is None else z0, count)
        positions = np.tile(where, (count, 1))
        return inside, search_attainable(checker, positions, inside.angles, depth, max_arcs=max_arcs)


def _of_place(
    robot: Any, place, definition: str, divisions: int, amplitude: str | Amplitude = "quintic", limits=None
) -> tuple[Problem, np.ndarray]:
    if not isinstance(robot, PlatformRobot):
        raise InputError("robot", getattr(robot, "name", robot), "a platform")
    if definition not in DEFINITIONS:
        raise InputError("definition", definition, one_of(definition, DEFINITIONS))
    if divisions % 2 or not 4 <= divisions <= 128:
        raise InputError("divisions", divisions, "an even number from 4 to 128")
    where = points_of("place", [place])
    problem, frame = kernel_problem(robot, amplitude, limits, families=("hypocycloid",), any_cables=True)
    return problem, frame.inward(where)[0]
