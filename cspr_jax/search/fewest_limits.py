"""Why no candidate is feasible: the limit that alone stands in the way, if there is one.

A limit can be raised, but a cable cannot push, and two cables cannot pass through each other. So candidates that only
limits refuse come first. Of these the first one that breaks a single limit, and is proved but for that, says what is
missing. Where there is none, the one that breaks the fewest does; of several limits those that all candidates break are
named, if these are more than one. Where limits alone refuse no candidate, what is no limit is the reason, and with it
the limits that every number of arcs breaks.
"""

from typing import NamedTuple

import numpy as np


class Refused(NamedTuple):
    """Candidates of n motions that only limits refuse.

    Fields:
        arcs: (n,) number of arcs of the candidate; 0: there is none.
        broken: (n, n_criteria) limits that stand in its way.
    """

    arcs: np.ndarray
    broken: np.ndarray


class FewestLimits:
    """Of n motions the candidate that breaks the fewest limits, and the limits that all candidates break.

    Args:
        count: of motions.
        n_criteria: of each.
    """

    def __init__(self, count: int, n_criteria: int) -> None:
        """There is no candidate yet."""
        self._arcs, self._broken = np.zeros(count, int), np.zeros((count, n_criteria), bool)
        self._least = np.full(count, n_criteria + 1)
        self._common = np.ones((count, n_criteria), bool)

    def take(self, rows: np.ndarray, arcs: np.ndarray, broken: np.ndarray) -> None:
        """Take in candidates that are proved but for limits.

        Args:
            rows: (m,) numbers of their motions, each at most once.
            arcs: (m,) numbers of arcs.
            broken: (m, n_criteria) the limits that each breaks.
        """
        counts = broken.sum(1)
        better = counts < self._least[rows]
        self._arcs[rows[better]], self._broken[rows[better]] = arcs[better], broken[better]
        self._least[rows[better]] = counts[better]
        self._common[rows] &= broken

    @property
    def is_single(self) -> np.ndarray:
        """Whether one limit at most refuses a candidate, so that no other one is better, (n,)."""
        return self._least <= 1

    def refused(self) -> Refused:
        """What was found.

        Returns:
            the candidates, and what is named.
        """
        is_common = (self._common.sum(1) > 1) & (self._arcs > 0)
        return Refused(self._arcs, np.where(is_common[:, None], self._common, self._broken))
