"""Smallest numbers, such as those of arcs, whose motions are proved: tried in increasing order, for many motions."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from cspr_jax.numerics.shapes import Int
from cspr_jax.schema.verdicts import FLAGS, Verdict

# Takes indices (m,) of motions, and the smallest number to try for each. Returns the number that was tried, which may
# be larger, or `NONE` without one; and the verdict.
Trial = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
NONE = -1
FEWER = FLAGS(Verdict.FEWER_ARCS_UNDECIDED)
UNDECIDED = FLAGS(Verdict.UNDECIDED | Verdict.FEWER_ARCS_UNDECIDED)


class Smallest(NamedTuple):
    """Smallest numbers of n motions.

    Fields:
        number: (n,) the smallest number that is proved; NONE: none is.
        undecided: (n,) the smallest number, up to that, for which it or a smaller one stayed undecided; NONE: none.
    """

    number: np.ndarray
    undecided: np.ndarray


def smallest_proved(
    trial: Trial, first: Int[np.ndarray, "n"], *, step: int, last: Int[np.ndarray, "n"] | int
) -> Smallest:
    """Smallest proved numbers from first ones, with a step, to last ones."""
    lower, last = np.array(first), np.broadcast_to(last, np.shape(first))
    number, undecided = np.full(len(lower), NONE), np.full(len(lower), NONE)
    is_open = lower <= last
    while is_open.any():
        index = np.flatnonzero(is_open)
        tried, verdict = trial(index, lower[index])
        verdict = np.asarray(verdict, FLAGS)
        is_proved, is_unsure = (verdict & ~FEWER) == 0, (verdict & UNDECIDED) != 0
        number[index[is_proved]] = tried[is_proved]
        is_first = is_unsure & (undecided[index] == NONE)
        undecided[index[is_first]] = tried[is_first]
        lower[index] = tried + step
        is_open[index] = ~is_proved & (tried != NONE) & (lower[index] <= last[index])
    return Smallest(number, undecided)
