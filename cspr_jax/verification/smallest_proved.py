"""Smallest numbers, such as of arcs, whose motions are proved, tried in increasing order for many motions."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from cspr_jax.numerics.shapes import Int
from cspr_jax.schema.verdicts import FLAGS, Verdict

# A function of indices (m,) of motions, and of the smallest number to try for each. It returns the number that was
# tried, which may be larger, or `NONE`; and the verdict.
Trial = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
NONE = -1
FEWER = FLAGS(Verdict.FEWER_ARCS_UNDECIDED)
UNDECIDED = FLAGS(Verdict.UNDECIDED | Verdict.FEWER_ARCS_UNDECIDED)


class Smallest(NamedTuple):
    """Smallest numbers of n motions.

    Fields:
        number: (n,) smallest number that is proved; NONE: there is none.
        undecided: (n,) smallest number up to `number` that stayed undecided, or left smaller ones undecided; NONE:
            there is none.
    """

    number: np.ndarray
    undecided: np.ndarray


def smallest_proved(
    trial: Trial, first: Int[np.ndarray, "n"], *, step: int, last: Int[np.ndarray, "n"] | int
) -> Smallest:
    """Smallest proved numbers among those from a first to a last number, in steps."""
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
