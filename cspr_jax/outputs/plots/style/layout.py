"""Panels of a picture: their number, positions and sizes, and their ticks."""

import math

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator, MultipleLocator

from cspr_jax.outputs.plots.style.labels import principal_angle

# Steps between ticks of angles, degrees.
DEGREES = (0.5, 1.0, 2.0, 5.0, 10.0, 15.0, 30.0, 45.0, 60.0, 90.0, 180.0)
# Smallest width of a panel, inches, with its labels and colour bar.
MIN_WIDTH = 1.6
# Narrower pictures, cm, are for a column of a page: the title has one line, and colour bars lie below the panels.
NARROW, INCH = 12.0, 2.54


def is_narrow() -> bool:
    """Tell whether the picture that is made inside `style.in_style` is for a column of a page."""
    return bool(matplotlib.rcParams["figure.figsize"][0] * INCH < NARROW)


def columns_of(count: int) -> int:
    """Number of panels that fit side by side into the width that `style.in_style` has set."""
    possible = max(1, int(matplotlib.rcParams["figure.figsize"][0] / MIN_WIDTH))
    return min(possible, 2 if count == 4 else min(3, count))


def panels(
    figure: Figure, count: int, *, polar: bool = False, same: bool = True
) -> tuple[list[Axes], list[Axes], list[Axes]]:
    """Panels that share both axes, or only the horizontal one."""
    columns = columns_of(count)
    lines = -(-count // columns)
    kind = {"projection": "polar"} if polar else {}
    grid = figure.subplots(lines, columns, squeeze=False, sharex=not polar, sharey=same, subplot_kw=kind)
    shown = list(grid.flat[:count])
    bottom = shown[max(0, count - columns) :]
    for panel in grid.flat[count:]:
        panel.set_visible(False)
    if not polar:
        for panel in bottom:
            panel.tick_params(labelbottom=True)
    return shown, bottom, list(grid[:, 0])


def in_degrees(axis: Axis, span: float) -> None:
    """Set ticks of an angle in degrees, without full revolutions."""
    step = next((step for step in DEGREES if span <= 7.0 * step), None)
    axis.set_major_locator(MaxNLocator(5) if step is None or span < 2.0 else MultipleLocator(step))
    axis.set_major_formatter(FuncFormatter(lambda tick, _: f"{principal_angle(tick) + 0.0:.6g}"))


def in_whole_numbers(axis: Axis, *, none: bool = False) -> None:
    """Set ticks at integers only."""
    axis.set_major_locator(MaxNLocator(6, integer=True, min_n_ticks=1))
    axis.set_major_formatter(FuncFormatter(lambda tick, _: "none" if none and tick == 0.0 else f"{tick:.0f}"))


def set_polar_ticks(axes: list[Axes], radius: float, unit: str) -> None:
    """Set ticks of azimuth and radius."""
    step = next((step for step in DEGREES if radius <= 4.5 * step), None)
    even = step is None or unit != "°"
    all_ticks = np.asarray(MaxNLocator(4).tick_values(0.0, radius)) if even else np.arange(0.0, radius, step)
    ticks = all_ticks[(all_ticks > 0.0) & (all_ticks < 0.95 * radius)]
    around = range(0, 360, 45)
    gap = " " if unit.isalpha() else ""
    for panel in axes:
        panel.set_ylim(0.0, radius)
        panel.set_yticks(ticks, labels=[""] * len(ticks))
        panel.set_xticks(
            [math.radians(angle) for angle in around], labels=[f"{principal_angle(angle):g}°" for angle in around]
        )
        panel.tick_params(pad=0.0, labelsize="small")
        panel.grid(True, color="black", alpha=0.25, linewidth=0.5)
        panel.set_axisbelow(False)
        for tick in ticks:
            box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.6}
            text = f"{tick:g}{gap}{unit}"
            panel.text(math.radians(-67.5), tick, text, fontsize="small", ha="center", va="center", bbox=box)
