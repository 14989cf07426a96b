"""Least durations along straight lines from rest to rest: from arrays of ends to arrays of results.

If all spools lie in one plane and there are no limits, motions by the formulas of the S-model need no proof: they meet
the bounds of every face (see `families.lines.s_model`) with a margin above rounding. Otherwise, and where p or T - p is
so short that its digits are lost, every motion is proved individually.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from cspr_jax.families.lines.durations import Rule, names_of
from cspr_jax.families.lines.fastest import fastest
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.shapes import Float
from cspr_jax.schema.columns import Columns
from cspr_jax.schema.verdicts import Verdict


@dataclasses.dataclass(frozen=True)
class LeastTimes(Columns):
    """Least durations along n lines; NumPy arrays, (n,) each.

    Fields:
        verdict: flags of `Verdict`; 0 where there is a feasible motion.
        duration: T, s; NaN where there is none, 0 where both ends are the same position.
        acceleration_time: p, s.
        least_duration: lower bound of the time of any motion along the line, s.
        duration_ratio: duration over least duration.
        rest_margin: smaller margin of rest at the two ends, m/s^2; NaN where an end is not below the spools.
        active_up: number, from 1 in the order of `names`, of the bound that limits the acceleration; 0: none.
        active_down: number of the bound that limits the braking; 0: none.
        names: names of the bounds.
    """

    verdict: np.ndarray
    duration: np.ndarray
    acceleration_time: np.ndarray
    least_duration: np.ndarray
    duration_ratio: np.ndarray
    rest_margin: np.ndarray
    active_up: np.ndarray
    active_down: np.ndarray
    names: tuple[str, ...]


def least_times(
    problem: Problem,
    starts: Float[np.ndarray, "n 3"],
    ends: Float[np.ndarray, "n 3"],
    *,
    law: str = "s-curve",
    rule: Rule = "optimum",
    max_acceleration: float = np.inf,
) -> LeastTimes:
    """Least durations along straight lines."""
    timings, results, moves = fastest(
        problem, starts, ends, law=law, rule=rule, max_acceleration=max_acceleration, sharp=False
    )
    # A refuted motion has no duration; the duration is 0 s where both ends are the same position.
    moves &= (results.verdict == 0) | (results.verdict == Verdict.UNDECIDED.value)
    nothing = np.where((results.verdict == 0) & ~moves, 0.0, np.nan)
    duration, minimum = (np.where(moves, x, nothing) for x in (timings.duration, timings.lower_bound))
    with np.errstate(invalid="ignore", divide="ignore"):
        relative = np.where(minimum > 0.0, duration / minimum, np.nan)
    return LeastTimes(
        verdict=results.verdict,
        duration=duration,
        acceleration_time=np.where(moves, timings.ratio, 0.5) * duration,
        least_duration=minimum,
        duration_ratio=relative,
        rest_margin=np.where(timings.depth > 0.0, timings.rest, np.nan),
        active_up=np.where(moves, timings.up + 1, 0).astype(np.int16),
        active_down=np.where(moves, timings.down + 1, 0).astype(np.int16),
        names=names_of(problem.robot, problem.limits),
    )
