"""Natural frequencies along motions on elastic cables: the lowest one, and those near the frequency of a swing."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from cspr_jax.motion.motion import Motion, sample_times
from cspr_jax.numerics.search.minima import narrowed_times

# A natural frequency within this factor of that of a swing counts as near it.
NEAR = 2.0

FrequenciesAt = Callable[[np.ndarray], np.ndarray]  # (n,) normalised times -> (n, dof), rad/s


class Nearest(NamedTuple):
    """The natural frequency that comes nearest to the frequency of a swing.

    Fields:
        natural: natural frequency, rad/s.
        swing: frequency of the swing, rad/s.
        t: time from the start of the motion, s.
    """

    natural: float
    swing: float
    t: float

    @property
    def is_near(self) -> bool:
        """Tell whether the ratio of both is within `NEAR`."""
        return self.swing / NEAR <= self.natural <= self.swing * NEAR


class MotionFrequencies(NamedTuple):
    """Natural frequencies along a motion.

    Fields:
        lowest: lowest natural frequency, rad/s; 0 where a state is not stable, NaN where a cable is not taut.
        t: its time from the start of the motion, s; NaN likewise.
        nearest: natural frequency nearest to that of the swing; None without a swing.
    """

    lowest: float
    t: float
    nearest: Nearest | None


NOT_TAUT = MotionFrequencies(math.nan, math.nan, None)


def motion_frequencies(motion: Motion, frequencies: FrequenciesAt, samples: int, swing: float) -> MotionFrequencies:
    """Natural frequencies along a motion, the lowest narrowed down between samples; `swing` may be NaN."""
    duration, tau = float(motion.duration()), sample_times(motion, samples)
    values = frequencies(tau)
    if not np.isfinite(values).all():
        return NOT_TAUT

    def lowest_at(points: np.ndarray) -> np.ndarray:
        return frequencies(points.ravel())[:, :1].reshape(*points.shape, 1)

    lowest, when = narrowed_times(lowest_at, tau[None], values[None, :, :1])
    return MotionFrequencies(float(lowest[0, 0]), float(when[0, 0]) * duration, _nearest(values, tau * duration, swing))


def _nearest(values: np.ndarray, times: np.ndarray, swing: float) -> Nearest | None:
    if not (math.isfinite(swing) and swing > 0.0):
        return None
    distance = np.abs(np.log(np.maximum(values, 1e-300) / swing))
    row, mode = np.unravel_index(distance.argmin(), distance.shape)
    return Nearest(float(values[row, mode]), swing, float(times[row]))
