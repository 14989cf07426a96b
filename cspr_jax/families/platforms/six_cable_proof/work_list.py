"""Work list of a proof: blocks of motions are closed, or halved until they are, or until their motion is refuted."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.numerics.linear.lanes import smallest
from cspr_jax.numerics.tolerances import SIX_CABLES_UNDECIDED
from cspr_jax.verification.bounds.blocks import Blocks

if TYPE_CHECKING:
    from jaxtyping import Float

# Slacks of limits nearer to zero are undecided, where double precision bounds them.
LIMITS_UNDECIDED = 1e-12
# A block is halved so many times at most, and so many blocks of an arc may be open.
HALVINGS, OPEN = 21, 64
# How many times more blocks may be open where nothing is missed by more than other criteria are undecided.
TOUCHING = 64
# How many times blocks are halved at once: in the first round, in the second, and in all later ones, where few blocks
# are open and a batch of them costs as much as a full one.
AT_ONCE = (1, 2, 3)


class BlockBounds(NamedTuple):
    """Bounds and attained values of k blocks.

    Fields:
        nodes: (m, n_criteria or more, k) values at instants: slacks first.
        bound: (n_criteria, k) proved lower bounds of the slacks.
        tau: (m, k) the instants.
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
        near: (n_criteria,) how near to zero slacks are undecided.
        ignored: (n_criteria,) mask of criteria that neither refute nor need be proved; None: all count.

    Fields:
        is_refuted: (n,) motions of which an instant breaks a criterion, or for which `refute` was called.
        is_stuck: (n,) motions that stay undecided.
        attained: (n, n_criteria or more) smallest values at the instants that were looked at.
        bound: (n, n_criteria) proved lower bounds; NaN of motions that are refuted or stuck.
        instant: (n,) tau at which a criterion is broken by most, else tau at which something else refutes the motion;
            NaN where nothing does.
    """

    def __init__(self, arcs: np.ndarray, near: np.ndarray, ignored: np.ndarray | None = None) -> None:
        """Start with nothing known."""
        self._ignored = np.zeros(len(near), bool) if ignored is None else ignored
        self._arcs, self._near = arcs, np.where(self._ignored, np.inf, near)
        self.is_refuted, self.is_stuck = np.zeros(len(arcs), bool), np.zeros(len(arcs), bool)
        self.bound, self.instant = np.full((len(arcs), len(near)), np.inf), np.full(len(arcs), np.nan)
        self.attained, self._worst = np.zeros((len(arcs), 0)), np.zeros(len(arcs))

    def work_off(self, blocks: Blocks, look: Callable[[Blocks, int], BlockBounds]) -> BlockBounds:
        """Bound blocks, and the halves of blocks that stay open."""
        first = bounds = look(blocks, 0)
        self.attained = np.full((len(self._arcs), bounds.nodes.shape[1]), np.inf)
        halved = 0
        for more in itertools.chain(AT_ONCE, itertools.repeat(AT_ONCE[-1])):
            is_open = self._take_in(blocks, bounds, last=halved >= HALVINGS)
            # All along ways on which a limit is touched, as on level ones along the floor, blocks stay open for long.
            fraction = np.where((bounds.bound > -SIX_CABLES_UNDECIDED).all(0), 1.0 / TOUCHING, 1.0)
            self.is_stuck |= np.bincount(blocks.row, fraction * is_open, len(self._arcs)) > OPEN * self._arcs
            is_open &= ~self.is_stuck[blocks.row]
            if not is_open.any():
                break
            blocks = blocks.part(is_open)
            for _ in range(more):
                blocks = blocks.halves()
            halved += more
            bounds = look(blocks, halved)
        self.bound[self.is_refuted | self.is_stuck] = np.nan
        return first

    def refute(self, row: Float[np.ndarray, "k"], tau: Float[np.ndarray, "k"]) -> None:
        """Note motions that are refuted by something else than criteria."""
        self.is_refuted[row] = True
        is_new = np.isnan(self.instant[row])
        self.instant[row[is_new]] = tau[is_new]

    def _take_in(self, blocks: Blocks, bounds: BlockBounds, *, last: bool) -> np.ndarray:
        # Take in the bounds of blocks; return the mask of blocks to be halved.
        minimum, low = bounds.nodes.min(0).T, bounds.bound.T
        _lower(self.attained, blocks.row, minimum)
        slack = minimum[:, : low.shape[1]]
        # NaN refutes nothing, and proves nothing.
        self._note_instants(blocks, bounds)
        self.is_refuted[blocks.row[(slack < -self._near).any(1)]] = True
        is_above = (low > self._near) | self._ignored
        is_proved = is_above.all(1) & bounds.is_enough(self.attained)
        with np.errstate(invalid="ignore"):  # infinities: singular poses, blocks without a bound
            is_known = ((slack - low <= 0.5 * self._near) & ~is_above).any(1)
        is_done = is_proved | is_known | last | np.isnan(minimum).any(1)
        self.is_stuck[blocks.row[is_done & ~is_proved]] = True
        _lower(self.bound, blocks.row[is_done], low[is_done])
        return ~is_done & ~(self.is_refuted | self.is_stuck)[blocks.row]

    def _note_instants(self, blocks: Blocks, bounds: BlockBounds) -> None:
        worst = (bounds.nodes[:, : len(self._near)] + self._near[None, :, None]).min(1)
        place = worst.argmin(0)
        value, tau = worst[place, np.arange(len(place))], bounds.tau[place, np.arange(len(place))]
        breaks = np.flatnonzero(value < self._worst[blocks.row])
        breaks = breaks[np.argsort(-value[breaks], kind="stable")]  # the worst of a motion is written last
        self._worst[blocks.row[breaks]], self.instant[blocks.row[breaks]] = value[breaks], tau[breaks]


def _lower(values: np.ndarray, row: np.ndarray, others: np.ndarray) -> None:
    # Lower the smallest values to those of others, of which equal rows stand side by side.
    if len(row):
        first = np.flatnonzero(np.diff(row, prepend=-1))
        values[row[first]] = np.minimum(values[row[first]], np.minimum.reduceat(others, first))


def least_nodes(
    nodes: Sequence[Array], n_slacks: int, places: Float[np.ndarray, "m"]
) -> tuple[Float[Array, "1 n_criteria n"], Float[Array, "n"]]:
    """Reduce the node values of n blocks to the few numbers that a verdict needs; slacks are the first of them."""
    worst = smallest(list(nodes[:n_slacks]))
    is_there = worst == jnp.min(worst, axis=0)[None]
    first = jnp.min(jnp.where(is_there, places[:, None], jnp.inf), axis=0)
    return jnp.stack([jnp.min(x, axis=0) for x in nodes])[None], jnp.where(first <= 1.0, first, jnp.nan)
