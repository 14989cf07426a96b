"""Leg of straight lines from rest to rest, by the S-model, a quintic or a cubic."""

import numpy as np

from cspr_jax.errors import ConfigError
from cspr_jax.families.lines.timed_lines import LineAnswers, motions_of, timed_lines
from cspr_jax.motion.answers import Answers
from cspr_jax.motion.leg import Leg
from cspr_jax.motion.motion import Motion
from cspr_jax.motion.problem import Problem
from cspr_jax.motion.waypoints import Waypoints
from cspr_jax.robots.model.point_mass import AT_P0, in_one_plane, spool_radius
from cspr_jax.schema.verdicts import Verdict


class TimedLines(Leg):
    """Any positions, joined by straight lines in the least time of their law; see `Leg`."""

    knows_motor_speeds = True

    def __init__(self, waypoints: Waypoints) -> None:
        """Refuse numbers of arcs, which a line does not have."""
        super().__init__(waypoints)
        self._refuse("arcs")

    def check(self, problem: Problem) -> None:
        """Refuse the rule of the thesis if the spools are not in one plane; see `Leg.check`."""
        if self.waypoints.plan_file.rule == "thesis" and not in_one_plane(problem.robot):
            path, key = self.waypoints.robot_file.placed("base_points", self.waypoints.path)
            raise ConfigError(path, f'{key}: must lie in one plane with rule = "thesis"')

    def join(self, problem: Problem, z0: float) -> tuple[Answers, list[Motion]]:
        """Join the positions; see `Leg.join`."""
        starts, ends = self._ends(problem, np.array([z0]))
        answers = self._solved(problem, starts, ends)
        return answers, list(motions_of(answers, starts, ends, law=self.waypoints.family))

    def answers(self, problem: Problem, depths: np.ndarray) -> Answers:
        """Answers for many depths; they matter only for rests in P0; see `Leg.answers`."""
        return self._solved(problem, *self._ends(problem, depths))

    def _ends(self, problem: Problem, depths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        # Return the starts and the ends of all lines, (n_depths * n_lines, 3) each.
        points = np.stack([self.waypoints.points(float(z0)) for z0 in depths])
        radius = float(spool_radius(problem.robot))
        distances = np.linalg.norm(np.diff(points, axis=1), axis=2)
        for i in (np.flatnonzero((distances <= AT_P0 * radius).any(0)) + 1).tolist():
            raise ConfigError(
                self.waypoints.path,
                f"{self.waypoints.name(i)}.position: must be another than that of "
                f"{self.waypoints.name(i - 1)}, for a line "
                "between them",
            )
        return points[:, :-1].reshape(-1, 3), points[:, 1:].reshape(-1, 3)

    def _solved(self, problem: Problem, starts: np.ndarray, ends: np.ndarray) -> LineAnswers:
        spec, law = self.waypoints.plan_file, self.waypoints.family
        largest = np.inf if spec.max_acceleration is None else spec.max_acceleration
        rule = spec.rule or "optimum"
        answers = timed_lines(problem, starts, ends, law=law, rule=rule, max_acceleration=largest)
        unbounded = np.flatnonzero(answers.verdict == Verdict.NOT_FINITE.value)
        for i in (unbounded % len(self.waypoints) + 1).tolist():
            raise ConfigError(
                self.waypoints.path,
                f"max_acceleration is missing: nothing else bounds the acceleration up to {self.waypoints.name(i)}",
            )
        return answers
