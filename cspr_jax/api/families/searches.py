"""Searches from Python: from arrays of targets to answers.

Searches use the axes of the robot, and float64 whatever precision jax is set to. Answers are NumPy arrays, which cannot
be differentiated; they can make their motions.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from cspr_jax.api.arguments.checks import AmplitudeOrNone, MaxArcs, checked
from cspr_jax.api.arguments.kernel_arguments import batched, check_point_mass, depths, kernel_problem, points_of
from cspr_jax.errors import InputError
from cspr_jax.errors.arguments import Depths, Points, StartOrRest
from cspr_jax.families.swings.arcs import minimum_arcs as search_arcs
from cspr_jax.families.swings.arcs import segments_between
from cspr_jax.families.swings.hypocycloid import Hypocycloid, Segment
from cspr_jax.families.swings.parities import pick
from cspr_jax.families.swings.transitions.oscillations import OscillationAnswers, transitions_to
from cspr_jax.families.swings.transitions.oscillations import minimum_oscillations as search_oscillations
from cspr_jax.motion.amplitudes import Amplitude
from cspr_jax.motion.answers import Answers
from cspr_jax.motion.cause import Cause
from cspr_jax.motion.leg import each
from cspr_jax.motion.motion import Placed
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.numerics.linear.frames import Frame
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.point_mass import PointMassRobot, rest_point


@dataclasses.dataclass(frozen=True)
class WithMotions:
    """Answers that can make their motions.

    Fields:
        make: function that makes the motions of answers; it is a function of a module, bound to its arguments, so that
            answers can be pickled and copied.
        problem: problem of the search.
    """

    make: Callable[[Any], Placed] = dataclasses.field(kw_only=True, repr=False, compare=False)
    problem: Problem = dataclasses.field(kw_only=True, repr=False, compare=False)

    def motions(self) -> Any:
        """Motions of the answers, with the number of arcs found, or, if none is, that of the best candidate.

        Returns:
            one motion whose leaves have a leading dimension (n,), in the robot's axes, for `jax.vmap`.
        """
        return self.make(self)

    def causes(self: Any) -> list[tuple[Cause, ...]]:
        """Find why motions are not feasible, with needed and allowed values.

        Returns:
            the causes for each of the n motions, the worst one first; a feasible motion has none.
        """
        from cspr_jax.verification.attained import with_attained  # searches themselves need no general proof

        with double_precision():
            placed, count = self.make(self), len(self.verdict)
            if not count:
                return []
            frame, answers = each(placed.frame, count)[0], with_attained(self.problem, self, each(placed.motion, count))
            return [answers.causes_of(i, frame) for i in range(count)]


@dataclasses.dataclass(frozen=True)
class ArcsAnswers(Answers, WithMotions):
    """Answers of `minimum_arcs`; see `motion.answers.Answers`."""


@dataclasses.dataclass(frozen=True)
class TransitionAnswers(OscillationAnswers, WithMotions):
    """Answers of `minimum_oscillations`; see `families.swings.transitions.oscillations.OscillationAnswers`."""


@checked(motion="hypocycloid")
def minimum_arcs(
    robot: PointMassRobot,
    targets: Points,
    *,
    start: StartOrRest | None = None,
    z0: Depths,
    amplitude: AmplitudeOrNone = None,
    limits: Limits | None = None,
    max_arcs: MaxArcs = 30,
) -> ArcsAnswers:
    """Smallest number of arcs to each of many targets, with duration, margin and verdict.

    Args:
        robot: point mass on three cables or more; on more than three, the margin is the distance that all tensions can
            keep from their limits, over weight / n_cables.
        targets: (n, 3) targets in the robot's axes, m.
        start: (3,) or (n, 3) start points in the robot's axes, m; None: at rest in P0. A start also counts as at rest
            in P0 if its distance from P0 is within 1e-9 of the robot's radius (the largest distance of a spool from
            the centroid of the spools). For any other start near P0 the motion depends on its direction from P0.
        z0: () or (n,) depth of P0 below the centroid of the spools, m.
        amplitude: name of an amplitude function, or the function itself; None: the quintic (2.50).
        limits: replace those of the robot, one by one; the floor is z in the robot's axes. None: those of the robot.
        max_arcs: largest number of arcs tried.

    Returns:
        the answers, (n,) each, proved.

    Raises:
        InputError: the wrong kind of robot, shapes that do not fit, values that are not finite, z0 not positive,
            max_arcs below 1, limits that contradict each other, or an amplitude function that breaks (2.49).
    """
    if not isinstance(robot, PointMassRobot) or robot.dof != 3:
        raise InputError("robot", getattr(robot, "name", robot), "a point mass on three cables or more")
    ends = points_of("targets", targets)
    depth = depths(z0, len(ends))
    start_points = None if start is None else np.asarray(start, float)
    if start_points is not None and start_points.shape not in ((3,), ends.shape):
        raise InputError("start", f"shape {start_points.shape}", f"finite numbers of shape (3,) or {ends.shape}")
    with double_precision():
        families = ("hypocycloid-standard",)
        problem, frame = kernel_problem(robot, amplitude or "quintic", limits, families=families, any_cables=True)
        starts = (
            rest_point(depth) if start_points is None else frame.inward(points_of("start", np.atleast_2d(start_points)))
        )
        endpoints = (np.broadcast_to(starts, ends.shape).copy(), frame.inward(ends), depth)
        answers = search_arcs(problem, *endpoints, max_arcs=max_arcs)
    make = partial(_motions_between, problem, frame, endpoints)
    return ArcsAnswers(**vars(answers), make=make, problem=problem)


def _motions_between(
    problem: Problem, frame: Frame, endpoints: tuple[np.ndarray, ...], answers: Answers
) -> Placed[Hypocycloid]:
    parities, _ = segments_between(problem, *endpoints)
    chosen = pick(parities, np.arange(len(answers.tried_arcs)), answers.tried_arcs)
    return batched(Hypocycloid, chosen, problem, answers, frame)


@checked(motion="transition")
def minimum_oscillations(
    robot: PointMassRobot,
    targets: Points,
    *,
    z0: Depths,
    amplitude: str | Amplitude = "quintic",
    limits: Limits | None = None,
    max_arcs: MaxArcs = 30,
) -> TransitionAnswers:
    """Smallest number of oscillations of a transition from rest to each of many targets, thesis chapter 1.

    Args:
        robot: point mass on three cables, or on two in a plane; or on more, as in `minimum_arcs`.
        targets: (n, 3) targets in the robot's axes, m.
        z0: () or (n,) depth of P0 below the centroid of the spools, m.
        amplitude: name of an amplitude function, or the function itself; it must satisfy (1.27) and (1.28).
        limits: as in `minimum_arcs`.
        max_arcs: twice the largest number of oscillations tried.

    Returns:
        the answers, (n,) each, with numbers of oscillations by the envelopes and by the tensions themselves; redundant
        cables have no envelopes.

    Raises:
        InputError: as for `minimum_arcs`.
    """
    check_point_mass(robot)
    ends = points_of("targets", targets)
    depth = depths(z0, len(ends))
    with double_precision():
        families = ("transition",)
        problem, frame = kernel_problem(robot, amplitude, limits, free_end=True, families=families, any_cables=True)
        segments = transitions_to(problem, frame.inward(ends), depth)
        answers = search_oscillations(problem, segments, depth, max_arcs=max_arcs)
    make = partial(_transitions, problem, frame, segments)
    return TransitionAnswers(**vars(answers), make=make, problem=problem)


def _transitions(problem: Problem, frame: Frame, segments: Segment, answers: Answers) -> Placed[Hypocycloid]:
    return batched(Hypocycloid, segments, problem, answers, frame)
