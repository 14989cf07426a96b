"""A workspace in three dimensions: its boundary, and the robot in it."""

from functools import partial
from typing import Any, NamedTuple

import numpy as np
from matplotlib import rcParams
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection
from mpl_toolkits.mplot3d.axes3d import Axes3D

from cspr_jax.errors import InputError
from cspr_jax.outputs.plots.boundary import Boundary, BoundarySides, boundary, sides_of
from cspr_jax.outputs.plots.conditions import conditions
from cspr_jax.outputs.plots.labels import COLOURS, axis_label, robot_name
from cspr_jax.outputs.plots.obstacles import COLOUR as OBSTACLE
from cspr_jax.outputs.plots.obstacles import faces_of, obstacles
from cspr_jax.outputs.plots.robot_at import Posed, posed
from cspr_jax.outputs.volumes import WorkspaceVolume, volume_of
from cspr_jax.store.result import Result

SPACE = ["x", "y", "z"]
ELEVATION, AZIMUTH = 20.0, -62.0  # degrees, of the eye
SURFACE, END, LINES, CABLES = COLOURS[5], "#9a9a9a", COLOURS[0], COLOURS[1]
BACK, FRONT = 0.4, 0.3  # opacities
# Width and least height, inches, and the share of the box in the figure; the rest is for ticks, title and legend.
WIDTH, LEAST_HEIGHT = 7.2, 4.4
WIDE, HIGH, MIDDLE = 0.76, 0.68, 0.51
MARGIN = 0.02  # room around the drawn points, over their largest side
# Share of the side of a panel that the diagonal of a box takes where mplot3d shows it without zoom.
DIAGONAL = 1.03


class _Eye(NamedTuple):
    # Signs of the axes of the picture in those of the file, and the direction towards the eye in the latter.
    signs: np.ndarray
    towards: np.ndarray


def solid_figure(result: Result, index: dict[str, int], fixed: list[str]) -> Figure:
    """The boundary of a workspace, with the robot at its centroid.

    Args:
        result: a map of a workspace over x, y and z.
        index: of the point, for each of its other axes.
        fixed: words for the constants.

    Returns:
        the figure.

    Raises:
        InputError: nothing is inside.
    """
    sides = sides_of(result, SPACE, index)
    if not (sides.verdict == 0).any():
        raise InputError("--solid", "nothing is inside", "a workspace with poses inside")
    surface = boundary(sides)
    angles = {axis: float(result.axes[axis][place]) for axis, place in index.items()}
    robot = posed(result, _middle(sides), angles)
    bodies = obstacles(result)
    points = np.concatenate([surface.corners, robot.ways.reshape(-1, 3), *bodies])
    box = np.stack([points.min(0), points.max(0)]) + np.array([[-1.0], [1.0]]) * MARGIN * np.ptp(points, axis=0).max()
    figure, panel = _panel(box[1] - box[0])
    eye = _axes(panel, result, box)
    _draw_surface(panel, surface, eye)
    _draw_robot(panel, robot)
    _draw_obstacles(panel, bodies, eye, surface)
    figure.legend(*_legend(surface, has_obstacles=bool(bodies)), loc="lower center", ncols=4)
    figure.suptitle(
        f"{robot_name(result)}: workspace, {conditions(result)}\n{', '.join([_volume(result, index), *fixed])}"
    )
    return figure


def _middle(sides: BoundarySides) -> np.ndarray:
    # Return the centroid of the points inside; if it is not in the workspace itself, the point inside that is nearest.
    grid = np.stack(np.meshgrid(*sides.points, indexing="ij"), axis=-1)
    inside = grid[sides.verdict == 0]
    middle = inside.mean(0)
    nearest = tuple(int(np.abs(points - x).argmin()) for points, x in zip(sides.points, middle, strict=True))
    if sides.verdict[nearest] == 0:
        return middle
    return inside[np.square(inside - middle).sum(1).argmin()]


def _panel(sizes: np.ndarray) -> tuple[Figure, Axes3D]:
    # The picture of a box fits into a figure of any shape: a panel is as large a square as its place allows, and the
    # place is higher or lower than the figure, as the picture is.
    elevation, azimuth = np.radians([ELEVATION, AZIMUTH])
    right, back, up = sizes / np.linalg.norm(sizes)
    across = abs(right * np.sin(azimuth)) + abs(back * np.cos(azimuth))
    high = up * np.cos(elevation) + (abs(right * np.cos(azimuth)) + abs(back * np.sin(azimuth))) * np.sin(elevation)
    larger = max(across, high)
    room = HIGH / (WIDE * high / larger)
    figure = Figure(figsize=(WIDTH, max(LEAST_HEIGHT, WIDTH / room)))
    panel: Axes3D = figure.add_axes(
        (0.0, MIDDLE - 0.5 * room, 1.0, room),
        projection="3d",
        elev=ELEVATION,
        azim=AZIMUTH,
        proj_type="ortho",
        computed_zorder=False,
    )
    panel.set_box_aspect(tuple(sizes), zoom=WIDE / (DIAGONAL * larger))
    return figure, panel


