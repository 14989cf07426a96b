"""Plans: a sequence of poses, each segment with its smallest number of arcs and what it asks of the cables."""

import dataclasses
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from cspr_jax.arithmetic.frames import Frame
from cspr_jax.config.plan import PlanFile, read_plan
from cspr_jax.config.reading import read_text
from cspr_jax.config.robot import RobotFile, resolve_robot
from cspr_jax.config.trajectory import NamedAmplitude
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.feasibility.platform.demands import pose_extremes
from cspr_jax.feasibility.point_mass.demands import Extremes, extremes
from cspr_jax.feasibility.problem import Problem
from cspr_jax.plans.choices import best_amplitude, chosen_depth
from cspr_jax.plans.platform_sequence import Poses
from cspr_jax.plans.sequence import Sequence, sequence_of
from cspr_jax.problem import build_amplitude, build_limits, motion_kind, platform_of, point_mass_of
from cspr_jax.robots.reference_pose import aligned, reference_pose
from cspr_jax.search.answers import Answers
from cspr_jax.trajectories.amplitudes import Amplitude, derivatives
from cspr_jax.trajectories.hypocycloid import Segment
from cspr_jax.trajectories.platform_segment import PoseSegment

# A third derivative that changes more than this, relative to its largest value, just beside a knot makes tensions jump.
JUMP, NEAR_KNOT = 1e-6, 1e-12
_JUMPS = 'amplitude {}: accelerations and tensions jump where its third derivative does; "effective-c3" has no jump'
# Where a search for z0 takes "best" epsilon to be, until it is chosen.
FIRST_EPSILON = 0.2


@dataclasses.dataclass(frozen=True)
class Plan:
    """A planned sequence.

    Fields:
        spec: the robot as its file has it.
        keys: the plan file.
        problem: robot, limits, amplitude function; of a platform its reference too.
        z0: m.
        frame: of the robot file.
        points: (n + 1, 3) in the axes of the robot file, m.
        answers: of the n segments.
        extremes: of the n segments; `lowest` is z in the axes of the robot file.
        segments: of the n segments, each of the parity of its number of arcs; in the kernels' coordinates.
        backwards: (n,) whether a segment runs against its normalised time, from its target back to rest.
        warnings: what its user should know, one line each.
        text: of the plan file; empty for a plan that has none.
    """

    spec: RobotFile
    keys: PlanFile
    problem: Problem | Problem
    z0: float
    frame: Frame
    points: np.ndarray
    answers: Answers
    extremes: Extremes
    segments: Segment | PoseSegment
    backwards: np.ndarray
    warnings: tuple[str, ...] = ()
    text: str = ""


def plan(path: Path) -> Plan:
    """Plan the sequence of a plan file.

    Args:
        path: the file.

    Returns:
        the plan, feasible or not.

    Raises:
        ConfigError: a mistake in the file.
    """
    text = read_text(path)
    return dataclasses.replace(plan_of(read_plan(text, path), path), text=text)


def plan_of(keys: PlanFile, path: Path) -> Plan:
    """Plan the sequence of a plan file's content.

    Args:
        keys: the content.
        path: of the file, named in errors.

    Returns:
        the plan, feasible or not.

    Raises:
        ConfigError: a mistake in it.
    """
    spec = resolve_robot(keys.robot, path, path.parent)
    if spec.is_platform:
        return _plan_of_poses(spec, keys, path)
    sequence = sequence_of(spec, keys, path)
    robot = point_mass_of(spec, keys, path)
    limits = build_limits(spec, keys, keys.floor, path)
    amplitude = build_amplitude(keys, path, epsilon=FIRST_EPSILON)
    problem = Problem(robot, limits, amplitude)
    z0 = chosen_depth(problem, sequence)
    if isinstance(keys.amplitude, NamedAmplitude) and keys.amplitude.epsilon == "best":
        amplitude, z0 = best_amplitude(problem, sequence, z0)
        problem = problem._replace(amplitude=amplitude)
    points = sequence.points(z0)
    depth = np.full(len(sequence), z0)
    answers = sequence.answers(problem, points, depth)
    segments = sequence.segments(problem, points, depth, answers)
    asked = extremes(problem, segments, answers.tried_arcs, keys.samples)
    return _plan(sequence, problem, z0, points, (answers, asked, segments))


def _plan(sequence: Sequence, problem, z0: float, points: np.ndarray, found: tuple, warnings: tuple = ()) -> Plan:
    # What leaves the kernels is in the axes of the robot file.
    frame, (answers, asked, segments) = sequence.frame, found
    asked = dataclasses.replace(asked, lowest=frame.height(asked.lowest))
    places, backwards = frame.outward(points), sequence.backwards
    return Plan(sequence.spec, sequence.keys, problem, z0, frame, places, answers, asked, segments, backwards, warnings)


def _jumps(amplitude: Amplitude) -> bool:
    # Whether A''' jumps between pieces.
    sides = [derivatives(amplitude, jnp.asarray(amplitude.knots) + s, order=3)[3] for s in (-NEAR_KNOT, NEAR_KNOT)]
    return bool((np.abs(np.asarray(sides[1] - sides[0])) > JUMP * float(amplitude.largest[3])).any())


def _plan_of_poses(spec: RobotFile, keys: PlanFile, path: Path) -> Plan:
    # Of a rigid platform, thesis chapter 3.
    sequence = Poses(spec, keys, path)
    robot = platform_of(spec, keys, path)
    limits = build_limits(spec, keys, keys.floor, path)
    amplitude = build_amplitude(keys, path, epsilon=FIRST_EPSILON)
    problem = Problem(aligned(robot)[0], limits, amplitude)
    sequence.check_poses(problem)
    z0 = chosen_depth(problem, sequence)
    try:
        reference_pose(robot, z0)
    except InputError as error:
        raise ConfigError(path, spec.typed(error)) from error
    if isinstance(keys.amplitude, NamedAmplitude) and keys.amplitude.epsilon == "best":
        amplitude, z0 = best_amplitude(problem, sequence, z0)
        problem = problem._replace(amplitude=amplitude)
    points, depth = sequence.points(z0), np.full(len(sequence), z0)
    answers = sequence.answers(problem, points, depth)
    segments = sequence.segments(problem, points, depth, answers)
    kind = motion_kind(keys)
    asked = pose_extremes(problem, segments, answers.tried_arcs, keys.samples, kind=kind)
    warnings = (_JUMPS.format(amplitude.name),) if kind.variable and _jumps(amplitude) else ()
    return _plan(sequence, problem, z0, points, (answers, asked, segments), warnings)
