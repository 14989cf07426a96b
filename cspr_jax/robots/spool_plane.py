"""Tests whether points of a robot lie on a line, or in a vertical plane. NumPy alone, since files are checked too."""

import numpy as np

# Below this ratio points count as lying on a line, or their plane as vertical.
SMALLEST_AREA_RATIO = 1e-6
SMALLEST_LEVEL_RATIO = 1e-3
# Points nearer to P0 than this part of the size of a robot count as being at P0; points as near to a line through P0,
# as being on it.
AT_P0 = 1e-9


def spread(points: np.ndarray) -> np.ndarray:
    """Spread of points about their centroid along their principal axes.

    Args:
        points: (n, m).

    Returns:
        (min(n, m),) singular values, the largest first.
    """
    return np.linalg.svd(points - points.mean(0), compute_uv=False)


def is_on_line(points: np.ndarray) -> bool:
    """Tell whether points lie on one line, or at one place.

    Args:
        points: (n, m), n >= 2, m >= 2.

    Returns:
        whether they do.
    """
    sizes = spread(points)
    return not sizes[1] > SMALLEST_AREA_RATIO * sizes[0]


def is_vertical(points: np.ndarray) -> bool:
    """Tell whether the plane of points is vertical; of more than three points, the plane of least squares.

    Args:
        points: (n, 3), n >= 3, not on a line.

    Returns:
        whether it is.
    """
    # Compare the area seen from above with the area in space, each as a product of two spreads.
    spreads, level = spread(points), spread(points[:, :2])
    return not level[0] * level[1] > SMALLEST_LEVEL_RATIO * spreads[0] * spreads[1]


def size(base_points: np.ndarray) -> float:
    """Size of a robot.

    Args:
        base_points: (n, 3) spools.

    Returns:
        the largest distance of a spool from the centroid of all, m.
    """
    return float(np.linalg.norm(base_points - base_points.mean(0), axis=1).max())


def in_plane(base_points: np.ndarray, points: np.ndarray, *, planar: bool = False) -> np.ndarray:
    """Points that lie in the plane of all spools.

    Args:
        base_points: (n, 3) spools.
        points: (k, 3).
        planar: whether the robot is planar, so that a line through the spools takes the place of their plane.

    Returns:
        (k,) mask; no point where the spools lie in no plane, in a vertical plane, or on a line in space.
    """
    spools = np.concatenate([base_points, base_points + np.array([0.0, 1.0, 0.0])]) if planar else base_points
    if len(spools) < 3 or is_on_line(spools) or is_vertical(spools):
        return np.zeros(len(points), bool)
    _, sizes, axes = np.linalg.svd(spools - spools.mean(0))
    near = AT_P0 * size(base_points)
    return (np.abs((points - spools.mean(0)) @ axes[2]) <= near) & bool(sizes[2] <= near)
