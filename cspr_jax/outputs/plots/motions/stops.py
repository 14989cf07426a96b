"""Stops along a plan: paths of plan and stops from above and from the side, and durations of the stops over time."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cspr_jax.motion.motion import states_at
from cspr_jax.outputs.plots.style.fitting import legend_above
from cspr_jax.outputs.plots.style.labels import COLOURS
from cspr_jax.outputs.stop_report import KINDS, PlannedStop, StopsAlong
from cspr_jax.robots.model.patterns import PATTERNS

SAMPLES = 60  # of a path of a stop
POINTS = 2000  # of the path of the plan
SHOWN = 60  # largest number of stops whose paths are drawn: more would hide each other
MARKERS = {"rest": "s", "path": "^", "free": "o", "swing": "D"}
NONE_COLOUR = "#b00000"


def stops_figure(answer: StopsAlong) -> Figure:
    """Paths of plan and stops, and durations."""
    path = _path(answer)
    is_planar = PATTERNS[answer.plan.problem.robot.pattern].is_planar
    views = {"xz": 2} if is_planar else {"xy": 1, "xz": 2}
    rows: list[Any] = [[*views] * (2 // len(views)), ["duration"] * 2]
    figure = Figure(figsize=(9.0, 7.2), layout="constrained")
    panels = figure.subplot_mosaic(rows, height_ratios=[1.5, 1.0])
    drawn = [stop for stop in answer.stops if stop.motion is not None]
    drawn = drawn[:: max(1, -(-len(drawn) // SHOWN))]
    for name, j in views.items():
        _paths(panels[name], answer, path, drawn, j)
    if answer.plan.robot_file.z_axis == "down":
        panels["xz"].invert_yaxis()
    _durations(panels["duration"], answer)
    count = sum(stop.is_found for stop in answer.stops)
    numbers = [str(i + 1) for i in answer.without]
    gone = f", cable{'s' * (len(numbers) > 1)} {', '.join(numbers)} broken" if numbers else ""
    figure.suptitle(
        f"{answer.plan.robot_file.name}: proved stops from {count} of {len(answer.stops)} instants{gone}, "
        f"z axis {answer.plan.robot_file.z_axis}"
    )
    return figure


def _path(answer: StopsAlong) -> np.ndarray:
    # Positions along the plan.
    motions = answer.plan.motions
    tau = np.linspace(0.0, 1.0, max(2, POINTS // len(motions)))
    return np.concatenate([np.asarray(states_at(motion, tau).position) for motion in motions])


def _colour(kind: str) -> str:
    return COLOURS[list(KINDS).index(kind)]


def _paths(panel: Axes, answer: StopsAlong, path: np.ndarray, drawn: list[PlannedStop], j: int) -> None:
    spools = np.asarray(answer.plan.robot_file.full.base_points, float)
    gone = np.isin(np.arange(len(spools)), [*answer.without, *answer.plan.robot_file.missing_cables])
    panel.plot(path[:, 0], path[:, j], color="black", linewidth=2.0, alpha=0.3, label="plan")
    for stop in drawn:
        if stop.motion is None or stop.kind == "rest":
            continue
        points = np.asarray(states_at(stop.motion, np.linspace(0.0, 1.0, SAMPLES)).position)
        panel.plot(points[:, 0], points[:, j], color=_colour(stop.kind), linewidth=0.9, alpha=0.85)
        panel.plot(points[-1:, 0], points[-1:, j], color=_colour(stop.kind), marker="o", markersize=2.5, linestyle="")
    panel.plot(spools[~gone, 0], spools[~gone, j], linestyle="", marker="s", markersize=4, color="0.35", label="spools")
    if gone.any():
        style: dict[str, Any] = {"linestyle": "", "marker": "x", "markersize": 6, "color": NONE_COLOUR}
        panel.plot(spools[gone, 0], spools[gone, j], label="broken", **style)
    panel.set(xlabel="x (m)", ylabel=f"{'xyz'[j]} (m)")
    panel.set_aspect("equal", adjustable="datalim")
    panel.grid(alpha=0.3)
    legend_above(panel, 3)


def _durations(panel: Axes, answer: StopsAlong) -> None:
    times, durations = answer.times, answer.durations
    panel.plot(times, durations, color="black", linewidth=0.8, alpha=0.5)
    kinds = np.array([stop.kind for stop in answer.stops])
    for kind, words in KINDS.items():
        rows = kinds == kind
        if rows.any():
            style: dict[str, Any] = {"marker": MARKERS[kind], "markersize": 4, "linestyle": "", "color": _colour(kind)}
            panel.plot(times[rows], durations[rows], label=words, **style)
    step = np.diff(times).min() if len(times) > 1 else 1.0
    for i, (first, last) in enumerate(answer.intervals_without):
        label: dict[str, Any] = {} if i else {"label": "none found"}
        panel.axvspan(first - 0.5 * step, last + 0.5 * step, color=NONE_COLOUR, alpha=0.15, linewidth=0.0, **label)
    for end in np.cumsum(answer.plan.answers.duration)[:-1]:
        panel.axvline(end, color="black", linewidth=0.8, alpha=0.3)
    panel.set(xlabel="instant on the plan (s)", ylabel="time to rest (s)", ylim=(0.0, None))
    panel.margins(x=0.01)
    panel.grid(alpha=0.3)
    legend_above(panel, len(KINDS) + 1)
