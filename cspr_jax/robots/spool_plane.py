"""How points of a robot's geometry are spread: on a line, in a vertical plane. NumPy alone, since files ask too."""

import numpy as np

# Below these ratios points count as lying on a line, and their plane as vertical.
SMALLEST_AREA_RATIO = 1e-6
SMALLEST_LEVEL_RATIO = 1e-3


def spread(points: np.ndarray) -> np.ndarray:
    """Spread of points about their centroid along their principal axes.

    Args:
        points: (n, m).

    Returns:
        (min(n, m),) singular values, the largest first.
    """
    return np.linalg.svd(points - points.mean(0), compute_uv=False)


def is_on_line(points: np.ndarray) -> bool:
    """Whether points lie on one line, or at one place.

    Args:
        points: (n, m), n >= 2, m >= 2.

    Returns:
        the claim.
    """
    sizes = spread(points)
    return not sizes[1] > SMALLEST_AREA_RATIO * sizes[0]


def is_vertical(points: np.ndarray) -> bool:
    """Whether the plane of points, of more than three that of least squares, is vertical.

    Args:
        points: (n, 3), n >= 3, not on a line.

    Returns:
        the claim.
    """
    # The product of both spreads from above, over that of both in space: how far the plane is from vertical.
    spreads, level = spread(points), spread(points[:, :2])
    return not level[0] * level[1] > SMALLEST_LEVEL_RATIO * spreads[0] * spreads[1]
