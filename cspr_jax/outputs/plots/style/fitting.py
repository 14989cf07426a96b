"""Fitting of text into a picture: long names are cut, long lines broken."""

import itertools
import re
import warnings
from collections.abc import Callable
from typing import Any, Literal

from matplotlib.axes import Axes
from matplotlib.axis import Tick
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.text import Text
from matplotlib.ticker import FixedFormatter, FixedLocator, FuncFormatter, MaxNLocator

from cspr_jax.errors import printable

LONGEST_NAME = 40
# Smallest number of letters of a title of one line.
SHORTEST = 8
# A hyphen before a number, and not within a word.
HYPHEN = re.compile(r"(?<![\w.\-])-(?=\.?\d)")
# Beginning of the line of a title that names segments that are not proved feasible.
DOUBT = "NOT PROVED FEASIBLE"
# Largest width of a legend above a panel, as a fraction of the panel's slot: tick labels take the rest.
BETWEEN_LABELS = 0.82
ABOVE = "legend above its panel"
# Largest numbers of intervals between ticks, tried one after the other.
FEWER_TICKS = (5, 4, 3, 2, 1)


def shortened(text: str, maximum: int = LONGEST_NAME) -> str:
    """A text from a file, joined to one line and cut to a length."""
    text = printable(text)
    if len(text) <= maximum:
        return text
    tail = (maximum - 3) // 3
    return f"{text[: maximum - 3 - tail]}...{text[len(text) - tail :]}"


def fit(figure: Figure, *, has_title: bool = True, lines: int | None = None) -> None:
    """Break titles, labels and legends that are longer than their space, at commas or else at spaces.

    Hyphens before numbers become minus signs.
    """
    width, height = figure.bbox.width, figure.bbox.height
    _fit_title(figure, 0.97 * width, has_title=has_title, lines=lines)
    for text in figure.findobj(Text):
        text.set_text(with_minus(text.get_text()))
    for legend in list(figure.legends):
        _fit_legend(figure, legend, 0.98 * width)
    for panel in figure.axes:
        if not panel.get_visible() or panel.name == "3d":
            continue
        columns, rows = _fractions(panel)
        _fit_above(panel, BETWEEN_LABELS * width * columns)
        _fit_ticks(panel)
        _break(panel.title, 0.85 * width * columns)
        _break(panel.xaxis.label, 0.85 * width * columns)
        _break(panel.yaxis.label, 0.85 * height * rows, upright=True)


def with_minus(text: str) -> str:
    """A text whose negative numbers have a minus sign, not a hyphen."""
    return HYPHEN.sub("\u2212", text)


def share_of_panels(figure: Figure) -> float:
    """Fraction of a picture's height that its panels take."""
    spans = sorted(
        (panel.get_position(original=panel.name == "3d").intervaly for panel in figure.axes if _is_panel(panel)),
        key=lambda span: float(span[0]),
    )
    total, end = 0.0, 0.0
    for low, high in spans:
        total += max(0.0, float(high) - max(float(low), end))
        end = max(end, float(high))
    return min(total, 1.0)


def _is_panel(panel: Axes) -> bool:
    return panel.get_visible() and panel.get_label() != "<colorbar>"


def thin_ticks(figure: Figure) -> None:
    """Give horizontal axes fewer ticks where their numbers would overlap."""
    panels = [panel for panel in figure.axes if panel.get_visible() and panel.name == "rectilinear"]
    panels = [panel for panel in panels if isinstance(panel.xaxis.get_major_locator(), MaxNLocator)]
    for count in FEWER_TICKS:
        if not panels:
            return
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "constrained_layout not applied")
            figure.draw_without_rendering()
        drawn = {panel: _ticks(panel) for panel in panels}
        panels = [panel for panel, ticks in drawn.items() if _labels_meet(ticks)]
        for panel in panels:
            # Two numbers are enough to show a scale: keep the outer ones if nothing else fits.
            ends = FixedLocator([drawn[panel][0].get_loc(), drawn[panel][-1].get_loc()])
            panel.xaxis.set_major_locator(MaxNLocator(count) if count > 1 else ends)


def _ticks(panel: Axes) -> list[Tick]:
    low, high = sorted(panel.get_xlim())
    return [tick for tick in panel.xaxis.get_major_ticks() if low <= tick.get_loc() <= high]


def _labels_meet(ticks: list[Tick]) -> bool:
    boxes = [tick.label1.get_window_extent().padded(1.0) for tick in ticks if tick.label1.get_visible()]
    return any(one.overlaps(other) for one, other in itertools.pairwise(boxes))


