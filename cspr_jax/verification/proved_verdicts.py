"""Verdicts that rest on a proof, whatever the trajectory family."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from cspr_jax.motion.problem import Problem, touchable
from cspr_jax.numerics.shapes import Float

# A motion may touch a limit if the slack is below this.
NEARLY = 1e-4
# Limits on speeds, whose proved slacks are those of the squares.
SPEEDS = ("cable_speed_max", "speed_max")


@dataclasses.dataclass(frozen=True)
class Verdicts:
    """Verdicts of n motions, (n,) each.

    Fields:
        verdict: flags of `Verdict`; 0 if proved.
        margin: smallest slack of taut cables that is attained: for lines a distance from facets, m/s^2; for Bezier
            segments a number without a unit, which includes the depth below the spools.
        bound: proved lower bound of the margin.
        limit_margin: smallest slack of the limits, without a unit; inf without limits.
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
    """Verdicts; motions that may touch a limit get those by the wider limits of proofs. Margins stay."""
    rows = np.flatnonzero((strict.verdict != 0) & (np.abs(strict.limit_margin) < NEARLY))
    if len(rows):
        strict.verdict[rows] = verdicts_of(touchable(problem), rows).verdict
    return strict


def plain_slack(
    name: str, values: Float[np.ndarray, "..."], squared: tuple[str, ...] = SPEEDS
) -> Float[np.ndarray, "..."]:
    """Slack of a limit as results show it."""
    return 1.0 - np.sqrt(np.maximum(1.0 - values, 0.0)) if name in squared else values
