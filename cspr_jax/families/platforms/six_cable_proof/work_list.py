"""Work list of a proof: blocks of motions are closed, or halved until they are, or until their motion is refuted."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.numerics.linear.lanes import smallest
from cspr_jax.numerics.shapes import Float
from cspr_jax.numerics.tolerances import SIX_CABLES_UNDECIDED
from cspr_jax.verification.bounds.blocks import Blocks

# Slacks of limits that are nearer to zero than this are undecided, if they are bounded in double precision.
LIMITS_UNDECIDED = 1e-12
HALVINGS = 21  # of a block, at most
OPEN = 64  # blocks of an arc that may be open
# Factor of `OPEN` for motions that break no criterion by more than the undecided range.
TOUCHING = 64
# How many times blocks are halved at once: in the first round, in the second, and in all later ones, where few blocks
# are open and a batch of them costs as much as a full one.
AT_ONCE = (1, 2, 3)


class BlockBounds(NamedTuple):
    """Bounds and attained values of k blocks.

    Fields:
        nodes: (m, n_criteria or more, k) values at times: slacks first.
        bound: (n_criteria, k) proved lower bounds of the slacks.
        tau: (m, k) the times.
        is_enough: takes the smallest values so far, (n, n_criteria or more), and gives which blocks need not be halved
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
        near: (n_criteria,) distance from zero within which slacks are undecided.
        ignored: (n_criteria,) mask of criteria that neither refute nor need be proved; None: all count.

    Fields:
        is_refuted: (n,) motions of which a sample breaks a criterion, or for which `refute` was called.
        is_stuck: (n,) motions that stay undecided.
        attained: (n, n_criteria or more) smallest values at the samples.
        bound: (n, n_criteria) proved lower bounds; NaN of motions that are refuted or stuck.
        refuted_tau: (n,) tau at which a criterion is broken by most, else tau at which something else refutes the
            motion; NaN where nothing does.
    """

    def __init__(self, arcs: np.ndarray, near: np.ndarray, ignored: np.ndarray | None = None) -> None:
        """Start with nothing proved."""
        self._ignored = np.zeros(len(near), bool) if ignored is None else ignored
        self._arcs, self._near = arcs, np.where(self._ignored, np.inf, near)
        self.is_refuted, self.is_stuck = np.zeros(len(arcs), bool), np.zeros(len(arcs), bool)
        self.bound, self.refuted_tau = np.full((len(arcs), len(near)), np.inf), np.full(len(arcs), np.nan)
        self.attained, self._worst = np.zeros((len(arcs), 0)), np.zeros(len(arcs))

    def run(self, blocks: Blocks, bounds_of: Callable[[Blocks, int], BlockBounds]) -> BlockBounds:
        """Bound blocks, and the halves of blocks that stay open."""
        first = bounds = bounds_of(blocks, 0)
        self.attained = np.full((len(self._arcs), bounds.nodes.shape[1]), np.inf)
        halved = 0
        for more in itertools.chain(AT_ONCE, itertools.repeat(AT_ONCE[-1])):
            is_open = self._apply(blocks, bounds, last=halved >= HALVINGS)
            # If a limit is touched all along a path, as on level ones along the floor, blocks stay open for long.
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
        """Note motions that are refuted by something else than criteria."""
        self.is_refuted[motion] = True
        is_new = np.isnan(self.refuted_tau[motion])
        self.refuted_tau[motion[is_new]] = tau[is_new]

    def _apply(self, blocks: Blocks, bounds: BlockBounds, *, last: bool) -> np.ndarray:
        # Apply the bounds of blocks; return the mask of blocks to be halved.
        minimum, low = bounds.nodes.min(0).T, bounds.bound.T
        _lower(self.attained, blocks.row, minimum)
        slack = minimum[:, : low.shape[1]]
        # NaN refutes nothing, and proves nothing.
        self._note_samples(blocks, bounds)
        self.is_refuted[blocks.row[(slack < -self._near).any(1)]] = True
        is_above = (low > self._near) | self._ignored
        is_proved = is_above.all(1) & bounds.is_enough(self.attained)
        with np.errstate(invalid="ignore"):  # infinities: singular poses, blocks without a bound
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
        breaks = breaks[np.argsort(-value[breaks], kind="stable")]  # the worst of a motion is written last
        self._worst[blocks.row[breaks]], self.refuted_tau[blocks.row[breaks]] = value[breaks], tau[breaks]


def _lower(values: np.ndarray, motion: np.ndarray, others: np.ndarray) -> None:
    # Lower the smallest values to those of others, of which equal motions stand side by side.
    if len(motion):
        first = np.flatnonzero(np.diff(motion, prepend=-1))
        values[motion[first]] = np.minimum(values[motion[first]], np.minimum.reduceat(others, first))


def smallest_nodes(
    nodes: Sequence[Array], n_slacks: int, offsets: Float[np.ndarray, "m"]
) -> tuple[Float[Array, "1 n_criteria n"], Float[Array, "n"]]:
    """Reduce the node values of n blocks to the few numbers that a verdict needs; slacks are the first of them."""
    worst = smallest(list(nodes[:n_slacks]))
    is_there = worst == jnp.min(worst, axis=0)[None]
    first = jnp.min(jnp.where(is_there, offsets[:, None], jnp.inf), axis=0)
    return jnp.stack([jnp.min(x, axis=0) for x in nodes])[None], jnp.where(first <= 1.0, first, jnp.nan)
