"""Sequences of poses, and how the families of trajectories join them."""

import abc
from pathlib import Path
from typing import Generic, TypeVar

import jax
import numpy as np

from cspr_jax.arithmetic.frames import frame_of
from cspr_jax.config.plan import PlanFile, Pose
from cspr_jax.config.robot import RobotFile
from cspr_jax.errors import ConfigError, shown
from cspr_jax.feasibility.problem import Problem
from cspr_jax.robots.point_mass import rest_point
from cspr_jax.search.answers import Answers, pick
from cspr_jax.search.oscillations import minimum_oscillations, transitions_to
from cspr_jax.search.point_mass_arcs import minimum_arcs, segments_between
from cspr_jax.trajectories.hypocycloid import Segment
from cspr_jax.trajectories.transition import steady

SharedKind = TypeVar("SharedKind")
AnswersKind = TypeVar("AnswersKind", bound=Answers)
SegmentKind = TypeVar("SegmentKind")


class Sequence(abc.ABC, Generic[SharedKind, AnswersKind, SegmentKind]):
    """The poses of a plan, joined by the segments of one family.

    Args:
        spec: the robot.
        keys: the plan.
        path: named in errors.

    Raises:
        ConfigError: poses that the family cannot join.
    """

    def __init__(self, spec: RobotFile, keys: PlanFile, path: Path) -> None:
        """Refuse poses that are no points."""
        self.spec, self.keys, self.path = spec, keys, path
        self.frame = frame_of(spec.base_points, spec.z_axis)
        for i, pose in enumerate(keys.pose):
            if pose.position is None and not pose.rest:
                raise ConfigError(path, f"pose[{i}].position is missing: [x, y, z] in m, or rest = true")
        # A fixed number of arcs for each segment, 0 where free.
        self._arcs = np.array([pose.arcs or 0 for pose in keys.pose[1:]])
        self._largest = max(keys.max_arcs, int(self._arcs.max()))

    def __len__(self) -> int:
        return len(self._arcs)

    @property
    def targets(self) -> np.ndarray:
        """Poses that are not at rest, (n, 3) from the centroid of the spools, z down, m."""
        moving = [pose.position for pose in self.keys.pose if not pose.rest]
        return self.frame.inward(np.asarray(moving, float).reshape(-1, 3))

    @property
    def backwards(self) -> np.ndarray:
        """(n_segments,) whether a segment runs against its normalised time."""
        return np.zeros(len(self), bool)

    def points(self, z0: float) -> np.ndarray:
        """Poses as points of the kernels; those at rest are P0.

        Args:
            z0: m.

        Returns:
            (n_poses, 3) from the centroid of the spools, z down, m.
        """
        at_rest = rest_point(np.asarray(z0))
        return np.array([at_rest if pose.rest else self.frame.inward(pose.position) for pose in self.keys.pose])

    @abc.abstractmethod
    def answers(self, problem: SharedKind, points: np.ndarray, z0: np.ndarray) -> AnswersKind:
        """Answers of all segments, for one z0; those of point masses also for several at once.

        Args:
            problem: robot, limits and amplitude.
            points: (n_poses, 3), or (n_depths, n_poses, 3), m.
            z0: (n_segments,), or (n_depths * n_segments,), m.

        Returns:
            the answers, as long as `z0`.
        """

    @abc.abstractmethod
    def segments(self, problem: SharedKind, points: np.ndarray, z0: np.ndarray, answers: AnswersKind) -> SegmentKind:
        """The segments, each of the parity of its number of arcs.

        Args:
            problem: robot, limits and amplitude.
            points: (n_poses, 3) m.
            z0: (n_segments,) m.
            answers: as `answers` gave them.

        Returns:
            leaves (n_segments, ...).
        """


