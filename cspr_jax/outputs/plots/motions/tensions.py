"""Tensions of a motion over time: the range of all cables, and the limits."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cspr_jax.config.plan import PlanFile
from cspr_jax.config.robot import RobotFile
from cspr_jax.outputs.plots.motions.motion import FAR, boundaries, doubt, draw_limits, shade_failing
from cspr_jax.outputs.plots.robots.robot_along import limits_of
from cspr_jax.outputs.plots.style.labels import COLOURS, cable_names, line_style, robot_name
from cspr_jax.store.reading.result import Result


def tensions_figure(result: Result, robot_file: RobotFile, plan_file: PlanFile) -> Figure:
    """Range of the tensions over time, with the limits."""
    figure = Figure(figsize=(7.2, 4.2), layout="constrained")
    panel = figure.subplots()
    draw_tensions(panel, result, limits_of(robot_file, plan_file))
    figure.legend(loc="outside lower center", ncols=4)
    figure.suptitle(f"{robot_name(result)}: tensions over time\n{extremes(result)}{doubt(result)}")
    return figure


def extremes(result: Result) -> str:
    """The smallest and the largest tension of a motion's rows, in words."""
    tension, time = result.data["tension"], result.axes["t"]
    if not np.isfinite(tension).any():
        return "no finite tension"
    names, each = cable_names(result.data), []
    for words, index in (("smallest", np.nanargmin(tension)), ("largest", np.nanargmax(tension))):
        row, cable = np.unravel_index(index, tension.shape)
        each.append(f"{words} {tension[row, cable]:.4g} N, {names[cable]}, t = {time[row]:.3g} s")
    return "; ".join(each)


def draw_tensions(
    panel: Axes, result: Result, limits: list[tuple[str, float]], charts: Sequence[str] = ("tension",)
) -> None:
    """Draw the range from the smallest to the largest tension, each cable as a thin line, and the limits."""
    time, tension = result.axes["t"], result.data["tension"]
    low, high = np.min(tension, axis=1), np.max(tension, axis=1)
    panel.fill_between(time, low, high, color=COLOURS[5], alpha=0.35, linewidth=0.0, label="range")
    for k, values in enumerate(tension.T):
        panel.plot(time, values, linewidth=1.0, label=cable_names(result.data)[k], **line_style(k))
    panel.plot(time, low, color="black", linewidth=1.4, label="smallest")
    draw_limits(panel, limits, tension, "N")
    finite = tension[np.isfinite(tension)]
    drawn = [value for _, value in limits if value <= FAR * float(np.abs(finite).max(initial=0.0))]
    top = 1.08 * max([float(finite.max(initial=0.0)), *drawn]) or 1.0
    bottom = min(0.0, 1.05 * float(finite.min(initial=0.0)))
    # Tensions of zero, below which no cable can go.
    panel.axhline(0.0, color="black", linewidth=0.8)
    boundaries(panel, result)
    shade_failing(panel, result.data, "tension", charts)
    panel.set(xlabel="time (s)", ylabel="tension (N)", ylim=(bottom, top))
    panel.margins(x=0.01)
