"""Smallest values: golden sections of one function, and of many that may have kinks around their smallest samples."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0

# Places that are refined for each function, points at each place, and rounds, each eight times as fine as the last.
PLACES, POINTS, ROUNDS = 3, 17, 4
# Samples whose distances differ by less than this ratio tell how a function bends.
EVEN = 1e-6


class Bracket(NamedTuple):
    """An interval in which a function falls and then rises, with two points that divide it by the golden section.

    Fields:
        low: (...) lower end.
        high: (...) upper end.
        left: (...) inner point nearer to `low`.
        right: (...) inner point nearer to `high`.
        at_left: (...) value at `left`.
        at_right: (...) value at `right`.
    """

    low: Any
    high: Any
    left: Any
    right: Any
    at_left: Any
    at_right: Any


def inner_points(low, high) -> tuple[Any, Any]:
    """Two points that divide an interval by the golden section.

    Args:
        low: (...) lower ends, NumPy or jax.
        high: (...) upper ends.

    Returns:
        (...) the left point; (...) the right point.
    """
    step = GOLDEN * (high - low)
    return high - step, low + step


def golden_step(function: Callable, bracket: Bracket, *, left_if_equal: bool = True) -> tuple[Bracket, Any]:
    """A bracket that is 0.618 times as wide, with one more value of the function.

    Args:
        function: (...) to (...), of jax.
        left_if_equal: whether to keep the left side where both points have the same value.

    Returns:
        the bracket, and the new value, (...).
    """
    low, high, left, right, at_left, at_right = bracket
    down = at_left <= at_right if left_if_equal else at_left < at_right
    low, high = jnp.where(down, low, left), jnp.where(down, right, high)
    points = inner_points(low, high)
    fresh = jnp.where(down, *points)
    value = function(fresh)
    left, right = jnp.where(down, fresh, right), jnp.where(down, left, fresh)
    at_left, at_right = jnp.where(down, value, at_right), jnp.where(down, at_left, value)
    return Bracket(low, high, left, right, at_left, at_right), value


def vertex_values(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Smallest values near samples, estimated by parabolas through three of them each.

    Args:
        times: (..., n) increasing.
        values: (..., n, n_functions) samples.

    Returns:
        (..., n, n_functions) vertices of the parabolas, at samples that are no minima their values.
    """
    least = np.array(values, float)
    gaps = np.diff(times)[..., None]
    before, after = gaps[..., :-1, :], gaps[..., 1:, :]
    with np.errstate(divide="ignore", invalid="ignore"):  # values may be infinite
        slopes = np.diff(values, axis=-2) / gaps
        fall, rise = slopes[..., :-1, :], slopes[..., 1:, :]
        square, slope = (rise - fall) / (before + after), (fall * after + rise * before) / (before + after)
        drop = slope**2 / (4.0 * square)
    # Both sides of a joint tell nothing of how values change.
    is_even = np.minimum(before, after) > EVEN * np.maximum(before, after)
    is_low = (fall <= 0.0) & (rise >= 0.0) & np.isfinite(drop) & is_even
    least[..., 1:-1, :] -= np.where(is_low, drop, 0.0)
    return least


def narrowed(function: Callable[[np.ndarray], np.ndarray], tau: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Smallest value of each function along each of several motions.

    Args:
        function: takes instants (n_motions, m), and gives values (n_motions, m, n_functions).
        tau: (n,) or (n_motions, n) increasing instants from 0 to 1, at least three.
        values: (n_motions, n, n_functions) values at these instants.

    Returns:
        (n_motions, n_functions) attained values.
    """
    return narrowed_places(function, tau, values)[0]


def narrowed_places(
    function: Callable[[np.ndarray], np.ndarray], tau: np.ndarray, values: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Smallest value of each function along each of several motions, and the instant at which it is attained.

    Args:
        function: as for `narrowed`.
        tau: as for `narrowed`.
        values: (n_motions, n, n_functions) as for `narrowed`.

    Returns:
        (n_motions, n_functions) values, and (n_motions, n_functions) instants.
    """
    tau = np.broadcast_to(tau, values.shape[:2])
    padded = np.pad(values, ((0, 0), (1, 1), (0, 0)), constant_values=np.inf)
    is_low = (values <= padded[:, :-2]) & (values <= padded[:, 2:])
    order = np.argsort(np.where(is_low, vertex_values(tau, values), np.inf), axis=1)[
        :, :PLACES
    ]  # (n_motions, PLACES, n_functions)
    gaps = np.diff(tau, axis=1, prepend=tau[:, :1], append=tau[:, -1:])
    place, width = (
        np.take_along_axis(np.broadcast_to(table[..., None], values.shape), order, axis=1)
        for table in (tau, np.maximum(gaps[:, 1:], gaps[:, :-1]))
    )
    smallest = values.min(1)
    when = np.take_along_axis(tau, values.argmin(1), axis=1)
    column = np.arange(values.shape[2])
    for _ in range(ROUNDS):
        points = np.clip(place[..., None] + width[..., None] * np.linspace(-1.0, 1.0, POINTS), 0.0, 1.0)
        samples = function(points.reshape(len(points), -1)).reshape(*points.shape, -1)
        # At each place of a function keep only the values of this function: (n_motions, PLACES, n_functions, POINTS).
        own_samples = np.moveaxis(samples[:, :, column, :, column], 0, 2)
        lowest = own_samples.min((1, 3))
        place = np.take_along_axis(points, own_samples.argmin(3)[..., None], axis=3)[..., 0]
        best = np.take_along_axis(place, own_samples.min(3).argmin(1)[:, None], axis=1)[:, 0]
        when = np.where(lowest < smallest, best, when)
        smallest = np.minimum(smallest, lowest)
        width = 2.0 * width / (POINTS - 1)
    return smallest, when
