"""Obstacles of maps of workspaces and of motions in pictures: sections, shadows, and surfaces in space."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.patches import Patch, Polygon

from cspr_jax.config.obstacles import SurroundingsKeys
from cspr_jax.outputs.plots.robot_at import hull_of, workspace_of
from cspr_jax.robots.shapes import Box, Cylinder, Obstacle
from cspr_jax.store.result import Result

COLOUR = "#5c3d2e"
AREA: dict[str, Any] = {"facecolor": (*to_rgb(COLOUR), 0.35), "edgecolor": COLOUR, "linewidth": 0.8}
# Directions of the points of a ball: of azimuths and of heights.
AROUND, UPWARD = 64, 33
CORNERS = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3), axis=-1).reshape(-1, 3)


def obstacles(result: Result) -> list[np.ndarray]:
    """Obstacles of a map of a workspace or of motions; all are convex.

    Returns:
        for each (n, 3) points, in the axes of the file, whose hull it is, m; none of another result.
    """
    if "map" not in result.attributes or not result.settings:
        return []
    tables = SurroundingsKeys(obstacle=result.settings.get("obstacle"))
    return [points_of(body) for body in (*workspace_of(result).bodies, *tables.bodies)]


def points_of(shape: Obstacle) -> np.ndarray:
    """Points whose hull an obstacle is.

    Returns:
        (n, 3) m.
    """
    if isinstance(shape, Box):
        return shape.centre + (CORNERS * shape.half) @ shape.rotation.T
    around, upward = np.linspace(0.0, 2.0 * np.pi, AROUND, endpoint=False), np.linspace(-0.5, 0.5, UPWARD) * np.pi
    azimuth, height = (x.reshape(-1) for x in np.meshgrid(around, upward))
    ball = np.stack([np.cos(azimuth) * np.cos(height), np.sin(azimuth) * np.cos(height), np.sin(height)], axis=1)
    centres = (shape.start, shape.end) if isinstance(shape, Cylinder) else (shape.centre,)
    return np.concatenate([centre + shape.radius * ball for centre in centres])


def draw_shadows(panel: Axes, bodies: Iterable[Obstacle], across: tuple[int, int]) -> None:
    """Draw the shadows of obstacles beside a path, and make room for them.

    Args:
        panel: the path, seen along the third axis.
        bodies: in the axes of the file.
        across: numbers of the two axes of the panel.
    """
    for number, body in enumerate(bodies):
        shadow = outline(points_of(body)[:, across])
        if len(shadow):
            label = "obstacle" if number == 0 else None
            panel.add_patch(Polygon(shadow, label=label, **AREA))
    panel.autoscale_view()


def outline(points: np.ndarray) -> np.ndarray:
    """The hull of points in a plane.

    Args:
        points: (n, 2).

    Returns:
        (m, 2) its corners in order; empty where the points lie on a line.
    """
    from scipy.spatial import ConvexHull, QhullError

    try:
        return points[ConvexHull(points).vertices]
    except (QhullError, ValueError):
        return np.empty((0, 2))


def section_of(points: np.ndarray, across: list[str], place: float) -> np.ndarray:
    """Section of a convex body with the plane over two axes.

    Args:
        points: (n, 3) whose hull it is, m.
        across: the two axes of the plane, of x, y and z.
        place: of the plane on the third axis, m.

    Returns:
        (m, 2) corners, coordinates in the order of `across`; empty where body and plane do not meet.
    """
    axis = next(k for k, name in enumerate("xyz") if name not in across)
    _, edges = hull_of(points)
    start, end = edges[:, 0], edges[:, 1]
    low, high = start[:, axis] - place, end[:, axis] - place
    cut = low * high <= 0.0
    part = (low / np.where(low == high, 1.0, low - high))[cut, None]
    met = np.concatenate([start[cut] + part * (end - start)[cut], points[points[:, axis] == place]])
    return outline(met[:, ["xyz".index(name) for name in across]])


def draw_obstacles(panel: Axes, result: Result, across: list[str], place: dict[str, float]) -> dict[str, Artist]:
    """Draw obstacles into a section over two of x, y and z: filled where it cuts them, dashed where they are hidden.

    Args:
        panel: the section, with its cells.
        across: the two axes of the section.
        place: the other axes, and where the section is.

    Returns:
        entries of the legend, by their words.
    """
    if not set(across) < set("xyz"):
        return {}
    limits, entries = (panel.get_xlim(), panel.get_ylim()), dict[str, Artist]()
    columns, third = ["xyz".index(axis) for axis in across], next(axis for axis in "xyz" if axis not in across)
    for points in obstacles(result):
        shadow, cut = outline(points[:, columns]), np.empty((0, 2))
        if third in place:
            cut = section_of(points, across, place[third])
        if len(cut):
            panel.add_patch(Polygon(cut, facecolor=COLOUR, edgecolor="white", linewidth=0.8))
            entries["obstacle"] = Patch(facecolor=COLOUR)
        elif len(shadow):
            panel.add_patch(Polygon(shadow, fill=False, edgecolor=COLOUR, linewidth=1.2, linestyle="--"))
            entries["obstacle beside the section"] = Patch(fill=False, edgecolor=COLOUR, linestyle="--")
    panel.set(xlim=limits[0], ylim=limits[1])
    return entries


def faces_of(points: np.ndarray) -> np.ndarray:
    """Surface of a convex body.

    Args:
        points: (n, 3) whose hull it is, m.

    Returns:
        (m, 3, 3) triangles, m.
    """
    return hull_of(points)[0]
