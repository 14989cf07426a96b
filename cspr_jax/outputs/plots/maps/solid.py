"""A workspace in three dimensions: its boundary, and the robot in it."""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection
from mpl_toolkits.mplot3d.axes3d import Axes3D

from cspr_jax.errors import InputError
from cspr_jax.numerics.shapes import Float
from cspr_jax.outputs.plots.maps.boundary import Boundary, BoundarySides, boundary, sides_of
from cspr_jax.outputs.plots.maps.conditions import conditions, is_workspace
from cspr_jax.outputs.plots.robots.obstacles import COLOUR as OBSTACLE
from cspr_jax.outputs.plots.robots.obstacles import faces_of, obstacles
from cspr_jax.outputs.plots.robots.robot_at import Posed, posed
from cspr_jax.outputs.plots.style.labels import COLOURS, robot_name
from cspr_jax.outputs.plots.style.scene import set_space, shape_of, signs_of, towards_eye
from cspr_jax.outputs.volumes import WorkspaceVolume, volume_of
from cspr_jax.store.reading.result import Result

SPACE = ["x", "y", "z"]
SURFACE = COLOURS[5]
END = "#9a9a9a"
LINES = COLOURS[0]
CABLES = COLOURS[1]
BACK, FRONT = 0.4, 0.3  # opacities
# Inches: width of the box, height of title and legend, and smallest and largest height of the picture.
ACROSS = 6.8
BESIDE = 1.3
LOW = 3.6
HIGH = 7.6


class _Eye(NamedTuple):
    # Signs from axes of the file to axes of the picture, and the direction to the viewer in axes of the file.
    signs: np.ndarray
    towards: np.ndarray


class _LevelLines(Line3DCollection):
    # Contour lines of a surface at the heights of the ticks, which are known only when the picture is drawn.

    def __init__(self, triangles: np.ndarray, panel: Axes3D, layer: float) -> None:
        self._triangles, self._panel = triangles, panel
        self._heights: np.ndarray | None = None
        super().__init__(triangles[:1, :2], colors=LINES, linewidths=0.5, zorder=layer)

    def do_3d_projection(self) -> float:
        heights = np.asarray(self._panel.zaxis.get_majorticklocs())
        if self._heights is None or not np.array_equal(heights, self._heights):
            self._heights = heights
            self.set_segments(_level_lines(self._triangles, heights))
        return super().do_3d_projection()


def solid_figure(result: Result, index: dict[str, int], fixed: list[str]) -> Figure:
    """The boundary of a workspace, with the robot at its centroid."""
    sides = sides_of(result, SPACE, index)
    if not (sides.verdict == 0).any():
        raise InputError("--solid", "nothing is inside", "a workspace with poses inside")
    surface = boundary(sides)
    angles = {axis: float(result.axes[axis][i]) for axis, i in index.items()}
    robot = posed(result, middle_of(sides), angles)
    bodies = obstacles(result)
    points = np.concatenate([surface.corners, robot.cable_points.reshape(-1, 3), *bodies])
    is_down = result.attributes.get("z_axis", "down") == "down"
    height = float(np.clip(ACROSS * shape_of(points) + BESIDE, LOW, HIGH))
    figure = Figure(figsize=(7.2, height), layout="constrained")
    panel: Axes3D = figure.add_subplot(projection="3d", computed_zorder=False)
    set_space(panel, points, is_down=is_down)
    eye = _Eye(signs_of(is_down=is_down), towards_eye(is_down=is_down))
    _draw_surface(panel, surface, eye)
    _draw_robot(panel, robot)
    _draw_obstacles(panel, bodies, eye, surface)
    figure.legend(*_legend(surface, has_obstacles=bool(bodies)), loc="outside lower center", ncols=5)
    figure.suptitle(
        f"{robot_name(result)}: workspace, {conditions(result)}\n{', '.join([volume_words(result, index), *fixed])}"
    )
    return figure


def is_solid(result: Result) -> bool:
    """Tell whether a map is a workspace over points in space."""
    return is_workspace(result) and min(len(np.unique(result.axes.get(axis, ()))) for axis in SPACE) > 1


def middle_of(sides: BoundarySides) -> Float[np.ndarray, "3"]:
    """The centroid of the points inside, or the nearest point inside where the centroid is outside."""
    grid = np.stack(np.meshgrid(*sides.points, indexing="ij"), axis=-1)
    inside = grid[sides.verdict == 0]
    middle = inside.mean(0)
    nearest = tuple(int(np.abs(points - x).argmin()) for points, x in zip(sides.points, middle, strict=True))
    if sides.verdict[nearest] == 0:
        return middle
    return inside[np.square(inside - middle).sum(1).argmin()]


def _draw_surface(panel: Axes3D, surface: Boundary, eye: _Eye) -> None:
    # Triangles that face away from the viewer are drawn behind the robot, the others in front of it.
    triangles = surface.corners[surface.pieces]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    is_front = normals @ eye.towards > 0.0
    shades = _shades(surface, normals, eye)
    for is_drawn, opacity, layer in ((~is_front, BACK, 1.0), (is_front, FRONT, 3.0)):
        # Draw triangles opaque and blend the complete surface: else edges between transparent neighbours would show.
        collection = Poly3DCollection(
            triangles[is_drawn],
            facecolors=shades[is_drawn],
            edgecolors=shades[is_drawn],
            linewidths=0.4,
            zorder=layer,
        )
        collection.set_rasterized(True)
        collection.set_agg_filter(partial(_fainter, opacity))
        panel.add_collection3d(collection)
        if is_drawn.any():
            panel.add_collection3d(_LevelLines(triangles[is_drawn], panel, layer + 0.1))


