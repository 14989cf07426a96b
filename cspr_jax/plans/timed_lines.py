"""Leg of straight lines from rest to rest: the S-model, the quintic, the cubic."""

from typing import Any

import numpy as np

from cspr_jax.errors import ConfigError
from cspr_jax.feasibility.point_mass.line_faces import in_one_plane
from cspr_jax.feasibility.point_mass.line_limits import open_limits
from cspr_jax.feasibility.problem import Problem
from cspr_jax.plans.leg import Leg
from cspr_jax.plans.stops import Stops
from cspr_jax.robots.point_mass import AT_P0, spool_radius
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.search.answers import Answers
from cspr_jax.search.timed_lines import LineAnswers, timed_lines
from cspr_jax.trajectories.motion import Motion


class TimedLines(Leg):
    """Any places, joined by straight lines in the least time of their law; see `Leg`."""

    def __init__(self, stops: Stops) -> None:
        """Refuse what a line knows nothing of."""
        super().__init__(stops)
        for i, pose in enumerate(stops.poses[1:], start=1):
            if pose.arcs is not None:
                raise ConfigError(stops.path, f'{stops.name(i)}.arcs: must be absent with family = "{stops.family}"')

    def check(self, problem: Problem) -> None:
        """Refuse spools that are not in one plane; see `Leg.check`."""
        if not in_one_plane(problem.robot):
            place, key = self.stops.spec.placed("base_points", self.stops.path)
            raise ConfigError(
                place, f'{key}: must lie in one plane for family "{self.stops.family}" (others do not exist yet)'
            )

    def join(self, problem: Problem, z0: float) -> tuple[Answers, list[Motion]]:
        """Join the places; see `Leg.join`."""
        answers, motions = self._solved(problem, z0)
        return answers, list(motions)

    def answers(self, problem: Problem, depths: np.ndarray) -> Answers:
        """Answers for several depths, on which they depend only by rests in P0; see `Leg.answers`."""
        parts = [self._solved(problem, float(z0))[0] for z0 in depths]
        columns = [{name: value for name, value in vars(part).items() if name != "names"} for part in parts]
        every: dict[str, Any] = {name: np.concatenate([column[name] for column in columns]) for name in columns[0]}
        return LineAnswers(**every, names=parts[0].names)

    def _solved(self, problem: Problem, z0: float):
        points, keys = self.stops.points(z0), self.stops.keys
        size = float(spool_radius(problem.robot))
        for i, apart in enumerate(np.linalg.norm(np.diff(points, axis=0), axis=1), start=1):
            if not apart > AT_P0 * size:
                raise ConfigError(
                    self.stops.path,
                    f"{self.stops.name(i)}.position: must be another than that of {self.stops.name(i - 1)}, for a line "
                    "between them",
                )
        largest = np.inf if keys.max_acceleration is None else keys.max_acceleration
        answers, motions = timed_lines(
            problem,
            points[:-1],
            points[1:],
            law=self.stops.family,
            rule=keys.rule or "optimum",
            max_acceleration=largest,
        )
        for i, verdict in enumerate(answers.verdict):
            if verdict == Verdict.NOT_FINITE.value:
                raise ConfigError(
                    self.stops.path,
                    f"max_acceleration is missing: nothing else bounds the acceleration up to {self.stops.name(i + 1)}",
                )
        return answers, motions

    def warnings(self, problem: Problem) -> list[str]:
        """Say that limits are looked at, not optimised; see `Leg.warnings`."""
        if not open_limits(problem.limits):
            return []
        names = ", ".join(row.name for row in open_limits(problem.limits))
        return [f'{names}: only looked at in samples with family = "{self.stops.family}": refuted or undecided']
