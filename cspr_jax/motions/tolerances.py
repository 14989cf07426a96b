"""Largest multiple of an uncertainty that motions are proved to stand, with one that they do not.

Blocks of a motion are proved for a multiple or halved (`uncertainty.holds`); a robot that breaks something in the
middle of one bounds the multiple from above (`uncertainty.fails`).
"""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from cspr_jax.motions.blocks import Blocks
from cspr_jax.motions.enclosures import Enclosure, Influence, influence
from cspr_jax.motions.uncertainty import Requirements, WorstDisplacements, fails, holds, worst
from cspr_jax.schema.limits import LARGEST_MULTIPLE

# Multiples that are tried first, one after the other; then they are divided, down to the first one or less.
RATIO, FIRST = 8.0, 1e-6
ROW = (1.0, 8.0, 64.0, 512.0, LARGEST_MULTIPLE)
# How near the two multiples of an answer are wanted, and in how many steps each is found.
NEAR, STEPS = 0.99, 12
# So many times a block is halved at most, and so many of an arc may be open.
HALVINGS, OPEN = 14, 256
# How much less is wanted where that is more, and how often in a row.
LESS, LESSER = 0.95, 8
# Levels on which a robot that fails is looked for where the bounds cannot hold.
MORE = 3


class Tolerated(NamedTuple):
    """Multiples of an uncertainty, of n motions.

    Fields:
        proved: (n,) every robot within this multiple meets everything: proved; 0 where nothing is.
        refuted: (n,) a robot within this multiple breaks something; infinite where none was found.
    """

    proved: np.ndarray
    refuted: np.ndarray


@dataclasses.dataclass
class _Open:
    # Blocks that are looked at, and what is known of them.
    blocks: Blocks
    known: Enclosure
    found: Influence
    worst: WorstDisplacements
    asked: Requirements

    def some(self, which: np.ndarray) -> "_Open":
        worst = WorstDisplacements(*(x[:, which] for x in self.worst))
        asked = dataclasses.replace(self.asked, slack=self.asked.slack[which])
        return _Open(self.blocks.some(which), self.known.some(which), self.found.some(which), worst, asked)

    def middles(self) -> "_Open":
        """The same, as if blocks had no length."""
        return dataclasses.replace(self, known=self.known.middle(self.found.mu))

    def fail(self, multiple: np.ndarray) -> np.ndarray:
        return fails(self.known, self.found, self.worst, self.asked, multiple)

    def hold(self, multiple: np.ndarray) -> np.ndarray:
        return holds(self.known, self.found, self.asked, multiple)


def tolerated(
    blocks: Blocks, arcs: np.ndarray, asked: Requirements, enclose: Callable[[Blocks], Enclosure], *, whole: bool = True
) -> Tolerated:
    """Multiples of an uncertainty that motions stand, and that they do not.

    Args:
        blocks: of n motions, whole motions, each feasible as it is planned.
        arcs: (n,) numbers of arcs.
        asked: what of all robots.
        enclose: what is known of blocks.
        whole: whether the multiples are wanted as near to each other as can be; else only whether they are below 1.

    Returns:
        the multiples.
    """
    if not len(arcs):
        return Tolerated(np.zeros(0), np.zeros(0))
    now, search = _looked_at(blocks, asked, enclose), _MultipleSearch(arcs, whole=whole)
    search.refuted = (
        _refuted_first(now, len(arcs)) if whole else _refuted_below(now, search.refuted, np.ones(len(arcs)))
    )
    search.wanted = _wanted(search.refuted, whole=whole)
    for level in range(HALVINGS + 1):
        now = search.left(now)
        is_open = search.open_blocks(now, level)
        if not is_open.any():
            break
        now = _looked_at(now.blocks.some(is_open).halves(), asked, enclose)
        search.refute(now)
    return Tolerated(search.proved, search.refuted)


class _MultipleSearch:
    # What is known of n motions: multiples that are refuted, wanted and, where it is settled, proved.

    def __init__(self, arcs: np.ndarray, *, whole: bool) -> None:
        self._arcs, self._whole, self._count = arcs, whole, len(arcs)
        self.refuted, self.wanted = np.full(len(arcs), np.inf), np.ones(len(arcs))
        self.proved, self._is_hopeless = np.full(len(arcs), np.nan), np.zeros(len(arcs), bool)

    def left(self, now: _Open) -> _Open:
        # Blocks of motions that are not settled.
        if self._whole:
            self.wanted = _reachable(now, self.wanted)
        self.proved = np.where(np.isnan(self.proved) & (self.wanted == 0.0), 0.0, self.proved)
        return now.some(np.isnan(self.proved)[now.blocks.row])

    def open_blocks(self, now: _Open, level: int) -> np.ndarray:
        # Blocks that are to be halved; settles motions without any, and those of which too much is open.
        row = now.blocks.row
        is_open = ~now.hold(self.wanted[row])
        is_open = self._lessened(now, is_open) if self._whole else self._hopeful(now, is_open)
        many = np.bincount(row[is_open], minlength=self._count)
        ends = (many > OPEN * self._arcs) | ((many > 0) & (level == HALVINGS))
        ends |= self._is_hopeless & (many > 0) & (level >= MORE)
        left = is_open & ends[row]
        if left.any():
            self.proved[ends] = _held(now.some(left), self.wanted)[ends] if self._whole else 0.0
        done = np.isnan(self.proved) & (many == 0)
        self.proved[done] = np.where(self._is_hopeless, 0.0, self.wanted)[done]
        return is_open & ~ends[row]

    def _lessened(self, now: _Open, is_open: np.ndarray) -> np.ndarray:
        # Less is wanted where too much is open.
        row = now.blocks.row
        for _ in range(LESSER):
            much = np.bincount(row[is_open], minlength=self._count) > OPEN * self._arcs
            if not much.any():
                break
            self.wanted = np.where(much, LESS * self.wanted, self.wanted)
            some = np.flatnonzero(is_open & much[row])
            is_open[some] = ~now.some(some).hold(self.wanted[row[some]])
        return is_open

    def _hopeful(self, now: _Open, is_open: np.ndarray) -> np.ndarray:
        # Where the middles themselves cannot hold, nothing is proved, and a robot that fails is looked for there alone.
        row = now.blocks.row
        is_bad = is_open & ~now.middles().hold(self.wanted[row])
        self._is_hopeless |= _any(row, is_bad, self._count)
        return is_open & (is_bad | ~self._is_hopeless[row])

    def refute(self, now: _Open) -> None:
        # Takes in what the middles of new blocks refute.
        self.refuted = _refuted_below(now, self.refuted, NEAR * self.refuted if self._whole else self.wanted)
        self.wanted = np.minimum(self.wanted, _wanted(self.refuted, whole=self._whole))


