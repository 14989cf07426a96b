"""Likely mistakes in a motion, of which a robot's size tells: units."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cspr_jax.config.motions.table import MotionTable

if TYPE_CHECKING:
    from jaxtyping import Float

FAR = 30.0  # sizes of the robot; farther motions are probably in other units
# Motions of so many rows at whole numbers of seconds are probably in milliseconds, or without units.
MANY = 50
CLOSER = 100.0  # times closer than others in the median are stamps that nearly repeat


def unit_hints(table: MotionTable, base_points: Float[np.ndarray, "n_cables 3"]) -> list[str]:
    """Units that a table probably has, other than those that it is read in."""
    points = np.asarray(base_points, float)
    size = float(np.linalg.norm(np.ptp(points, axis=0))) or 1.0
    reach = float(np.abs(table.positions - points.mean(axis=0)).max())
    lines = []
    if reach > FAR * size:
        lines.append(
            f"positions are up to {reach:.3g} m from the spools of a robot of {size:.3g} m: are they millimetres? "
            "Then say so: # units: mm"
        )
    times = table.times
    if len(times) > MANY and np.array_equal(times, np.round(times)):
        lines.append(
            f"times are whole numbers, from {times[0]:g} to {times[-1]:g} s: are they milliseconds? "
            "Then say so: # units: ms"
        )
    return lines


def near_repeat(times: Float[np.ndarray, "n"]) -> tuple[int, float] | None:
    """First two stamps that nearly repeat."""
    steps = np.diff(times)
    steps = np.where(steps > 0.0, steps, np.inf)
    if len(steps) < 4:
        return None
    i, median = int(np.argmin(steps)), float(np.median(steps))
    first = int(np.argmax(steps * CLOSER < median))
    return (first, median / float(steps[first])) if steps[i] * CLOSER < median < np.inf else None
