"""Text that fits into a picture: long names cut, long lines broken."""

from typing import Literal

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.text import Text

from cspr_jax.errors import one_line

LONGEST_NAME = 40


def shortened(text: str, most: int = LONGEST_NAME) -> str:
    """A text from a file, on one line and not too long.

    Args:
        text: anything.
        most: how many letters at most.

    Returns:
        the text, or its beginning and its end.
    """
    text = one_line(text)
    if len(text) <= most:
        return text
    tail = (most - 3) // 3
    return f"{text[: most - 3 - tail]}...{text[len(text) - tail :]}"


def fit(figure: Figure) -> None:
    """Break titles and labels that are longer than their place, at commas or else at spaces; legends likewise.

    Args:
        figure: with its final size.
    """
    width, height = figure.bbox.width, figure.bbox.height
    if figure.get_suptitle():
        _break(figure.suptitle(figure.get_suptitle()), 0.97 * width)
    for legend in list(figure.legends):
        _fit_legend(figure, legend, 0.98 * width)
    for panel in figure.axes:
        if not panel.get_visible() or panel.name == "3d":
            continue
        columns, rows = _shares(panel)
        _break(panel.title, 0.85 * width * columns)
        _break(panel.xaxis.label, 0.85 * width * columns)
        _break(panel.yaxis.label, 0.85 * height * rows, upright=True)


def _fit_legend(figure: Figure, legend: Legend, room: float) -> None:
    # Below the panels: as many entries side by side as fit, then entries on several lines.
    handles = [handle for handle in legend.legend_handles if handle is not None]
    words = [text.get_text() for text in legend.get_texts()]
    where: Literal["lower center", "outside lower center"]
    where = "lower center" if figure.get_layout_engine() is None else "outside lower center"
    for columns in range(len(words) - 1, 0, -1):
        if legend.get_window_extent().width <= room:
            return
        legend.remove()
        legend = figure.legend(handles, words, loc=where, ncols=columns)
    beside = legend.get_window_extent().width - max(text.get_window_extent().width for text in legend.get_texts())
    for text in legend.get_texts():
        _break(text, room - beside)


def _shares(panel: Axes) -> tuple[float, float]:
    # Of the picture's width and height; a colour bar beside several panels has no place in their grid.
    place = panel.get_subplotspec()
    if place is None:
        return 1.0, 1.0
    grid = place.get_gridspec()
    return len(place.colspan) / grid.ncols, len(place.rowspan) / grid.nrows


def _break(text: Text, room: float, *, upright: bool = False) -> None:
    given = text.get_text()
    if not given.strip():
        return

    def fits(line: str) -> bool:
        text.set_text(line)
        extent = text.get_window_extent()
        return (extent.height if upright else extent.width) <= room

    lines = []
    for line in given.split("\n"):
        broken = [line] if fits(line) else _packed(line.split(", "), ", ", fits)
        for part in broken:
            lines += [part] if fits(part) else _packed(part.split(" "), " ", fits)
    text.set_text("\n".join(lines))


def _packed(parts: list[str], joint: str, fits) -> list[str]:
    # As many parts on each line as fit; the joint stays at the end of a line that goes on.
    lines = [parts[0]]
    for part in parts[1:]:
        if fits(lines[-1] + joint + part):
            lines[-1] += joint + part
        else:
            lines[-1] += joint.rstrip()
            lines.append(part)
    return lines
