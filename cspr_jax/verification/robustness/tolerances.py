"""Largest multiple of an uncertainty that motions are proved to tolerate, and smallest multiple that is refuted.

Blocks of a motion are proved for a multiple or halved (`uncertainty.holds`); a robot that fails a criterion in the
middle of a block bounds the multiple from above (`uncertainty.fails`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import partial
from typing import NamedTuple, Protocol

import numpy as np

from cspr_jax.numerics.shapes import Num
from cspr_jax.schema.limits import LARGEST_MULTIPLE
from cspr_jax.verification.bounds.blocks import Blocks
from cspr_jax.verification.bounds.enclosures import Enclosure, Influence, influence
from cspr_jax.verification.robustness.uncertainty import Requirements, WorstDisplacements, fails, holds, worst

# Multiples that are tried first, in this order. A multiple that fails is divided by `RATIO` as long as it fails, down
# to `SMALLEST`.
FIRST_MULTIPLES = (1.0, 8.0, 64.0, 512.0, LARGEST_MULTIPLE)
RATIO = 8.0
SMALLEST = 1e-6
NEAR = 0.99  # ratio of the proved to the refuted multiple at which the search ends
STEPS = 12  # number of bisections for each of the two multiples
HALVINGS = 14  # largest number of halvings of a block
OPEN = 256  # largest number of open blocks per arc
# Factor on `OPEN` for the multiple 1, which decides whether a motion is feasible.
DECIDED = 4.0
LOWERED = 0.95  # factor by which a target is lowered if more blocks are open
LOWERINGS = 8  # largest number of times in a row that a target is lowered
# Level of halving up to which a robot that fails is searched for although the bounds cannot hold.
MORE = 3


class Tolerated(NamedTuple):
    """Multiples of an uncertainty, of n motions.

    Fields:
        proved: (n,) multiple within which every robot is proved to meet all criteria; 0 where nothing is proved.
        refuted: (n,) multiple within which some robot fails a criterion; infinite where none was found.
    """

    proved: np.ndarray
    refuted: np.ndarray


class Pool(Protocol):
    """Open blocks with their bounds; multiples are (k,), one for each block."""

    blocks: Blocks

    def part(self, rows: np.ndarray) -> "Pool":
        """Blocks chosen by indices, or by a mask (k,)."""
        ...

    def halves(self, rows: np.ndarray) -> "Pool":
        """Halves of chosen blocks."""
        ...

    def middles(self) -> "Pool":
        """Middles of the blocks, as blocks of length zero."""
        ...

    def hold(self, multiple: np.ndarray) -> np.ndarray:
        """Tell in which blocks every robot within a multiple is proved to meet all criteria.

        Args:
            multiple: (k,).

        Returns:
            (k,).
        """
        ...

    def fail(self, multiple: np.ndarray) -> np.ndarray:
        """Tell in the middle of which blocks a robot within a multiple fails a criterion.

        Args:
            multiple: (k,).

        Returns:
            (k,).
        """
        ...


@dataclasses.dataclass
class _Open:
    # Blocks of swings, and of platforms on six cables.
    enclosed: Callable[[Blocks], "_Open"]
    blocks: Blocks
    enclosure: Enclosure
    influence: Influence
    worst: WorstDisplacements
    requirements: Requirements

    def part(self, rows: np.ndarray) -> "_Open":
        worst = WorstDisplacements(*(x[:, rows] for x in self.worst))
        requirements = dataclasses.replace(self.requirements, slack=self.requirements.slack[rows])
        enclosure, influence = self.enclosure.part(rows), self.influence.part(rows)
        return _Open(self.enclosed, self.blocks.part(rows), enclosure, influence, worst, requirements)

    def halves(self, rows: np.ndarray) -> "_Open":
        return self.enclosed(self.blocks.part(rows).halves())

    def middles(self) -> "_Open":
        return dataclasses.replace(self, enclosure=self.enclosure.middle(self.influence.mu))

    def fail(self, multiple: np.ndarray) -> np.ndarray:
        return fails(self.enclosure, self.influence, self.worst, self.requirements, multiple)

    def hold(self, multiple: np.ndarray) -> np.ndarray:
        return holds(self.enclosure, self.influence, self.requirements, multiple)


def tolerated(
    blocks: Blocks,
    arcs: Num[np.ndarray, "n"],
    requirements: Requirements,
    enclose: Callable[[Blocks], Enclosure],
    *,
    full: bool = True,
) -> Tolerated:
    """Multiples of an uncertainty that motions are proved to tolerate, and that are refuted."""
    if not len(arcs):
        return Tolerated(np.zeros(0), np.zeros(0))
    return tolerated_by(_enclosed(requirements, enclose, blocks), arcs, full=full)


def tolerated_by(pool: Pool, arcs: Num[np.ndarray, "n"], *, full: bool = True) -> Tolerated:
    """Multiples of an uncertainty, like `tolerated`, for any pool of blocks."""
    search = _MultipleSearch(arcs, full=full)
    search.refuted = (
        _refuted_first(pool, len(arcs)) if full else _refuted_below(pool, search.refuted, np.ones(len(arcs)))
    )
    search.targets = _targets(search.refuted, full=full)
    for level in range(HALVINGS + 1):
        pool = search.left(pool)
        is_open = search.open_blocks(pool, level)
        if not is_open.any():
            break
        pool = pool.halves(is_open)
        search.refute(pool)
    return Tolerated(search.proved, search.refuted)


class _MultipleSearch:
    # State of the search for n motions: refuted multiples, targets and, for finished motions, proved multiples.

    def __init__(self, arcs: np.ndarray, *, full: bool) -> None:
        self._arcs, self._full, self._count = arcs, full, len(arcs)
        self.refuted, self.targets = np.full(len(arcs), np.inf), np.ones(len(arcs))
        self.proved, self._is_hopeless = np.full(len(arcs), np.nan), np.zeros(len(arcs), bool)

    @property
    def _most_open(self) -> np.ndarray:
        # Multiples other than 1 may be less close, since no verdict depends on them.
        return OPEN * self._arcs * np.where(self.targets == 1.0, DECIDED, 1.0)

    def left(self, pool: Pool) -> Pool:
        # Blocks of open motions.
        if self._full:
            self.targets = _reachable(pool, self.targets)
        self.proved = np.where(np.isnan(self.proved) & (self.targets == 0.0), 0.0, self.proved)
        return pool.part(np.isnan(self.proved)[pool.blocks.row])

    def open_blocks(self, pool: Pool, level: int) -> np.ndarray:
        # Blocks to be halved; finish motions that have none, or too many.
        row = pool.blocks.row
        is_open = ~pool.hold(self.targets[row])
        is_open = self._lessened(pool, is_open) if self._full else self._hopeful(pool, is_open)
        many = np.bincount(row[is_open], minlength=self._count)
        ends = (many > self._most_open) | ((many > 0) & (level == HALVINGS))
        ends |= self._is_hopeless & (many > 0) & (level >= MORE)
        left = is_open & ends[row]
        if left.any():
            self.proved[ends] = _held(pool.part(left), self.targets)[ends] if self._full else 0.0
        done = np.isnan(self.proved) & (many == 0)
        self.proved[done] = np.where(self._is_hopeless, 0.0, self.targets)[done]
        return is_open & ~ends[row]

    def _lessened(self, pool: Pool, is_open: np.ndarray) -> np.ndarray:
        # Lower the targets of motions of which too many blocks are open.
        row = pool.blocks.row
        for _ in range(LOWERINGS):
            much = np.bincount(row[is_open], minlength=self._count) > self._most_open
            if not much.any():
                break
            self.targets = np.where(much, _not_across_one(LOWERED * self.targets, self.targets), self.targets)
            indices = np.flatnonzero(is_open & much[row])
            is_open[indices] = ~pool.part(indices).hold(self.targets[row[indices]])
        return is_open

    def _hopeful(self, pool: Pool, is_open: np.ndarray) -> np.ndarray:
        # Once the middle of a block cannot hold, nothing can be proved for its motion: only search for a robot that
        # fails, in such middles.
        row = pool.blocks.row
        is_bad = is_open & ~pool.middles().hold(self.targets[row])
        self._is_hopeless |= _any(row, is_bad, self._count)
        return is_open & (is_bad | ~self._is_hopeless[row])

    def refute(self, pool: Pool) -> None:
        # Add multiples that the middles of new blocks refute.
        self.refuted = _refuted_below(pool, self.refuted, NEAR * self.refuted if self._full else self.targets)
        self.targets = np.minimum(self.targets, _targets(self.refuted, full=self._full))


def _reachable(pool: Pool, multiples: np.ndarray) -> np.ndarray:
    # Lower multiples that cannot hold even in the middle of a block.
    row, middles = pool.blocks.row, pool.middles()
    fails = ~middles.hold(multiples[row])
    if not fails.any():
        return multiples
    failing = middles.part(fails)
    minimum = _held(failing, multiples)
    return np.where(minimum < multiples, _near(minimum), multiples)


def _enclosed(requirements: Requirements, enclose: Callable[[Blocks], Enclosure], blocks: Blocks) -> _Open:
    enclosure = enclose(blocks)
    influences = influence(enclosure)
    each = dataclasses.replace(requirements, slack=requirements.slack[blocks.row])
    enclosed = partial(_enclosed, requirements, enclose)
    return _Open(enclosed, blocks, enclosure, influences, worst(enclosure, influences, each), each)


def _targets(refuted: np.ndarray, *, full: bool) -> np.ndarray:
    # Multiples to be proved next; 0 where the search has ended.
    if not full:
        return np.where(refuted > 1.0, 1.0, 0.0)
    return np.minimum(_near(refuted), LARGEST_MULTIPLE)


def _near(multiple: np.ndarray) -> np.ndarray:
    # A slightly smaller multiple, but at least 1 if the multiple is above 1.
    return _not_across_one(NEAR * multiple, multiple)


def _not_across_one(smaller: np.ndarray, multiple: np.ndarray) -> np.ndarray:
    # Do not pass 1, at which it is decided whether a motion is feasible.
    return np.where(multiple > 1.0, np.maximum(smaller, 1.0), smaller)


def _any(row: np.ndarray, is_so: np.ndarray, count: int) -> np.ndarray:
    return np.bincount(row[is_so], minlength=count) > 0


def _refuted_first(pool: Pool, count: int) -> np.ndarray:
    # Find the smallest of the first multiples that middles of blocks refute, then narrow it down.
    high, row = np.full(count, np.inf), pool.blocks.row
    for multiple in FIRST_MULTIPLES:
        left = pool.part(np.isinf(high)[row])
        broken = left.fail(np.full(len(left.blocks.row), multiple))
        high[_any(left.blocks.row, broken, count)] = multiple
    bad = pool.part(np.isfinite(high)[row])
    bad = bad.part(bad.fail(high[bad.blocks.row]))
    while len(bad.blocks.row):
        broken = bad.fail(high[bad.blocks.row] / RATIO)
        lower = _any(bad.blocks.row, broken, count) & (high > SMALLEST)
        high = np.where(lower, high / RATIO, high)
        bad = bad.part(broken & lower[bad.blocks.row])
    return _narrowed(pool, high / RATIO, high)


def _refuted_below(pool: Pool, refuted: np.ndarray, multiples: np.ndarray) -> np.ndarray:
    # Try multiples in the middles of blocks, narrow down those that are refuted, and return the smallest.
    multiples = np.minimum(multiples, LARGEST_MULTIPLE)
    is_new = _any(pool.blocks.row, pool.fail(multiples[pool.blocks.row]), len(refuted)) & (multiples > 0.0)
    high = np.where(is_new, multiples, np.inf)
    return np.minimum(refuted, _narrowed(pool, np.zeros(len(refuted)), high))


def _narrowed(pool: Pool, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    # Lower `high`, if it is finite and hence refuted by some middle, towards `low`, while some middle still refutes it.
    pool = pool.part(np.isfinite(high)[pool.blocks.row])
    pool = pool.part(pool.fail(high[pool.blocks.row]))
    low, high = low.copy(), high.copy()
    for _ in range(STEPS):
        if not len(pool.blocks.row):
            break
        middle = np.where(np.isfinite(high), 0.5 * (low + high), 0.0)
        broken = pool.fail(middle[pool.blocks.row])
        lower = _any(pool.blocks.row, broken, len(high))
        low, high = np.where(lower, low, middle), np.where(lower, middle, high)
        pool = pool.part(broken | ~lower[pool.blocks.row])
    return high


def _held(left: Pool, multiples: np.ndarray) -> np.ndarray:
    # Largest multiple that holds in all blocks of each motion, (n,); motions without blocks keep their multiples.
    row = left.blocks.row
    low, high = np.zeros(len(row)), multiples[row]
    for _ in range(STEPS):
        middle = 0.5 * (low + high)
        held = left.hold(middle)
        low, high = np.where(held, middle, low), np.where(held, high, middle)
    minimum = multiples.copy()
    np.minimum.at(minimum, row, low)
    return minimum
