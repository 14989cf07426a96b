"""Reasons why no candidate is feasible, if possible a single limit.

A limit can be raised, but a cable cannot push, and two cables cannot pass through each other. So candidates that
violate only limits come first. Among them, the first one that violates a single limit, and is proved otherwise, shows
which limit to raise; candidates that keep the smallest tension are preferred, so that a cable is called slack only if
no other limit is the reason. If each candidate violates several limits, the one with the fewest is taken; limits that
all candidates violate are named if there is more than one. If every candidate fails another criterion, that criterion
is the reason, together with the limits that are violated for every number of arcs.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cspr_jax.numerics.shapes import Bool, Int, Num
from cspr_jax.schema.verdicts import Verdict


class Refused(NamedTuple):
    """Candidates of n motions that violate only limits.

    Fields:
        arcs: (n,) number of arcs of the candidate; 0: there is none.
        broken: (n, n_criteria) mask of the limits that it violates.
    """

    arcs: np.ndarray
    broken: np.ndarray


def rank(flags: Sequence[Verdict], broken: Bool[np.ndarray, "n n_criteria"]) -> Int[np.ndarray, "n"]:
    """Rank of candidates by the limits that they violate."""
    is_slack = np.array([flag == Verdict.SLACK_CABLE for flag in flags])
    return 2 * broken.sum(1) + (broken & is_slack).any(1)


class FewestLimits:
    """Candidates of n motions that violate the fewest limits, and limits that all candidates of a motion violate.

    Args:
        flags: flags of the criteria.
    """

    def __init__(self, count: int, flags: Sequence[Verdict]) -> None:
        """Begin without candidates."""
        self._flags, shape = flags, (count, len(flags))
        self._arcs, self._broken, self._common = np.zeros(count, int), np.zeros(shape, bool), np.ones(shape, bool)
        self._least = np.full(count, 2 * len(flags) + 2)

    def take(
        self, rows: Int[np.ndarray, "m"], arcs: Num[np.ndarray, "m"], broken: Bool[np.ndarray, "m n_criteria"]
    ) -> None:
        """Add candidates that are proved except for limits."""
        ranks = rank(self._flags, broken)
        better = ranks < self._least[rows]
        self._arcs[rows[better]], self._broken[rows[better]] = arcs[better], broken[better]
        self._least[rows[better]] = ranks[better]
        self._common[rows] &= broken

    def may_change(self, rows: Int[np.ndarray, "m"], broken: Bool[np.ndarray, "m n_criteria"]) -> Bool[np.ndarray, "m"]:
        """Tell which candidates can change the result, because they may violate fewer limits, or others."""
        return (rank(self._flags, broken) < self._least[rows]) | (self._common[rows] & ~broken).any(1)

    @property
    def is_best(self) -> np.ndarray:
        """Tell for each motion whether its candidate violates at most one limit, so that none can be better, (n,)."""
        return self._least <= 2

    def refused(self) -> Refused:
        """Candidates that violate the fewest limits, and the limits to name."""
        is_common = (self._common.sum(1) > 1) & (self._arcs > 0)
        return Refused(self._arcs, np.where(is_common[:, None], self._common, self._broken))
