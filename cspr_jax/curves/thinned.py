"""Motion through every second sample of another one, by which is estimated how closely samples tell a motion."""

import dataclasses
from typing import Any

import numpy as np

from cspr_jax.curves.interpolation import hermite
from cspr_jax.curves.spline import Spline
from cspr_jax.numerics.elementary import as_float64

JUMP = 1e-6  # share of the largest acceleration by which one jumps, but for rounding, where legs meet


def thinned(spline: Spline, first: int) -> Spline:
    """Hermite pieces through every second sample of a motion, its ends, and where the accelerations of legs jump."""
    knots = np.asarray(spline.knots)
    tables = {name: np.asarray(getattr(spline, name)) for name in ("position", "quaternion")}
    sides = {name: _sides(table, np.diff(knots)[:, None]) for name, table in tables.items() if table.ndim}
    is_kept = np.zeros(len(knots), bool)
    is_kept[[0, -1]] = is_kept[first::2] = True
    for starts, ends in (pair for pairs in sides.values() for pair in pairs[2:]):
        is_kept[1:-1] |= (np.abs(starts[1:] - ends[:-1]) > JUMP * np.abs(ends).max()).any(axis=1)
    rows = np.flatnonzero(is_kept)
    times = np.repeat(knots[rows], 2)[1:-1]
    fewer: dict[str, Any] = {
        name: as_float64(hermite(times, [_between(starts[rows[:-1]], ends[rows[1:] - 1]) for starts, ends in pairs]))
        for name, pairs in sides.items()
    }
    return dataclasses.replace(spline, knots=as_float64(knots[rows]), **fewer)


def _sides(table: np.ndarray, width: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    # Values and derivatives that samples of pieces of this degree have, at the starts and at the ends of the pieces.
    degree, factor, pairs = table.shape[1] - 1, np.ones_like(width), []
    for order in range(degree // 2 + 1):
        rows = np.diff(table, order, axis=1)
        pairs.append((factor * rows[:, 0], factor * rows[:, -1]))
        factor = factor * (degree - order) / width
    return pairs


def _between(starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    return np.stack([starts, ends], axis=1).reshape(-1, starts.shape[1])