def _axes(panel: Axes3D, result: Result, box: np.ndarray) -> _Eye:
    # Scales are equal. Where z points down y is turned, too, so that nothing is mirrored.
    is_down = result.attributes.get("z_axis", "down") == "down"
    signs = np.array([1.0, -1.0, -1.0]) if is_down else np.ones(3)
    for name, sign, (low, high) in zip(SPACE, signs, box.T, strict=True):
        panel.set(**{f"{name}lim": (low, high) if sign > 0.0 else (high, low)})
    parts = np.ptp(box, axis=0) / np.ptp(box, axis=0).max()
    for name, part, axis in zip(SPACE, parts, (panel.xaxis, panel.yaxis, panel.zaxis), strict=True):
        axis.set_major_locator(MaxNLocator(max(2, round((15.0 if name == "z" else 9.0) * part)), steps=[1, 2, 5, 10]))
        axis.set_rotate_label(False)
        axis.set_label_text(axis_label(result, name), rotation=90.0 if name == "z" else 0.0)
        axis.labelpad = rcParams["font.size"] * (0.2 if name == "z" else 1.3)
    elevation, azimuth = np.radians([ELEVATION, AZIMUTH])
    level = np.cos(elevation)
    return _Eye(signs, signs * np.array([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)]))


def _draw_surface(panel: Axes3D, surface: Boundary, eye: _Eye) -> None:
    # Triangles that are turned away lie behind the robot, those that are turned to the eye before it.
    triangles = surface.corners[surface.pieces]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    is_front = normals @ eye.towards > 0.0
    shades = _shades(surface, normals, eye)
    for is_drawn, opacity, layer in ((~is_front, BACK, 1.0), (is_front, FRONT, 3.0)):
        # Triangles are opaque, and made transparent as a whole: else the edges of neighbours would show as a net.
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
        lines = _level_lines(triangles[is_drawn], panel.zaxis.get_major_locator()())
        panel.add_collection3d(Line3DCollection(lines, colors=LINES, linewidths=0.5, zorder=layer + 0.1))


def _level_lines(triangles: np.ndarray, heights: np.ndarray) -> np.ndarray:
    # Return (n, 2, 3) segments in which triangles pass heights.
    segments = []
    for height in heights:
        above = triangles[..., 2] > height
        cut = above.any(1) & ~above.all(1)
        # The corner that lies alone on its side comes first.
        alone = np.argmax(above[cut] == (above[cut].sum(1, keepdims=True) == 1), axis=1)
        first, *others = (triangles[cut, (alone + k) % 3] for k in range(3))
        parts = [(height - first[:, 2:]) / (other[:, 2:] - first[:, 2:]) for other in others]
        segments.append(np.stack([first + p * (other - first) for p, other in zip(parts, others, strict=True)], axis=1))
    return np.concatenate(segments) if segments else np.empty((0, 2, 3))


def _fainter(opacity: float, image: np.ndarray, dpi: float) -> tuple[np.ndarray, float, float]:
    # matplotlib calls this filter twice for a collection in space.
    del dpi
    faint = image.copy()
    faint[..., 3] = np.minimum(faint[..., 3], opacity)
    return faint, 0.0, 0.0


def _shades(surface: Boundary, normals: np.ndarray, eye: _Eye) -> np.ndarray:
    # Return (m, 3) colours in the light of a lamp beside the eye; normals of neighbours are mixed to hide facets.
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
    panel.add_collection3d(Line3DCollection(robot.ways, colors=CABLES, linewidths=1.1, zorder=2.0))
    if len(robot.faces):
        panel.add_collection3d(Poly3DCollection(robot.faces, facecolors="#505050", edgecolors="none", zorder=2.1))
    panel.add_collection3d(Line3DCollection(robot.edges, colors="black", linewidths=1.2, zorder=2.2))
    for points, look in ((robot.base, "s"), (robot.attached, "o")):
        panel.plot(*points.T, look, color="black", markersize=4.0 if look == "s" else 2.0, zorder=2.3)


def _draw_obstacles(panel: Axes3D, bodies: list[np.ndarray], eye: _Eye, surface: Boundary) -> None:
    # An obstacle whose middle is nearer to the eye than that of the workspace lies before it.
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


def _volume(result: Result, index: dict[str, int]) -> str:
    volume: WorkspaceVolume = volume_of(result)
    place = tuple(index[axis] for axis in volume.axes)
    size, error = float(volume.volume[place]), float(volume.error[place])
    if error == 0.0:
        return f"volume {size:.4g} m³"
    digits = max(0, 1 - int(np.floor(np.log10(error))))  # two of the error
    return f"volume {size:.{digits}f} ± {error:.{digits}f} m³"