def _fit_title(figure: Figure, space: float, *, has_title: bool, lines: int | None) -> None:
    title = figure.get_suptitle()
    doubts = [line for line in title.split("\n") if line.startswith(DOUBT)]
    if not title:
        return
    text = figure.suptitle(title)
    if not has_title:
        text.set_text("\n".join(doubts))
        text.set_in_layout(bool(doubts))
        title = text.get_text()
    if lines is None:
        _break(text, space)
        return
    first = title.split("\n")[0]
    line = f"{first.split(':')[0]}: {doubts[0]}" if doubts and has_title else first
    for maximum in range(len(line), SHORTEST, -1):
        text.set_text(shortened(line, maximum))
        if text.get_window_extent().width <= space:
            return


def _fit_above(panel: Axes, space: float) -> None:
    # A legend above its panel gets as many entries per line as fit.
    legend = panel.get_legend()
    if legend is None or legend.get_gid() != ABOVE:
        return
    handles = [handle for handle in legend.legend_handles if handle is not None]
    words = [text.get_text() for text in legend.get_texts()]
    for columns in _fewer_columns(len(words)):
        if legend.get_window_extent().width <= space:
            return
        legend = legend_above(panel, columns, handles, words)


def legend_above(panel: Axes, columns: int, handles: list | None = None, words: list[str] | None = None) -> Legend:
    """A legend above a panel, at its right; `fit` breaks it into lines."""
    entries: Any = panel.get_legend_handles_labels() if handles is None or words is None else (handles, words)
    legend = panel.legend(
        *entries,
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        borderaxespad=0.2,
        ncols=columns,
        frameon=False,
        columnspacing=1.2,
        handlelength=1.8,
    )
    legend.set_gid(ABOVE)
    return legend


def _fit_ticks(panel: Axes) -> None:
    for axis in (panel.xaxis, panel.yaxis):
        formatter = axis.get_major_formatter()
        if isinstance(formatter, FuncFormatter):
            axis.set_major_formatter(FuncFormatter(_minus_of(formatter.func)))
        elif isinstance(formatter, FixedFormatter):
            formatter.seq = [with_minus(word) for word in formatter.seq]


def _minus_of(words: Callable[..., str]) -> Callable[..., str]:
    def written(tick: float, index: int | None = None) -> str:
        return with_minus(words(tick, index))

    return written


def _fit_legend(figure: Figure, legend: Legend, space: float) -> None:
    # A legend below the panels gets as many entries per line as fit, then entries of several lines.
    handles = [handle for handle in legend.legend_handles if handle is not None]
    words = [text.get_text() for text in legend.get_texts()]
    where: Literal["lower center", "outside lower center"]
    where = "lower center" if figure.get_layout_engine() is None else "outside lower center"
    for columns in _fewer_columns(len(words)):
        if legend.get_window_extent().width <= space:
            return
        legend.remove()
        legend = figure.legend(handles, words, loc=where, ncols=columns)
    beside = legend.get_window_extent().width - max(text.get_window_extent().width for text in legend.get_texts())
    for text in legend.get_texts():
        _break(text, space - beside)


def _fewer_columns(count: int) -> list[int]:
    # Numbers of columns with which all lines have nearly equally many entries, the largest first.
    return list(dict.fromkeys(-(-count // lines) for lines in range(2, count + 1)))


def _fractions(panel: Axes) -> tuple[float, float]:
    # Fractions of the picture's width and height that a panel takes; a colour bar beside several panels has no slot in
    # their grid.
    spec = panel.get_subplotspec()
    if spec is None:
        return 1.0, 1.0
    grid = spec.get_gridspec()
    return len(spec.colspan) / grid.ncols, len(spec.rowspan) / grid.nrows


def _break(text: Text, space: float, *, upright: bool = False) -> None:
    original = text.get_text()
    if not original.strip():
        return

    def fits(line: str) -> bool:
        text.set_text(line)
        extent = text.get_window_extent()
        return (extent.height if upright else extent.width) <= space

    lines = []
    for line in original.split("\n"):
        broken = [line] if fits(line) else _packed(line.split(", "), ", ", fits)
        for part in broken:
            lines += [part] if fits(part) else _packed(part.split(" "), " ", fits)
    text.set_text("\n".join(lines))


def _packed(parts: list[str], joint: str, fits) -> list[str]:
    # Put as many parts on each line as fit; a separator stays at the end of its line.
    lines = [parts[0]]
    for part in parts[1:]:
        if fits(lines[-1] + joint + part):
            lines[-1] += joint + part
        else:
            lines[-1] += joint.rstrip()
            lines.append(part)
    return lines
