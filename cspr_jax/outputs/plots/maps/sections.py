"""Sections of maps, with a colour for each cell."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path
from matplotlib.projections.polar import PolarAxes

from cspr_jax.numerics.shapes import Float, Num
from cspr_jax.outputs.plots.maps.conditions import EXCLUDED
from cspr_jax.outputs.plots.maps.marks import draw_marks, marked
from cspr_jax.outputs.plots.robots.obstacles import draw_obstacles
from cspr_jax.outputs.plots.style.colours import LARGEST, NONE_COLOUR, TOLD_APART, Scale, add_bar, scale_of
from cspr_jax.outputs.plots.style.labels import (
    PANELS,
    as_drawn,
    axis_label,
    chosen,
    heading,
    is_angle,
    label,
    unit,
    values,
)
from cspr_jax.outputs.plots.style.layout import columns_of, in_degrees, in_whole_numbers, panels, set_polar_ticks
from cspr_jax.outputs.plots.style.word_ticks import word_scale, worded
from cspr_jax.schema.quantities import best_name, row_of
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.store.reading.result import Result

# Axes of orientations that are drawn in polar coordinates.
POLAR = ("tilt_azimuth", "tilt")
# Axes of a view from above, drawn in its true shape.
AROUND = ("azimuth", "radius")
# Pairs of axes that span a plane, the second of which is drawn upward or, in polar coordinates, outward. A picture
# shows the first pair that varies, or else the pair with the most cells.
PLANES = (("x", "y"), POLAR, ("from_x", "from_y"))
OTHERS = (AROUND, ("x", "z"), ("y", "z"), ("radius", "z"))
HATCH = "////"
PANEL, SINGLE = 3.1, 5.2  # inches, the longer side


class PlaneSection(NamedTuple):
    """Content of sections of a map.

    Fields:
        name: name of the quantity.
        across: the two axes of a panel.
        over: the axis that differs between the panels; None: there is one panel.
        coordinates: coordinates on the fixed axes.
        fixed: words for the constants.
        excluded: (n_first, n_second, n_panels) cells that conditions other than that of the quantity exclude.
    """

    name: str
    across: list[str]
    over: str | None
    coordinates: dict[str, float]
    fixed: list[str]
    excluded: np.ndarray


def section_figure(
    result: Result,
    section: PlaneSection,
    data: Num[np.ndarray, "n_first n_second n_panels"],
    informative: np.ndarray | None = None,
) -> Figure:
    """Sections of a map, one in each panel."""
    name, across, over = section.name, section.across, section.over
    polar = tuple(across) in (POLAR, AROUND)
    says = np.ones(data.shape, bool) if informative is None else informative
    saying = np.flatnonzero(says.any((0, 1)))
    shown = saying[chosen(len(saying), PANELS)] if len(saying) else chosen(data.shape[2], PANELS)
    alone = {axis: float(points[0]) for axis, points in result.axes.items() if len(points) == 1} | section.coordinates
    if over is not None:
        shown = _moved(shown, marked(result, name, across, over, alone))
    figure = Figure(figsize=_figure_size(result, across, len(shown)), layout="constrained")
    axes, bottom, left = panels(figure, len(shown), polar=polar)
    # The points of an axis may be in any order, and repeated.
    orders = [np.unique(result.axes[axis], return_index=True)[1] for axis in across]
    points = [as_drawn(result, axis, result.axes[axis][order]) for axis, order in zip(across, orders, strict=True)]
    data = as_drawn(result, name, data[np.ix_(*orders, shown)])
    excluded = section.excluded[np.ix_(*orders, shown)]
    # Cells of -inf are beyond all scales, and have no colour.
    endless = np.isneginf(data) if data.dtype.kind == "f" else np.zeros(data.shape, bool)
    data = np.where(endless, np.nan, data) if endless.any() else data
    quantity = row_of(name)
    meaning = worded(result, name, data)
    cells, scale = (
        (data, number_scale(result, name, data)) if meaning is None else (meaning[0], word_scale(*meaning[1:]))
    )
    titles = values(result, over, result.axes[over][shown]) if over is not None else []
    legend: dict[str, Artist] = {"no value": Patch(color=NONE_COLOUR)} if scale.missing and not endless.all() else {}
    if endless.any():
        legend = {
            "−∞" if name != "wrench_margin" else "−∞: the cables do not span the wrench": Patch(color=NONE_COLOUR)
        }
    if excluded.any():
        legend[EXCLUDED] = Patch(facecolor="white", hatch=HATCH, edgecolor="black")
    for k, panel in enumerate(axes):
        image = _section(panel, result, cells[:, :, k], across, points, scale)
        _hatch(panel, excluded[:, :, k], points)
        if quantity.contoured and not polar:
            _loci(panel, cells[:, :, k], points)
        coordinates = alone | ({over: float(result.axes[over][shown[k]])} if over is not None else {})
        elsewhere = {a: p for a, p in coordinates.items() if a not in across}
        legend |= draw_obstacles(panel, result, across, elsewhere) | draw_marks(panel, result, name, across, elsewhere)
        if titles:
            panel.set_title(titles[k])
    words = list(section.fixed)
    if polar:
        outward = np.flatnonzero(says[:, orders[1]][:, :, shown].any((0, 2)))
        set_polar_ticks(axes, edges(points[1])[outward[-1] + 1 if len(outward) else -1], unit(result, across[1]))
        words.append(f"around: {axis_label(result, across[0])}, outward: {axis_label(result, across[1])}")
    else:
        _name_axes(result, across, bottom, left)
    legend = add_bar(figure, image, axes, scale, label(result, name)) | legend
    if legend:
        figure.legend(legend.values(), legend.keys(), loc="outside lower center", ncols=len(legend))
    figure.suptitle(f"{heading(result, name)}\n{', '.join(words)}")
    return figure


def _moved(shown: np.ndarray, marked_indices: list[int]) -> np.ndarray:
    # Evenly chosen sections, in which each section with marks that is missing replaces the one nearest to it.
    indices = shown.tolist()
    for index in marked_indices:
        if index not in indices:
            free = [other for other in indices if other not in marked_indices]
            if free:
                indices[indices.index(min(free, key=lambda other: abs(other - index)))] = index
    return np.sort(indices)


def _figure_size(result: Result, across: list[str], count: int) -> tuple[float, float]:
    # Width and height of the picture in inches; panels in metres have the shape of their range.
    columns = columns_of(count)
    side = SINGLE if count == 1 else PANEL
    width, height = side, side
    if _equal(result, across):
        x, y = (float(np.ptp(result.axes[axis])) for axis in across)
        width, height = side * min(1.0, max(0.4, x / (y or x or 1.0))), side * min(1.0, max(0.3, y / (x or y or 1.0)))
    return columns * (width + 0.15) + 1.9, -(-count // columns) * (height + 0.35) + 1.15


def _equal(result: Result, across: list[str]) -> bool:
    return all(result.units[axis] == "m" for axis in across)


def _name_axes(result: Result, across: list[str], bottom: list[Axes], left: list[Axes]) -> None:
    for panel in bottom:
        panel.set_xlabel(axis_label(result, across[0]))
    for panel in left:
        panel.set_ylabel(axis_label(result, across[1]))
    for name, axis in zip(across, (bottom[0].xaxis, left[0].yaxis), strict=True):
        if is_angle(result, name):
            in_degrees(axis, float(np.ptp(np.degrees(result.axes[name]))))
        elif name == "cable":
            in_whole_numbers(axis)


def is_informative(name: str, data: np.ndarray) -> np.ndarray:
    """Cells that contain information: most orientations of a grid are impossible for the robot."""
    if row_of(name).unflagged:
        return (data.astype(int) & Verdict.NOT_ACCESSIBLE.value) == 0
    return data > 0 if data.dtype.kind == "i" else np.isfinite(data)


def _section(panel: Axes, result: Result, cells: np.ndarray, across: list[str], points: list[np.ndarray], scale: Scale):
    x, y = map(edges, points)
    if isinstance(panel, PolarAxes):
        # Divide cells into narrow ones, whose straight sides look round.
        parts = int(min(120.0, np.ceil(np.diff(x).max() / 3.0)))
        x = np.interp(np.arange(parts * (len(x) - 1) + 1) / parts, np.arange(len(x)), np.radians(x))
        y, cells = np.maximum(y, 0.0), np.repeat(cells, parts, axis=0)
    if cells.dtype.kind == "f":
        # Infinite values have the colour beyond the end of the scale; only NaN has no colour.
        cells = np.ma.masked_invalid(np.clip(cells.astype(float), -LARGEST, LARGEST))
    image = panel.pcolormesh(x, y, cells.T, cmap=scale.colours, norm=scale.norm, rasterized=True)
    if _equal(result, across):
        panel.set_aspect("equal")
    if across[1] == "z" and result.attributes.get("z_axis", "down") == "down":
        panel.yaxis.set_inverted(True)
    return image


def _hatch(panel: Axes, cells: np.ndarray, points: list[np.ndarray]) -> None:
    # Draw all cells as one path, so that the hatching continues from cell to cell.
    if not cells.any():
        return
    x, y = map(edges, points)
    x, y = (np.radians(x), np.maximum(y, 0.0)) if isinstance(panel, PolarAxes) else (x, y)
    i, j = np.nonzero(cells)
    corners = np.stack([np.stack([x[i + a], y[j + b]], -1) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1), (0, 0))], 1)
    path = Path(corners.reshape(-1, 2), np.tile([Path.MOVETO, *[Path.LINETO] * 3, Path.CLOSEPOLY], len(i)))
    panel.add_patch(PathPatch(path, facecolor="none", edgecolor="black", linewidth=0.0, hatch=HATCH))


def _loci(panel: Axes, cells: np.ndarray, points: list[np.ndarray]) -> None:
    # Draw lines where an integer number of oscillations just does not suffice: for horizontal transitions these are the
    # hexagons of thesis Fig. 1.6.
    levels = np.arange(1.0, np.nanmax(np.where(np.abs(cells) < 1e4, cells, np.nan), initial=1.0))
    if min(cells.shape) < 2 or not 0 < len(levels) <= 40:
        return
    lines = panel.contour(*points, cells.T, levels=levels, colors="white", linewidths=0.8)
    for text in panel.clabel(lines, fmt="%d", fontsize="small"):
        text.set_rotation(0.0)  # rotated, a 6 could be read as a 9


def number_scale(result: Result, name: str, values: np.ndarray) -> Scale:
    """The scale of a quantity whose values are numbers, and do not stand for words."""
    choice = next((choice for axis, choice in result.choices.items() if best_name(axis) == name), None)
    points = np.zeros(0) if choice is None else np.unique(as_drawn(result, name, choice.points))
    if not 0 < len(points) <= TOLD_APART:
        return scale_of(values, signed=row_of(name).signed)
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


def in_order(result: Result, across: Sequence[str]) -> list[str]:
    """Axes that vary, those of the plane first."""
    plane = next((pair for pair in PLANES if set(pair) <= set(across)), None) or max(
        (pair for pair in OTHERS if set(pair) <= set(across)),
        key=lambda pair: len(result.axes[pair[0]]) * len(result.axes[pair[1]]),
        default=(),
    )
    return [*plane, *(axis for axis in across if axis not in plane)]
