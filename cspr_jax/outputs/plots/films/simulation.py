"""A plan that winches drive in MuJoCo: paths, and errors of the effector and of tensions over time."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cspr_jax.outputs.mujoco.simulation import Simulated
from cspr_jax.outputs.plots.films.replay import ONE_PLANE
from cspr_jax.outputs.plots.style.fitting import legend_above
from cspr_jax.outputs.plots.style.labels import COLOURS, line_style
from cspr_jax.outputs.table_layout import two_digits


def simulation_figure(simulated: Simulated) -> Figure:
    """Planned and driven path, error of position, tensions and torques."""
    is_planar = np.ptp(simulated.position[:, 1]) <= ONE_PLANE * np.ptp(simulated.position[:, 0])
    layout: Any = [["xz", "xz"] if is_planar else ["xy", "xz"], ["error", "error"], ["tension", "tension"]]
    layout.append(["torque", "torque"])
    figure = Figure(figsize=(10.0, 11.0), layout="constrained")
    drawn = figure.subplot_mosaic(layout, height_ratios=[1.4, 0.8, 0.8, 0.8])
    for name, j in (("xy", 1), ("xz", 2)):
        if name in drawn:
            _paths(drawn[name], simulated, j)
    if simulated.z_axis == "down":
        drawn["xz"].invert_yaxis()
    drawn["error"].plot(simulated.time, 1e3 * simulated.error, color="black", linewidth=1.0)
    drawn["error"].set_ylabel("distance from\nthe plan (mm)")
    drawn["error"].set_ylim(bottom=0.0)
    _cables(drawn["tension"], simulated.time, simulated.tension, simulated.tension_reached, "tension (N)", "cable")
    _cables(drawn["torque"], simulated.time, simulated.torque, simulated.torque_reached, "torque (N m)", "motor")
    for name in ("error", "tension", "torque"):
        drawn[name].margins(x=0.01)
        drawn[name].grid(alpha=0.3)
    drawn["torque"].set_xlabel("time (s)")
    figure.suptitle(
        f"{simulated.robot}: driven by its winches in MuJoCo {simulated.mujoco}; z axis {simulated.z_axis}"
        f"\nwithin {two_digits(1e3 * simulated.error.max())} mm of the plan, "
        f"{two_digits(1e3 * simulated.error[-1])} mm at its end"
    )
    return figure


def _paths(panel: Axes, simulated: Simulated, j: int) -> None:
    curves: tuple[tuple[str, np.ndarray, dict[str, Any]], ...] = (
        ("planned", simulated.position, {"color": "black", "linewidth": 2.2, "alpha": 0.35}),
        ("driven", simulated.reached, {"color": COLOURS[1], "linewidth": 1.0, "linestyle": "--"}),
    )
    for name, path, style in curves:
        panel.plot(path[:, 0], path[:, j], label=name, **style)
    panel.set_xlabel("x (m)")
    panel.set_ylabel(f"{'xyz'[j]} (m)")
    panel.set_aspect("equal", adjustable="datalim")
    panel.grid(alpha=0.3)
    legend_above(panel, 2)


def _cables(
    panel: Axes, time: np.ndarray, planned: np.ndarray, simulated: np.ndarray, label: str, of_what: str
) -> None:
    for k in range(planned.shape[1]):
        colour = line_style(k)["color"]
        panel.plot(time, simulated[:, k], linewidth=0.7, alpha=0.75, label=f"{of_what} {k + 1}", color=colour)
    for k in range(planned.shape[1]):
        panel.plot(time, planned[:, k], linewidth=0.6, color="black", label="" if k else "planned")
    panel.set_ylabel(label)
    legend_above(panel, planned.shape[1] + 1)
