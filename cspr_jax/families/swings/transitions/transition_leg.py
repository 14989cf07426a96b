"""Leg of transitions, chapter 1: from rest to a target, swings at the target, back to rest."""

import jax
import numpy as np

from cspr_jax.config.keys.pose import Pose
from cspr_jax.errors import ConfigError, shown
from cspr_jax.families.swings.hypocycloid import Hypocycloid, Segment
from cspr_jax.families.swings.transitions.oscillations import minimum_oscillations, transitions_to
from cspr_jax.families.swings.transitions.transition import steady
from cspr_jax.motion.answers import Answers
from cspr_jax.motion.leg import Leg, each
from cspr_jax.motion.motion import Backwards, Motion
from cspr_jax.motion.problem import Problem
from cspr_jax.motion.waypoints import Waypoints
from cspr_jax.numerics.elementary import as_float64


class Transitions(Leg):
    """Rest and targets, joined by transitions and by swings of constant amplitude; see `Leg`."""

    step = 2

    def __init__(self, waypoints: Waypoints) -> None:
        """Refuse pairs of poses that a transition cannot join."""
        super().__init__(waypoints)
        pairs = list(zip(waypoints.poses[:-1], waypoints.poses[1:], strict=True))
        for i, (start, end) in enumerate(pairs):
            _check_pair(waypoints, i, start, end)
        # A transition to rest is one from rest, reversed in time, (1.56) to (1.58).
        self._backwards = np.array([end.rest for _, end in pairs])
        self._steady = np.array([not (start.rest or end.rest) for start, end in pairs])
        # Index of the pose that is the target of each segment.
        self._target = np.arange(len(pairs)) + np.where(self._backwards, 0, 1)

    def join(self, problem: Problem, z0: float) -> tuple[Answers, list[Motion]]:
        """Join the poses; see `Leg.join`."""
        answers, segments = self._answers_and_segments(problem, np.array([z0]))
        motions: list[Motion] = []
        for i, segment in enumerate(each(segments, len(self))):
            motion = Hypocycloid(segment, problem.amplitude, as_float64(answers.tried_arcs[i]))
            motions.append(Backwards(motion) if self._backwards[i] else motion)
        return answers, motions

    def answers(self, problem: Problem, depths: np.ndarray) -> Answers:
        """Answers for several depths; see `Leg.answers`."""
        return self._answers_and_segments(problem, depths)[0]

    def _answers_and_segments(self, problem: Problem, depths: np.ndarray) -> tuple[Answers, Segment]:
        count, z0 = len(depths), np.repeat(depths, len(self))
        targets = self.waypoints.points(depths)[:, self._target].reshape(-1, 3)
        is_steady = np.tile(self._steady, count)
        segments = _with_swings(transitions_to(problem, targets, z0), is_steady)
        answers = minimum_oscillations(
            problem,
            segments,
            z0,
            max_arcs=self.waypoints.max_arcs,
            arcs=np.tile(self.waypoints.arcs, count),
            steady=is_steady,
        )
        return answers, segments


def _with_swings(segments: Segment, is_steady: np.ndarray) -> Segment:
    # Replace steady transitions by the swing of constant amplitude at their target.
    def choose(swing, transition):
        swing = np.broadcast_to(swing, np.shape(transition))
        return np.where(is_steady.reshape(-1, *[1] * (np.ndim(transition) - 1)), swing, transition)

    return jax.tree.map(choose, steady(segments), segments)


def _check_pair(waypoints: Waypoints, i: int, start: Pose, end: Pose) -> None:
    name, path = waypoints.name(i + 1), waypoints.path
    if start.rest and end.rest:
        raise ConfigError(path, f"{name}.rest = true: must follow a target, not another rest")
    if not start.rest and not end.rest and start.position != end.position:
        raise ConfigError(
            path,
            f"{name}.position = {shown(end.position)}: must be that of {waypoints.name(i)}, or at rest, in a plan of "
            'transitions (family = "hypocycloid-standard" joins two targets)',
        )
    if end.arcs is not None and end.arcs % 2:
        raise ConfigError(path, f"{name}.arcs = {end.arcs}: must be even in a plan of transitions")
