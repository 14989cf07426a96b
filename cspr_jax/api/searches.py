"""Searches from Python: arrays of targets in, answers out.

In the axes of the robot, and in float64 whatever jax is set to. They give NumPy arrays, which cannot be differentiated.
"""

from functools import partial

import numpy as np

from cspr_jax.api.answers import ArcsAnswers, TransitionAnswers
from cspr_jax.api.argument_checks import checked
from cspr_jax.api.arguments import batched, depths, kernel_problem, points_of
from cspr_jax.arithmetic.elementary import double_precision
from cspr_jax.arithmetic.frames import Frame
from cspr_jax.errors import InputError
from cspr_jax.motions.amplitudes import Amplitude
from cspr_jax.motions.answers import Answers
from cspr_jax.motions.motion import Placed
from cspr_jax.motions.problem import Problem
from cspr_jax.robots.limits import Limits
from cspr_jax.robots.point_mass import PointMassRobot, rest_point
from cspr_jax.swings.arcs import minimum_arcs as search_arcs
from cspr_jax.swings.arcs import segments_between
from cspr_jax.swings.hypocycloid import Hypocycloid, Segment
from cspr_jax.swings.oscillations import minimum_oscillations as search_oscillations
from cspr_jax.swings.oscillations import transitions_to
from cspr_jax.swings.parities import pick


@checked
def minimum_arcs(
    robot: PointMassRobot,
    targets: np.ndarray,
    *,
    start: np.ndarray | None = None,
    z0: np.ndarray | float,
    amplitude: str | Amplitude | None = None,
    limits: Limits | None = None,
    max_arcs: int = 30,
) -> ArcsAnswers:
    """Smallest number of arcs to each of many targets, with duration, margin and verdict.

    Args:
        robot: a point mass on three cables.
        targets: (n, 3) in the robot's axes, m.
        start: (3,) or (n, 3) in the robot's axes, m; None: at rest in P0. A start within 1e-9 of the robot's size
            (the largest distance of a spool from the centroid of all) of P0 is at rest there too; of one that
            is not, but near P0, the direction of so short a way decides the motion.
        z0: () or (n,) depth of P0 below the centroid of the spools, m.
        amplitude: its name, or the function; None: the quintic (2.50).
        limits: over those of the robot, one by one; the floor is z in the robot's axes. None: those of the robot.
        max_arcs: largest number of arcs tried.

    Returns:
        the answers, (n,) each, proved.

    Raises:
        InputError: another kind of robot, shapes that do not fit, values that are not finite, z0 not positive,
            max_arcs below 1, limits that contradict each other, or an amplitude function that breaks (2.49).
    """
    if not isinstance(robot, PointMassRobot) or robot.dof != 3:
        raise InputError("robot", getattr(robot, "name", robot), "a point mass on three cables")
    ends = points_of("targets", targets)
    depth = depths(z0, len(ends))
    start_points = None if start is None else np.asarray(start, float)
    if start_points is not None and start_points.shape not in ((3,), ends.shape):
        raise InputError("start", f"shape {start_points.shape}", f"finite numbers of shape (3,) or {ends.shape}")
    with double_precision():
        problem, frame = kernel_problem(robot, amplitude or "quintic", limits, families=("hypocycloid-standard",))
        starts = (
            rest_point(depth) if start_points is None else frame.inward(points_of("start", np.atleast_2d(start_points)))
        )
        given_points = (np.broadcast_to(starts, ends.shape).copy(), frame.inward(ends), depth)
        answers = search_arcs(problem, *given_points, max_arcs=max_arcs)
    make = partial(_motions_between, problem, frame, given_points)
    return ArcsAnswers(**vars(answers), make=make, problem=problem)


def _motions_between(
    problem: Problem, frame: Frame, given_points: tuple[np.ndarray, ...], answers: Answers
) -> Placed[Hypocycloid]:
    parities, _ = segments_between(problem, *given_points)
    chosen = pick(parities, np.arange(len(answers.tried_arcs)), answers.tried_arcs)
    return batched(Hypocycloid, chosen, problem, answers, frame)


@checked
def minimum_oscillations(
    robot: PointMassRobot,
    targets: np.ndarray,
    *,
    z0: np.ndarray | float,
    amplitude: str | Amplitude = "quintic",
    limits: Limits | None = None,
    max_arcs: int = 30,
) -> TransitionAnswers:
    """Smallest number of oscillations of a transition from rest to each of many targets, thesis chapter 1.

    Args:
        robot: a point mass on three cables, or on two in a plane.
        targets: (n, 3) in the robot's axes, m.
        z0: () or (n,) depth of P0 below the centroid of the spools, m.
        amplitude: its name, or the function; it must meet (1.27) and (1.28).
        limits: as in `minimum_arcs`.
        max_arcs: twice the largest number of oscillations tried.

    Returns:
        the answers, (n,) each; by the envelopes and by the tensions themselves.

    Raises:
        InputError: as `minimum_arcs` does.
    """
    if not isinstance(robot, PointMassRobot):
        raise InputError("robot", getattr(robot, "name", robot), "a point mass")
    ends = points_of("targets", targets)
    depth = depths(z0, len(ends))
    with double_precision():
        problem, frame = kernel_problem(robot, amplitude, limits, free_end=True, families=("transition",))
        segments = transitions_to(problem, frame.inward(ends), depth)
        answers = search_oscillations(problem, segments, depth, max_arcs=max_arcs)
    make = partial(_transitions, problem, frame, segments)
    return TransitionAnswers(**vars(answers), make=make, problem=problem)


def _transitions(problem: Problem, frame: Frame, segments: Segment, answers: Answers) -> Placed[Hypocycloid]:
    return batched(Hypocycloid, segments, problem, answers, frame)
