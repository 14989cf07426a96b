"""Proof of any motion over its whole time: blocks are halved until each criterion is decided on each of them.

A criterion is met throughout a block if the lower bound of its slack is positive, and broken throughout if the upper
bound is negative. What is left when blocks are as short as the resolution are the ends of intervals in which a
criterion fails, or instants that are undecided.
"""

import dataclasses
from collections.abc import Callable

import numpy as np

from cspr_jax.motions.block_slacks import BlockSlacks

# Blocks at the start, and the share of itself, or of a tenth of usual ones, to which the smallest slack is narrowed.
FIRST = 32
CLOSE = 0.01
# Blocks of all halvings together; beyond, what is open stays undecided, and margins are less close.
MOST, NARROWING = 100_000, 4_000


@dataclasses.dataclass(frozen=True)
class TimeProof:
    """Bounds of n_criteria over a motion, and where it breaks them.

    Fields:
        low: (n_criteria,) lower bound of each slack over the whole motion.
        high: (n_criteria,) upper bound of the smallest slack.
        when: (n_criteria,) an instant within the block in which that bound was found, s.
        failing: for each criterion (m, 2) intervals of time in which it fails throughout, s; as wide as is proved.
        open: for each criterion (m, 2) intervals, none longer than the resolution unless blocks ran out, that are
            undecided.
        blocks: number of blocks that were looked at.
    """

    low: np.ndarray
    high: np.ndarray
    when: np.ndarray
    failing: list[np.ndarray]
    open: list[np.ndarray]
    blocks: int


def time_proof(
    slacks: Callable[[np.ndarray, np.ndarray], BlockSlacks], duration: float, resolution: float = 5e-7
) -> TimeProof:
    """Decide criteria over a whole motion.

    Args:
        slacks: bounds of the slacks over blocks, from their starts and ends, (k,) s each.
        duration: s.
        resolution: length of the shortest blocks, s.

    Returns:
        the proof.
    """
    edges = np.linspace(0.0, duration, FIRST + 1)
    start, end = edges[:-1], edges[1:]
    leaves: list[tuple[np.ndarray, ...]] = []
    total = 0
    while len(start):
        bounds = slacks(start, end)
        total += len(start)
        undecided = ~((bounds.low > 0.0) | (bounds.high < 0.0)).all(1)
        halve = undecided & (end - start > resolution)
        if total + 2 * halve.sum() > MOST:
            halve[:] = False
        leaves.append((start[~halve], end[~halve], bounds.low[~halve], bounds.high[~halve]))
        middle = 0.5 * (start + end)[halve]
        start, end = np.concatenate([start[halve], middle]), np.concatenate([middle, end[halve]])
    starts, ends, low, high = (np.concatenate(parts) for parts in zip(*leaves, strict=True))
    starts, ends, low, high, more = _narrowed(slacks, starts, ends, low, high)
    failing = [merged(starts, ends, column < 0.0) for column in high.T]
    is_open = ~((low > 0.0) | (high < 0.0))
    return TimeProof(
        low=low.min(0),
        high=high.min(0),
        when=0.5 * (starts + ends)[high.argmin(0)],
        failing=failing,
        open=[merged(starts, ends, column) for column in is_open.T],
        blocks=total + more,
    )


def _narrowed(slacks, starts, ends, low, high):
    # Halve the blocks that may hold the smallest slack of a criterion until its bounds are close.
    more = 0
    # Slacks are as large as they usually are: near zero no share of the smallest one is small enough.
    usual = np.median(np.abs(np.where(np.isfinite(high), high, np.nan)), axis=0)
    while more < NARROWING:
        close = CLOSE * np.fmax(np.abs(high.min(0)), 0.1 * np.nan_to_num(usual))
        chosen = ((low < high.min(0) - close) & np.isfinite(high.min(0))).any(1)
        if not chosen.any():
            break
        middle = 0.5 * (starts + ends)[chosen]
        parts = np.concatenate([starts[chosen], middle]), np.concatenate([middle, ends[chosen]])
        bounds = slacks(*parts)
        more += len(parts[0])
        # A part has no looser bounds than the whole.
        lows, highs = (np.tile(side[chosen], (2, 1)) for side in (low, high))
        starts, ends = (np.concatenate([x[~chosen], part]) for x, part in zip((starts, ends), parts, strict=True))
        low = np.concatenate([low[~chosen], np.maximum(bounds.low, lows)])
        high = np.concatenate([high[~chosen], np.minimum(bounds.high, highs)])
    order = np.argsort(starts)
    return starts[order], ends[order], low[order], high[order], more


def merged(starts: np.ndarray, ends: np.ndarray, flags: np.ndarray) -> np.ndarray:
    """Join neighbouring blocks to intervals.

    Args:
        starts: (n,) s, increasing.
        ends: (n,) s.
        flags: (n,) whether a block counts.

    Returns:
        (m, 2) s.
    """
    edges = np.diff(np.concatenate([[0], flags.astype(int), [0]]))
    return np.stack([starts[edges[:-1] == 1], ends[np.flatnonzero(edges == -1) - 1]], axis=1)
