"""Noise in recorded samples, recognised by their differences."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from scipy.interpolate import CubicSpline

from cspr_jax.config.motions.table import MotionTable
from cspr_jax.curves.interpolation import continuous
from cspr_jax.numerics.shapes import Float

WINDOW = 96  # number of consecutive samples from which noise is estimated at a time
MAX_WINDOWS = 16
ORDERS = range(2, 13)  # orders of the differences that are tried
# Median of the absolute value of a normal variable, over its standard deviation.
MEDIAN = 0.6745
# Standard deviation of the second derivative of a cubic spline through white noise of unit variance at unit steps.
BENDING = 6.0
GRAVITY = 9.81
# Noise is reported if its accelerations exceed this fraction of gravity, or of the motion's own largest acceleration
# where that is larger, and the acceleration jumps by more than that at the given fraction of the samples.
ACCELERATION = 0.02
JUMP_FRACTION = 0.01
# Samples that scatter by more than this fraction of the range of positions are waypoints, unless their time steps are
# at most CLOSE, s.
SCATTER, CLOSE = 0.05, 0.02
DECIMALS = range(9)  # numbers of decimals to which files may be rounded
ONE_STEP = 0.1  # smallest fraction of the nonzero third differences of rounded samples that are one step
MIN_SAMPLES = 32


@dataclasses.dataclass(frozen=True)
class Noise:
    """Noise of samples.

    Fields:
        deviation: standard deviation, in the unit of the samples.
        bending: standard deviation of the second derivatives that the noise causes, per s^2.
        jump: median jump of the second derivative of the spline through the samples, per s^2.
        step: step to which the samples are rounded, if rounding is the noise; else 0.
    """

    deviation: float
    bending: float
    jump: float
    step: float


def noise_notes(table: MotionTable, *, radius: float = 1.0) -> list[str]:
    """Notes about noise that makes the accelerations of a table useless."""
    parts = [("accelerations jump", "m/s^2", "m", table.positions, 1.0)]
    if table.quaternions is not None:
        parts.append(("angular accelerations jump", "rad/s^2", "rad", 2.0 * continuous(table.quaternions), radius))
    lines = []
    for words, unit, short, values, arm in parts:
        noise = noise_of(table.times, values, arm=arm)
        if noise is not None:
            reason = f", since they are rounded to {noise.step:g}" if noise.step else ""
            lines.append(
                f"{words} by {noise.jump:.2g} {unit} between samples{reason}: smooth the record "
                f"(--smooth {noise.deviation:.1g}: its noise in {short}) or give fewer samples"
            )
    return lines


def noise_of(times: Float[np.ndarray, "n"], values: Float[np.ndarray, "n width"], *, arm: float = 1.0) -> Noise | None:
    """Noise of samples, if it spoils their second derivatives.

    Differences of a high order vanish along smooth motions, but not in noise; so the order with the smallest median
    shows the noise alone.
    """
    is_later = np.append(True, np.diff(times) > 0.0)
    times, values = times[is_later], values[is_later]
    if len(times) < MIN_SAMPLES:
        return None
    step = float(np.median(np.diff(times)))
    starts = np.unique(np.linspace(0, len(times) - WINDOW, MAX_WINDOWS).astype(int).clip(min=0))
    spread = max(_deviation(times[i : i + WINDOW], values[i : i + WINDOW]) for i in starts)
    rounding = _rounding(values)
    is_rounded = _is_of_rounding(rounding, spread, values)
    deviation = max(spread, rounding / math.sqrt(12.0) if is_rounded else 0.0)
    extent = float(np.ptp(values, axis=0).max())
    if deviation > SCATTER * extent and step > CLOSE:
        return None
    bending = BENDING * deviation / step**2
    if bending * arm <= ACCELERATION * GRAVITY:
        return None
    jumps = np.linalg.norm(np.diff(CubicSpline(times, values)(times, 2), axis=0), axis=1)
    minimum = ACCELERATION * max(GRAVITY / arm, _calm(times, values, step, deviation))
    if bending <= minimum or np.mean(jumps > minimum) < JUMP_FRACTION:
        return None
    return Noise(deviation, bending, float(np.median(jumps[jumps > minimum])), rounding if is_rounded else 0.0)


def _calm(times: np.ndarray, values: np.ndarray, step: float, deviation: float) -> float:
    # Largest second derivative through every n-th sample, with n so large that noise adds little to it.
    stride = 1
    while len(times) // stride > 8 and BENDING * deviation / (stride * step) ** 2 > ACCELERATION * GRAVITY / 4.0:
        stride *= 2
    if len(times) // stride < 4:
        return 0.0
    coarse = times[::stride]
    return float(np.abs(CubicSpline(coarse, values[::stride])(coarse, 2)).max())


def _deviation(times: np.ndarray, values: np.ndarray) -> float:
    # Standard deviation of noise in a short window, by divided differences of the order with the smallest median.
    estimates = []
    for order in ORDERS:
        if len(times) < 3 * order:
            break
        indices = np.arange(order + 1) + np.arange(len(times) - order)[:, None]
        gaps = times[indices][:, :, None] - times[indices][:, None]
        gaps /= float(np.median(np.diff(times)))
        gaps[:, np.arange(order + 1), np.arange(order + 1)] = 1.0
        weights = 1.0 / gaps.prod(axis=2)
        weights /= np.linalg.norm(weights, axis=1, keepdims=True)
        differences = np.einsum("ij,ijk->ik", weights, values[indices])
        estimates.append(np.median(np.abs(differences), axis=0) / MEDIAN)
    return float(np.max(np.min(estimates, axis=0)))


def _rounding(values: np.ndarray) -> float:
    # Step to which samples are rounded: the largest power of ten that divides all of them; 0 where there is none.
    sample = values[:: max(len(values) // 1000, 1)]
    for decimals in DECIMALS:
        scaled = sample * 10.0**decimals
        if np.abs(scaled - np.round(scaled)).max() <= 1e-6:
            return 10.0**-decimals
    return 0.0


def _is_rounded(values: np.ndarray, step: float) -> bool:
    # Third differences of rounded samples are often one step. Those of coordinates that lie on a grid by design are 0;
    # where the acceleration jumps by a, they are a t^2, which is two steps at least, since a t^2 / 2 is on the grid.
    differences = np.round(np.abs(np.diff(values, 3, axis=0)) / step)
    changes = differences[differences > 0.0]
    return len(changes) > 0 and bool(np.mean(changes == 1.0) >= ONE_STEP)


def deviation_of(times: Float[np.ndarray, "n"], values: Float[np.ndarray, "n width"]) -> float:
    """Standard deviation of the noise of the first samples, rounding errors included."""
    spread, step = _deviation(times[:WINDOW], values[:WINDOW]), _rounding(values)
    return step / math.sqrt(12.0) if _is_of_rounding(step, spread, values) else spread


def _is_of_rounding(step: float, spread: float, values: np.ndarray) -> bool:
    return step / math.sqrt(12.0) > 0.3 * spread and _is_rounded(values, step)
