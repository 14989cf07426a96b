"""Smallest values of functions over intervals, with a proof: blocks are halved until values and bounds agree."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from cspr_jax.numerics.shapes import Float

ROUNDS = 64
# A bound and an attained value agree if they differ by at most this fraction of the scale of the values.
AGREED = 1e-12
# Halving ends after this many blocks, with the bounds that are proved by then.
MAX_BLOCKS = 2_000_000


class Proved(NamedTuple):
    """Smallest values of n cases, by group of functions.

    Fields:
        attained: (n, n_groups) smallest value found.
        bound: (n, n_groups) proved lower bound.
    """

    attained: np.ndarray
    bound: np.ndarray


class MinimumBlocks(NamedTuple):
    """Blocks: parts of the intervals.

    Fields:
        case: (n_blocks,) index of the case.
        piece: (n_blocks,) index of the piece of a piecewise function.
        start: (n_blocks,) start of each block.
        width: (n_blocks,) width of each block.
    """

    case: np.ndarray
    piece: np.ndarray
    start: np.ndarray
    width: np.ndarray

    def rows(self, index) -> "MinimumBlocks":
        """Blocks chosen by an index, or by a mask (n_blocks,)."""
        return MinimumBlocks(*(x[index] for x in self))

    def halved(self) -> "MinimumBlocks":
        """Both halves of each block."""
        half = 0.5 * self.width
        left, right = (self.case, self.piece, self.start, half), (self.case, self.piece, self.start + half, half)
        return MinimumBlocks(*(np.concatenate(pair) for pair in zip(left, right, strict=True)))


def smallest(
    blocks: MinimumBlocks,
    count: int,
    values: Callable[[MinimumBlocks], tuple[np.ndarray, np.ndarray]],
    scales: Float[np.ndarray, "n_groups"],
    *,
    batch_size: int,
    enough: float = math.inf,
) -> Proved:
    """Smallest values over all blocks of each case."""
    best = np.full((count, len(scales)), np.inf)
    done, seen = best.copy(), 0
    for halvings in range(ROUNDS + 1):
        low, attained = _of(values, blocks, batch_size)
        np.minimum.at(best, blocks.case, attained)
        sharp = (low >= best[blocks.case] - AGREED * scales) | (low > enough * scales)
        seen += len(low)
        is_open = ~sharp.all(1) & (seen < MAX_BLOCKS) & (halvings < ROUNDS)
        np.minimum.at(done, blocks.case[~is_open], low[~is_open])
        if not is_open.any():
            break
        blocks = blocks.rows(is_open).halved()
    return Proved(best, done)


def _of(values, blocks: MinimumBlocks, batch_size: int) -> tuple[np.ndarray, np.ndarray]:
    parts = [values(blocks.rows(slice(i, i + batch_size))) for i in range(0, len(blocks.case), batch_size)]
    low, attained = (np.concatenate(x) for x in zip(*parts, strict=True))
    return low, attained
