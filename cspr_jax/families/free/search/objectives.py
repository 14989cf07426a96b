"""Objectives of free motions: time, energy, the largest tension, or the margin of the tensions.

Time and energy are sums over the motion. The largest tension and the margin are levels: unknowns that shift the bounds
of all tensions. Among motions with the same level, the fastest is best.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from cspr_jax.families.free.search.equations import ValueBounds
from cspr_jax.numerics.shapes import Bool, Float

# Weight of the time, in half swings, beside a level: a hundredth of a half swing adds 1e-6 to the objective.
LITTLE = 1e-4


class Objective(NamedTuple):
    """An objective in the form that a search uses.

    Fields:
        time: weight of the durations, in half swings.
        energy: weight of the time integral, in half swings, of the squared tensions over the weight of the robot.
        level: weight of the level; 0 without one.
        low_lift: (n_values,) increase of the lower bounds with the level.
        high_lift: (n_values,) increase of the upper bounds with the level.
        start: level from which a search starts.
        largest: largest level at which all limits are kept.
    """

    time: float
    energy: float
    level: float
    low_lift: np.ndarray
    high_lift: np.ndarray
    start: float = 0.0
    largest: float = np.inf

    def keeps_limits(self, level: Float[np.ndarray, "l s"]) -> Bool[np.ndarray, "l"]:
        """Tell whether motions with these levels keep the limits of the tensions."""
        return np.all(level <= self.largest, axis=1)


def _time(bounds: ValueBounds, n_cables: int) -> tuple[Objective, ValueBounds]:
    zero = np.zeros(len(bounds.low))
    return Objective(1.0, 0.0, 0.0, zero, zero), bounds


def _energy(bounds: ValueBounds, n_cables: int) -> tuple[Objective, ValueBounds]:
    zero = np.zeros(len(bounds.low))
    return Objective(0.0, 1.0, 0.0, zero, zero), bounds


def _tension(bounds: ValueBounds, n_cables: int) -> tuple[Objective, ValueBounds]:
    # The level is the largest tension over the allowed one.
    high, lift = bounds.high.copy(), np.zeros(len(bounds.low))
    high[:n_cables], lift[:n_cables] = 0.0, bounds.high[:n_cables]
    return Objective(LITTLE, 0.0, 1.0, np.zeros(len(lift)), lift, 1.0, 1.0), bounds._replace(high=high)


def _margin(bounds: ValueBounds, n_cables: int) -> tuple[Objective, ValueBounds]:
    # The level is minus the margin, over the weight.
    lift = np.zeros(len(bounds.low))
    lift[:n_cables] = 1.0
    return Objective(LITTLE, 0.0, 1.0, -lift, lift, 0.0, 0.0), bounds


OBJECTIVES: dict[str, Callable[[ValueBounds, int], tuple[Objective, ValueBounds]]] = {
    "time": _time,
    "energy": _energy,
    "tension": _tension,
    "margin": _margin,
}
