"""Quantities of maps as lines over one axis: of several points of another axis, or of several results."""

import dataclasses

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cspr_jax.errors import InputError
from cspr_jax.plots.labels import COLOURS, STYLES, axis_label, chosen, label, notes, panels, value
from cspr_jax.results import Result

LINES = len(COLOURS)


@dataclasses.dataclass(frozen=True)
class Line:
    """One line of a picture.

    Fields:
        points: (n,) along the axis.
        values: (n,).
        name: for the legend; empty for none.
    """

    points: np.ndarray
    values: np.ndarray
    name: str = ""


def line_figure(
    result: Result, name: str, groups: dict[str, list[Line]], across: str, fixed: list[str], used: list[str]
) -> Figure:
    """Lines over one axis, in one panel or several.

    Args:
        result: gives labels and constants.
        name: of the quantity.
        groups: the lines of each panel, by its title.
        across: the axis.
        fixed: what was fixed for the picture.
        used: axes that the picture shows.

    Returns:
        the figure.
    """
    count = len(groups)
    figure = Figure(figsize=(6.8, 4.4) if count == 1 else (3.4 * min(3, count) + 1.0, 3.4 * -(-count // 3) + 0.9))
    figure.set_layout_engine("constrained")
    every, bottom, left = panels(figure, count)
    for panel, (title, lines) in zip(every, groups.items(), strict=True):
        _draw(panel, lines)
        panel.set_title(title, fontsize=10)
    for panel in bottom:
        panel.set_xlabel(axis_label(result, across))
    for panel in left:
        panel.set_ylabel(label(result, name))
    if every[0].get_legend_handles_labels()[0]:
        every[0].legend(fontsize=9, framealpha=0.9)
    figure.suptitle(f"{result.attributes['robot']}: {notes(result, fixed, used)}", fontsize=10)
    return figure


def _draw(panel: Axes, lines: list[Line]) -> None:
    for i, line in enumerate(lines):
        whole = line.values.dtype.kind in "iu"
        marker = "." if len(line.points) <= 60 else ""
        panel.plot(
            line.points,
            line.values,
            marker=marker,
            linestyle=STYLES[i],
            color=COLOURS[i],
            linewidth=1.3,
            drawstyle="steps-mid" if whole else "default",
            label=line.name or None,
        )
    panel.grid(alpha=0.3)


def lines_of(result: Result, data: np.ndarray, across: str, by: str) -> list[Line]:
    """The lines of one panel, one for each point of an axis, at most six.

    Args:
        result: gives axes and units.
        data: (n_across, n_by).
        across: the axis along the lines.
        by: the axis that tells them apart.

    Returns:
        the lines.
    """
    points = result.axes[by]
    return [
        Line(result.axes[across], data[:, i], value(result, by, points[i], digits=3))
        for i in chosen(len(points), LINES)
    ]


def overlaid(results: list[tuple[str, Result, np.ndarray, str]]) -> tuple[str, list[Line]]:
    """One line a result, over the same axis.

    Args:
        results: of each its name, itself, its values (n,), its axis.

    Returns:
        the axis and the lines.

    Raises:
        InputError: different axes, or too many results.
    """
    if len(results) > LINES:
        raise InputError("results", len(results), f"at most {LINES} in one picture")
    axes = sorted({axis for _, _, _, axis in results})
    if len(axes) > 1:
        raise InputError("results", axes, "results that vary along the same axis")
    return axes[0], [Line(result.axes[axis], values, name) for name, result, values, axis in results]
