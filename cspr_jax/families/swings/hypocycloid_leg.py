"""Leg of standard hypocycloids between any points: chapter 2."""

import numpy as np

from cspr_jax.errors import ConfigError
from cspr_jax.families.swings.arcs import arcs_and_segments
from cspr_jax.families.swings.hypocycloid import Hypocycloid, Segment
from cspr_jax.motion.answers import Answers
from cspr_jax.motion.leg import Leg, each
from cspr_jax.motion.motion import Motion
from cspr_jax.motion.problem import Problem
from cspr_jax.motion.waypoints import Waypoints
from cspr_jax.numerics.elementary import as_float64


class Hypocycloids(Leg):
    """Any points, joined by standard hypocycloids; see `Leg`."""

    step = 1

    def __init__(self, waypoints: Waypoints) -> None:
        """Refuse a key that belongs to transitions."""
        if waypoints.plan_file.inclination is not None:
            raise ConfigError(waypoints.path, 'inclination: must be absent unless family = "transition"')
        super().__init__(waypoints)

    def join(self, problem: Problem, z0: float) -> tuple[Answers, list[Motion]]:
        """Join the points; see `Leg.join`."""
        answers, segments = self._answers_and_segments(problem, np.array([z0]))
        pairs = zip(each(segments, len(self)), answers.tried_arcs, strict=True)
        return answers, [Hypocycloid(segment, problem.amplitude, as_float64(arcs)) for segment, arcs in pairs]

    def answers(self, problem: Problem, depths: np.ndarray) -> Answers:
        """Answers for several depths; see `Leg.answers`."""
        return self._answers_and_segments(problem, depths)[0]

    def _answers_and_segments(self, problem: Problem, depths: np.ndarray) -> tuple[Answers, Segment]:
        points = self.waypoints.points(depths)
        starts, ends = points[:, :-1].reshape(-1, 3), points[:, 1:].reshape(-1, 3)
        return arcs_and_segments(
            problem,
            starts,
            ends,
            np.repeat(depths, len(self)),
            max_arcs=self.waypoints.max_arcs,
            arcs=np.tile(self.waypoints.arcs, len(depths)),
        )
