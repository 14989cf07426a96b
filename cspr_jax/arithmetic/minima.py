"""Smallest values along a motion of functions that may have kinks, narrowed down around their smallest samples."""

from collections.abc import Callable

import numpy as np

# Places looked at for each function, points at each, and how often: each round is eight times as fine as the last.
PLACES, POINTS, ROUNDS = 3, 17, 4


def narrowed(function: Callable[[np.ndarray], np.ndarray], tau: np.ndarray, values: np.ndarray) -> np.ndarray:
    """The smallest value of each function.

    Args:
        function: of (m,) instants, to (m, n_functions).
        tau: (n,) equidistant instants, at least three.
        values: (n, n_functions) of the functions there.

    Returns:
        (n_functions,) values that they attain.
    """
    padded = np.pad(values, ((1, 1), (0, 0)), constant_values=np.inf)
    lows = np.where((values <= padded[:-2]) & (values <= padded[2:]), values, np.inf)
    place = tau[np.argsort(lows, axis=0)[:PLACES]]  # (PLACES, n_functions)
    smallest, width = values.min(0), tau[1] - tau[0]
    column = np.arange(values.shape[1])
    for _ in range(ROUNDS):
        points = np.clip(place[..., None] + width * np.linspace(-1.0, 1.0, POINTS), 0.0, 1.0)
        found = function(points.ravel()).reshape(*points.shape, -1)
        own = found[:, column, :, column].transpose(1, 0, 2)  # (PLACES, n_functions, POINTS)
        smallest = np.minimum(smallest, own.min((0, 2)))
        place = np.take_along_axis(points, own.argmin(2)[..., None], axis=2)[..., 0]
        width = 2.0 * width / (POINTS - 1)
    return smallest
