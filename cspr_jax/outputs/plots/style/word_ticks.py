"""Colours and ticks of quantities whose values stand for words: verdicts, and names of binding limits."""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.colors import BoundaryNorm, ListedColormap, to_hex

from cspr_jax.numerics.shapes import Num
from cspr_jax.outputs.plots.style.colours import NONE_COLOUR, Scale
from cspr_jax.outputs.plots.style.labels import COLOURS
from cspr_jax.schema.limits import LIMITS
from cspr_jax.schema.map_kinds import quantity_of
from cspr_jax.schema.meanings import meanings_of
from cspr_jax.schema.verdicts import NO_REASON, Verdict
from cspr_jax.store.reading.result import Result

OF_LIMITS = {limit.flag: (limit.legend, limit.colour) for limit in LIMITS}
# Words and colours of verdicts: more fundamental reasons come first, and failures before undecided verdicts. The
# colours are Okabe and Ito's, and greys.
REASONS = {
    Verdict.NOT_ACCESSIBLE: ("not accessible", "#f4f4f4"),
    Verdict.ABOVE_SPOOLS: ("above the spools", "#9e9e9e"),
    Verdict.BELOW_FLOOR: OF_LIMITS[Verdict.BELOW_FLOOR],
    Verdict.SINGULAR: ("singular", "#D55E00"),
    Verdict.CABLE_CABLE: ("cables touch", "#CC79A7"),
    Verdict.CABLE_PLATFORM: ("cable touches platform", "#E69F00"),
    Verdict.OBSTACLE: ("obstacle touched", "#A6761D"),
    Verdict.WRENCH_INFEASIBLE: ("wrench infeasible", "#882255"),
    **OF_LIMITS,
    Verdict.OVER_FEED: ("feed", "#C77CFF"),
    Verdict.UNCERTAINTY: ("not every robot", "#B3CDE3"),
    Verdict.UNDECIDED: ("undecided", "#F0E442"),
    Verdict.NOT_FINITE: ("not finite", "#000000"),
}
FEASIBLE_COLOUR = "#009E73"
# Colours of other words, also Okabe and Ito's; if there are more words, all get shades of a continuous scale.
MORE = (*COLOURS, "#F0E442", "#000000")


def worded(result: Result, name: str, values: Num[np.ndarray, "..."]) -> tuple[np.ndarray, list[str], list[str]] | None:
    """Values of a quantity as indices of words, these words, and their colours; None: the values are numbers."""
    quantity = quantity_of(result.attributes.get("map"), name)
    if quantity.unflagged:
        return reasons(values, quantity.unflagged)
    words = meanings_of(quantity, result.settings)
    return _named(values, words) if words else None


def _named(values: np.ndarray, words: tuple[str, ...]) -> tuple[np.ndarray, list[str], list[str]]:
    # If there are enough colours, each word has the same colour in all pictures of a sweep. 0 stands for none.
    used = np.unique(values)
    few = len(words) - 1 <= len(MORE)
    ranks = used - 1 if few else np.arange(len(used)) - (0 in used)
    shades = MORE if few else [to_hex(c) for c in matplotlib.colormaps["viridis"](np.linspace(0.0, 1.0, len(used)))]
    texts = [words[number] if number < len(words) else f"{number}" for number in used.tolist()]
    colours = [shades[rank % len(shades)] if number else NONE_COLOUR for number, rank in zip(used, ranks, strict=True)]
    return np.searchsorted(used, values), texts, colours


def word_scale(words: list[str], colours: list[str]) -> Scale:
    """The scale of numbers that stand for words."""
    norm = BoundaryNorm(np.arange(len(colours) + 1) - 0.5, len(colours))
    return Scale(ListedColormap(colours), norm, ticks=([float(i) for i in range(len(words))], words))


def reasons(verdicts: Num[np.ndarray, "..."], unflagged: str) -> tuple[np.ndarray, list[str], list[str]]:
    """Verdicts as indices of reasons, the reasons in words, and their colours."""
    flags = verdicts.astype(int) & ~NO_REASON.value
    numbers = np.zeros(flags.shape, int)
    for number, flag in reversed(list(enumerate(REASONS, start=1))):
        numbers = np.where(flags & flag.value, number, numbers)
    used = np.unique(numbers)
    entries = [(unflagged, FEASIBLE_COLOUR), *REASONS.values()]
    words, colours = zip(*(entries[number] for number in used), strict=True)
    return np.searchsorted(used, numbers), list(words), list(colours)
