"""A plan as curves over time: lengths, poses and tensions at any times, held at both ends."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from cspr_jax.numerics.linear.frames import IDENTITY
from cspr_jax.numerics.linear.rotations import products
from cspr_jax.numerics.shapes import Float
from cspr_jax.outputs.motion_files import rows_at
from cspr_jax.plans.planning import PlannedMotions

SAMPLES, SECONDS = 2000, 10.0  # samples of a segment for each so many seconds of the longest one

Curve = Callable[[np.ndarray], np.ndarray]


@dataclasses.dataclass(frozen=True)
class PlanCurves:
    """Curves of a plan; poses are those of the kernels. Cubic between samples of values and rates.

    Fields:
        duration: s.
        lengths: (n, m) lengths of the cables at times, m.
        rates: (n, m) m/s; 0 before and behind the plan.
        tensions: (n, m) N; of a pair of cables, their sum.
        tensions_each: (n, 2 m) N, of each cable of pairs; without pairs the same as `tensions`.
        poses: positions of the mass centre (n, 3), m, and quaternions (n, 4).
    """

    duration: float
    lengths: Curve
    rates: Curve
    tensions: Curve
    tensions_each: Curve
    poses: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


def curves_of(plan: PlannedMotions) -> PlanCurves:
    """Curves of a plan with a finite motion."""
    from scipy.interpolate import CubicHermiteSpline  # few commands need it

    durations = plan.answers.duration
    count = SAMPLES * int(np.ceil(durations.max() / SECONDS))
    columns = rows_at(plan, [np.linspace(0.0, 1.0, count + 1)] * len(durations))
    times, first = np.unique(columns["t"], return_index=True)
    columns = {name: values[first] for name, values in columns.items()}
    end = float(durations.sum())

    def held(curve: Curve) -> Curve:
        return lambda at: np.asarray(curve(np.clip(at, 0.0, end)))

    lengths = CubicHermiteSpline(times, columns["length"], columns["rate"])
    positions = CubicHermiteSpline(
        times, plan.frame.inward(columns["position"]), plan.frame.rotated(columns["velocity"])
    )
    quaternions = _quaternions(plan, times, columns)
    rates = lengths.derivative()

    def poses(at: np.ndarray) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 4"]]:
        inside = np.clip(at, 0.0, end)
        turns = np.asarray(quaternions(inside))
        return np.asarray(positions(inside)), turns / np.linalg.norm(turns, axis=1, keepdims=True)

    def moving(at: np.ndarray) -> np.ndarray:
        return np.where(((at >= 0.0) & (at <= end))[:, None], rates(np.clip(at, 0.0, end)), 0.0)

    def between(rows: np.ndarray) -> Curve:
        return lambda at: np.stack([np.interp(at, times, column) for column in rows.T], axis=1)

    tensions, each = between(columns["tension"]), between(columns.get("tension_each", columns["tension"]))
    return PlanCurves(end, held(lengths), moving, tensions, each, poses)


def _quaternions(plan: PlannedMotions, times: np.ndarray, columns: dict[str, np.ndarray]) -> Curve:
    from scipy.interpolate import CubicHermiteSpline  # few commands need it

    if "quaternion" not in columns:
        return lambda at: np.broadcast_to(np.array(IDENTITY), (len(at), 4))
    turns = np.asarray(plan.frame.rotated_quaternions(columns["quaternion"]))
    # The sign of quaternions may jump where segments meet.
    flips = np.cumprod(np.where(np.r_[1.0, (turns[1:] * turns[:-1]).sum(1)] < 0.0, -1.0, 1.0))
    turns = turns * flips[:, None]
    spin = np.asarray(plan.frame.rotated(columns["omega"]))
    return CubicHermiteSpline(times, turns, 0.5 * products(np.insert(spin, 0, 0.0, axis=1), turns))
