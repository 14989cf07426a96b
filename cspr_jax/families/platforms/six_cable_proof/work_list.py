"""Work list of a proof: blocks are halved until each is proved, or until its motion is refuted or given up."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.numerics.elementary import minimum_of
from cspr_jax.numerics.linear.lanes import smallest
from cspr_jax.numerics.shapes import Float
from cspr_jax.numerics.tolerances import SIX_CABLES_UNDECIDED
from cspr_jax.verification.bounds.blocks import Blocks

# Slacks of limits closer to zero than this are undecided if they are bounded in double precision.
LIMITS_UNDECIDED = 1e-12
HALVINGS = 21  # largest number of halvings of a block
OPEN = 64  # largest number of open blocks of an arc
# Factor of `OPEN` for blocks proved to break no criterion by more than the tolerance of criteria that are no limits.
TOUCHING = 64
# Number of times that blocks are halved at once: in the first, in the second, and in all later rounds. In later rounds
# few blocks are open, and a batch of them costs as much as a full one.
AT_ONCE = (1, 2, 3)


class BlockBounds(NamedTuple):
    """Bounds and attained values of k blocks.

    Fields:
        nodes: (m, n_criteria or more, k) values at times, slacks first.
        bound: (n_criteria, k) proved lower bounds of the slacks.
        tau: (m, k) times of the values.
        is_enough: function of the smallest values so far, (n, n_criteria or more); tells which blocks need no halving
            once their slacks are proved, (k,).
    """

    nodes: np.ndarray
    bound: np.ndarray
    tau: np.ndarray
    is_enough: Callable[[np.ndarray], np.ndarray]


class WorkList:
    """Work list of n motions.

    Args:
        arcs: (n,) numbers of arcs.
        near: (n_criteria,) slacks closer to zero than this are undecided.
        ignored: (n_criteria,) mask of criteria that neither refute a motion nor need a proof; None: there are none.

    Fields:
        is_refuted: (n,) motions that break a criterion at a sample, or for which `refute` was called.
        is_stuck: (n,) motions that stay undecided.
        attained: (n, n_criteria or more) smallest values at the samples.
        bound: (n, n_criteria) proved lower bounds; NaN for motions that are refuted or stuck.
        refuted_tau: (n,) tau at which a criterion is violated most, else tau at which something else refutes the
            motion; NaN if nothing does.
    """

    def __init__(self, arcs: np.ndarray, near: np.ndarray, ignored: np.ndarray | None = None) -> None:
        """Start with nothing proved."""
        self._ignored = np.zeros(len(near), bool) if ignored is None else ignored
        self._arcs, self._near = arcs, np.where(self._ignored, np.inf, near)
        self.is_refuted, self.is_stuck = np.zeros(len(arcs), bool), np.zeros(len(arcs), bool)
        self.bound, self.refuted_tau = np.full((len(arcs), len(near)), np.inf), np.full(len(arcs), np.nan)
        self.attained, self._worst = np.zeros((len(arcs), 0)), np.zeros(len(arcs))

    def run(self, blocks: Blocks, bounds_of: Callable[[Blocks, int], BlockBounds]) -> BlockBounds:
        """Bound blocks and the halves of open ones; return bounds of the first blocks."""
        first = bounds = bounds_of(blocks, 0)
        self.attained = np.full((len(self._arcs), bounds.nodes.shape[1]), np.inf)
        halved = 0
        for more in itertools.chain(AT_ONCE, itertools.repeat(AT_ONCE[-1])):
            is_open = self._apply(blocks, bounds, last=halved >= HALVINGS)
            # If a limit is touched along a full path, as on level ones along the floor, many blocks stay open.
            fraction = np.where((bounds.bound > -SIX_CABLES_UNDECIDED).all(0), 1.0 / TOUCHING, 1.0)
            self.is_stuck |= np.bincount(blocks.row, fraction * is_open, len(self._arcs)) > OPEN * self._arcs
            is_open &= ~self.is_stuck[blocks.row]
            if not is_open.any():
                break
            blocks = blocks.part(is_open)
            for _ in range(more):
                blocks = blocks.halves()
            halved += more
            bounds = bounds_of(blocks, halved)
        self.bound[self.is_refuted | self.is_stuck] = np.nan
        return first

    def refute(self, motion: Float[np.ndarray, "k"], tau: Float[np.ndarray, "k"]) -> None:
        """Record motions that something else than criteria refutes."""
        self.is_refuted[motion] = True
        is_new = np.isnan(self.refuted_tau[motion])
        self.refuted_tau[motion[is_new]] = tau[is_new]

    def _apply(self, blocks: Blocks, bounds: BlockBounds, *, last: bool) -> np.ndarray:
        # Apply the bounds of blocks; return the mask of blocks to halve.
        minimum, low = bounds.nodes.min(0).T, bounds.bound.T
        _lower(self.attained, blocks.row, minimum)
        slack = minimum[:, : low.shape[1]]
        # NaN neither refutes nor proves anything.
        self._note_samples(blocks, bounds)
        self.is_refuted[blocks.row[(slack < -self._near).any(1)]] = True
        is_above = (low > self._near) | self._ignored
        is_proved = is_above.all(1) & bounds.is_enough(self.attained)
        with np.errstate(invalid="ignore"):  # singular poses and blocks without a bound are infinite
            is_exact = ((slack - low <= 0.5 * self._near) & ~is_above).any(1)
        is_done = is_proved | is_exact | last | np.isnan(minimum).any(1)
        self.is_stuck[blocks.row[is_done & ~is_proved]] = True
        _lower(self.bound, blocks.row[is_done], low[is_done])
        return ~is_done & ~(self.is_refuted | self.is_stuck)[blocks.row]

    def _note_samples(self, blocks: Blocks, bounds: BlockBounds) -> None:
        worst = (bounds.nodes[:, : len(self._near)] + self._near[None, :, None]).min(1)
        node = worst.argmin(0)
        value, tau = worst[node, np.arange(len(node))], bounds.tau[node, np.arange(len(node))]
        breaks = np.flatnonzero(value < self._worst[blocks.row])
        breaks = breaks[np.argsort(-value[breaks], kind="stable")]  # written last: the worst value of a motion
        self._worst[blocks.row[breaks]], self.refuted_tau[blocks.row[breaks]] = value[breaks], tau[breaks]


def _lower(values: np.ndarray, motion: np.ndarray, others: np.ndarray) -> None:
    # Lower the smallest values of motions; values of the same motion are adjacent.
    if len(motion):
        first = np.flatnonzero(np.diff(motion, prepend=-1))
        values[motion[first]] = np.minimum(values[motion[first]], np.minimum.reduceat(others, first))


def smallest_nodes(
    nodes: Sequence[Array], n_slacks: int, offsets: Float[np.ndarray, "m"]
) -> tuple[Float[Array, "1 n_criteria n"], Float[Array, "n"]]:
    """Reduce the node values of n blocks to the few numbers that a verdict needs; slacks come first."""
    worst = smallest(list(nodes[:n_slacks]))
    is_there = worst == minimum_of(worst, axis=0)[None]
    first = minimum_of(jnp.where(is_there, offsets[:, None], jnp.inf), axis=0)
    return jnp.stack([minimum_of(x, axis=0) for x in nodes])[None], jnp.where(first <= 1.0, first, jnp.nan)
