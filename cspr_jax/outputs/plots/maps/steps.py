"""Points of an axis as colours: the edges between them, and the scale of a quantity that takes these values."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib
import numpy as np
from matplotlib.colors import BoundaryNorm, ListedColormap

from cspr_jax.outputs.plots.style.colours import NONE_COLOUR, TOLD_APART, Scale, scale_of
from cspr_jax.outputs.plots.style.labels import as_drawn
from cspr_jax.schema.quantities import EVERY, best_name
from cspr_jax.store.reading.result import Result

if TYPE_CHECKING:
    from jaxtyping import Float


def number_scale(result: Result, name: str, values: np.ndarray) -> Scale:
    """The scale of a quantity whose numbers are no words."""
    choice = next((choice for axis, choice in result.choices.items() if best_name(axis) == name), None)
    points = np.zeros(0) if choice is None else np.unique(as_drawn(result, name, choice.points))
    if not 0 < len(points) <= TOLD_APART:
        return scale_of(values, signed=EVERY[name].signed)
    shades = matplotlib.colormaps["cividis"](np.linspace(0.0, 1.0, len(points)))
    return Scale(
        ListedColormap(list(shades)).with_extremes(bad=NONE_COLOUR),
        BoundaryNorm(edges(points), len(points)),
        ticks=(points.tolist(), [f"{point:.4g}" for point in points]),
        missing=bool(np.isnan(values).any()),
    )


def edges(points: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n+1"]:
    """Edges of cells about points."""
    if len(points) == 1:
        return points[0] + np.array([-0.5, 0.5]) * max(1.0, abs(points[0]))
    middles = 0.5 * (points[1:] + points[:-1])
    return np.concatenate([[1.5 * points[0] - 0.5 * points[1]], middles, [1.5 * points[-1] - 0.5 * points[-2]]])
