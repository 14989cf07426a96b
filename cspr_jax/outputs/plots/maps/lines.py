"""Quantities of maps as lines over one axis: of several points of another axis, or of several results."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from cspr_jax.errors import InputError
from cspr_jax.numerics.shapes import Int
from cspr_jax.outputs.plots.maps.conditions import EXCLUDED
from cspr_jax.outputs.plots.style.fitting import shortened
from cspr_jax.outputs.plots.style.fixed_axes import table
from cspr_jax.outputs.plots.style.labels import (
    COLOURS,
    STYLES,
    as_drawn,
    axis_label,
    chosen,
    is_angle,
    label,
    robot_name,
    values,
)
from cspr_jax.outputs.plots.style.layout import columns_of, in_degrees, in_whole_numbers, panels
from cspr_jax.outputs.plots.style.word_ticks import worded
from cspr_jax.store.reading.result import Result

LINES = len(COLOURS)
# Symbol of points that conditions other than that of a margin exclude.
CROSSES: dict[str, Any] = {"marker": "x", "linestyle": "", "color": "black", "markersize": 5}


@dataclasses.dataclass(frozen=True)
class PlottedLine:
    """One line of a picture.

    Fields:
        points: (n,) coordinates along the axis.
        values: (n,) values of the quantity.
        name: name in the legend; empty for none.
        excluded: (n,) whether conditions other than that of the values exclude a point; None: no point is excluded.
    """

    points: np.ndarray
    values: np.ndarray
    name: str = ""
    excluded: np.ndarray | None = None


def line_figure(
    result: Result, name: str, groups: dict[str, list[PlottedLine]], across: str, title: str, fixed: list[str]
) -> Figure:
    """Lines over one axis, in one panel or several."""
    count = len(groups)
    columns = columns_of(count)
    figure = Figure(figsize=(6.8, 4.4) if count == 1 else (3.4 * columns + 1.0, 3.4 * -(-count // columns) + 0.9))
    figure.set_layout_engine("constrained")
    axes, bottom, left = panels(figure, count)
    drawn = [[_as_drawn(result, name, across, line) for line in lines] for lines in groups.values()]
    drawn, words = _in_words(result, name, drawn)
    for panel, heading, lines in zip(axes, groups, drawn, strict=True):
        _draw(panel, lines)
        panel.set_title(heading)
    for panel in bottom:
        panel.set_xlabel(axis_label(result, across))
    for panel in left:
        panel.set_ylabel(label(result, name))
    _ticks(axes[0], result, across, drawn, words)
    if any(line.name for line in drawn[0]):
        handles = axes[0].lines[: len(drawn[0])]
        legend = axes[0].legend(handles, [""] * len(handles), frameon=True, framealpha=0.9, fontsize="small")
        # Set texts afterwards, since matplotlib leaves out names that begin with an underscore.
        for text, line in zip(legend.get_texts(), drawn[0], strict=True):
            text.set_text(line.name)
    if any(line.excluded is not None and line.excluded.any() for lines in drawn for line in lines):
        figure.legend([Line2D([], [], **CROSSES)], [EXCLUDED], loc="outside lower center")
    figure.suptitle("\n".join([title, ", ".join(fixed)]).strip())
    return figure


def _as_drawn(result: Result, name: str, across: str, line: PlottedLine) -> PlottedLine:
    # The points of an axis may be in any order.
    order = np.argsort(line.points, kind="stable")
    points, data = as_drawn(result, across, line.points[order]), as_drawn(result, name, line.values[order])
    return PlottedLine(points, data, line.name, None if line.excluded is None else line.excluded[order])


def _draw(panel: Axes, lines: list[PlottedLine]) -> None:
    for i, line in enumerate(lines):
        full = line.values.dtype.kind in "iu"
        panel.plot(
            line.points,
            line.values,
            marker="." if len(line.points) <= 60 else "",
            linestyle=STYLES[i],
            color=COLOURS[i],
            linewidth=1.3,
            drawstyle="steps-mid" if full else "default",
            label=line.name or None,
        )
    for line in lines:
        if line.excluded is not None and line.excluded.any():
            panel.plot(line.points[line.excluded], line.values[line.excluded], **CROSSES)
    panel.grid(alpha=0.3)


def _in_words(result: Result, name: str, groups: list[list[PlottedLine]]) -> tuple[list[list[PlottedLine]], list[str]]:
    # Replace values that stand for words by numbers from 0 on, which become the ticks of these words.
    arrays = [line.values for lines in groups for line in lines]
    meaning = worded(result, name, np.concatenate(arrays))
    if meaning is None:
        return groups, []
    numbers, words, _ = meaning
    parts = iter(np.split(numbers, np.cumsum([len(values) for values in arrays])[:-1]))
    return [[dataclasses.replace(line, values=next(parts)) for line in lines] for lines in groups], words


def _ticks(panel: Axes, result: Result, across: str, groups: list[list[PlottedLine]], words: list[str]) -> None:
    numbers = np.concatenate([line.values for lines in groups for line in lines])
    if words:
        panel.set_yticks(range(len(words)), labels=words)
    elif numbers.dtype.kind in "iu":
        in_whole_numbers(panel.yaxis, none=bool((numbers == 0).any()))
    if is_angle(result, across):
        in_degrees(panel.xaxis, float(np.ptp(groups[0][0].points)))
    elif across == "cable":
        in_whole_numbers(panel.xaxis)


def lines_of(
    result: Result, data: Int[np.ndarray, "n_across n_by"], excluded: np.ndarray, across: str, by: str
) -> list[PlottedLine]:
    """The lines of one panel, one for each point of an axis, at most six."""
    points = result.axes[by]
    shown = chosen(len(points), LINES)
    names = values(result, by, points[shown])
    return [
        PlottedLine(result.axes[across], data[:, i], name, excluded[:, i]) for i, name in zip(shown, names, strict=True)
    ]


def names_of(results: list[Result], stems: list[str]) -> list[str]:
    """Names that tell results of one picture apart: their amplitude functions, else robots, else files."""
    if len(results) > 1:
        for words in (_amplitude, robot_name):
            names = [words(result) for result in results]
            if len(set(names)) == len(results) and all(names):
                return names
    return [shortened(stem) for stem in stems]


def _amplitude(result: Result) -> str:
    amplitude = table(result.settings, "trajectory").get("amplitude")
    if isinstance(amplitude, dict):
        amplitude = ", ".join(
            f"epsilon = {part}" if key == "epsilon" else f"{key} {part}" if key == "polynomial" else str(part)
            for key, part in sorted(amplitude.items(), reverse=True)
        )
    return shortened(amplitude) if isinstance(amplitude, str) else ""


def overlaid(names: list[str], results: list[tuple[Result, str, PlottedLine]]) -> tuple[str, list[PlottedLine]]:
    """One line for each result, over the same axis."""
    if len(results) > LINES:
        raise InputError("results", len(results), f"at most {LINES} in one picture")
    axes = sorted({axis for _, axis, _ in results})
    if len(axes) > 1:
        raise InputError("results", axes, "results that vary along the same axis")
    return axes[0], [dataclasses.replace(line, name=name) for name, (*_, line) in zip(names, results, strict=True)]
