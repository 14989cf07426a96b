"""Obstacles of maps of workspaces and of motions in pictures: sections, projections, and surfaces in space."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.patches import Patch, Polygon
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

from cspr_jax.config.keys.obstacles import ObstacleKeys
from cspr_jax.numerics.shapes import Float
from cspr_jax.outputs.plots.robots.robot_at import hull_of, workspace_of
from cspr_jax.outputs.plots.style.scene import across_and_up
from cspr_jax.robots.model.shapes import Box, Cylinder, Obstacle
from cspr_jax.store.reading.result import Result

# Number of points on a circle.
CIRCLE_POINTS = 48
COLOUR = "#5c3d2e"
AREA: dict[str, Any] = {"facecolor": (*to_rgb(COLOUR), 0.35), "edgecolor": COLOUR, "linewidth": 0.8}
# Numbers of azimuths and of elevations of points on a sphere.
AROUND, UPWARD = 64, 33
CORNERS = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3), axis=-1).reshape(-1, 3)


def obstacles(result: Result) -> list[np.ndarray]:
    """Obstacles of a map of a workspace or of motions; all are convex."""
    if "map" not in result.attributes or not result.settings:
        return []
    tables = ObstacleKeys(obstacle=result.settings.get("obstacle"))
    return [points_of(body) for body in (*workspace_of(result).bodies, *tables.bodies)]


def points_of(shape: Obstacle) -> Float[np.ndarray, "n 3"]:
    """Points whose convex hull is the obstacle."""
    if isinstance(shape, Box):
        return shape.centre + (CORNERS * shape.half) @ shape.rotation.T
    around, upward = np.linspace(0.0, 2.0 * np.pi, AROUND, endpoint=False), np.linspace(-0.5, 0.5, UPWARD) * np.pi
    azimuth, height = (x.reshape(-1) for x in np.meshgrid(around, upward))
    ball = np.stack([np.cos(azimuth) * np.cos(height), np.sin(azimuth) * np.cos(height), np.sin(height)], axis=1)
    centres = (shape.start, shape.end) if isinstance(shape, Cylinder) else (shape.centre,)
    return np.concatenate([centre + shape.radius * ball for centre in centres])


def draw_shadows(panel: Axes, bodies: Iterable[Obstacle], across: tuple[int, int]) -> None:
    """Draw projections of obstacles beside a path, and widen the axes for them."""
    for number, body in enumerate(bodies):
        shadow = outline(points_of(body)[:, across])
        if len(shadow):
            label = "obstacle" if number == 0 else None
            panel.add_patch(Polygon(shadow, label=label, **AREA))
    panel.autoscale_view()


def outline(points: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "m 2"]:
    """The hull of points in a plane."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return points[ConvexHull(points).vertices]
    except (QhullError, ValueError):
        return np.empty((0, 2))


def section_of(points: Float[np.ndarray, "n 3"], across: list[str], coordinate: float) -> Float[np.ndarray, "m 2"]:
    """Section of a convex body with the plane over two axes."""
    axis = next(k for k, name in enumerate("xyz") if name not in across)
    _, edges = hull_of(points)
    start, end = edges[:, 0], edges[:, 1]
    low, high = start[:, axis] - coordinate, end[:, axis] - coordinate
    cut = low * high <= 0.0
    part = (low / np.where(low == high, 1.0, low - high))[cut, None]
    met = np.concatenate([start[cut] + part * (end - start)[cut], points[points[:, axis] == coordinate]])
    return outline(met[:, ["xyz".index(name) for name in across]])


def draw_obstacles(panel: Axes, result: Result, across: list[str], coordinates: dict[str, float]) -> dict[str, Artist]:
    """Draw obstacles into a section over two of x, y and z: filled where it cuts them, dashed outlines elsewhere."""
    if not set(across) < set("xyz"):
        return {}
    limits, entries = (panel.get_xlim(), panel.get_ylim()), dict[str, Artist]()
    columns, third = ["xyz".index(axis) for axis in across], next(axis for axis in "xyz" if axis not in across)
    for points in obstacles(result):
        shadow, cut = outline(points[:, columns]), np.empty((0, 2))
        if third in coordinates:
            cut = section_of(points, across, coordinates[third])
        if len(cut):
            panel.add_patch(Polygon(cut, facecolor=COLOUR, edgecolor="white", linewidth=0.8))
            entries["obstacle"] = Patch(facecolor=COLOUR)
        elif len(shadow):
            panel.add_patch(Polygon(shadow, fill=False, edgecolor=COLOUR, linewidth=1.2, linestyle="--"))
            entries["obstacle beside the section"] = Patch(fill=False, edgecolor=COLOUR, linestyle="--")
    panel.set(xlim=limits[0], ylim=limits[1])
    return entries


def faces_of(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "m 3 3"]:
    """Surface of a convex body."""
    return hull_of(points)[0]


def draw_bodies(panel: Any, bodies: Sequence[Obstacle], *, is_down: bool) -> None:
    """Draw obstacles behind cables and path, so that these stay visible."""
    view = across_and_up(is_down=is_down)
    for body in bodies:
        points = points_of(body)
        middle = points.mean(0)
        area = middle + outline((points - middle) @ view.T) @ view
        panel.add_collection3d(Poly3DCollection([area], **AREA, zorder=1.5))
        lines = Line3DCollection(lines_on(body), colors=COLOUR, linewidths=0.7, alpha=0.6, zorder=1.6)
        panel.add_collection3d(lines)


def lines_on(body: Obstacle) -> list[np.ndarray]:
    """Lines that show the shape of an obstacle: edges of a box, or circles on a cylinder or sphere."""
    if isinstance(body, Box):
        return list(hull_of(points_of(body))[1])
    if isinstance(body, Cylinder):
        return [_circle(end, body.end - body.start, body.radius) for end in (body.start, body.end)]
    return [_circle(body.centre, axis, body.radius) for axis in np.eye(3)]


def _circle(centre: np.ndarray, normal: np.ndarray, radius: float) -> np.ndarray:
    # The right singular vectors after the first one are normal to the axis.
    _, first, second = np.linalg.svd(normal[None])[2]
    angle = np.linspace(0.0, 2.0 * np.pi, CIRCLE_POINTS + 1)[:, None]
    return centre + radius * (np.cos(angle) * first + np.sin(angle) * second)
