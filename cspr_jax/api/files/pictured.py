"""Answers that draw themselves, and write the picture."""

from __future__ import annotations

import abc
from pathlib import Path
from typing import TYPE_CHECKING

from cspr_jax.api.arguments.checks import checked
from cspr_jax.errors.arguments import PictureSize

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Pictured(abc.ABC):
    """Answer about a robot that has one picture."""

    robot: str

    @abc.abstractmethod
    def _figure(self) -> Figure: ...

    @checked()
    def plot(
        self,
        *,
        size: PictureSize | None = None,
        dpi: float | None = None,
        font_size: float | None = None,
        preset: str | None = None,
        title: bool = True,
        output: str | Path | None = None,
    ) -> Figure:
        """Draw the answer, as the command of its name does with -o.

        Args:
            size: width and height, cm, as (16, 10) or "16x10"; None: the usual size of the picture.
            dpi: pixels per inch of a file; None: 160.
            font_size: size of the font, points; None: 10.
            preset: width of a "column" or a "page" of a paper, as in `plot`; None: neither.
            title: whether the title is drawn.
            output: picture to write; its ending selects the format. None: nothing is written.

        Returns:
            the figure of matplotlib.

        Raises:
            ConfigError: a size out of range, or an unknown picture format.
            StoreError: the picture cannot be written.
        """
        from cspr_jax.api.files.pictures import finished  # loads matplotlib
        from cspr_jax.outputs.plots.style.style import style_of

        return finished(self._figure, self.robot, style_of(size, dpi, font_size, preset, title=title), output)
