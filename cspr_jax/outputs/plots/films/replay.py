"""A plan and its motion in MuJoCo: both paths, and the deviations of path and tensions over time."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from cspr_jax.outputs.mujoco.replay import PlayedPlan
from cspr_jax.outputs.plots.style.fitting import legend_above
from cspr_jax.outputs.plots.style.labels import COLOURS, line_style
from cspr_jax.outputs.table_layout import two_digits

# A path is planar if its extent along y is at most this fraction of that along x: typed numbers are rounded.
ONE_PLANE = 1e-9
BOUNDARIES = 200  # largest number of segments whose boundaries are drawn: more lines would hide the rest
RAISED = str.maketrans("-0123456789", "\u207b\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079")
WINDOWS = 250  # number of windows of time, each of which shows its largest deviation


def replay_figure(replay: PlayedPlan) -> Figure:
    """Planned and played path, and deviations of path and tensions."""
    is_planar = np.ptp(replay.position[:, 1]) <= ONE_PLANE * np.ptp(replay.position[:, 0])
    layout: Any = [["xz", "xz"] if is_planar else ["xy", "xz"], ["path", "path"], ["tension", "tension"]]
    figure = Figure(figsize=(10.0, 8.5), layout="constrained")
    drawn = figure.subplot_mosaic(layout, height_ratios=[1.2, 0.9, 0.9])
    for name, j in (("xy", 1), ("xz", 2)):
        if name in drawn:
            _paths(drawn[name], replay, j)
    if replay.z_axis == "down":
        drawn["xz"].invert_yaxis()
    deviations = {"each segment from its start": replay.path_deviation, "all in one go": replay.through_deviation}
    _deviations(drawn["path"], replay, deviations)
    drawn["path"].set_ylabel("path off the plan (m)")
    cables = {f"cable {k + 1}": values for k, values in enumerate(np.abs(replay.tension_deviation).T)}
    _deviations(drawn["tension"], replay, cables)
    drawn["tension"].set_ylabel("tension off MuJoCo's (N)")
    path, tension = replay.path_deviation.max(), np.abs(replay.tension_deviation).max()
    figure.suptitle(
        f"{replay.robot}: played in MuJoCo {replay.mujoco}, each segment from its start; z axis {replay.z_axis}"
        f"\npath within {two_digits(path)} m, tensions within {two_digits(tension)} N"
    )
    return figure


def _paths(panel: Axes, replay: PlayedPlan, j: int) -> None:
    curves: tuple[tuple[str, np.ndarray, dict[str, Any]], ...] = (
        ("planned", replay.position, {"color": "black", "linewidth": 2.2, "alpha": 0.35}),
        ("played", replay.played.position, {"color": COLOURS[1], "linewidth": 1.0, "linestyle": "--"}),
    )
    for name, path, style in curves:
        panel.plot(path[:, 0], path[:, j], label=name, **style)
    panel.set_xlabel("x (m)")
    panel.set_ylabel(f"{'xyz'[j]} (m)")
    panel.set_aspect("equal", adjustable="datalim")
    panel.grid(alpha=0.3)
    legend_above(panel, 2)


def _deviations(panel: Axes, replay: PlayedPlan, values: dict[str, np.ndarray]) -> None:
    # Draw the largest value of each window, since rounding is noise, which would fill the panel.
    starts = np.unique(np.linspace(0.0, len(replay.time), WINDOWS, endpoint=False).astype(int))
    time = replay.time[starts]
    drawn = {name: _largest(deviations, starts) for name, deviations in values.items()}
    for k, (name, deviations) in enumerate(drawn.items()):
        panel.plot(time, deviations, linewidth=1.0, label=name, **line_style(k))
    _whole_decades(panel, np.concatenate(list(drawn.values())))
    panel.set_xlabel("time (s)")
    panel.margins(x=0.01)
    panel.grid(alpha=0.3)
    legend_above(panel, len(values))
    ends = np.flatnonzero(np.diff(replay.segment))
    for end in replay.time[ends][:BOUNDARIES]:
        panel.axvline(end, color="black", linewidth=0.8, alpha=0.35)


def _whole_decades(panel: Axes, values: np.ndarray) -> None:
    # The axis extends from one power of ten to another, so that at least two ticks have numbers.
    positive = values[np.isfinite(values) & (values > 0.0)]
    if not len(positive):
        return
    low, high = int(np.floor(np.log10(positive.min()))), int(np.ceil(np.log10(positive.max())))
    panel.set_yscale("log")
    panel.set_ylim(10.0**low, 10.0 ** max(high, low + 1))
    panel.yaxis.set_major_locator(LogLocator(numticks=6))
    panel.yaxis.set_major_formatter(FuncFormatter(lambda tick, _: "10" + str(round(np.log10(tick))).translate(RAISED)))
    panel.yaxis.set_minor_formatter(NullFormatter())


def _largest(values: np.ndarray, starts: np.ndarray) -> np.ndarray:
    # Largest value of each window; a value of exactly 0 leaves a gap.
    largest = np.maximum.reduceat(values, starts)
    return np.where(largest > 0.0, largest, np.nan)
