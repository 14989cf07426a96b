"""Limits that refuse every number of arcs of a point mass; see `motions.fewest_limits`."""

import jax
import numpy as np

from cspr_jax.motions.fewest_limits import FewestLimits, Refused
from cspr_jax.motions.limits import limits_set
from cspr_jax.motions.problem import Problem
from cspr_jax.swings.criteria import flags
from cspr_jax.swings.hypocycloid import Segment
from cspr_jax.swings.parities import pick
from cspr_jax.swings.proof import SMALLEST_MARGIN, is_met_at_samples, prove

# Criteria that are no limits: taut cables, and the depth below the spools.
BASIC = 2


def refusals(problem: Problem, parities: dict[int, Segment], upper: np.ndarray) -> Refused:
    """Limits that refuse segments whose cables some number of arcs keeps taut.

    Args:
        parities: the segments for even (key 0) and odd (key 1) numbers of arcs, leaves (n, ...); none is feasible.
        upper: (n, max_arcs) upper bounds of the slack of the cables and of the depth; -inf where out of the question.

    Returns:
        the refusals.
    """
    is_limit = np.arange(BASIC + len(limits_set(problem.limits))) >= BASIC
    fewest, alive = FewestLimits(len(upper), flags(problem.limits)), upper >= -SMALLEST_MARGIN
    while True:
        rows = np.flatnonzero(~fewest.is_best & alive.any(1))
        if not len(rows):
            return fewest.refused()
        arcs = np.argmax(alive[rows], axis=1) + 1
        alive[rows, arcs - 1] = False
        is_taut, broken = _limits_of(problem, pick(parities, rows, arcs), arcs, is_limit)
        fewest.take(rows[is_taut], arcs[is_taut], broken[is_taut])


def _limits_of(
    problem: Problem, segments: Segment, arcs: np.ndarray, is_limit: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    # Return which candidates are proved but for the limits that they break, and these limits (n, n_criteria).
    proof = prove(problem, segments, arcs, ignored=np.tile(is_limit, (len(arcs), 1)))
    is_proved, broken = proof.feasible.copy(), proof.broken & is_limit
    unclear = np.flatnonzero(is_proved & (~broken & ~proof.met).any(1))
    for _ in range(int(is_limit.sum()) + 1):
        if not len(unclear):
            break
        part = jax.tree.map(lambda leaf, rows=unclear: leaf[rows], segments)
        again = prove(problem, part, arcs[unclear], ignored=broken[unclear])
        is_proved[unclear] = again.feasible
        broken[unclear] |= again.broken & is_limit
        unclear = unclear[again.infeasible]
    return is_proved, broken


def unavoidable(problem: Problem, parities: dict[int, Segment], upper: np.ndarray, suspects: np.ndarray) -> np.ndarray:
    """Criteria that every number of arcs breaks.

    Args:
        parities: the segments for even (key 0) and odd (key 1) numbers of arcs, leaves (n, ...).
        upper: (n, max_arcs) -inf at numbers of arcs that are out of the question.
        suspects: (n, n_criteria) criteria to be tested, each broken by some number of arcs.

    Returns:
        (n, n_criteria) which of them every number of arcs breaks: proved.
    """
    suspects, left = suspects.copy(), upper > -np.inf
    while True:
        rows = np.flatnonzero(suspects.any(1) & left.any(1))
        if not len(rows):
            return suspects
        arcs = np.argmax(left[rows], axis=1) + 1
        left[rows, arcs - 1] = False
        suspects[rows] &= ~is_met_at_samples(problem, pick(parities, rows, arcs), arcs)