def _reachable(now: _Open, wanted: np.ndarray) -> np.ndarray:
    # Less where it cannot hold even in a middle.
    row, middles = now.blocks.row, now.middles()
    fails = ~middles.hold(wanted[row])
    if not fails.any():
        return wanted
    some = middles.some(fails)
    least = _held(some, wanted)
    return np.where(least < wanted, _near(least), wanted)


def _looked_at(blocks: Blocks, asked: Requirements, enclose: Callable[[Blocks], Enclosure]) -> _Open:
    known = enclose(blocks)
    found, own = influence(known), dataclasses.replace(asked, slack=asked.slack[blocks.row])
    return _Open(blocks, known, found, worst(known, found, own), own)


def _wanted(refuted: np.ndarray, *, whole: bool) -> np.ndarray:
    # Multiples that are to be proved; 0 where there is nothing to be proved any more.
    if not whole:
        return np.where(refuted > 1.0, 1.0, 0.0)
    return np.minimum(_near(refuted), LARGEST_MULTIPLE)


def _near(multiple: np.ndarray) -> np.ndarray:
    # A little less, but not less than 1 if it is more.
    return np.where(multiple > 1.0, np.maximum(NEAR * multiple, 1.0), NEAR * multiple)


def _any(row: np.ndarray, is_so: np.ndarray, count: int) -> np.ndarray:
    return np.bincount(row[is_so], minlength=count) > 0


def _refuted_first(now: _Open, count: int) -> np.ndarray:
    # The least multiple of a coarse row that the middles refute, and then more closely.
    high, row = np.full(count, np.inf), now.blocks.row
    for multiple in ROW:
        left = now.some(np.isinf(high)[row])
        broken = left.fail(np.full(len(left.blocks.row), multiple))
        high[_any(left.blocks.row, broken, count)] = multiple
    bad = now.some(np.isfinite(high)[row])
    bad = bad.some(bad.fail(high[bad.blocks.row]))
    while len(bad.blocks.row):
        broken = bad.fail(high[bad.blocks.row] / RATIO)
        lower = _any(bad.blocks.row, broken, count) & (high > FIRST)
        high = np.where(lower, high / RATIO, high)
        bad = bad.some(broken & lower[bad.blocks.row])
    return _narrowed(now, high / RATIO, high)


def _refuted_below(now: _Open, refuted: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    # Multiples that are refuted, where what was wanted is.
    wanted = np.minimum(wanted, LARGEST_MULTIPLE)
    is_new = _any(now.blocks.row, now.fail(wanted[now.blocks.row]), len(refuted)) & (wanted > 0.0)
    high = np.where(is_new, wanted, np.inf)
    return np.minimum(refuted, _narrowed(now, np.zeros(len(refuted)), high))


def _narrowed(now: _Open, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    # Multiples that some middle refutes, from `high`, which some middle does where it is finite, down towards `low`.
    now = now.some(np.isfinite(high)[now.blocks.row])
    now = now.some(now.fail(high[now.blocks.row]))
    low, high = low.copy(), high.copy()
    for _ in range(STEPS):
        if not len(now.blocks.row):
            break
        middle = np.where(np.isfinite(high), 0.5 * (low + high), 0.0)
        broken = now.fail(middle[now.blocks.row])
        lower = _any(now.blocks.row, broken, len(high))
        low, high = np.where(lower, low, middle), np.where(lower, middle, high)
        now = now.some(broken | ~lower[now.blocks.row])
    return high


def _held(left: _Open, wanted: np.ndarray) -> np.ndarray:
    # Largest multiples found that hold in all of some blocks, (n,); the wanted one of motions without any.
    row = left.blocks.row
    low, high = np.zeros(len(row)), wanted[row]
    for _ in range(STEPS):
        middle = 0.5 * (low + high)
        held = left.hold(middle)
        low, high = np.where(held, middle, low), np.where(held, high, middle)
    least = wanted.copy()
    np.minimum.at(least, row, low)
    return least
