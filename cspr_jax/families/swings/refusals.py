"""Limits that refuse every number of arcs of a point mass; see `verification.fewest_limits`."""

from __future__ import annotations

import jax
import numpy as np

from cspr_jax.families.swings.hypocycloid import Segment
from cspr_jax.families.swings.parities import pick
from cspr_jax.families.swings.proof.criteria import BASIC, flags
from cspr_jax.families.swings.proof.limit_screen import broken_at_samples, upcoming
from cspr_jax.families.swings.proof.verdicts import SMALL, first_pass, is_met_at_samples, prove
from cspr_jax.motion.limits import limits_set
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.shapes import Bool, Float, Num
from cspr_jax.numerics.tolerances import SMALLEST_MARGIN
from cspr_jax.robots.model.limits import NO_LIMITS
from cspr_jax.verification.fewest_limits import FewestLimits, Refused


def refusals(
    problem: Problem,
    parities: dict[int, Segment],
    upper: Float[np.ndarray, "n max_arcs"],
    refuted: Bool[np.ndarray, "n max_arcs n_criteria"],
) -> Refused:
    """Limits that refuse segments for which some number of arcs keeps cables taut."""
    fewest, alive = FewestLimits(len(upper), flags(problem.limits)), upper >= -SMALLEST_MARGIN
    while True:
        rows = np.flatnonzero(~fewest.is_best & alive.any(1))
        if not len(rows):
            return fewest.refused()
        rows, arcs = upcoming(alive, rows)
        alive[rows, arcs - 1] = False
        tells = fewest.may_change(rows, refuted[rows, arcs - 1])
        rows, arcs = rows[tells], arcs[tells]
        if not len(rows):
            continue
        taut = prove(problem._replace(limits=NO_LIMITS), pick(parities, rows, arcs), arcs).feasible
        rows, arcs = rows[taut], arcs[taut]
        # Take the candidates of each segment one after the other, since one may make the next ones superfluous.
        rank = np.arange(len(rows)) - np.searchsorted(rows, rows)
        left = np.argsort(rank, kind="stable")
        while len(left):
            left = left[~fewest.is_best[rows[left]]]
            left = left[fewest.may_change(rows[left], refuted[rows[left], arcs[left] - 1])]
            # Add the next candidates of the same segments until the batch is full: a full batch takes no longer.
            count = max(int(np.searchsorted(rank[left], rank[left[:1]], side="right").sum()), SMALL)
            batch, left = left[:count], left[count:]
            if len(batch):
                is_clear, broken = _limits_of(problem, parities, rows[batch], arcs[batch], fewest)
            for number in np.unique(rank[batch]):
                due = is_clear & (rank[batch] == number)
                fewest.take(rows[batch][due], arcs[batch][due], broken[due])


def _limits_of(
    problem: Problem, parities: dict[int, Segment], rows: np.ndarray, arcs: np.ndarray, fewest: FewestLimits
) -> tuple[np.ndarray, np.ndarray]:
    # Return which candidates with taut cables certainly break limits, and these limits, (n, n_criteria). A candidate
    # whose samples break all remaining limits is not proved: it changes nothing.
    segments = pick(parities, rows, arcs)
    coarse = first_pass(problem, segments, arcs.astype(float))
    is_limit = np.arange(BASIC + len(limits_set(problem.limits))) >= BASIC
    proof = prove(problem, segments, arcs, ignored=np.ones((len(arcs), len(is_limit)), bool), coarse=coarse)
    is_proved, broken = np.ones(len(arcs), bool), proof.broken & is_limit
    unclear = np.flatnonzero((is_limit & ~broken & ~proof.met).any(1) & fewest.may_change(rows, broken))
    for _ in range(int(is_limit.sum()) + 1):
        if not len(unclear):
            break
        part, seen = jax.tree.map(lambda array, rows=unclear: array[rows], (segments, coarse))
        again = prove(problem, part, arcs[unclear], ignored=broken[unclear] | ~is_limit, coarse=seen)
        is_proved[unclear] = again.feasible
        broken[unclear] |= again.broken & is_limit
        unclear = unclear[again.infeasible]
    return is_proved, broken


def unavoidable(
    problem: Problem,
    parities: dict[int, Segment],
    upper: Num[np.ndarray, "n max_arcs"],
    suspects: Bool[np.ndarray, "n n_criteria"],
) -> Bool[np.ndarray, "n n_criteria"]:
    """Criteria that every number of arcs breaks."""
    suspects, left = suspects.copy(), upper > -np.inf
    while True:
        rows = np.flatnonzero(suspects.any(1) & left.any(1))
        if not len(rows):
            return suspects
        rows, arcs = upcoming(left, rows)
        left[rows, arcs - 1] = False
        broken = broken_at_samples(problem, pick(parities, rows, arcs), arcs)
        unclear = np.flatnonzero((suspects[rows] & ~broken).any(1))
        if len(unclear):
            index, number = rows[unclear], arcs[unclear]
            broken[unclear] = ~is_met_at_samples(problem, pick(parities, index, number), number)
        np.logical_and.at(suspects, rows, broken)
