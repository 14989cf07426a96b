"""Sections of maps, in colours."""

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.projections.polar import PolarAxes

from cspr_jax.feasibility.verdicts import Verdict
from cspr_jax.plots.labels import PANELS, axis_label, chosen, columns_of, label, notes, panels, start, value
from cspr_jax.plots.reasons import colours_of, reasons
from cspr_jax.results import Result

# Quantities of which either sign is as good as the other.
SIGNED = ("used_inclination",)
# Quantities that are flags of a verdict.
VERDICTS = ("verdict", "main_reason")
# Azimuth and tilt of an orientation: a polar plane.
POLAR = ("tilt_azimuth", "tilt")
# More lines than that say nothing.
LOCI = 100.0
NONE_COLOUR = "#d0d0d0"


def section_figure(
    result: Result,
    name: str,
    data: np.ndarray,
    across: list[str],
    over: str | None,
    fixed: list[str],
    told: np.ndarray | None = None,
) -> Figure:
    """Sections of a map, one a panel.

    Args:
        result: gives axes, labels and constants.
        name: of the quantity.
        data: (n_first, n_second, n_panels).
        across: the two axes of a panel.
        over: the axis that differs between the panels; None: there is one panel.
        fixed: what was fixed for the picture.
        told: of data's shape, the cells that say more than that there is nothing; None: all.

    Returns:
        the figure.
    """
    polar = tuple(across) == POLAR
    says = np.ones(data.shape, bool) if told is None else told
    saying = np.flatnonzero(says.any((0, 1)))
    shown = saying[chosen(len(saying), PANELS)] if len(saying) else chosen(data.shape[2], PANELS)
    columns, count = columns_of(len(shown)), len(shown)
    size = (3.1 * columns + 1.3, 3.2 * -(-count // columns) + 0.8) if count > 1 else (7.0, 5.6)
    figure = Figure(figsize=size, layout="constrained")
    every, bottom, left = panels(figure, count, polar=polar)
    data = data[:, :, shown]
    words: list[str] = []
    if name in VERDICTS:
        data, words, used = reasons(data)
        colours, norm = colours_of(used)
    else:
        colours, norm = _colours(data, signed=name in SIGNED)
    for k, (panel, i) in enumerate(zip(every, shown, strict=True)):
        image = _section(panel, result, data[:, :, k], across, colours, norm)
        if name == "least_oscillations":
            _loci(panel, result, data[:, :, k], across)
        if over is not None:
            panel.set_title(value(result, over, result.axes[over][i], digits=3), fontsize=10)
    if polar and len(saying):
        farthest = np.flatnonzero(says[:, :, shown].any((0, 2)))[-1]
        every[0].set_ylim(0.0, _edges(result.axes[across[1]])[farthest + 1])
        fixed = [*fixed, f"around: {across[0]}, outward: {across[1]} (rad)"]
    elif not polar:
        _name_axes(result, across, bottom, left)
    bar = figure.colorbar(image, ax=every, shrink=0.9, label=label(result, name))
    if words:
        bar.set_ticks(range(len(words)), labels=words)
        bar.ax.minorticks_off()
    elif data.dtype.kind == "i":
        _count_ticks(bar, int(data.max()))
    handles, labels = every[0].get_legend_handles_labels()
    if handles:
        figure.legend(handles, labels, loc="outside lower left", ncols=len(handles), fontsize=9, frameon=False)
    used = [*across, *([over] if over else [])]
    figure.suptitle(f"{result.attributes['robot']}: {result.labels[name]}\n{notes(result, fixed, used)}", fontsize=11)
    return figure


def _name_axes(result: Result, across: list[str], bottom: list[Axes], left: list[Axes]) -> None:
    for panel in bottom:
        panel.set_xlabel(axis_label(result, across[0]))
    for panel in left:
        panel.set_ylabel(axis_label(result, across[1]))


def tells(name: str, data: np.ndarray) -> np.ndarray:
    """Which cells say more than that there is nothing: most of all orientations are none that a robot can take.

    Args:
        name: of the quantity.
        data: it.

    Returns:
        of data's shape.
    """
    if name in VERDICTS:
        return (data.astype(int) & Verdict.NOT_ACCESSIBLE.value) == 0
    return data > 0 if data.dtype.kind == "i" else np.isfinite(data)


def _section(panel: Axes, result: Result, values: np.ndarray, across: list[str], colours, norm):
    x, y = (_edges(result.axes[axis]) for axis in across)
    if isinstance(panel, PolarAxes):
        panel.grid(False)
        panel.set_rlabel_position(270.0)
        y = np.maximum(y, 0.0)
    image = panel.pcolormesh(x, y, values.T, cmap=colours, norm=norm, rasterized=True)
    if all(result.units[axis] == "m" for axis in across):
        panel.set_aspect("equal")
    if across[1] == "z" and result.attributes.get("z_axis", "down") == "down":
        panel.yaxis.set_inverted(True)
    if across == ["x", "y"] and "base_points" in result.attributes:
        base = np.asarray(result.attributes["base_points"])
        panel.fill(base[:, 0], base[:, 1], fill=False, edgecolor="white", linewidth=2.4)
        panel.fill(base[:, 0], base[:, 1], fill=False, edgecolor="black", linewidth=1.0, label="spools")
    place = start(result)
    if all(axis in place for axis in across):
        panel.plot(
            *(place[axis] for axis in across), "o", color="white", markeredgecolor="black", markersize=5, label="start"
        )
    return image


def _loci(panel: Axes, result: Result, values: np.ndarray, across: list[str]) -> None:
    # Where a whole number of oscillations is just too few: the hexagons of thesis Fig. 1.6 on horizontal transitions.
    x, y = (result.axes[axis] for axis in across)
    levels = np.arange(1.0, min(np.nanmax(values, initial=1.0, where=np.isfinite(values)), LOCI))
    if min(values.shape) > 1 and len(levels):
        lines = panel.contour(x, y, values.T, levels=levels, colors="white", linewidths=0.8)
        panel.clabel(lines, fmt="%d", fontsize=8)


def _edges(points: np.ndarray) -> np.ndarray:
    middles = 0.5 * (points[1:] + points[:-1])
    return np.concatenate([[1.5 * points[0] - 0.5 * points[1]], middles, [1.5 * points[-1] - 0.5 * points[-2]]])


def _colours(data: np.ndarray, *, signed: bool):
    if data.dtype.kind == "i":
        most = max(int(data.max()), 1)
        colours = matplotlib.colormaps["viridis"](np.linspace(0.0, 1.0, most))
        return ListedColormap([NONE_COLOUR, *colours]), BoundaryNorm(np.arange(-0.5, most + 1), most + 1)
    finite = data[np.isfinite(data)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
    if signed:
        size = max(abs(low), abs(high)) or 1.0
        return matplotlib.colormaps["PuOr_r"], Normalize(-size, size)
    return matplotlib.colormaps["cividis"], Normalize(low, high if high > low else low + 1.0)


def _count_ticks(bar, most: int) -> None:
    step = -(-max(most, 1) // 12)
    ticks = [0, *range(step, most + 1, step)]
    bar.set_ticks(ticks, labels=["none", *(str(tick) for tick in ticks[1:])])
    bar.ax.minorticks_off()
