"""Criteria of a checked motion that are on their limits, as far as its samples show.

A motion that touches a limit, such as the fastest one, is above or below it between samples by less than the error of
interpolation. That error is estimated by interpolation through every second sample.
"""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cspr_jax.build.scenes import scene_of
from cspr_jax.curves.interpolation import thinned
from cspr_jax.curves.spline import Spline
from cspr_jax.motion.cause import Cause
from cspr_jax.plans.planning import PlannedMotions
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.verification.bounds.block_slacks import block_slacks
from cspr_jax.verification.proved_answers import MotionProof, cause_of
from cspr_jax.verification.robustness.motion_tolerances import states_as_bounds

# Criteria are compared with the error of interpolation if their smallest slack, over its scale, is below this.
NEAR = 1e-3
# Number of samples per piece, and largest number of pieces, for comparing motions.
SAMPLES, MAX_PIECES = 8, 256


class TouchedLimit(NamedTuple):
    """A criterion that a motion meets or misses by less than the error of its interpolation.

    Fields:
        cause: the criterion with its numbers, time and words.
        tolerance: error of the interpolation, in the unit of the cause.
    """

    cause: Cause
    tolerance: float

    def to_dict(self) -> dict[str, Any]:
        """The criterion as the JSON of a check has it."""
        return self.cause.to_dict() | {"tolerance": self.tolerance}

    @property
    def text(self) -> str:
        """The criterion in words."""
        return (
            f"on its limit, as far as its rows tell: {self.cause.text}; the motion through every second row differs "
            f"by {self.tolerance:.2g} {self.cause.unit} there"
        )


def limits_touched(plan: PlannedMotions, case: MotionProof) -> list[TouchedLimit]:
    """Criteria that are on their limits, as far as samples of positions and their rates show."""
    motion = plan.legs[0].motions[0] if plan.legs[0].motions else None
    if not isinstance(motion, Spline) or motion.interpolation != "hermite" or len(motion.knots) < 4:
        return []
    rows: list[TouchedLimit] = []
    for k in np.argsort(case.proof.high / case.scales).tolist():
        if case.criteria[k].flag == Verdict.MOTOR_OVER_TORQUE_RMS:  # a criterion of no single time
            continue
        if abs(case.proof.high[k]) > NEAR * case.scales[k] or case.criteria[k].flag.text in [
            row.cause.criterion for row in rows
        ]:
            continue
        slack, tolerance = _compared(plan, motion, case, k)
        if abs(slack) <= tolerance:
            rows.append(TouchedLimit(cause_of(case, k, plan.frame), tolerance))
    return rows


def _compared(plan: PlannedMotions, motion: Spline, case: MotionProof, k: int) -> tuple[float, float]:
    # Smallest slack of a criterion, and the largest change of its slack if every second sample is left out, near the
    # times at which the criterion fails or its slack is smallest.
    taus = _sample_times(np.asarray(motion.knots), case.proof.failing[k], float(case.proof.when[k]))
    scene = scene_of(plan.problem.robot, plan.robot_file, plan.frame, plan.keys, Path("motion"), trajectory=plan.keys)

    def slacks(curve: Spline) -> np.ndarray:
        states = states_as_bounds(curve, taus)
        return block_slacks(plan.problem.robot, plan.problem.limits, lambda *_: states, taus, taus, scene).high[:, k]

    fine = slacks(motion)
    away = np.min([np.abs(slacks(thinned(motion, first)) - fine) for first in (1, 2)], axis=0)
    return min(float(fine.min()), float(case.proof.high[k])), float(away.max())


def _sample_times(knots: np.ndarray, failing: np.ndarray, when: float) -> np.ndarray:
    # Normalised times in the pieces in which a criterion fails, or its slack is smallest, and in their neighbours.
    spans = np.concatenate([failing, [[when, when]]])
    first, last = (np.searchsorted(knots, side) for side in spans.T)
    pieces = np.unique(np.concatenate([np.arange(i - 2, j + 2) for i, j in zip(first, last, strict=True)]))
    pieces = pieces[(pieces >= 0) & (pieces < len(knots) - 1)]
    pieces = pieces[np.unique(np.linspace(0, len(pieces) - 1, MAX_PIECES).astype(int))]
    fractions = (np.arange(SAMPLES) + 0.5) / SAMPLES
    return (knots[pieces, None] + np.diff(knots)[pieces, None] * fractions).ravel() / knots[-1]
