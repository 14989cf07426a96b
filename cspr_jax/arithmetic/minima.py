"""Smallest values of functions of normalised time that may have kinks, narrowed down around their smallest samples."""

from collections.abc import Callable

import numpy as np

# Places looked at for each function, points at each, and how often: each round is eight times as fine as the last.
PLACES, POINTS, ROUNDS = 3, 17, 4


def narrowed(function: Callable[[np.ndarray], np.ndarray], tau: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Smallest value of each function along each of several motions.

    Args:
        function: of instants (n_motions, m), to (n_motions, m, n_functions).
        tau: (n,) equidistant instants from 0 to 1, at least three.
        values: (n_motions, n, n_functions) of the functions there.

    Returns:
        (n_motions, n_functions) values that they attain.
    """
    padded = np.pad(values, ((0, 0), (1, 1), (0, 0)), constant_values=np.inf)
    lows = np.where((values <= padded[:, :-2]) & (values <= padded[:, 2:]), values, np.inf)
    place = tau[np.argsort(lows, axis=1)[:, :PLACES]]  # (n_motions, PLACES, n_functions)
    smallest, width = values.min(1), tau[1] - tau[0]
    column = np.arange(values.shape[2])
    for _ in range(ROUNDS):
        points = np.clip(place[..., None] + width * np.linspace(-1.0, 1.0, POINTS), 0.0, 1.0)
        found = function(points.reshape(len(points), -1)).reshape(*points.shape, -1)
        # Of each place of a function its own values alone: (n_motions, PLACES, n_functions, POINTS).
        own = np.moveaxis(found[:, :, column, :, column], 0, 2)
        smallest = np.minimum(smallest, own.min((1, 3)))
        place = np.take_along_axis(points, own.argmin(3)[..., None], axis=3)[..., 0]
        width = 2.0 * width / (POINTS - 1)
    return smallest
