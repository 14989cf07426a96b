"""Unions of intervals of numbers."""

from __future__ import annotations

import numpy as np

from cspr_jax.numerics.shapes import Float


def united(intervals: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "m 2"]:
    """The same union as intervals that neither overlap nor touch."""
    merged: list[list[float]] = []
    for start, end in sorted(intervals.tolist()):
        if merged and start <= merged[-1][1]:
            merged[-1][1] = max(merged[-1][1], end)
        else:
            merged.append([start, end])
    return np.array(merged).reshape(-1, 2)
