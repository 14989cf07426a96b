"""Workspaces of one robot under several conditions: outlines in the same sections."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path as Path2D

from cspr_jax.errors import InputError
from cspr_jax.outputs.plots.maps.boundary import BoundarySides, outlines, sides_of, step_of
from cspr_jax.outputs.plots.maps.conditions import conditions
from cspr_jax.outputs.plots.maps.marks import draw_marks
from cspr_jax.outputs.plots.robots.obstacles import draw_obstacles
from cspr_jax.outputs.plots.robots.robot_at import robot_of
from cspr_jax.outputs.plots.selection import SAME
from cspr_jax.outputs.plots.style.fitting import shortened
from cspr_jax.outputs.plots.style.labels import COLOURS, PANELS, STYLES, axis_label, chosen, robot_name, values
from cspr_jax.outputs.plots.style.layout import columns_of, panels
from cspr_jax.store.reading.result import Result

PLANES = [["x", "y"], ["x", "z"], ["y", "z"]]
SPACE = ("x", "y", "z")
SIDE, ALONE = 3.1, 5.2  # inches, the longer side of a panel
# Spools are shown unless the panels would get longer than this multiple of the grid.
LARGEST_RATIO, MARGIN = 1.5, 0.04
OPACITY = 0.18  # opacity of the areas in which boundaries may lie
_END: dict[str, Any] = {"linestyle": ":", "linewidth": 0.7}


class Compared(NamedTuple):
    """A result of a comparison.

    Fields:
        result: a map of a workspace.
        file: name of its file.
        across: axes that vary.
        at: index of the chosen point of each other axis.
    """

    result: Result
    file: str
    across: list[str]
    at: dict[str, int]

    @property
    def coordinates(self) -> dict[str, float]:
        """Coordinates that are the same in the whole picture."""
        fixed = [axis for axis in self.result.axes if axis not in self.across]
        return {axis: float(self.result.axes[axis][self.at[axis]]) for axis in fixed}


def comparison_figure(compared: list[Compared], fixed: list[str]) -> Figure:
    """Outlines of workspaces, one for each result, in the sections of the first."""
    plane = next((pair for pair in PLANES if set(pair) <= set(compared[0].across)), [])
    _check(compared, plane)
    first = compared[0].result
    over = next((axis for axis in compared[0].across if axis not in plane), None)
    heights = np.zeros(1) if over is None else _heights(compared, over)
    box = _box(compared, plane)
    figure = Figure(figsize=_figure_size(box, len(heights), len(compared)), layout="constrained")
    drawn, bottom, left = panels(figure, len(heights))
    titles = [""] if over is None else values(first, over, heights)
    legend: dict[str, Artist] = {}
    for panel, height, title in zip(drawn, heights, titles, strict=True):
        panel.set(xlim=box[:, 0], ylim=box[:, 1], title=title)
        panel.set_aspect("equal")
        panel.grid(alpha=0.3)
        coordinates = compared[0].coordinates | ({} if over is None else {over: float(height)})
        for one in compared:
            legend |= draw_obstacles(panel, one.result, plane, coordinates)
        legend |= draw_marks(panel, first, "verdict", plane, coordinates)
        for i, one in enumerate(compared):
            current = {} if over is None else {over: int(np.abs(one.result.axes[over] - height).argmin())}
            legend |= _outline(panel, sides_of(one.result, plane, one.at | current), i)
    if plane[1] == "z" and first.attributes.get("z_axis", "down") == "down":
        drawn[0].yaxis.set_inverted(True)
    for panel in bottom:
        panel.set_xlabel(axis_label(first, plane[0]))
    for panel in left:
        panel.set_ylabel(axis_label(first, plane[1]))
    legend["band: step of the grid"] = Patch(facecolor="black", alpha=OPACITY)
    _add_legend(figure, _names(compared), legend)
    robots = list(dict.fromkeys(robot_name(one.result) for one in compared))
    figure.suptitle("\n".join([f"{', '.join(robots)}: workspaces", ", ".join(fixed)]).strip())
    return figure


def _names(compared: list[Compared]) -> list[str]:
    # Results are named by their conditions, and by robot and file where the conditions are the same.
    words = [conditions(one.result) for one in compared]
    if len({robot_name(one.result) for one in compared}) > 1:
        words = [f"{robot_name(one.result)}: {text}" for one, text in zip(compared, words, strict=True)]
    stems = [Path(one.file).stem for one in compared]
    files = stems if len(set(stems)) == len(stems) else [one.file for one in compared]
    return [f"{w} ({shortened(f)})" if words.count(w) > 1 else w for w, f in zip(words, files, strict=True)]


def _check(compared: list[Compared], plane: list[str]) -> None:
    first = compared[0]
    if len(compared) > len(COLOURS):
        raise InputError("results", len(compared), f"at most {len(COLOURS)} in one picture")
    if not plane:
        raise InputError("results", f"{first.file} over {first.across}", "maps over two or three of x, y and z")
    for one in compared[1:]:
        if robot_of(one.result, one.coordinates).base_points != robot_of(first.result, first.coordinates).base_points:
            raise InputError("results", one.file, f"of a robot with the spools of that in {first.file}")
        if set(one.across) != set(first.across):
            allowed = f"over {', '.join(first.across)}, as {first.file}; --at fixes the others"
            raise InputError("results", f"{one.file} over {one.across}", allowed)
        for axis in SPACE:
            if axis not in plane and not _agree(_points(one, axis), _points(first, axis)):
                allowed = f"of the points of {first.file}; --at fixes axes"
                raise InputError("results", f"{axis} of {one.file}", allowed)


def _heights(compared: list[Compared], over: str) -> np.ndarray:
    # Choose heights evenly among those with points inside, or among all if there are none.
    points = np.unique(compared[0].result.axes[over])
    has_inside = np.zeros(len(points), bool)
    for one in compared:
        inside = sides_of(one.result, one.across, one.at).verdict == 0
        has_inside |= np.moveaxis(inside, one.across.index(over), 0).reshape(len(points), -1).any(1)
    shown = np.flatnonzero(has_inside) if has_inside.any() else np.arange(len(points))
    return points[shown[chosen(len(shown), PANELS)]]


def _points(one: Compared, axis: str) -> np.ndarray:
    # Drawn points of an axis out of the plane.
    if axis in one.across:
        return np.unique(one.result.axes[axis])
    return np.array([one.coordinates[axis]]) if axis in one.coordinates else np.empty(0)


def _agree(points: np.ndarray, others: np.ndarray) -> bool:
    return len(points) == len(others) and bool(np.allclose(points, others, rtol=SAME, atol=SAME))


def _box(compared: list[Compared], plane: list[str]) -> np.ndarray:
    # Corners (2, 2) of a rectangle around the grids, and around the spools unless these are far away.
    grids = np.array([[f(one.result.axes[axis]) for axis in plane] for one in compared for f in (np.min, np.max)])
    base = np.array(robot_of(compared[0].result, compared[0].coordinates).base_points)
    both = np.concatenate([grids, base[:, ["xyz".index(axis) for axis in plane]]])
    shown = both if (np.ptp(both, axis=0) <= LARGEST_RATIO * np.ptp(grids, axis=0)).all() else grids
    margin = MARGIN * np.ptp(shown, axis=0).max()
    return np.stack([shown.min(0) - margin, shown.max(0) + margin])


def _figure_size(box: np.ndarray, count: int, lines: int) -> tuple[float, float]:
    columns = columns_of(count)
    width, height = (ALONE if count == 1 else SIDE) * np.clip((box[1] - box[0]) / (box[1] - box[0]).max(), 0.3, 1.0)
    return columns * (float(width) + 0.15) + 0.9, -(-count // columns) * (float(height) + 0.35) + 1.2 + 0.21 * lines


def _outline(panel: Axes, sides: BoundarySides, number: int) -> dict[str, Artist]:
    # The line is thin along the end of the grid, beyond which nothing is known.
    # Margins of different conditions have different scales, so that their interpolated zeros could not be compared: the
    # line runs half-way between points on different sides, as for volumes, within an area that is as wide as the step.
    plain, ends = sides._replace(margins=[]), False
    _draw_step(panel, plain, number)
    for corners, is_end in outlines(plain):
        ends |= is_end
        panel.plot(*corners.T, color=COLOURS[number], **(_END if is_end else _line_style(number)))
    return {"end of the grid": Line2D([], [], color="black", **_END)} if ends else {}


def _draw_step(panel: Axes, sides: BoundarySides, number: int) -> None:
    # Fill all triangles of the grid with corners on both sides: the boundary may lie in them.
    triangles = step_of(sides)
    path = Path2D(
        np.concatenate([triangles, triangles[:, :1]], axis=1).reshape(-1, 2),
        np.tile([Path2D.MOVETO, Path2D.LINETO, Path2D.LINETO, Path2D.CLOSEPOLY], len(triangles)),
    )
    panel.add_patch(PathPatch(path, facecolor=COLOURS[number], alpha=OPACITY, linewidth=0.0))


def _line_style(number: int) -> dict[str, Any]:
    return {"linestyle": STYLES[number], "linewidth": 1.6}


def _add_legend(figure: Figure, words: list[str], entries: dict[str, Artist]) -> None:
    lines = [Line2D([], [], color=COLOURS[i], **_line_style(i)) for i in range(len(words))]
    labels = [*words, *entries]
    figure.legend([*lines, *entries.values()], labels, loc="outside lower center", ncols=len(labels))
