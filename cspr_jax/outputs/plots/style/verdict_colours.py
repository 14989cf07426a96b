"""Verdicts as colours: one reason for each cell, the first of those that its flags name."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cspr_jax.schema.verdicts import NO_REASON, Verdict

if TYPE_CHECKING:
    from jaxtyping import Int

# Deeper reasons come first, and refutations before open verdicts. The colours are Okabe and
# Ito's, and greys.
REASONS = {
    Verdict.NOT_ACCESSIBLE: ("not accessible", "#f4f4f4"),
    Verdict.ABOVE_SPOOLS: ("above the spools", "#9e9e9e"),
    Verdict.BELOW_FLOOR: ("below the floor", "#6f6f6f"),
    Verdict.SINGULAR: ("singular", "#D55E00"),
    Verdict.CABLE_CABLE: ("cables touch", "#CC79A7"),
    Verdict.CABLE_PLATFORM: ("cable touches platform", "#E69F00"),
    Verdict.OBSTACLE: ("obstacle touched", "#A6761D"),
    Verdict.WRENCH_INFEASIBLE: ("wrench infeasible", "#882255"),
    Verdict.SLACK_CABLE: ("slack cable", "#56B4E9"),
    Verdict.OVER_TENSION: ("too much tension", "#0072B2"),
    Verdict.CABLE_TOO_LONG: ("cable too long", "#8c6d31"),
    Verdict.CABLE_TOO_FAST: ("cable too fast", "#7b4173"),
    Verdict.CABLE_OVER_ACCELERATION: ("cable acceleration", "#bd9e39"),
    Verdict.TOO_FAST: ("too fast", "#A05195"),
    Verdict.OVER_ACCELERATION: ("acceleration", "#D9B44A"),
    Verdict.OVER_FEED: ("feed", "#C77CFF"),
    Verdict.UNCERTAINTY: ("not every robot", "#B3CDE3"),
    Verdict.UNDECIDED: ("undecided", "#F0E442"),
    Verdict.NOT_FINITE: ("not finite", "#000000"),
}
FEASIBLE_COLOUR = "#009E73"


def reasons(verdicts: Int[np.ndarray, "..."], unflagged: str) -> tuple[np.ndarray, list[str], list[str]]:
    """Verdicts as numbers of reasons."""
    flags = verdicts.astype(int) & ~NO_REASON.value
    numbers = np.zeros(flags.shape, int)
    for number, flag in reversed(list(enumerate(REASONS, start=1))):
        numbers = np.where(flags & flag.value, number, numbers)
    used = np.unique(numbers)
    entries = [(unflagged, FEASIBLE_COLOUR), *REASONS.values()]
    words, colours = zip(*(entries[number] for number in used), strict=True)
    return np.searchsorted(used, numbers), list(words), list(colours)
