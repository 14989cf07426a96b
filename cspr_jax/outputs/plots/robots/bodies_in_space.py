"""Obstacles of a motion in space: the area that each covers in the picture, and lines on its surface."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

from cspr_jax.outputs.plots.robots.obstacles import AREA, COLOUR, outline, points_of
from cspr_jax.outputs.plots.robots.robot_at import hull_of
from cspr_jax.outputs.plots.style.scene import across_and_up
from cspr_jax.robots.model.shapes import Box, Cylinder, Obstacle

# Points of a circle.
AROUND = 48


def draw_bodies(panel: Any, bodies: Sequence[Obstacle], *, is_down: bool) -> None:
    """Draw obstacles behind cables and path, which stay visible."""
    view = across_and_up(is_down=is_down)
    for body in bodies:
        points = points_of(body)
        middle = points.mean(0)
        area = middle + outline((points - middle) @ view.T) @ view
        panel.add_collection3d(Poly3DCollection([area], **AREA, zorder=1.5))
        lines = Line3DCollection(lines_on(body), colors=COLOUR, linewidths=0.7, alpha=0.6, zorder=1.6)
        panel.add_collection3d(lines)


def lines_on(body: Obstacle) -> list[np.ndarray]:
    """Lines that show the shape of an obstacle: edges of a box, circles about the ends of a cylinder, or on a ball."""
    if isinstance(body, Box):
        return list(hull_of(points_of(body))[1])
    if isinstance(body, Cylinder):
        return [_circle(end, body.end - body.start, body.radius) for end in (body.start, body.end)]
    return [_circle(body.centre, way, body.radius) for way in np.eye(3)]


def _circle(centre: np.ndarray, normal: np.ndarray, radius: float) -> np.ndarray:
    # The right singular vectors behind the first one are at right angles to the normal.
    _, first, second = np.linalg.svd(normal[None])[2]
    angle = np.linspace(0.0, 2.0 * np.pi, AROUND + 1)[:, None]
    return centre + radius * (np.cos(angle) * first + np.sin(angle) * second)
