"""Several motions in one picture, such as those of families on the same targets."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cspr_jax.errors import InputError
from cspr_jax.outputs.plots.motions.motion import doubt
from cspr_jax.outputs.plots.style.fitting import shortened
from cspr_jax.outputs.plots.style.labels import COLOURS, STYLES, robot_name
from cspr_jax.store.reading.result import Result


def motion_comparison_figure(results: list[Result], files: list[str]) -> Figure:
    """Paths from the side and from above; smallest tension and largest cable speed over time."""
    if len(results) > len(COLOURS):
        raise InputError("results", len(results), f"at most {len(COLOURS)} in one picture")
    axes = [str(result.attributes.get("z_axis", "down")) for result in results]
    if len(set(axes)) > 1:
        raise InputError("results", " and ".join(axes), "motions whose z axes point the same way")
    figure = Figure(figsize=(9.0, 7.6), layout="constrained")
    # Planar robots have no view from above.
    views = {"xz": 2} if not any(result.data["position"][:, 1].any() for result in results) else {"xy": 1, "xz": 2}
    rows: list[Any] = [[*views] * (2 // len(views)), ["tension"] * 2, ["rate"] * 2]
    panels = figure.subplot_mosaic(rows, height_ratios=[1.6, 1, 1])
    for k, (result, name) in enumerate(zip(results, _names(results, files), strict=True)):
        style: dict[str, Any] = {"color": COLOURS[k], "linestyle": STYLES[k], "linewidth": 1.4}
        time, position = result.axes["t"], result.data["position"]
        for panel, j in views.items():
            panels[panel].plot(position[:, 0], position[:, j], **style)
        panels["tension"].plot(time, result.data["tension"].min(1), label=name, **style)
        panels["rate"].plot(time, np.abs(result.data["rate"]).max(1), **style)
    for panel, j in views.items():
        _draw_spools(panels[panel], results, j)
    if axes[0] == "down":
        panels["xz"].invert_yaxis()
    panels["tension"].axhline(0.0, color="black", linewidth=0.8)
    panels["tension"].set(xlabel="time (s)", ylabel="smallest tension (N)")
    panels["rate"].set(xlabel="time (s)", ylabel="largest cable speed (m/s)", ylim=(0.0, None))
    for name in ("tension", "rate"):
        panels[name].grid(alpha=0.3)
        panels[name].margins(x=0.01)
    figure.legend(loc="outside lower center", ncols=min(3, len(results)))
    robots = list(dict.fromkeys(robot_name(result) for result in results))
    figure.suptitle(f"{', '.join(robots)}: {len(results)} motions, z axis {axes[0]}")
    return figure


def _draw_spools(panel: Axes, results: list[Result], j: int) -> None:
    # Draw spools only if they are the same for all motions.
    bases = [np.asarray(result.attributes.get("base_points", np.empty((0, 3)))) for result in results]
    if all(base.shape == bases[0].shape and (base == bases[0]).all() for base in bases):
        panel.plot(bases[0][:, 0], bases[0][:, j], linestyle="", marker="s", markersize=4, color="0.35")
    panel.set(xlabel="x (m)", ylabel=f"{'xyz'[j]} (m)")
    panel.set_aspect("equal", adjustable="datalim")
    panel.grid(alpha=0.3)


def _names(results: list[Result], files: list[str]) -> list[str]:
    # Name each motion by its family if all families differ, else by its file; add the duration, and whether it is not
    # proved.
    families = [str(result.attributes.get("family", "")) for result in results]
    stems = [Path(file).stem for file in files]
    labels = stems if len(set(stems)) == len(stems) else files
    words = families if len(set(families)) == len(families) and all(families) else labels
    ends = [f"{result.axes['t'][-1]:.4g} s{', not proved feasible' if doubt(result) else ''}" for result in results]
    return [f"{shortened(word)}, {end}" for word, end in zip(words, ends, strict=True)]
