"""Feasible frequencies of ellipses over one axis, such as the radius of a circle, as a band."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from cspr_jax.outputs.plots.maps.lines import CROSSES
from cspr_jax.outputs.plots.style.fixed_axes import table
from cspr_jax.outputs.plots.style.labels import COLOURS, as_drawn, axis_label, is_angle, robot_name
from cspr_jax.outputs.plots.style.layout import in_degrees
from cspr_jax.store.reading.result import Result

# Quantities that the picture needs.
SHOWN = ("lowest_frequency", "highest_frequency", "natural_frequency", "used_frequency", "verdict")
SIZES = ("circle_radius", "scale")
# Quantities that belong to the frequency in use.
AT_A_FREQUENCY = ("verdict", "margin", "used_frequency", "binding_cable", "duration", "tension_margin", "limit_margin")
# Largest upper end of the picture, over the largest natural frequency: the band may extend far above, or to infinity.
HIGHEST = 2.5
FINE = 1001  # number of points along the band
HIGHEST_SHOWN = 1e6  # rad/s, replaces infinity
BAND_COLOUR, EDGE = "#cfe3f1", COLOURS[0]
NATURAL: dict[str, Any] = {"color": "black", "linestyle": "--", "linewidth": 1.1}
BEST: dict[str, Any] = {"color": COLOURS[1], "linewidth": 2.4}
STATIC: dict[str, Any] = {"color": "0.35", "linestyle": ":", "linewidth": 1.2}


def has_frequencies(result: Result, across: list[str]) -> bool:
    """Tell whether a result has feasible frequencies over one axis."""
    return set(SHOWN) <= set(result.data) and len(across) == 1 and across != ["frequency"]


def frequencies_figure(result: Result, across: str, data: dict[str, np.ndarray], fixed: list[str]) -> Figure:
    """Band of the feasible frequencies, with the natural one and the one with the largest margin."""
    order = np.argsort(result.axes[across], kind="stable")
    points = as_drawn(result, across, result.axes[across][order])
    low, high, natural, used, verdict = (data[name][order] for name in SHOWN)
    figure = Figure(figsize=(6.8, 4.4), layout="constrained")
    panel = figure.subplots()
    top = _top(high, natural)
    limits = _static_limits(points, low, is_size=across in SIZES)
    _draw_band(panel, points, low, high, limits)
    panel.plot(points, natural, label="natural frequency", zorder=3.0, **NATURAL)
    if "frequency" not in result.axes:
        rule = _rule(result)
        if rule != "natural":
            panel.plot(points, used, label="largest margin" if rule == "best" else "frequency of the sweep", **BEST)
        broken = (verdict != 0) & (used > low) & (used < high)
        if broken.any():
            panel.plot(points[broken], used[broken], label="refused by limits", **CROSSES)
    for i, limit in enumerate(limits):
        panel.axvline(limit, label="_" if i else "static limit", **STATIC)
    panel.set(xlim=(points[0], points[-1]), ylim=(0.0, top), ylabel="frequency (rad/s)")
    panel.set_xlabel(axis_label(result, across))
    if is_angle(result, across):
        in_degrees(panel.xaxis, float(np.ptp(points)))
    panel.grid(alpha=0.3)
    panel.legend(frameon=True, framealpha=0.9, fontsize="small")
    figure.suptitle("\n".join([f"{robot_name(result)}: feasible frequencies", ", ".join(fixed)]).strip())
    return figure


def mark_ends(figure: Figure, result: Result, across: str, data: dict[str, np.ndarray]) -> None:
    """Draw the ends of the feasible frequencies, and the natural ones, into a section over frequencies."""
    panel = figure.axes[0]
    order = np.argsort(result.axes[across], kind="stable")
    points = as_drawn(result, across, result.axes[across][order])
    ranges = panel.get_xlim(), panel.get_ylim()
    for name, style in (("lowest_frequency", "-"), ("highest_frequency", "-"), ("natural_frequency", "--")):
        values = np.minimum(data[name][order], HIGHEST_SHOWN)
        for colour, width in (("white", 3.2), ("black", 1.2)):
            panel.plot(points, values, color=colour, linewidth=width, linestyle=style if width < 2.0 else "-")
    panel.set(xlim=ranges[0], ylim=ranges[1])
    handles = [Line2D([], [], color="black", linewidth=1.2, linestyle=style) for style in ("-", "--")]
    words = ["ends of the feasible frequencies", "natural frequency"]
    figure.legend(handles, words, loc="outside lower center", ncols=2)


def turns_in_words(result: Result, name: str) -> list[str]:
    """Phrases for the title of a map of ellipses: their size and frequency."""
    if result.attributes.get("map") != "ellipse" or not result.settings:
        return []
    ellipse, words = table(result.settings, "ellipse"), []
    if "radius" in ellipse:
        words.append(f"radius {ellipse['radius']:.4g} m")
    elif "half_axes" in ellipse:
        lengths = [f"{np.linalg.norm(axis):.4g} m" for axis in ellipse["half_axes"]]
        words.append("half-axes " + " and ".join(lengths) if len(lengths) > 1 else f"to and fro by {lengths[0]}")
    rule = _rule(result)
    if name in AT_A_FREQUENCY and not {"frequency"} & {*result.axes, *result.choices}:
        words.append(f"at the {rule} frequency" if isinstance(rule, str) else f"at {rule:.4g} rad/s")
    return words


def _rule(result: Result) -> str | float:
    rule = table(result.settings, "ellipse").get("frequency", "best")
    return 2.0 * np.pi * rule["hertz"] if isinstance(rule, dict) else rule


def _top(high: np.ndarray, natural: np.ndarray) -> float:
    # Do not extend the picture for ends of the band that rise to infinity.
    usual = HIGHEST * float(np.nanmax(natural, initial=0.0))
    largest = float(np.max(high[np.isfinite(high)], initial=0.0))
    return min(usual, 1.1 * largest) if usual > 0.0 and largest > 0.0 and np.isfinite(high).all() else usual or 1.0


def _static_limits(points: np.ndarray, low: np.ndarray, *, is_size: bool) -> list[float]:
    # Find static limits: between two points, of which one has the lowest frequency 0. Beyond the limit the square of
    # that frequency rises linearly with the axis, or with the inverse of a size.
    limits = []
    with np.errstate(divide="ignore"):
        along = 1.0 / points if is_size else points
    for i in np.flatnonzero((low[:-1] == 0.0) != (low[1:] == 0.0)).tolist():
        step = 1 if low[i] == 0.0 else -1
        inside, first = (i, i + 1) if step > 0 else (i + 1, i)
        ahead = first + step
        if np.isnan(low[first]):
            continue
        limit = float(points[inside])
        if 0 <= ahead < len(low) and low[ahead] > low[first]:
            gradient = (low[ahead] ** 2 - low[first] ** 2) / (along[ahead] - along[first])
            zero = along[first] - low[first] ** 2 / gradient
            limit = 1.0 / zero if is_size else zero
        ends = points[inside], points[first]
        limits.append(float(np.clip(limit, min(ends), max(ends))))
    return limits


def _draw_band(panel: Axes, points: np.ndarray, low: np.ndarray, high: np.ndarray, limits: list[float]) -> None:
    # The lower end rises from each static limit like a square root, the upper one falls from infinity like its inverse.
    positions = np.unique(np.concatenate([np.linspace(points[0], points[-1], FINE), points, limits]))
    squares = np.interp(positions, *_joined(points, low**2, limits)), np.interp(positions, points, high**-2.0)
    below, above = np.sqrt(squares[0]), np.maximum(squares[1], HIGHEST_SHOWN**-2.0) ** -0.5
    panel.fill_between(positions, below, above, color=BAND_COLOUR, linewidth=0.0, label="feasible")
    for ends in (below, above):
        panel.plot(positions, ends, color=EDGE, linewidth=1.3)


def _joined(points: np.ndarray, values: np.ndarray, zeros: list[float]) -> tuple[np.ndarray, np.ndarray]:
    # Insert zeros between the points of a line.
    positions = np.concatenate([points, zeros])
    order = np.argsort(positions, kind="stable")
    return positions[order], np.concatenate([values, np.zeros(len(zeros))])[order]
