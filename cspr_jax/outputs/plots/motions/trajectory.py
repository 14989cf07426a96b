"""A motion in space: its path, the spools, and the robot at some times with its cables coloured by tension."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.transforms import ScaledTranslation
from mpl_toolkits.mplot3d.art3d import Line3DCollection

from cspr_jax.config.plan import PlanFile
from cspr_jax.config.robot import RobotFile
from cspr_jax.numerics.shapes import Float
from cspr_jax.outputs.plots.motions.ends import draw_ends, entries_of_ends, segment_rows
from cspr_jax.outputs.plots.motions.motion import doubt, point_words
from cspr_jax.outputs.plots.robots.obstacles import AREA, draw_bodies, points_of
from cspr_jax.outputs.plots.robots.robot_along import moving
from cspr_jax.outputs.plots.style.labels import COLOURS, robot_name
from cspr_jax.outputs.plots.style.scene import colours_of_tension, set_space, shape_of
from cspr_jax.store.reading.result import Result

# Largest number of times at which the robot is drawn, among those where segments begin and end.
SHOWN = 6
# Inches: width of the robot, height of texts above and below it, and smallest and largest height of the picture.
ACROSS = 6.6
BESIDE = 1.9
LOW = 3.9
HIGH = 7.6
# Spools closer together than this fraction of the largest distance share a label.
TOGETHER = 0.08


def trajectory_figure(result: Result, robot_file: RobotFile, plan_file: PlanFile) -> Figure:
    """The motion in space."""
    points = points_in_space(result, robot_file, plan_file)
    height = float(np.clip(ACROSS * shape_of(points) + BESIDE, LOW, HIGH))
    figure = Figure(figsize=(7.2, height), layout="constrained")
    panel = figure.add_subplot(projection="3d", computed_zorder=False)
    draw_trajectory(figure, panel, result, robot_file, plan_file)
    figure.legend(*legend_of(result, plan_file), loc="outside lower center", ncols=6)
    figure.suptitle(
        f"{robot_name(result)}: trajectory, {result.axes['t'][-1]:.4g} s{point_words(result.data)}{doubt(result)}"
    )
    return figure


def points_in_space(result: Result, robot_file: RobotFile, plan_file: PlanFile) -> Float[np.ndarray, "n 3"]:
    """Points that determine the shape of a picture: path, spools and corners of obstacles."""
    return np.concatenate(
        [result.data["position"], np.asarray(robot_file.base_points, float), *map(points_of, plan_file.bodies)]
    )


def draw_trajectory(figure: Figure, panel: Any, result: Result, robot_file: RobotFile, plan_file: PlanFile) -> None:
    """Path, spools, obstacles, flight of a released object, and the robot where segments begin and end."""
    ends = segment_rows(result.data, result.axes["t"])
    rows = ends[np.unique(np.linspace(0, len(ends) - 1, min(SHOWN, len(ends))).round().astype(int))]
    robot, path = moving(result.data, robot_file, rows, plan_file), result.data["position"]
    flight = result.data.get("flight_position", np.empty((0, 3)))
    bodies, is_down = plan_file.bodies, result.attributes.get("z_axis", "down") == "down"
    of_robot = [robot.cable_points.reshape(-1, 3), robot.corners.reshape(-1, 3)]
    set_space(panel, np.concatenate([*of_robot, path, flight, *map(points_of, bodies)]), is_down=is_down)
    draw_bodies(panel, bodies, is_down=is_down)
    tension = result.data["tension"]
    norm = Normalize(0.0, float(tension[np.isfinite(tension)].max(initial=0.0)) or 1.0)
    colours = colours_of_tension()
    panel.plot(*path.T, color="black", linewidth=1.2, zorder=3.0)
    if len(flight):
        panel.plot(*flight.T, color=COLOURS[2], linewidth=1.4, linestyle="--", zorder=3.0)
    spools = panel.plot(*robot.base.T, linestyle="", marker="s", markersize=5, color="0.35", zorder=2.0)[0]
    # A flat box extends beyond its panel, which is a square.
    spools.set(clip_on=False, in_layout=False)
    name_spools(panel, robot.base)
    for row, paths, corners in zip(rows, robot.cable_points, robot.corners, strict=True):
        cables = Line3DCollection(paths, colors=colours(norm(tension[row])), linewidths=1.6, zorder=2.5)
        panel.add_collection3d(cables)
        cables.set(clip_on=False, in_layout=False)
        if len(corners):
            edges = corners.reshape(-1, 2, 3)
            panel.add_collection3d(Line3DCollection(edges, colors="black", linewidths=1.2, zorder=4.0))
    draw_ends(panel, path, ends)
    add_tension_bar(figure, panel, ScalarMappable(norm, colours))


def add_tension_bar(figure: Figure, panel: Any, colours: ScalarMappable) -> None:
    """Add the bar of the cables' colours below the robot, which needs the full width."""
    figure.colorbar(colours, ax=panel, label="tension (N)", location="bottom", shrink=0.5, aspect=36, pad=0.02)


def name_spools(panel: Any, base: Float[np.ndarray, "n_cables 3"]) -> None:
    """Write numbers of cables beside their spools; spools close together share a label."""
    near = TOGETHER * np.ptp(base, axis=0).max()
    left = list(range(len(base)))
    while left:
        group = [k for k in left if np.linalg.norm(base[k] - base[left[0]]) <= near]
        left = [k for k in left if k not in group]
        words = ", ".join(str(k + 1) for k in group)
        # Place the words above the marks.
        above = panel.transData + ScaledTranslation(0.0, 0.06, panel.figure.dpi_scale_trans)
        position, style = (
            base[group].mean(0),
            {"ha": "center", "va": "bottom", "fontsize": "small", "zorder": 6.0, "in_layout": False},
        )
        panel.text(*position, words, transform=above, **style)


def legend_of(result: Result, plan_file: PlanFile) -> tuple[list[Artist], list[str]]:
    """Entries of the legend of a motion in space."""
    entries: dict[str, Artist] = {
        "path": Line2D([], [], color="black", linewidth=1.2),
        **entries_of_ends(segment_rows(result.data, result.axes["t"])),
        "cables": Line2D([], [], color=colours_of_tension()(0.6), linewidth=1.6),
        "spools, by cable": Line2D([], [], linestyle="", marker="s", color="0.35"),
    }
    if plan_file.obstacle:
        entries["obstacles"] = Patch(**AREA)
    if "flight_position" in result.data:
        entries["flight"] = Line2D([], [], color=COLOURS[2], linewidth=1.4, linestyle="--")
    return list(entries.values()), list(entries)
