"""Verdicts that rest on a proof, for several trajectory families."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from cspr_jax.motion.problem import Problem, touchable
from cspr_jax.numerics.shapes import Float

# A motion with a slack below this may touch a limit.
NEARLY = 1e-4
# Limits of speeds, whose slacks are proved for the squares of speeds.
SPEEDS = ("cable_speed_max", "speed_max")


@dataclasses.dataclass(frozen=True)
class Verdicts:
    """Verdicts of n motions, (n,) each.

    Fields:
        verdict: flags of `Verdict`; 0 if proved.
        margin: smallest attained slack of taut cables: for lines a distance from facets, m/s^2; for Bezier segments a
            dimensionless number, which includes the depth below the spools.
        bound: proved lower bound of the margin.
        limit_margin: smallest slack of the limits, dimensionless; inf without limits.
    """

    verdict: np.ndarray
    margin: np.ndarray
    bound: np.ndarray
    limit_margin: np.ndarray

    def replace(self, rows: np.ndarray, part: "Verdicts") -> None:
        """Replace the verdicts of some of the motions."""
        for name, values in vars(part).items():
            getattr(self, name)[rows] = values


def with_touched(
    problem: Problem, strict: Verdicts, verdicts_of: Callable[[Problem, np.ndarray], Verdicts]
) -> Verdicts:
    """Verdicts, by wider limits for motions that may touch a limit; margins do not change."""
    rows = np.flatnonzero((strict.verdict != 0) & (np.abs(strict.limit_margin) < NEARLY))
    if len(rows):
        strict.verdict[rows] = verdicts_of(touchable(problem), rows).verdict
    return strict


def plain_slack(
    name: str, values: Float[np.ndarray, "..."], squared: tuple[str, ...] = SPEEDS
) -> Float[np.ndarray, "..."]:
    """Slack of a limit in the form of results."""
    return 1.0 - np.sqrt(np.maximum(1.0 - values, 0.0)) if name in squared else values
