"""A figure in which few artists move from picture to picture; all others are drawn once."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from PIL import Image

from cspr_jax.numerics.shapes import Int


class MovingFigure(Figure):
    """Figure whose pictures differ in the moving artists; writers of films get them by `savefig`."""

    def draw_background(self, moving: Collection[Artist], dpi: float) -> None:
        """Draw everything behind the moving artists."""
        self.set_dpi(dpi)
        self._agg = FigureCanvasAgg(self)
        self._front = [artist for panel in self.axes for artist in _in_front(panel, moving)]
        for artist in self._front:
            artist.set_animated(True)
        self._agg.draw()
        self._background = self._agg.copy_from_bbox(self.bbox)

    def picture(self) -> Int[np.ndarray, "height width 4"]:
        """The current picture."""
        self._agg.restore_region(self._background)
        renderer = self._agg.get_renderer()
        for artist in self._front:
            artist.draw(renderer)
        return np.array(self._agg.buffer_rgba())

    def savefig(self, fname: Any, *, transparent: bool | None = None, **settings: Any) -> None:
        """Write the picture, as writers of films ask for it."""
        if settings["format"] == "png":
            Image.fromarray(self.picture()).save(fname, "png")
        else:
            fname.write(self.picture().tobytes())


def _in_front(panel: Any, moving: Collection[Artist]) -> list[Artist]:
    # Artists to draw for each picture: from the first moving artist on, all that lie in front of it. A legend beside
    # the panel overlaps nothing that moves, and would take as long to draw as all of these.
    drawn = sorted((artist for artist in panel.get_children() if artist is not panel.patch), key=Artist.get_zorder)
    first = next((index for index, artist in enumerate(drawn) if artist in moving), len(drawn))
    return [
        artist
        for artist in drawn[first:]
        if not isinstance(artist, Legend) or artist.get_window_extent().overlaps(panel.bbox)
    ]
