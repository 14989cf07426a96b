"""Axes in space for a robot on its way, and the colours of its cables by tension."""

from typing import Any

import matplotlib
import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.ticker import FixedLocator, Locator, MaxNLocator

ELEVATION, AZIMUTH = 18.0, -62.0  # degrees, of the eye
# Around what is drawn, of its size.
ROOM = 0.04
# Sides below this part of the longest one have room for few ticks.
SHORT = 0.45


def colours_of_tension() -> ListedColormap:
    """Colours of cables from the lowest tension to the largest.

    Returns:
        plasma without the end that is too light on white.
    """
    return ListedColormap(matplotlib.colormaps["plasma"](np.linspace(0.0, 0.88, 256)))


def set_space(panel: Any, points: np.ndarray, *, is_down: bool, zoom: float = 0.9) -> None:
    """Axes of true proportions, seen from the side with z upward in the picture.

    Args:
        panel: axes in three dimensions.
        points: (n, 3) what is drawn, m.
        is_down: whether z points down; then y is turned too, so that nothing is mirrored.
        zoom: of the box; 1 fills the panel if it is a cube.
    """
    low, high = points.min(0), points.max(0)
    size = np.maximum(high - low, 0.1 * (high - low).max())
    middle = 0.5 * (low + high)
    signs = (1.0, -1.0, -1.0) if is_down else (1.0, 1.0, 1.0)
    for k, name in enumerate("xyz"):
        half = (0.5 + ROOM) * signs[k] * size[k]
        panel.set(**{f"{name}lim": (middle[k] - half, middle[k] + half), f"{name}label": f"{name} (m)"})
        getattr(panel, f"{name}axis").set_major_locator(_ticks(middle[k], size[k], size.max()))
    panel.set_box_aspect(tuple(size), zoom=zoom)
    panel.view_init(elev=ELEVATION, azim=AZIMUTH)


def _ticks(middle: float, size: float, largest: float) -> Locator:
    # Those near the ends of a short side would meet those of its neighbour.
    if size >= SHORT * largest:
        return MaxNLocator(4)
    every = np.asarray(MaxNLocator(3).tick_values(middle - 0.5 * size, middle + 0.5 * size))
    away = np.abs(every - middle)
    return FixedLocator(every[away <= max(0.35 * size, away.min())])
