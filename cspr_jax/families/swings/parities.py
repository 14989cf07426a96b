"""Selections of segments, for even and for odd numbers of arcs."""

from __future__ import annotations

import jax
import numpy as np

from cspr_jax.families.swings.hypocycloid import Segment
from cspr_jax.numerics.shapes import Int, Num


def pick(parities: dict[int, Segment], rows: Int[np.ndarray, "m"], arcs: Num[np.ndarray, "m"]) -> Segment:
    """Select segments, each of the parity of its number of arcs."""
    if parities[0] is parities[1]:
        return jax.tree.map(lambda array: np.asarray(array)[rows], parities[0])
    is_odd = arcs % 2 == 1

    def choose(even, odd):
        return np.where(is_odd.reshape(-1, *[1] * (even.ndim - 1)), odd[rows], even[rows])

    return jax.tree.map(choose, parities[0], parities[1])


def rows_of(parities: dict[int, Segment], rows: Int[np.ndarray, "m"]) -> dict[int, Segment]:
    """Select segments for both parities."""
    return {
        parity: jax.tree.map(lambda array: np.asarray(array)[rows], segments) for parity, segments in parities.items()
    }
