"""Films as GIF: at most 256 colours for all pictures together, since choosing colours takes longer than drawing."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.animation import AbstractMovieWriter
from PIL import Image

from cspr_jax.numerics.shapes import Int
from cspr_jax.outputs.plots.films.moving_figure import MovingFigure

# Number of pictures from which colours are taken; number of colours that are kept exactly, such as white and greys,
# which cover most of a picture; and number of all colours.
SAMPLES = 8
EXACT = 32
COLOURS = 256


class GifWriter(AbstractMovieWriter):
    """A writer of films for matplotlib."""

    def setup(self, fig: Any, outfile: Any, dpi: float | None = None) -> None:
        """Begin a film."""
        super().setup(fig, outfile, dpi=dpi)
        self._moving: MovingFigure = fig
        self._pictures = list[np.ndarray]()

    def grab_frame(self, **savefig_kwargs: Any) -> None:
        """Take the figure's picture."""
        self._pictures.append(self._moving.picture())

    def finish(self) -> None:
        """Write the file."""
        last = len(self._pictures) - 1
        indices = np.unique(np.linspace(0, last, SAMPLES).round().astype(int))
        colours = shared_colours([self._pictures[i] for i in indices])
        nearest = np.full(256**3, -1, np.int16)
        first, *others = (_in_colours(picture, colours, nearest) for picture in self._pictures)
        first.save(self.outfile, "gif", save_all=True, append_images=others, duration=round(1000 / self.fps), loop=0)


def shared_colours(pictures: list[np.ndarray]) -> Int[np.ndarray, "n 3"]:
    """Colours for pictures: the most frequent ones exactly, and means of the others."""
    numbers, counts = np.unique(np.stack([_number(picture) for picture in pictures]), return_counts=True)
    order = np.argsort(-counts, kind="stable")
    colours, counts = _colour(numbers[order]), counts[order]
    if len(colours) <= COLOURS:
        return colours
    # The square root gives thin lines colours of their own in spite of large areas.
    weighted = np.repeat(colours[EXACT:], np.sqrt(counts[EXACT:]).astype(int), axis=0)
    means = Image.fromarray(weighted[None]).quantize(COLOURS - EXACT).getpalette() or []
    return np.concatenate([colours[:EXACT], np.reshape(means, (-1, 3)).astype(np.uint8)])


def _in_colours(picture: np.ndarray, colours: np.ndarray, nearest: np.ndarray) -> Image.Image:
    # Pillow finds the nearest colour by six of eight bits, which makes white grey. `nearest` caches results.
    numbers = _number(picture)
    new = np.unique(numbers[nearest[numbers] < 0])
    differences = _colour(new).astype(int)[:, None] - colours.astype(int)
    nearest[new] = np.sum(differences**2, axis=2).argmin(1)
    image = Image.fromarray(nearest[numbers].astype(np.uint8))
    image.putpalette(colours.tobytes())
    return image


def _number(picture: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(picture).view("<u4")[..., 0] & 0xFFFFFF


def _colour(numbers: np.ndarray) -> np.ndarray:
    return np.stack([numbers & 255, numbers >> 8 & 255, numbers >> 16], axis=-1).astype(np.uint8)
