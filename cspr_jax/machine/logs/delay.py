"""Delay of measured lengths behind planned ones.

Measured lengths are planned ones of an earlier time, with an offset of each cable: l_i(t) = p_i(t - d) + o_i. The
delay d is that of the least sum of squares, first among many, then by Gauss-Newton steps on d and the offsets; lengths
far from it count less (Huber's weights), so that one bad cable or a slack one does not decide. For one cable without
noise the least squares are the largest correlation. The standard deviation of d is that of linear least squares,
s / |p'|, larger by what neighbouring errors have in common (their correlation from row to row).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from cspr_jax.numerics.shapes import Float

CANDIDATES, ROWS = 401, 250
STEPS = 30
HUBER = 2.0  # deviations, over their scale, from which on a length counts less
RIVAL = 1.1  # another delay is named where its root mean square is at most so many times the best one's
EQUAL = 1e-6  # errors over the deviation of the lengths that are as good as none
# Root mean square of the lengths about their means, over the largest length, below which nothing moves.
STATIC = 1e-9

Planned = Callable[[np.ndarray], np.ndarray]


class Delay(NamedTuple):
    """Delay of a log.

    Fields:
        value: s, positive where the log is late; NaN where the lengths do not change.
        deviation: standard deviation, s.
        rival: another delay that fits nearly as well, s; NaN: there is none.
        offsets: (m,) mean differences of measured from planned lengths after the delay, m.
        is_at_edge: whether the best delay is the largest that was tried.
    """

    value: float
    deviation: float
    rival: float
    offsets: np.ndarray
    is_at_edge: bool


def delay_of(
    times: Float[np.ndarray, "n"], lengths: Float[np.ndarray, "n m"], planned: Planned, rate: Planned, largest: float
) -> Delay:
    """Delay of measured lengths, with gaps as NaN; `planned` and `rate` give lengths (n, m) and rates at times."""
    at_zero = planned(times)
    offsets = np.nanmedian(lengths - at_zero, axis=0)
    if not np.nanstd(at_zero, axis=0).max() > STATIC * np.abs(at_zero).max():
        return Delay(np.nan, np.nan, np.nan, offsets, is_at_edge=False)
    rows = np.unique(np.linspace(0, len(times) - 1, min(ROWS, len(times))).astype(int))
    trials = np.linspace(-largest, largest, CANDIDATES)
    costs = np.array([_spread(lengths[rows] - planned(times[rows] - trial)) for trial in trials])
    lows = np.flatnonzero((costs <= np.r_[np.inf, costs[:-1]]) & (costs <= np.r_[costs[1:], np.inf]))
    lows = lows[np.argsort(costs[lows], kind="stable")][:4]
    refined = [_refined(times, lengths, planned, rate, trials[k]) for k in lows]
    ends = [_spread(lengths - planned(times - value)) for value, _, _ in refined]
    best = int(np.argmin(ends))
    value, deviation, offsets = refined[best]
    step = trials[1] - trials[0]
    rivals = [
        refined[k][0]
        for k in np.argsort(ends, kind="stable")
        if ends[k] <= RIVAL * ends[best] + EQUAL * np.nanstd(at_zero) and abs(refined[k][0] - value) > 2.0 * step
    ]
    return Delay(value, deviation, rivals[0] if rivals else np.nan, offsets, bool(abs(value) >= largest - step))


def _spread(errors: np.ndarray) -> float:
    # Robust scale of errors about the offset of each cable.
    is_given = np.isfinite(errors)
    if is_given.all():  # medians that look for gaps take several times as long
        centred = np.abs(errors - np.median(errors, axis=0)).ravel()
    else:
        centred = np.abs(errors - np.nanmedian(errors, axis=0))[is_given]
    scale = 1.4826 * float(np.median(centred)) or float(np.sqrt(np.mean(centred**2)))
    if scale == 0.0:
        return 0.0
    reduced = centred / scale
    return scale * float(np.sqrt(np.mean(np.where(reduced <= HUBER, reduced**2, 2.0 * HUBER * reduced - HUBER**2))))


def _refined(
    times: np.ndarray, lengths: np.ndarray, planned: Planned, rate: Planned, start: float
) -> tuple[float, float, np.ndarray]:
    value, offsets, deviation = start, np.zeros(lengths.shape[1]), np.inf
    for _ in range(STEPS):
        errors = lengths - planned(times - value)
        derivative = -rate(times - value)
        is_given = np.isfinite(errors)
        offsets = np.nanmedian(errors, axis=0)
        centred = np.where(is_given, errors - offsets, 0.0)
        scale = 1.4826 * float(np.median(np.abs(centred[is_given])))
        reduced = np.abs(centred) / scale if scale > 0.0 else np.zeros_like(centred)
        weights = np.where(is_given, np.where(reduced <= HUBER, 1.0, HUBER / np.maximum(reduced, HUBER)), 0.0)
        total = np.maximum(weights.sum(0), 1e-300)
        offsets = offsets + (weights * centred).sum(0) / total
        centred = np.where(is_given, errors - offsets, 0.0)
        mean = (weights * derivative).sum(0) / total
        across = derivative - mean
        information = float((weights * across**2).sum())
        if not information > 0.0:
            break
        step = float((weights * across * centred).sum()) / information
        value += step
        deviation = _deviation(centred - step * across, weights, information)
        if abs(step) <= 1e-12 * max(1.0, abs(value)):
            break
    return value, deviation, offsets


def _deviation(errors: np.ndarray, weights: np.ndarray, information: float) -> float:
    # Errors of neighbouring rows are alike where a machine lags: they carry less information than as many others.
    count = max(float((weights > 0.0).sum()) - errors.shape[1] - 1.0, 1.0)
    weighted = np.sqrt(weights) * errors
    variance = float((weighted**2).sum()) / count
    if variance == 0.0:
        return 0.0
    common = float((weighted[1:] * weighted[:-1]).sum()) / float((weighted**2).sum())
    common = float(np.clip(common, 0.0, 0.999))
    return float(np.sqrt(variance / information * (1.0 + common) / (1.0 - common)))
