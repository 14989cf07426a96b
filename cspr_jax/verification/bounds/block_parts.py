"""Blocks of several motions with bounds of their slacks, and the parts into which blocks are cut.

Over a block a slack lies between two lines. The part in which the lower line is above a level, or the upper one below
it, is decided. If the undecided part is a small fraction of the block, the block is cut around it; near a simple root
its length decreases quadratically, while halving would take a step for each binary digit.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cspr_jax.numerics.shapes import Bool, Complex, Float
from cspr_jax.numerics.tolerances import ROUNDING
from cspr_jax.verification.bounds.block_slacks import BlockSlacks

SMALL = 0.5  # an undecided part below this fraction of its block is cut out, else the block is halved
WIDER = 1e-3  # fraction of the block by which the undecided part is widened at either end


class TimeBlocks(NamedTuple):
    """Blocks of time.

    Fields:
        motion: (k,) index of the motion.
        start: (k,) s.
        end: (k,) s.
        slacks: bounds of slacks, (k, n_criteria).
    """

    motion: np.ndarray
    start: np.ndarray
    end: np.ndarray
    slacks: BlockSlacks

    def take(self, chosen: np.ndarray) -> "TimeBlocks":
        """Some of the blocks."""
        slacks = BlockSlacks(*(bounds[chosen] for bounds in self.slacks))
        return TimeBlocks(self.motion[chosen], self.start[chosen], self.end[chosen], slacks)

    def undecided(self, level: Float[np.ndarray, "..."]) -> Bool[np.ndarray, "k n_criteria"]:
        """Tell which slacks are neither above nor below a level throughout."""
        return ~((self.slacks.low > level) | (self.slacks.high < level))

    def rest(
        self, level: np.ndarray, matters: Bool[np.ndarray, "k n_criteria"], *, has_upper: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        """Part of each block outside of which slacks that matter are above their levels or, with `has_upper`, below."""
        low, high, low_rise, high_rise = self.slacks
        sides = [_below(low + np.maximum(-low_rise, 0.0) - level, low_rise)]
        if has_upper:
            sides.append(_below(np.maximum(high_rise, 0.0) - high + level, -high_rise))
        first = np.where(matters, np.max([side[0] for side in sides], axis=0), 1.0).min(1)
        last = np.where(matters, np.min([side[1] for side in sides], axis=0), 0.0).max(1)
        first, last = first - WIDER, last + WIDER
        return np.where(first < WIDER, 0.0, first), np.where(last > 1.0 - WIDER, 1.0, last)

    def cut(
        self, first: Float[np.ndarray, "k"], last: Float[np.ndarray, "k"], jumps: Complex[np.ndarray, "n"]
    ) -> "tuple[TimeBlocks, TimeBlocks]":
        """Cut each block around its undecided part, or halve it; a jump of acceleration splits what is undecided."""
        width = self.end - self.start
        before, after = self.start + first * width, np.where(last < 1.0, self.start + last * width, self.end)
        is_cut = (last - first < SMALL) & (before < after)
        outside = [self._part(is_cut & (first > 0.0), 0.0, first + 0.5 * WIDER, end=before)]
        outside.append(self._part(is_cut & (last < 1.0), last - 0.5 * WIDER, 1.0, start=after))
        # Split at a jump what is left, since no bounds across a jump come close to the slacks on both of its sides.
        start, end = np.where(is_cut, before, self.start), np.where(is_cut, after, self.end)
        middle, has_jump = _jump_within(jumps, self.motion, start, end)
        middle = np.where(has_jump, middle, 0.5 * (start + end))
        is_split = has_jump | ~is_cut
        inner = self._replace(start=start, end=end)
        halves = [inner._replace(end=middle).take(is_split), inner._replace(start=middle).take(is_split)]
        return joined(outside), joined([inner.take(~is_split), *halves])

    def _part(self, chosen, first, last, **edges) -> "TimeBlocks":
        # Bounds from the lines between two fractions of the block, which are extended beyond their rounding errors.
        low, high, low_rise, high_rise = self.slacks
        ends = [np.broadcast_to(fraction, len(low))[:, None] for fraction in (first, last)]
        lower = np.minimum(*(low_rise * fraction for fraction in ends)) + np.maximum(-low_rise, 0.0)
        upper = np.maximum(*(high_rise * fraction for fraction in ends)) - np.maximum(high_rise, 0.0)
        low = low + lower - ROUNDING * (np.abs(low) + np.abs(low_rise))
        high = high + upper + ROUNDING * (np.abs(high) + np.abs(high_rise))
        level = np.zeros_like(low)
        return self._replace(slacks=BlockSlacks(low, high, level, level), **edges).take(chosen)

    def no_looser_than(self, other: BlockSlacks) -> "TimeBlocks":
        """The blocks with the tighter of two bounds."""
        low, high, low_rise, high_rise = self.slacks
        is_low, is_high = low < other.low, high > other.high
        return self._replace(
            slacks=BlockSlacks(
                np.where(is_low, other.low, low),
                np.where(is_high, other.high, high),
                np.where(is_low, 0.0, low_rise),
                np.where(is_high, 0.0, high_rise),
            )
        )


def joined(batches: "list[TimeBlocks]") -> TimeBlocks:
    """All blocks of several batches."""
    bounds = (np.concatenate(parts) for parts in zip(*(blocks.slacks for blocks in batches), strict=True))
    motion, start, end = (np.concatenate(parts) for parts in zip(*(blocks[:3] for blocks in batches), strict=True))
    return TimeBlocks(motion, start, end, BlockSlacks(*bounds))


def _jump_within(
    jumps: np.ndarray, motion: np.ndarray, start: np.ndarray, end: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    # Time of a jump strictly within each block, near its middle, (k,), and whether there is one.
    if not len(jumps):
        return start, np.zeros(len(start), bool)
    # NumPy sorts complex numbers by their real parts, the motions, first.
    earliest, latest = (
        np.searchsorted(jumps, motion + 1j * start, side="right"),
        np.searchsorted(jumps, motion + 1j * end),
    )
    chosen = np.clip(np.searchsorted(jumps, motion + 0.5j * (start + end)), earliest, np.maximum(latest - 1, earliest))
    return jumps.imag[np.minimum(chosen, len(jumps) - 1)], latest > earliest


def _below(value: np.ndarray, rise: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    # Fractions of the block between which a line, with this value at the start, is not above zero.
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.clip(-value / rise, 0.0, 1.0)
    return np.where(rise < 0.0, root, 0.0), np.where(rise > 0.0, root, 1.0)
