"""Blocks of motions: parts of arcs, cut at the knots of the amplitude function, and halved where open."""

import itertools
import math
from typing import NamedTuple

import numpy as np

# Of a part more that a piece between knots gets as little as this is not worth a block.
SLIVER = 0.3


class Blocks(NamedTuple):
    """Blocks of motions.

    Fields:
        row: (k,) whose block it is.
        start: (k,) tau where it starts.
        stop: (k,) tau where it stops; no knot inside.
    """

    row: np.ndarray
    start: np.ndarray
    stop: np.ndarray

    def some(self, which: np.ndarray) -> "Blocks":
        """Blocks chosen by indices, or by a mask (k,)."""
        return Blocks(*(x[which] for x in self))

    def instants(self, places: np.ndarray) -> np.ndarray:
        """Instants at the same places of each block.

        Args:
            places: (m,) from -1 at its start to 1 at its stop.

        Returns:
            (m, k) tau.
        """
        return 0.5 * (self.start + self.stop) + places[:, None] * (0.5 * (self.stop - self.start))

    def halves(self) -> "Blocks":
        """Both halves of each block, (2 k,)."""
        middle = 0.5 * (self.start + self.stop)
        return Blocks(
            np.repeat(self.row, 2),
            np.stack([self.start, middle], axis=1).ravel(),
            np.stack([middle, self.stop], axis=1).ravel(),
        )


def parts_of_arcs(arcs: np.ndarray, knots: np.ndarray, parts: int) -> Blocks:
    """Parts of all arcs of motions, nearly equal.

    Args:
        arcs: (n,) number of arcs of each motion, 1 or more.
        knots: of the amplitude function, inside ]0, 1[.
        parts: how many an arc, or nearly.

    Returns:
        the blocks, those of a motion side by side, in time.
    """
    pieces = list(itertools.pairwise([0.0, *knots.tolist(), 1.0]))

    def edges_of(p: int) -> np.ndarray:
        # Equal within each piece, so that no sliver is left beside a knot.
        counts = [max(1, math.ceil(parts * p * (stop - start) - SLIVER)) for start, stop in pieces]
        inside = [np.linspace(*piece, count + 1)[:-1] for piece, count in zip(pieces, counts, strict=True)]
        return np.concatenate([*inside, [1.0]])

    edges = {p: edges_of(p) for p in np.unique(arcs).tolist()}
    each = [edges[int(p)] for p in arcs]
    row = np.repeat(np.arange(len(arcs)), [len(x) - 1 for x in each])
    nothing = np.zeros(0)
    start, stop = (np.concatenate([nothing, *(x[part] for x in each)]) for part in (slice(-1), slice(1, None)))
    return Blocks(row, start, stop)
