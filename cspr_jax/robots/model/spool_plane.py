"""Tests whether points of a robot lie on a line, or in a vertical plane. NumPy alone, for checks of files."""

from __future__ import annotations

import numpy as np

from cspr_jax.numerics.shapes import Bool, Float

# Points lie on a line if their second spread over the first is not above the first number; their plane is vertical if
# its area as seen from above, over its area in space, is not above the second.
SMALLEST_AREA_RATIO = 1e-6
SMALLEST_LEVEL_RATIO = 1e-3
# Points closer to P0, or to a line through P0, than this fraction of the radius of the spools count as lying there.
AT_P0 = 1e-9


def spread(points: Float[np.ndarray, "n m"]) -> np.ndarray:
    """Spread of points about their centroid along their principal axes."""
    return np.linalg.svd(points - points.mean(0), compute_uv=False)


def is_on_line(points: Float[np.ndarray, "n m"]) -> bool:
    """Tell whether points lie on one line, or coincide."""
    spreads = spread(points)
    return not spreads[1] > SMALLEST_AREA_RATIO * spreads[0]


def is_vertical(points: Float[np.ndarray, "n 3"]) -> bool:
    """Tell whether the plane of points is vertical; of more than three points, the plane of least squares."""
    # Compare the area seen from above with the area in space, each as a product of two spreads.
    spreads, level = spread(points), spread(points[:, :2])
    return not level[0] * level[1] > SMALLEST_LEVEL_RATIO * spreads[0] * spreads[1]


def largest_radius(base_points: Float[np.ndarray, "n 3"]) -> float:
    """Largest distance of a spool from the centroid of all spools."""
    return float(np.linalg.norm(base_points - base_points.mean(0), axis=1).max())


def in_plane(
    base_points: Float[np.ndarray, "n 3"], points: Float[np.ndarray, "k 3"], *, planar: bool = False
) -> Bool[np.ndarray, "k"]:
    """Tell which points lie in the plane of all spools; none does where the spools do not share one plane."""
    spools = np.concatenate([base_points, base_points + np.array([0.0, 1.0, 0.0])]) if planar else base_points
    if len(spools) < 3 or is_on_line(spools) or is_vertical(spools):
        return np.zeros(len(points), bool)
    _, spreads, axes = np.linalg.svd(spools - spools.mean(0))
    near = AT_P0 * largest_radius(base_points)
    return (np.abs((points - spools.mean(0)) @ axes[2]) <= near) & bool(spreads[2] <= near)
