"""Colours of the cells of a map, with a scale that a few extreme cells do not stretch."""

import dataclasses
from typing import Any

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, Colormap, ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from cspr_jax.outputs.plots.style.layout import is_narrow

NONE_COLOUR = "#d0d0d0"
BULK_FRACTION = 0.98  # fraction of the cells that the scale covers, where a scale of all cells would be too long
LARGEST_RATIO = 1.5  # a scale of all cells is too long above this ratio of its length to that of the covered cells
FEW = 10  # up to this number of cells the scale covers all; with more, at least one may lie beyond
# Up to this number of different counts each has a colour.
TOLD_APART = 12
# Computing colours of larger values would overflow; no quantity of a robot is as large.
LARGEST = 1e100


@dataclasses.dataclass(frozen=True)
class Scale:
    """Colours of values.

    Fields:
        colours: the colour map.
        norm: bounds of the scale.
        extend: ends beyond which there are values: "neither", "min", "max" or "both".
        beyond: words for the values beyond the ends; empty for none.
        ticks: ticks of the bar, with their texts; None: chosen automatically.
        is_integer: whether all values are whole numbers.
        missing: whether there are cells without a value.
    """

    colours: Colormap
    norm: Normalize
    extend: str = "neither"
    beyond: str = ""
    ticks: tuple[list[float], list[str]] | None = None
    is_integer: bool = False
    missing: bool = False


def scale_of(data: np.ndarray, *, signed: bool = False) -> Scale:
    """The scale of the values that a picture shows."""
    if data.dtype.kind in "iu":
        return _of_counts(data)
    data = data.astype(float)  # single precision could not hold LARGEST
    inside = data[np.abs(data) < LARGEST]
    low, high = (float(inside.min()), float(inside.max())) if inside.size else (0.0, 1.0)
    minimum, maximum = low, high
    if signed:
        maximum = _bulk(np.abs(inside)) if inside.size else 1.0
        high = max(abs(low), abs(high)) or 1.0
        maximum = maximum if high > LARGEST_RATIO * maximum > 0.0 else high
        minimum, low = -maximum, -high
    elif inside.size:
        upper, lower = _bulk(inside), -_bulk(-inside)
        maximum = upper if high - low > LARGEST_RATIO * (upper - low) > 0.0 else high
        minimum = lower if maximum - low > LARGEST_RATIO * (maximum - lower) > 0.0 else low
    above, below = bool((data > maximum).any()), bool((data < minimum).any())
    colours = matplotlib.colormaps["PuOr_r" if signed else "cividis"].with_extremes(bad=NONE_COLOUR)
    if maximum <= minimum:
        maximum = minimum + (abs(minimum) or 1.0)
    extend = {(False, False): "neither", (True, False): "max", (False, True): "min"}.get((above, below), "both")
    # Infinite values have no number to show.
    ends = data[np.isfinite(data)]
    words = [f"up to {float(ends.max()):.3g}"] if (ends > maximum).any() else []
    words += [f"down to {float(ends.min()):.3g}"] if (ends < minimum).any() else []
    full = bool((inside == np.round(inside)).all())
    return Scale(
        colours,
        Normalize(minimum, maximum),
        extend,
        ", ".join(words),
        is_integer=full,
        missing=bool(np.isnan(data).any()),
    )


def _bulk(values: np.ndarray) -> float:
    # A quantile that is one of the values, not an interpolated one.
    part = 1.0 if values.size <= FEW else min(BULK_FRACTION, 1.0 - 1.5 / values.size)
    return float(np.quantile(values, part, method="inverted_cdf"))


def _of_counts(data: np.ndarray) -> Scale:
    # Counts from 1 on have a colour each; 0 and less stand for none.
    counts = data[data > 0]
    minimum, maximum = (int(counts.min()), int(counts.max())) if counts.size else (1, 1)
    bulk = int(_bulk(counts)) if counts.size else 1
    stretched = maximum - minimum + 1 > max(TOLD_APART, LARGEST_RATIO * (bulk - minimum + 1))
    end = max(bulk, minimum + TOLD_APART // 2) if stretched else maximum
    number, more, none = end - minimum + 1, end < maximum, bool((data <= 0).any())
    shades = matplotlib.colormaps["viridis"](np.linspace(0.0, 1.0, number + more))
    bounds = np.arange(minimum, end + 2) - 0.5
    step = next(step * 10**k for k in range(10) for step in (1, 2, 5) if number <= 12 * step * 10**k)
    ticks = [float(tick) for tick in range(-(-minimum // step) * step, end + 1, step)] or [float(minimum)]
    texts = [f"{tick:.0f}" for tick in ticks]
    if none:
        bounds = np.concatenate([[min(-0.5, float(data.min()) - 0.5)], bounds])
        ticks, texts = [float(bounds[:2].mean()), *ticks], ["none", *texts]
    shown = [NONE_COLOUR, *shades[:number]] if none else list(shades[:number])
    colours = ListedColormap(shown).with_extremes(over=shades[-1])
    beyond, extend = (f"up to {maximum}", "max") if more else ("", "neither")
    return Scale(colours, BoundaryNorm(bounds, len(shown)), extend, beyond, (ticks, texts), is_integer=True)


def add_bar(figure: Figure, image, panels: list[Axes], scale: Scale, words: str) -> dict[str, Artist]:
    """Explain colours: by a bar beside the panels, or below them in a narrow picture; words by entries of a legend."""
    ticks, texts = scale.ticks or ([], [])
    if is_narrow() and texts and not any(text.lstrip("-").isdigit() for text in texts):
        return {text: Patch(color=image.cmap(image.norm(tick))) for tick, text in zip(ticks, texts, strict=True)}
    text = f"{words}; {scale.beyond}" if scale.beyond else words
    where: dict[str, Any] = {"location": "bottom", "aspect": 30, "pad": 0.02} if is_narrow() else {"shrink": 0.9}
    bar = figure.colorbar(image, ax=panels, extend=scale.extend, label=text, spacing="uniform", **where)
    if scale.ticks is not None:
        bar.set_ticks(scale.ticks[0], labels=scale.ticks[1])
        bar.ax.minorticks_off()
    elif scale.is_integer:
        bar.locator = MaxNLocator(8, integer=True)
        bar.update_ticks()
    return {}
