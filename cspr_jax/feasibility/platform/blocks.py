"""Blocks of a platform's motions: parts of arcs, cut at the knots of the amplitude function, and halved where open."""

from typing import NamedTuple

import numpy as np

# So many times a block is halved at most, and so many of an arc may be open.
HALVINGS, OPEN = 20, 64


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

    def halves(self) -> "Blocks":
        """Both halves of each block, (2 k,)."""
        middle = 0.5 * (self.start + self.stop)
        return Blocks(
            np.repeat(self.row, 2),
            np.stack([self.start, middle], axis=1).ravel(),
            np.stack([middle, self.stop], axis=1).ravel(),
        )


def parts_of_arcs(arcs: np.ndarray, knots: np.ndarray, parts: int) -> Blocks:
    """Equal parts of all arcs of motions.

    Args:
        arcs: (n,) number of arcs of each motion, 1 or more.
        knots: of the amplitude function, inside ]0, 1[.
        parts: how many an arc.

    Returns:
        the blocks, those of a motion side by side, in time.
    """
    edges = {
        int(p): np.unique(np.concatenate([np.arange(parts * p + 1) / (parts * p), knots])) for p in np.unique(arcs)
    }
    each = [edges[int(p)] for p in arcs]
    row = np.repeat(np.arange(len(arcs)), [len(x) - 1 for x in each])
    nothing = np.zeros(0)
    start, stop = (np.concatenate([nothing, *(x[part] for x in each)]) for part in (slice(-1), slice(1, None)))
    return Blocks(row, start, stop)
