"""Segments of either parity of their numbers of arcs."""

import jax
import numpy as np

from cspr_jax.swings.hypocycloid import Segment


def pick(parities: dict[int, Segment], rows: np.ndarray, arcs: np.ndarray) -> Segment:
    """Pick segments, each of the parity of its number of arcs.

    Args:
        parities: as `segments_between` gives them.
        rows: (m,) which segments.
        arcs: (m,) number of arcs of each.

    Returns:
        leaves (m, ...).
    """
    if parities[0] is parities[1]:
        return jax.tree.map(lambda leaf: np.asarray(leaf)[rows], parities[0])
    is_odd = arcs % 2 == 1

    def choose(even, odd):
        return np.where(is_odd.reshape(-1, *[1] * (even.ndim - 1)), odd[rows], even[rows])

    return jax.tree.map(choose, parities[0], parities[1])


def rows_of(parities: dict[int, Segment], rows: np.ndarray) -> dict[int, Segment]:
    """Pick segments, of both parities.

    Args:
        parities: as `segments_between` gives them.
        rows: (m,) which segments.

    Returns:
        leaves (m, ...).
    """
    return {
        parity: jax.tree.map(lambda leaf: np.asarray(leaf)[rows], segments) for parity, segments in parities.items()
    }
