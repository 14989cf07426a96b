"""Tensions of a motion over time: the band that they fill, and the limits."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cspr_jax.config.plan import PlanFile
from cspr_jax.config.robot import RobotFile
from cspr_jax.outputs.plots.labels import COLOURS, cable_names, robot_name
from cspr_jax.outputs.plots.motion import boundaries, doubt
from cspr_jax.outputs.plots.moving import limits_of
from cspr_jax.store.result import Result

# Limits beyond this many times the largest tension are written and not drawn.
FAR = 1.6
LIMIT = COLOURS[1]


def tensions_figure(result: Result, spec: RobotFile, keys: PlanFile) -> Figure:
    """The band of tensions over time, with the limits.

    Args:
        result: the motion.
        spec: the robot whose cables have these tensions.
        keys: the plan, whose limits go before the robot's.

    Returns:
        the figure.
    """
    figure = Figure(figsize=(7.2, 4.2), layout="constrained")
    panel = figure.subplots()
    draw_tensions(panel, result, limits_of(spec, keys))
    figure.legend(loc="outside lower center", ncols=4)
    figure.suptitle(f"{robot_name(result)}: tensions over time\n{extremes(result)}{doubt(result)}")
    return figure


def extremes(result: Result) -> str:
    """The smallest and the largest tension of a motion's rows, in words.

    Args:
        result: the motion.

    Returns:
        both, with their cables and instants.
    """
    tension, time = result.data["tension"], result.axes["t"]
    if not np.isfinite(tension).any():
        return "no finite tension"
    names, each = cable_names(result.data), []
    for words, place in (("smallest", np.nanargmin(tension)), ("largest", np.nanargmax(tension))):
        row, cable = np.unravel_index(place, tension.shape)
        each.append(f"{words} {tension[row, cable]:.4g} N, {names[cable]}, t = {time[row]:.3g} s")
    return "; ".join(each)


def draw_tensions(panel: Axes, result: Result, limits: list[tuple[str, float]]) -> None:
    """Tensions as a band from the smallest to the largest of all cables, each cable as a thin line, and the limits.

    Args:
        panel: over time.
        result: the motion.
        limits: words and values, N.
    """
    time, tension = result.axes["t"], result.data["tension"]
    low, high = np.min(tension, axis=1), np.max(tension, axis=1)
    panel.fill_between(time, low, high, color=COLOURS[5], alpha=0.35, linewidth=0.0, label="all cables")
    for k, values in enumerate(tension.T):
        panel.plot(time, values, color="black", linewidth=0.5, alpha=0.45, label="" if k else "each cable")
    panel.plot(time, low, color=COLOURS[0], linewidth=1.3, label="smallest of them")
    finite = tension[np.isfinite(tension)]
    top = 1.08 * float(finite.max(initial=0.0)) or 1.0
    beyond = [value for _, value in limits if value > FAR * top]
    top = max([top, *(1.08 * value for _, value in limits if value not in beyond)])
    bottom = min(0.0, 1.05 * float(finite.min(initial=0.0)))
    for words, value in limits:
        if value not in beyond:
            panel.axhline(value, color=LIMIT, linewidth=1.2, linestyle="--")
            side = "top" if value > 0.9 * top else "bottom"
            panel.annotate(
                f"{words} {value:.4g} N", (0.99, value), xycoords=("axes fraction", "data"), ha="right", va=side
            )
    if beyond:
        text = f"largest allowed {min(beyond):.4g} N, above the picture"
        panel.annotate(text, (0.99, 0.98), xycoords="axes fraction", ha="right", va="top")
    # No cable pulls there.
    panel.axhline(0.0, color="black", linewidth=0.8)
    boundaries(panel, result)
    panel.set(xlabel="time (s)", ylabel="tension (N)", ylim=(bottom, top))
    panel.margins(x=0.01)
