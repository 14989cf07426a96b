"""Proof of any motion over its full duration: blocks of time are cut until each criterion is decided on all of them.

The level of a criterion is zero or, for limits, which may be touched, a little less. A criterion is met throughout a
block if the lower bound of its slack is above the level, and fails throughout if the upper bound is below it. Blocks
that are still open at the resolution are ends of intervals in which a criterion fails, or undecided times. Open blocks
of all motions are bounded together.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Sequence

import numpy as np

from cspr_jax.numerics.shapes import Float, Int
from cspr_jax.verification.bounds.block_parts import TimeBlocks, joined
from cspr_jax.verification.bounds.block_slacks import BlockSlacks

FIRST = 32  # number of blocks at the start
# Bounds of the smallest slack are narrowed to this fraction of that slack, or of a tenth of the median if it is larger.
CLOSE = 0.002
# Largest numbers of blocks of a motion for deciding criteria, and for narrowing margins.
MAX_BLOCKS, NARROWING = 100_000, 4_000
# Blocks that narrow a margin are no shorter than this fraction of the resolution.
SHORTEST = 1e-3


@dataclasses.dataclass(frozen=True)
class TimeProof:
    """Bounds of the slacks of criteria over a motion, and intervals in which criteria fail.

    Fields:
        low: (n_criteria,) lower bound of each slack over the full motion.
        high: (n_criteria,) upper bound of the smallest slack.
        when: (n_criteria,) a time within the block that gives `high`, s.
        failing: for each criterion (m, 2) intervals of time in which it is proved to fail throughout, s.
        open: for each criterion (m, 2) undecided intervals, s; none is longer than the resolution unless the largest
            number of blocks was reached.
        blocks: number of blocks that were bounded.
        near: blocks that may contain the smallest slack of some criterion; None: not known.
    """

    low: np.ndarray
    high: np.ndarray
    when: np.ndarray
    failing: list[np.ndarray]
    open: list[np.ndarray]
    blocks: int
    near: TimeBlocks | None = None


def time_proof(
    slacks: Callable[[np.ndarray, np.ndarray], BlockSlacks],
    duration: float,
    resolution: float = 5e-7,
    jumps: np.ndarray | None = None,
    level: np.ndarray | float = 0.0,
) -> TimeProof:
    """Decide criteria over a full motion."""
    at_jumps = [] if jumps is None else [jumps]
    return time_proofs(
        lambda _, start, end: slacks(start, end), np.array([duration]), resolution, at_jumps, level=level
    )[0]


def time_proofs(
    slacks: Callable[[np.ndarray, np.ndarray, np.ndarray], BlockSlacks],
    durations: Float[np.ndarray, "n_motions"],
    resolution: float = 5e-7,
    jumps: Sequence[np.ndarray] = (),
    groups: Int[np.ndarray, "n_criteria"] | None = None,
    *,
    level: np.ndarray | float = 0.0,
    rounding: np.ndarray | float = 0.0,
    intervals: bool = True,
    margins: bool = True,
) -> list[TimeProof]:
    """Decide criteria over several full motions at once; only with `margins` are smallest slacks narrowed down.

    Blocks may hold a smallest slack if bounds that are wrong by `rounding` would let them.
    """
    count = len(durations)
    if not count:
        return []
    edges = np.asarray(durations, float)[:, None] * np.linspace(0.0, 1.0, FIRST + 1)
    blocks_at = np.repeat(np.arange(count), FIRST), edges[:, :-1].ravel(), edges[:, 1:].ravel()
    start = blocks = _bounded(slacks, *blocks_at, full=None)
    totals, leaves, fails = np.full(count, FIRST), [], np.zeros(count, bool)
    at_jumps = np.concatenate([np.empty(0, complex), *(i + 1j * np.asarray(row) for i, row in enumerate(jumps))])
    while len(blocks.start):
        undecided = blocks.undecided(np.asarray(level))
        is_open = undecided.any(1) & (blocks.end - blocks.start > resolution)
        if not intervals:
            fails |= np.bincount(blocks.motion, (blocks.slacks.high < level).any(1), count) > 0.0
            is_open &= ~fails[blocks.motion]
        is_open &= (totals + 2 * np.bincount(blocks.motion[is_open], minlength=count))[blocks.motion] <= MAX_BLOCKS
        leaves.append(blocks.take(~is_open))
        first, last = blocks.rest(np.asarray(level), undecided, has_upper=True)
        outside, inner = blocks.take(is_open).cut(first[is_open], last[is_open], at_jumps)
        leaves.append(outside)
        blocks = _bounded(slacks, *inner)
        totals += np.bincount(blocks.motion, minlength=count)
    if not margins:
        blocks = joined(leaves)
        return _proofs(blocks.take(np.lexsort((blocks.start, blocks.motion))), totals, level, rounding)
    narrow, more = _narrowed(slacks, joined(leaves), _usual(start.slacks.high, count), resolution, at_jumps, groups)
    return _proofs(narrow.take(np.lexsort((narrow.start, narrow.motion))), totals + more, level, rounding)


def _bounded(slacks, motion: np.ndarray, start: np.ndarray, end: np.ndarray, full: BlockSlacks | None) -> TimeBlocks:
    # Bounds of a block also hold for its parts: keep the tighter ones.
    if full is not None and not len(start):
        return TimeBlocks(motion, start, end, full)
    blocks = TimeBlocks(motion, start, end, slacks(motion, start, end).complete())
    return blocks if full is None else blocks.no_looser_than(full)


def _usual(high: np.ndarray, count: int) -> np.ndarray:
    # Usual magnitude of the slacks of each motion, (count, n_criteria).
    return np.median(np.where(np.isfinite(high), np.abs(high), 0.0).reshape(count, FIRST, -1), axis=1)


def _smallest(motion: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    # Smallest values of each motion, (count, n_criteria); inf for motions without values.
    minimum = np.full((count, values.shape[1]), np.inf)
    if len(motion):
        order = np.argsort(motion, kind="stable")
        firsts = np.flatnonzero(np.diff(motion[order], prepend=-1))
        minimum[motion[order][firsts]] = np.minimum.reduceat(values[order], firsts)
    return minimum


def _narrowed(
    slacks,
    blocks: TimeBlocks,
    usual: np.ndarray,
    resolution: float,
    jumps: np.ndarray,
    groups: np.ndarray | None,
) -> tuple[TimeBlocks, np.ndarray]:
    # Cut blocks that may contain the smallest slack of a criterion until its bounds are close; count the new blocks.
    count, leaves = len(usual), []
    more = np.zeros(count, int)
    minimum = _grouped(_smallest(blocks.motion, blocks.slacks.high, count), groups)
    while len(blocks.start):
        # Use the usual magnitude of slacks too, since bounds of a slack near zero cannot reach a relative accuracy.
        with np.errstate(invalid="ignore"):  # about infinite bounds
            level = (minimum - CLOSE * np.fmax(np.abs(minimum), 0.1 * usual))[blocks.motion]
        matters = (blocks.slacks.low < level) & np.isfinite(level)
        is_open = matters.any(1) & (blocks.end - blocks.start > SHORTEST * resolution)
        is_open &= (more < NARROWING)[blocks.motion]
        leaves.append(blocks.take(~is_open))
        first, last = blocks.rest(level, matters, has_upper=False)
        outside, inner = blocks.take(is_open).cut(first[is_open], last[is_open], jumps)
        leaves.append(outside)
        blocks = _bounded(slacks, *inner)
        more += np.bincount(blocks.motion, minlength=count)
        minimum = np.minimum(minimum, _grouped(_smallest(blocks.motion, blocks.slacks.high, count), groups))
    return joined(leaves), more


def _grouped(values: np.ndarray, groups: np.ndarray | None) -> np.ndarray:
    # For each column, the smallest value of its group.
    if groups is None or not len(groups):
        return values
    smallest = np.full((len(values), int(groups.max()) + 1), np.inf)
    np.minimum.at(smallest.T, groups, values.T)
    return smallest[:, groups]


def _proofs(
    blocks: TimeBlocks, totals: np.ndarray, level: np.ndarray | float, rounding: np.ndarray | float
) -> list[TimeProof]:
    count = len(totals)
    low, high = (_smallest(blocks.motion, side, count) for side in blocks.slacks[:2])
    failing = [_merged(blocks, column, count) for column in (blocks.slacks.high < level).T]
    is_open = [_merged(blocks, column, count) for column in blocks.undecided(np.asarray(level)).T]
    proofs, firsts = [], np.searchsorted(blocks.motion, np.arange(count + 1))
    for i, (first, last) in enumerate(itertools.pairwise(firsts)):
        when = 0.5 * (blocks.start + blocks.end)[first + blocks.slacks.high[first:last].argmin(0)]
        may_hold = blocks.slacks.low[first:last] <= high[i] + 2.0 * np.asarray(rounding)
        near = blocks.take(first + np.flatnonzero(may_hold.any(1)))
        near = near._replace(motion=np.zeros_like(near.motion))  # the proof is of a single motion
        sides = [parts[i] for parts in failing], [parts[i] for parts in is_open]
        proofs.append(TimeProof(low[i], high[i], when, *sides, int(totals[i]), near))
    return proofs


def _merged(blocks: TimeBlocks, flags: np.ndarray, count: int) -> list[np.ndarray]:
    # Join neighbouring blocks of a motion to intervals, (m, 2) for each motion.
    is_next = np.diff(blocks.motion, prepend=-1) == 0
    before, after = np.append(False, flags[:-1]) & is_next, np.append(flags[1:] & is_next[1:], False)
    firsts, lasts = np.flatnonzero(flags & ~before), np.flatnonzero(flags & ~after)
    intervals = np.stack([blocks.start[firsts], blocks.end[lasts]], axis=1)
    return np.split(intervals, np.searchsorted(blocks.motion[firsts], np.arange(1, count)))
