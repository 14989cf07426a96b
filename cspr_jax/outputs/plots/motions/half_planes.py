"""Plane sections of intersections of half-spaces, clipped to the window of a panel."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cspr_jax.numerics.shapes import Float

# Owner of sides that belong to the window.
WINDOW = -1


class Plane(NamedTuple):
    """Plane of a section. Coordinates in it are products with its two directions.

    Fields:
        point: (3,) any point of the plane.
        across: (3,) unit vector to the right.
        upward: (3,) unit vector upward, normal to `across`.
    """

    point: np.ndarray
    across: np.ndarray
    upward: np.ndarray

    def seen(self, points: Float[np.ndarray, "... 3"]) -> Float[np.ndarray, "... 2"]:
        """Coordinates of points, projected onto the plane."""
        return points @ np.stack([self.across, self.upward], axis=1)


class Polygon(NamedTuple):
    """A convex polygon.

    Fields:
        corners: (n, 2) corners, counterclockwise; none for an empty polygon.
        owners: (n,) owner of the side from each corner to the next: index of a half-space, or `WINDOW`.
    """

    corners: np.ndarray
    owners: np.ndarray


class Window(NamedTuple):
    """A rectangle.

    Fields:
        low: (2,) its lower left corner.
        high: (2,) its upper right corner.
    """

    low: np.ndarray
    high: np.ndarray


def section(
    plane: Plane, normals: Float[np.ndarray, "n 3"], offsets: Float[np.ndarray, "n"], window: Window
) -> Polygon:
    """The section of the set of points with `normals @ point >= offsets`."""
    (left, low), (right, high) = window
    corners = np.array([[left, low], [right, low], [right, high], [left, high]])
    polygon = Polygon(corners, np.full(4, WINDOW))
    beside = plane.point - plane.seen(plane.point) @ np.stack([plane.across, plane.upward])
    for number in np.flatnonzero(np.isfinite(offsets)):
        polygon = _cut(polygon, plane.seen(normals[number]), offsets[number] - normals[number] @ beside, int(number))
    return polygon


def _cut(polygon: Polygon, normal: np.ndarray, offset: float, owner: int) -> Polygon:
    # Clip a polygon to normal @ point >= offset.
    slacks = polygon.corners @ normal - offset
    corners, owners = [], []
    for k, slack in enumerate(slacks):
        after = (k + 1) % len(slacks)
        if slack >= 0.0:
            corners.append(polygon.corners[k])
            owners.append(polygon.owners[k])
        if (slack >= 0.0) != (slacks[after] >= 0.0):
            part = slack / (slack - slacks[after])
            corners.append((1.0 - part) * polygon.corners[k] + part * polygon.corners[after])
            owners.append(owner if slack >= 0.0 else polygon.owners[k])
    return Polygon(np.array(corners).reshape(-1, 2), np.array(owners, int))


def window_around(points: Float[np.ndarray, "n 2"], *, margin: float = 0.12, shape: float = 1.0) -> Window:
    """A window that contains given points."""
    low, high = points.min(axis=0), points.max(axis=0)
    height = (1.0 + 2.0 * margin) * max((high[0] - low[0]) / shape, high[1] - low[1])
    half = 0.5 * max(height, 1e-9) * np.array([shape, 1.0])
    middle = 0.5 * (low + high)
    return Window(middle - half, middle + half)
