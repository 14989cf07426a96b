"""Unions of intervals of numbers."""

import numpy as np


def united(intervals: np.ndarray) -> np.ndarray:
    """Intervals of which none overlaps or touches another one.

    Args:
        intervals: (n, 2) in any order.

    Returns:
        (m, 2) with the same points, increasing.
    """
    merged: list[list[float]] = []
    for start, end in sorted(intervals.tolist()):
        if merged and start <= merged[-1][1]:
            merged[-1][1] = max(merged[-1][1], end)
        else:
            merged.append([start, end])
    return np.array(merged).reshape(-1, 2)