def _level_lines(triangles: np.ndarray, heights: np.ndarray) -> np.ndarray:
    # Line segments (n, 2, 3) in which triangles intersect level planes.
    segments = []
    for height in heights:
        above = triangles[..., 2] > height
        cut = above.any(1) & ~above.all(1)
        # Put the corner first that is alone on its side of the plane.
        alone = np.argmax(above[cut] == (above[cut].sum(1, keepdims=True) == 1), axis=1)
        first, *others = (triangles[cut, (alone + k) % 3] for k in range(3))
        parts = [(height - first[:, 2:]) / (other[:, 2:] - first[:, 2:]) for other in others]
        segments.append(np.stack([first + p * (other - first) for p, other in zip(parts, others, strict=True)], axis=1))
    return np.concatenate(segments) if segments else np.empty((0, 2, 3))


def _fainter(opacity: float, image: np.ndarray, dpi: float) -> tuple[np.ndarray, float, float]:
    # matplotlib may call this filter twice for a collection in space.
    del dpi
    faint = image.copy()
    faint[..., 3] = np.minimum(faint[..., 3], opacity)
    return faint, 0.0, 0.0


def _shades(surface: Boundary, normals: np.ndarray, eye: _Eye) -> np.ndarray:
    # Colours (m, 3) lit by a lamp beside the viewer; normals of neighbours are averaged to hide facets.
    mixed = np.zeros(surface.corners.shape)
    for k in range(3):
        np.add.at(mixed, surface.pieces[:, k], normals)
    smooth = mixed[surface.pieces].sum(1)
    smooth /= np.maximum(np.linalg.norm(smooth, axis=1, keepdims=True), 1e-300)
    lamp = eye.signs * np.array([0.1, -0.6, 0.8])
    light = (0.6 + 0.4 * np.abs(smooth @ lamp))[:, None]
    colours = np.where(surface.is_end[:, None], to_rgb(END), to_rgb(SURFACE))
    return 1.0 - (1.0 - colours * light) * 0.95


def _draw_robot(panel: Axes3D, robot: Posed) -> None:
    floor = panel.get_zlim()[0]
    down = robot.base.copy()
    down[:, 2] = floor
    panel.add_collection3d(
        Line3DCollection(np.stack([robot.base, down], 1), colors="#9a9a9a", linewidths=0.6, linestyles=":", zorder=0.5)
    )
    panel.add_collection3d(Line3DCollection(robot.cable_points, colors=CABLES, linewidths=1.1, zorder=2.0))
    if len(robot.faces):
        panel.add_collection3d(Poly3DCollection(robot.faces, facecolors="#505050", edgecolors="none", zorder=2.1))
    panel.add_collection3d(Line3DCollection(robot.edges, colors="black", linewidths=1.2, zorder=2.2))
    for points, symbol in ((robot.base, "s"), (robot.attached, "o")):
        panel.plot(*points.T, symbol, color="black", markersize=4.0 if symbol == "s" else 2.0, zorder=2.3)
    # A flat box extends beyond its panel, which is a square.
    for artist in (*panel.collections, *panel.lines):
        artist.set(clip_on=False, in_layout=False)


def _draw_obstacles(panel: Axes3D, bodies: list[np.ndarray], eye: _Eye, surface: Boundary) -> None:
    # Draw an obstacle in front of the workspace if its middle is nearer to the viewer.
    middle = surface.corners.mean(0) @ eye.towards
    for points in bodies:
        faces = faces_of(points)
        normals = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
        facing = np.abs(normals @ eye.towards) / np.maximum(np.linalg.norm(normals, axis=1), 1e-300)
        shades = 1.0 - (1.0 - np.array(to_rgb(OBSTACLE))) * (0.55 + 0.45 * facing[:, None])
        layer = 3.5 if points.mean(0) @ eye.towards > middle else 0.8
        panel.add_collection3d(
            Poly3DCollection(faces, facecolors=shades, edgecolors=shades, linewidths=0.3, zorder=layer)
        )


def _legend(surface: Boundary, *, has_obstacles: bool = False) -> tuple[list[Any], list[str]]:
    entries: dict[str, Any] = {"workspace": Patch(color=SURFACE, alpha=0.55)}
    if surface.is_end.any():
        entries["end of the grid"] = Patch(color=END, alpha=0.55)
    if has_obstacles:
        entries["obstacles"] = Patch(color=OBSTACLE)
    entries["cables"] = Line2D([], [], color=CABLES, linewidth=1.1)
    entries["spools"] = Line2D([], [], color="black", marker="s", markersize=4.0, linestyle="")
    return list(entries.values()), list(entries)


def volume_words(result: Result, index: dict[str, int]) -> str:
    """The volume of a workspace with its error, in words."""
    volume: WorkspaceVolume = volume_of(result)
    index_of_volume = tuple(index[axis] for axis in volume.axes)
    value, error = float(volume.volume[index_of_volume]), float(volume.error[index_of_volume])
    if error == 0.0:
        return f"volume {value:.4g} m³"
    digits = max(0, 1 - int(np.floor(np.log10(error))))  # so that the error has two digits
    return f"volume {value:.{digits}f} ± {error:.{digits}f} m³"
