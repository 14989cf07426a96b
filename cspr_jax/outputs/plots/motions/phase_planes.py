"""Phase plane of paths: path speed over the path, speeds from which the end can be reached, and binding limits."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cspr_jax.outputs.plots.maps.frequencies import BAND_COLOUR, EDGE
from cspr_jax.outputs.plots.motions.motion import doubt
from cspr_jax.outputs.plots.style.labels import COLOURS, STYLES, robot_name
from cspr_jax.schema.verdicts import Verdict, criterion_words
from cspr_jax.store.reading.result import Result

# Upper end of the picture, over the largest speed of the motion.
HIGHEST = 1.25
FREE: dict[str, Any] = {"color": "black"}
# Largest number of limits that have a colour each.
MAX_NAMED = 12


def phase_plane_figure(result: Result) -> Figure:
    """Path speeds over the path, of all sections side by side."""
    data = result.data
    figure = Figure(figsize=(7.2, 4.4), layout="constrained")
    panel = figure.subplots()
    s, (low, high, speed, cap) = data["path_coordinate"], data["path_speed"].T
    sections = data["path_section"]
    first = [0, *(np.flatnonzero(np.diff(sections)) + 1).tolist(), len(s)]
    top = _top(low, high, speed)
    for i, rows in enumerate(map(slice, first[:-1], first[1:])):
        label = "_" if i else "the end can be reached"
        panel.fill_between(
            s[rows], low[rows], np.minimum(high[rows], 2.0 * top), color=BAND_COLOUR, linewidth=0.0, label=label
        )
        for side in (low, high):
            panel.plot(s[rows], np.minimum(side[rows], 2.0 * top), color=EDGE, linewidth=0.8)
        panel.plot(
            s[rows], cap[rows], color="0.3", linestyle="--", linewidth=1.1, label="_" if i else "limits of speeds"
        )
        _draw_motion(panel, data, rows)
        if i:
            panel.axvline(s[rows][0], color="0.2", linewidth=1.0, label="_" if i > 1 else "stop")
    _draw_passes(panel, data)
    _draw_failures(panel, s, low, first)
    panel.set(xlim=(s[0], s[-1]), ylim=(0.0, top), xlabel="path coordinate s (m)", ylabel="path speed s' (m/s)")
    panel.grid(alpha=0.3)
    handles, words = panel.get_legend_handles_labels()
    shown = {word: handle for handle, word in zip(handles, words, strict=True)}
    if not (cap < top).any():
        shown.pop("limits of speeds", None)
    figure.legend(shown.values(), shown.keys(), loc="outside lower center", ncols=3, fontsize="small")
    figure.suptitle(f"{robot_name(result)}: path speeds{doubt(result)}")
    return figure


def _top(low: np.ndarray, high: np.ndarray, speed: np.ndarray) -> float:
    fastest = float(np.nanmax(speed, initial=0.0))
    if fastest:
        return HIGHEST * fastest
    # Without a motion, show all speeds from which the end can be reached, unless a few are far larger.
    finite = high[np.isfinite(high) & (high > 0.0)]
    usual = 3.0 * float(np.median(finite)) if len(finite) else 1.0
    return HIGHEST * max(float(np.nanmax(low, initial=0.0)), min(usual, float(finite.max(initial=0.0)))) or 1.0


def _names(data) -> list[tuple[int, int]]:
    # Binding limits, those that bind at most nodes first.
    pairs, counts = np.unique(
        np.stack([data["path_binds"].astype(int), data["path_binding_cable"].astype(int)]), axis=1, return_counts=True
    )
    order = np.argsort(-counts, kind="stable")
    return [(int(flag), int(cable)) for flag, cable in pairs.T[order] if flag][:MAX_NAMED]


def _draw_motion(panel: Axes, data, rows: slice) -> None:
    s, speed = data["path_coordinate"][rows], data["path_speed"][rows, 2]
    panel.plot(s, speed, linewidth=1.0, **FREE)
    flags, cables = data["path_binds"][rows], data["path_binding_cable"][rows]
    for k, (flag, cable) in enumerate([(0, 0), *_names(data)]):
        binds = ((flags == flag) & (cables == cable))[:-1]
        # Draw a cell from its first node to its second one.
        at_nodes = np.append(binds, False) | np.insert(binds, 0, False)
        if not (at_nodes & np.isfinite(speed)).any():
            continue
        line = np.where(at_nodes, speed, np.nan)
        words = criterion_words(Verdict(flag), cable - 1 if cable else None)
        style = FREE if k == 0 else {"color": COLOURS[k % len(COLOURS)], "linestyle": STYLES[(k - 1) // len(COLOURS)]}
        panel.plot(s, line, label="motion, nothing binds" if k == 0 else words, linewidth=2.4, zorder=3.5, **style)


def _draw_passes(panel: Axes, data) -> None:
    # Mark poses that the motion passes without stopping.
    inside = (np.diff(data["path_segment"]) != 0) & (np.diff(data["path_section"]) == 0)
    for k, coordinate in enumerate(data["path_coordinate"][1:][inside].tolist()):
        panel.axvline(coordinate, color="0.35", linestyle=":", linewidth=1.2, label="_" if k else "pose")


def _draw_failures(panel: Axes, s: np.ndarray, low: np.ndarray, first: list[int]) -> None:
    # Draw up to the last point that cannot be passed at any speed.
    is_named = False
    for rows in map(slice, first[:-1], first[1:]):
        unknown, coordinates = np.isnan(low[rows]), s[rows]
        if not unknown.any():
            continue
        last = coordinates[np.flatnonzero(unknown)[-1]]
        panel.axvspan(coordinates[0], last, color="#c03030", alpha=0.12, linewidth=0.0)
        words = "_" if is_named else "no path speed passes"
        panel.plot([last], [0.0], "x", color="#c03030", markersize=10, markeredgewidth=2.4, clip_on=False, label=words)
        is_named = True
