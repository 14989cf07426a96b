"""Winding torques over winding speeds of the motors along motions, with lines and limits of the motors."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from cspr_jax.outputs.plots.style.fitting import shortened
from cspr_jax.outputs.plots.style.labels import COLOURS, line_style

WIDTH, HEIGHT = 3.1, 2.7  # inches of a panel
LARGEST_COLUMNS = 4
FAR = 2.5  # limits beyond so many times the demands are named, not drawn
DASHES = (0, (4, 2))


def torque_speed_figure(
    robot: str,
    curves: Mapping[str, Mapping[str, np.ndarray]],
    required: Mapping[str, np.ndarray],
    factor: float,
    limits: Mapping[str, np.ndarray],
) -> Figure:
    """A panel a motor, from curves of "speed" and "torque" (k, n), required values (n,) and limits (n,)."""
    count = len(required["torque"])
    columns = min(count, LARGEST_COLUMNS)
    rows = math.ceil(count / columns)
    figure = Figure(figsize=(WIDTH * columns + 0.6, HEIGHT * rows + 1.2), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False)
    for k, panel in enumerate(panels.ravel()):
        if k >= count:
            panel.set_visible(False)
            continue
        _draw(panel, k, curves, factor, required, limits)
        panel.set_title(f"motor {k + 1}")
        if k % columns == 0:
            panel.set_ylabel("torque (N m)")
        if k + columns >= count:
            panel.set_xlabel("speed (rad/s)")
    handles = _handles(list(curves), factor, limits)
    figure.legend(handles=handles, loc="outside lower center", ncols=min(len(handles), columns + 1))
    figure.suptitle(f"{shortened(robot)}: winding torque over winding speed, safety factor {factor:g}")
    return figure


def _draw(
    panel: Axes,
    k: int,
    curves: Mapping[str, Mapping[str, np.ndarray]],
    factor: float,
    required: Mapping[str, np.ndarray],
    limits: Mapping[str, np.ndarray],
) -> None:
    torque, speed = float(required["torque"][k]), float(required["speed"][k])
    for number, curve in enumerate(curves.values()):
        speeds, torques = curve["speed"][:, k], curve["torque"][:, k]
        panel.plot(speeds, torques, linewidth=1.2, **line_style(number))
        panel.plot(factor * speeds, factor * torques, linewidth=0.8, alpha=0.45, **line_style(number))
    panel.plot(
        [-speed, speed, speed, -speed, -speed],
        [-torque, -torque, torque, torque, -torque],
        color="black",
        linewidth=0.9,
        linestyle=":",
    )
    right, top = 1.15 * speed or 1.0, 1.15 * torque or 1.0
    if "line" in limits:
        stall, fastest = (float(limits["line"][i][k]) for i in (0, 1))
        corners = np.array([[0.0, stall], [fastest, 0.0], [0.0, -stall], [-fastest, 0.0], [0.0, stall]])
        panel.plot(*corners.T, color="black", linewidth=1.3)
        right, top = (max(shown, min(1.1 * end, FAR * shown)) for shown, end in ((right, fastest), (top, stall)))
    for name, draw in (("motor_torque_max", panel.axhline), ("motor_speed_max", panel.axvline)):
        for sign in (1.0, -1.0) if name in limits else ():
            draw(sign * float(limits[name][k]), color=COLOURS[1], linewidth=1.0, linestyle=DASHES)
    right = max(right, min(1.1 * _limit(limits, "motor_speed_max", k), FAR * speed))
    top = max(top, min(1.1 * _limit(limits, "motor_torque_max", k), FAR * torque))
    if "motor_power_max" in limits:
        _hyperbola(panel, float(limits["motor_power_max"][k]), right, top)
    panel.axhline(0.0, color="black", linewidth=0.5, alpha=0.4)
    panel.axvline(0.0, color="black", linewidth=0.5, alpha=0.4)
    panel.set(xlim=(-right, right), ylim=(-top, top))
    panel.grid(alpha=0.25)


def _limit(limits: Mapping[str, np.ndarray], name: str, k: int) -> float:
    return float(limits[name][k]) if name in limits else 0.0


def _hyperbola(panel: Axes, power: float, right: float, top: float) -> None:
    speeds = np.geomspace(power / (2.0 * top), right, 80)
    if speeds[0] < right:
        for a in (1.0, -1.0):
            for b in (1.0, -1.0):
                panel.plot(a * speeds, b * power / speeds, color=COLOURS[2], linewidth=1.0, linestyle="-.")


def _handles(names: Sequence[str], factor: float, limits: Mapping[str, np.ndarray]) -> list[Line2D]:
    handles = [Line2D([], [], linewidth=1.1, label=shortened(name), **line_style(k)) for k, name in enumerate(names)]
    handles.append(Line2D([], [], color=COLOURS[0], linewidth=0.8, alpha=0.45, label=f"{factor:g} times it"))
    box = f"{factor:g} times the largest"
    handles.append(Line2D([], [], color="black", linewidth=0.9, linestyle=":", label=box))
    if "line" in limits:
        handles.append(Line2D([], [], color="black", linewidth=1.3, label="line of the motor"))
    if {"motor_torque_max", "motor_speed_max"} & limits.keys():
        handles.append(Line2D([], [], color=COLOURS[1], linewidth=1.0, linestyle=DASHES, label="limits"))
    if "motor_power_max" in limits:
        handles.append(Line2D([], [], color=COLOURS[2], linewidth=1.0, linestyle="-.", label="limit of power"))
    return handles
