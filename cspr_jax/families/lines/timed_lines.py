"""Straight lines from rest to rest in the least time: from arrays of ends to answers."""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import numpy as np

from cspr_jax.families.lines.durations import Rule, names_of
from cspr_jax.families.lines.fastest import fastest
from cspr_jax.families.lines.motion import TimedLine
from cspr_jax.families.lines.verdicts import laws_of
from cspr_jax.motion.answers import Answers
from cspr_jax.motion.limits import are_of_motors
from cspr_jax.motion.problem import Problem, search_problem
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.shapes import Float


@dataclasses.dataclass(frozen=True)
class LineAnswers(Answers):
    """Answers of straight lines.

    Fields:
        acceleration_time: (n,) p, s.
        least_duration: (n,) lower bound of the time of any motion along the line, s.
        active: (n, 2) numbers, from 1, of the bounds that limit the acceleration and the braking; 0: none.
        names: names of the bounds, in the order of their numbers.
    """

    acceleration_time: np.ndarray
    least_duration: np.ndarray
    active: np.ndarray
    names: tuple[str, ...] = ()

    def details(self, i: int) -> dict[str, Any]:
        """Details of a segment; see `Answers.details`."""
        active = dict.fromkeys(self.names[k - 1] for k in self.active[i] if k > 0)
        return super().details(i) | {
            "acceleration_time": float(self.acceleration_time[i]),
            "active": list(active),
            "least_duration": float(self.least_duration[i]),
            "arcs": None,
            "tried_arcs": None,
        }


def timed_lines(
    problem: Problem,
    starts: Float[np.ndarray, "n 3"],
    ends: Float[np.ndarray, "n 3"],
    *,
    law: str = "s-curve",
    rule: Rule = "optimum",
    max_acceleration: float = np.inf,
) -> LineAnswers:
    """The fastest motions along straight lines by a law of time, proved."""
    timings, results, moves = fastest(
        problem, starts, ends, law=law, rule=rule, max_acceleration=max_acceleration, sharp=True
    )
    none, nothing = np.zeros(len(starts), int), np.full(len(starts), np.nan)
    duration = np.where(moves, timings.duration, np.nan)
    return LineAnswers(
        none,
        none,
        results.verdict,
        duration,
        results.margin,
        results.bound,
        results.limit_margin,
        *(nothing, nothing, nothing),
        np.where(moves, timings.ratio, 0.5) * duration,
        np.where(moves, timings.lower_bound, np.nan),
        np.stack([np.where(moves, x + 1, 0) for x in (timings.up, timings.down)], axis=1),
        _names(problem),
        margin_unit="m/s^2",
    )


def _names(problem: Problem) -> tuple[str, ...]:
    # Speeds of cables stand for those of motors.
    limits, searched = problem.limits, search_problem(problem).limits
    names = names_of(problem.robot, searched)
    if limits.motor_speed_max is None:
        return names
    of_motors = are_of_motors(limits, searched)
    sources = (of_motors.any(), "motor_speed_max"), (not of_motors.all(), "cable_speed_max")
    shown = " or ".join(name for is_met, name in sources if is_met)
    return tuple(shown if name == "cable_speed_max" else name for name in names)


def motions_of(
    answers: LineAnswers, starts: Float[np.ndarray, "n 3"], ends: Float[np.ndarray, "n 3"], *, law: str
) -> list[TimedLine]:
    """Motions along straight lines."""
    with np.errstate(invalid="ignore"):
        ratios = answers.acceleration_time / answers.duration
    laws = laws_of(law, np.where(np.isfinite(ratios), ratios, 0.5))
    columns = (starts, ends - starts, laws, answers.duration)
    return [TimedLine(*jax.tree.map(lambda x, i=i: as_float64(x[i]), columns)) for i in range(len(starts))]
