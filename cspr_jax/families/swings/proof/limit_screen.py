"""Second screen, for limits: a few samples refute most numbers of arcs that clearly break a limit.

The screen takes candidates when the search comes to them, as many at a time as a batch holds. A sample that breaks a
limit by more than rounding refutes a candidate; the screen accepts none.
"""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.families.swings.hypocycloid import Segment
from cspr_jax.families.swings.parities import pick
from cspr_jax.families.swings.proof.criteria import BASIC, slacks
from cspr_jax.families.swings.proof.verdicts import BATCH, tolerance
from cspr_jax.motion.limits import limits_set
from cspr_jax.motion.problem import Problem, touchable
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.linear.lanes import smallest_of_each
from cspr_jax.numerics.shapes import Bool, Int, Num
from cspr_jax.runtime.persistent_jit import persistent_jit

SAMPLES = 32
# A sample refutes a candidate if its slack is below minus this multiple of the tolerance with which
# `families.swings.proof.verdicts` refutes a limit.
FAR = 2.0


class LimitScreen:
    """Candidates of n segments: which ones remain, and the limits that each breaks at samples.

    Args:
        parities: the segments for even (key 0) and odd (key 1) numbers of arcs, leaves (n, ...).
        alive: (n, max_arcs) mask of candidates, column p - 1 for p arcs.

    Attributes:
        alive: (n, max_arcs) candidates that are not refuted.
        broken: (n, max_arcs, n_criteria) criteria that a candidate breaks at a sample; only limits.
    """

    def __init__(self, problem: Problem, parities: dict[int, Segment], alive: np.ndarray) -> None:
        """Start without any candidate screened."""
        n_limits = len(limits_set(problem.limits))
        self._problem, self._parities = problem, parities
        self._unseen = alive.copy() if n_limits else np.zeros_like(alive)
        self.alive, self.broken = alive.copy(), np.zeros((*alive.shape, BASIC + n_limits), bool)

    def screened(self, rows: Int[np.ndarray, "m"]) -> Int[np.ndarray, "k"]:
        """Screen until the first remaining candidate of each segment has passed; return the segments that have one."""
        while True:
            rows = rows[self.alive[rows].any(1)]
            open_rows = rows[self._unseen[rows, np.argmax(self.alive[rows], axis=1)]]
            if not len(open_rows):
                return rows
            self._see(*upcoming(self._unseen, open_rows))

    def _see(self, rows: np.ndarray, arcs: np.ndarray) -> None:
        broken = broken_at_samples(self._problem, pick(self._parities, rows, arcs), arcs)
        self.broken[rows, arcs - 1] = broken
        self._unseen[rows, arcs - 1] = False
        self.alive[rows, arcs - 1] &= ~broken.any(1)


def broken_at_samples(
    problem: Problem, segments: Segment, arcs: Num[np.ndarray, "n"]
) -> Bool[np.ndarray, "n n_criteria"]:
    """Limits that some sample breaks by more than rounding."""
    lowest, near = in_batches(
        partial(_lowest, touchable(problem)), (segments, np.asarray(arcs, float)), batch_size=BATCH
    )
    return np.concatenate([np.zeros((len(lowest), BASIC), bool), lowest < -FAR * near[:, None]], axis=1)


def upcoming(
    candidates: Bool[np.ndarray, "n max_arcs"], rows: Int[np.ndarray, "m"]
) -> tuple[Num[np.ndarray, "k"], Num[np.ndarray, "k"]]:
    """Next candidates of segments: one each, or until a batch is full, which takes no longer."""
    left = candidates[rows]
    owner, column = np.nonzero(left & (np.cumsum(left, axis=1) <= max(BATCH // len(rows), 1)))
    return rows[owner], column + 1


@persistent_jit
def _lowest(problem: Problem, arguments) -> tuple[Array, Array]:
    # Return the smallest sampled slack of each limit (n, n_limits), and the tolerances (n,).
    segments, arcs = arguments
    tau = jnp.broadcast_to(((jnp.arange(SAMPLES, dtype=arcs.dtype) + 0.5) / SAMPLES)[:, None], (SAMPLES, len(arcs)))
    values = jax.vmap(jax.vmap(partial(slacks, *problem)), in_axes=(None, None, 0))(segments, arcs, tau)
    near = jax.vmap(partial(tolerance, problem.amplitude, minimum=0.0))(segments, arcs)
    return jnp.stack(smallest_of_each(values[BASIC:]), axis=1), near
