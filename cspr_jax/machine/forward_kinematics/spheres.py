"""Points at given distances from fixed centres, in space, in the plane y = 0 or on a vertical line.

The squared distances to two centres differ by an expression that is linear in the point. For as many centres as
dimensions these differences put the point p = f + h n on a line along the normal n of the centres' plane, and
h^2 = l^2 - |f - c|^2 has two roots, one on either side of the plane: both solutions, and no others.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cspr_jax.numerics.shapes import Float, Int

# Square of the height above the centres' plane, over the square of the largest length, that counts as 0 on either side:
# spheres that touch. Rounding of the squares is some 1e-16.
TOUCHING = 1e-13
# Singular values of the differences of centres, over the largest, below which centres do not span a direction.
FLAT = 1e-9


class Centres(NamedTuple):
    """Centres of spheres, prepared for many sets of distances.

    Fields:
        points: (m, 3) m.
        axes: indices, 0 to 2, of the d coordinates that the point may change.
        inverse: (d, m - 1) from differences of squares to the foot, relative to the first centre.
        normal: (3,) unit vector across the centres' plane, downwards (z > 0) unless it is level.
        is_spanned: whether the differences determine the point, and nothing is left along a normal.
    """

    points: np.ndarray
    axes: np.ndarray
    inverse: np.ndarray
    normal: np.ndarray
    is_spanned: bool


def centres_of(points: Float[np.ndarray, "m 3"], axes: tuple[int, ...]) -> Centres:
    """Centres of spheres, whose common points may move along some axes."""
    moved = np.array(axes)
    differences = 2.0 * (points[1:] - points[:1])[:, moved]
    _, singular, rows = np.linalg.svd(np.vstack([differences, np.zeros((1, len(axes)))]))
    scale = max(float(np.abs(points).max()), 1e-300)
    is_kept = singular > FLAT * max(float(singular[0]), FLAT * scale)
    inverse = np.linalg.pinv(differences, rcond=FLAT) if len(differences) else np.zeros((len(axes), 0))
    normal = np.zeros(3)
    if not is_kept.all():
        # The direction nearest to the vertical is chosen if several are left.
        free = rows[~is_kept]
        down = free.T @ free[:, -1]
        across = down if np.linalg.norm(down) > FLAT else free[-1]
        normal[moved] = across / np.linalg.norm(across)
    return Centres(points, moved, inverse, normal, bool(is_kept.all()))


def feet_and_squares(
    centres: Centres, fixed: Float[np.ndarray, "3"], distances: Float[np.ndarray, "n m"]
) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n"]]:
    """Feet of points in the centres' plane, and squares of their heights above it, negative where there are none.

    For more centres than dimensions the feet are those of least squares of the differences, and the squares mean ones.
    Coordinates that do not change are those of the fixed point.
    """
    coordinates, height = _lanes(centres, fixed, np.ascontiguousarray(distances.T))
    return np.stack(coordinates, axis=1), height


def _lanes(
    centres: Centres, fixed: np.ndarray, distances: Float[np.ndarray, "m n"]
) -> tuple[list[np.ndarray], np.ndarray]:
    # Coordinates of the feet, and squares of the heights: sums over short axes are slow, so that each is written out.
    first, axes = centres.points[0], centres.axes
    offsets = (centres.points - first)[:, axes]
    fixed_axes = np.setdiff1d(range(3), axes)
    squares = distances**2 - ((centres.points - fixed)[:, fixed_axes] ** 2).sum(1)[:, None]
    right = squares[:1] - squares[1:] + (offsets[1:] ** 2).sum(1)[:, None]
    within = [
        sum((x * y for x, y in zip(row, right, strict=True)), np.zeros(len(distances.T))) for row in centres.inverse
    ]
    coordinates = [np.full(len(distances.T), value) for value in fixed]
    for i, axis in enumerate(axes):
        coordinates[axis] = first[axis] + within[i]
    height = np.zeros(len(distances.T))
    for square, offset in zip(squares, offsets, strict=True):
        height += square - sum((x - y) ** 2 for x, y in zip(within, offset, strict=True))
    return coordinates, height / len(offsets)


def common_points(
    centres: Centres, fixed: Float[np.ndarray, "3"], distances: Float[np.ndarray, "n m"]
) -> tuple[Float[np.ndarray, "n 2 3"], Float[np.ndarray, "n 2 m"], Int[np.ndarray, "n"]]:
    """Common points of spheres, the lower ones first, their distances from the centres, and how many there are.

    Two, one where the spheres touch, or none; then both points are the foot.
    """
    lanes = np.ascontiguousarray(distances.T)
    feet, squares = _lanes(centres, fixed, lanes)
    limit = TOUCHING * lanes.max(0) ** 2
    counts = np.where(squares > limit, 2, np.where(squares >= -limit, 1, 0))
    heights = np.sqrt(np.where(counts == 2, squares, 0.0))
    points = np.empty((len(distances), 2, 3))
    reached = np.empty((len(distances), 2, len(lanes)))
    for k, side in enumerate((centres.normal, -centres.normal)):
        point = [foot + heights * part if part else foot for foot, part in zip(feet, side, strict=True)]
        for i in range(3):
            points[:, k, i] = point[i]
        for i, centre in enumerate(centres.points):
            reached[:, k, i] = np.sqrt(sum((x - y) ** 2 for x, y in zip(point, centre, strict=True)))
    return points, reached, counts
