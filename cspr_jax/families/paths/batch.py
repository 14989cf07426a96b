"""Least times along many paths at a time."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from cspr_jax.curves.spline import Spline, chained
from cspr_jax.families.paths.geometry.section import Section, SectionSettings
from cspr_jax.families.paths.least_time.least_time import LeastTime, least_times_along
from cspr_jax.motion.answers import Answers
from cspr_jax.motion.problem import Problem
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.verification.proved_answers import proved_answers


@dataclasses.dataclass(frozen=True)
class PathTimes:
    """The fastest motions along n paths.

    Fields:
        answers: proved verdicts and margins.
        duration: (n,) s; inf where no motion is proved feasible.
        lower_bound: (n,) rigorous lower bound of the time of any motion forward along the path with the same stops, s;
            NaN if none is found.
        motions: motions over time, from the centroid of the spools; slow ones where none is feasible.
        sections: (n,) motions along the sections of each path.
    """

    answers: Answers
    duration: np.ndarray
    lower_bound: np.ndarray
    motions: list[Spline]
    sections: list[list[LeastTime]]


def least_times(
    problem: Problem, scene: Scene | None, paths: Sequence[Sequence[Section]], grid: int, ramp_time: float
) -> PathTimes:
    """Find the fastest motions along paths."""
    flat = [section for path in paths for section in path]
    motions_along = list(least_times_along(problem, flat, [SectionSettings(grid, ramp_time)] * len(flat)))
    ends = np.cumsum([len(path) for path in paths])
    sections = [motions_along[end - len(path) : end] for path, end in zip(paths, ends.tolist(), strict=True)]
    motions = [chained([section.motion for section in path]) for path in sections]
    answers = proved_answers(problem, motions, scene)
    duration = np.where(answers.verdict == 0, answers.duration, np.inf)
    bounds = np.array([sum(section.lower_bound for section in path) for path in sections], float)
    return PathTimes(answers, duration, bounds, motions, sections)