class Hypocycloids(Sequence[Problem, Answers, Segment]):
    """Any poses, joined by the standard hypocycloids of chapter 2; see `Sequence`."""

    def __init__(self, spec: RobotFile, keys: PlanFile, path: Path) -> None:
        """Refuse what belongs to transitions."""
        if spec.planar:
            raise ConfigError(
                path, f'family = "{keys.family}": must be "transition" for a planar robot ("{spec.name}")'
            )
        if keys.inclination is not None:
            raise ConfigError(path, 'inclination: must be absent unless family = "transition"')
        super().__init__(spec, keys, path)

    def answers(self, problem: Problem, points: np.ndarray, z0: np.ndarray) -> Answers:
        """Smallest numbers of arcs; see `Sequence.answers`."""
        starts, ends = points[..., :-1, :].reshape(-1, 3), points[..., 1:, :].reshape(-1, 3)
        fixed = np.tile(self._arcs, len(z0) // len(self))
        return minimum_arcs(problem, starts, ends, z0, max_arcs=self._largest, arcs=fixed)

    def segments(self, problem: Problem, points: np.ndarray, z0: np.ndarray, answers: Answers) -> Segment:
        """The segments; see `Sequence.segments`."""
        parities, _ = segments_between(problem, points[:-1], points[1:], z0)
        return pick(parities, np.arange(len(self)), answers.tried_arcs)


class Transitions(Sequence[Problem, Answers, Segment]):
    """Rest to a target, swings at it, back to rest: chapter 1; see `Sequence`."""

    def __init__(self, spec: RobotFile, keys: PlanFile, path: Path) -> None:
        """Refuse pairs of poses that a transition cannot join."""
        super().__init__(spec, keys, path)
        pairs = list(zip(keys.pose[:-1], keys.pose[1:], strict=True))
        for i, (start, end) in enumerate(pairs):
            _check_pair(i, start, end, path)
        for i, pose in enumerate(keys.pose):
            if spec.planar and pose.position is not None and pose.position[1] != 0.0:
                raise ConfigError(path, f"pose[{i}].position = {shown(pose.position)}: must have y = 0: a planar robot")
        self._backwards = np.array([end.rest for _, end in pairs])
        self._steady = np.array([not (start.rest or end.rest) for start, end in pairs])
        # Which pose is the target of each segment.
        self._target = np.arange(len(pairs)) + np.where(self._backwards, 0, 1)

    @property
    def backwards(self) -> np.ndarray:
        """(n_segments,) whether a segment runs against its normalised time: back to rest, (1.56) to (1.58)."""
        return self._backwards

    def answers(self, problem: Problem, points: np.ndarray, z0: np.ndarray) -> Answers:
        """Smallest numbers of oscillations; see `Sequence.answers`."""
        repeats = len(z0) // len(self)
        segments = self._between(problem, points, z0)
        return minimum_oscillations(
            problem,
            segments,
            z0,
            max_arcs=self._largest,
            arcs=np.tile(self._arcs, repeats),
            steady=np.tile(self._steady, repeats),
        )

    def segments(self, problem: Problem, points: np.ndarray, z0: np.ndarray, answers: Answers) -> Segment:
        """The segments; see `Sequence.segments`."""
        return self._between(problem, points, z0)

    def _between(self, problem: Problem, points: np.ndarray, z0: np.ndarray) -> Segment:
        segments = transitions_to(problem, points[..., self._target, :].reshape(-1, 3), z0)
        same = np.tile(self._steady, len(z0) // len(self))

        def choose(swing, transition):
            swing = np.broadcast_to(swing, np.shape(transition))
            return np.where(same.reshape(-1, *[1] * (np.ndim(transition) - 1)), swing, transition)

        return jax.tree.map(choose, steady(segments), segments)


def _check_pair(i: int, start: Pose, end: Pose, path: Path) -> None:
    if start.rest and end.rest:
        raise ConfigError(path, f"pose[{i + 1}].rest = true: must follow a target, not another rest")
    if not start.rest and not end.rest and start.position != end.position:
        raise ConfigError(
            path,
            f"pose[{i + 1}].position = {shown(end.position)}: must be that of pose[{i}], or at rest, in a plan of "
            'transitions (family = "hypocycloid-standard" joins two targets)',
        )
    if end.arcs is not None and end.arcs % 2:
        raise ConfigError(path, f"pose[{i + 1}].arcs = {end.arcs}: must be even in a plan of transitions")


_FAMILIES: dict[str, type[Hypocycloids] | type[Transitions]] = {
    "hypocycloid-standard": Hypocycloids,
    "transition": Transitions,
}


def sequence_of(spec: RobotFile, keys: PlanFile, path: Path) -> Hypocycloids | Transitions:
    """The sequence of a plan for a point mass.

    Args:
        spec: the robot.
        keys: the plan.
        path: named in errors.

    Returns:
        its poses, joined by its family.

    Raises:
        ConfigError: poses that the family cannot join.
    """
    if keys.family not in _FAMILIES:
        raise ConfigError(path, f'family = "{keys.family}": must be one of {", ".join(_FAMILIES)} for a point mass')
    if keys.beat is not None:
        raise ConfigError(path, f'beat = "{keys.beat}": must be absent for a point mass')
    for i, pose in enumerate(keys.pose):
        for key in ("tilt_torsion", "quaternion", "beta_hat"):
            if getattr(pose, key) is not None:
                raise ConfigError(path, f"pose[{i}].{key}: must be absent for a point mass")
    return _FAMILIES[keys.family](spec, keys, path)
