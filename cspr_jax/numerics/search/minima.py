"""Smallest values: of one function by golden sections, and of many with kinks by refinement around their samples."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from cspr_jax.numerics.shapes import Float, Int

GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0

# Minima are refined around STARTS samples of each function, by POINTS points around each; the points of each round are
# eight times as dense as those of the round before.
STARTS = 3
POINTS = 17
ROUNDS = 4
# Between points a function falls below the lower one by less than this multiple of the difference to its neighbours.
DROP = 2.0
# A second derivative can be estimated from three samples if the ratio of their distances is at least this.
EVEN = 1e-6
CLOSE = 1e-12  # distance of the two samples on both sides of a joint of pieces


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
    """Two points that divide an interval by the golden section."""
    step = GOLDEN * (high - low)
    return high - step, low + step


def golden_step(function: Callable, bracket: Bracket, *, left_if_equal: bool = True) -> tuple[Bracket, Any]:
    """A bracket that is 0.618 times as wide, with one more value of the function."""
    low, high, left, right, at_left, at_right = bracket
    down = at_left <= at_right if left_if_equal else at_left < at_right
    low, high = jnp.where(down, low, left), jnp.where(down, right, high)
    points = inner_points(low, high)
    fresh = jnp.where(down, *points)
    value = function(fresh)
    left, right = jnp.where(down, fresh, right), jnp.where(down, left, fresh)
    at_left, at_right = jnp.where(down, value, at_right), jnp.where(down, at_left, value)
    return Bracket(low, high, left, right, at_left, at_right), value


def vertex_values(
    times: Float[np.ndarray, "... n"], values: Float[np.ndarray, "... n n_functions"]
) -> Float[np.ndarray, "... n n_functions"]:
    """Smallest values near samples, estimated by parabolas through three of them each."""
    vertices = np.array(values, float)
    gaps = np.diff(times)[..., None]
    before, after = gaps[..., :-1, :], gaps[..., 1:, :]
    with np.errstate(divide="ignore", invalid="ignore"):  # values may be infinite
        rates = np.diff(values, axis=-2) / gaps
        earlier, later = rates[..., :-1, :], rates[..., 1:, :]
        square, rate = (later - earlier) / (before + after), (earlier * after + later * before) / (before + after)
        drop = rate**2 / (4.0 * square)
    # Functions may jump at a joint of pieces, so that differences across it tell nothing about derivatives.
    is_even = np.minimum(before, after) > EVEN * np.maximum(before, after)
    is_low = (earlier <= 0.0) & (later >= 0.0) & np.isfinite(drop) & is_even
    vertices[..., 1:-1, :] -= np.where(is_low, drop, 0.0)
    return vertices


def lowest_samples(
    values: Float[np.ndarray, "... n n_functions"], estimates: Float[np.ndarray, "... n n_functions"], count: int
) -> Int[np.ndarray, "... count n_functions"]:
    """Samples around which to search for minima: the smallest sample, then local minima in the order of estimates."""
    earlier, later = np.array(values, float), np.array(values, float)
    earlier[..., 1:, :], earlier[..., :1, :] = values[..., :-1, :], np.inf
    later[..., :-1, :], later[..., -1:, :] = values[..., 1:, :], np.inf
    ranks = np.where((values <= earlier) & (values <= later), estimates, np.inf)
    np.put_along_axis(ranks, values.argmin(-2)[..., None, :], -np.inf, axis=-2)
    return np.argsort(ranks, axis=-2, kind="stable")[..., :count, :]


def narrowed(
    function: Callable[[np.ndarray], np.ndarray], tau: np.ndarray, values: Float[np.ndarray, "n_motions n n_functions"]
) -> Float[np.ndarray, "n_motions n_functions"]:
    """Smallest value of each function along each motion."""
    return narrowed_times(function, tau, values)[0]


def narrowed_times(
    function: Callable[[np.ndarray], np.ndarray], tau: np.ndarray, values: Float[np.ndarray, "n_motions n n_functions"]
) -> tuple[Float[np.ndarray, "n_motions n_functions"], Float[np.ndarray, "n_motions n_functions"]]:
    """Smallest value of each function along each motion, and the time at which it is attained."""
    tau = np.broadcast_to(tau, values.shape[:2])
    starts = lowest_samples(values, vertex_values(tau, values), STARTS)
    return followed(function, tau, starts, ROUNDS)


def followed(
    function: Callable[[np.ndarray], np.ndarray],
    tau: Float[np.ndarray, "n_motions n"],
    starts: Int[np.ndarray, "n_motions n_starts n_functions"],
    rounds: int,
    n_followed: int = STARTS,
) -> tuple[Float[np.ndarray, "n_motions n_functions"], Float[np.ndarray, "n_motions n_functions"]]:
    """Smallest value of each function near the samples from which the search starts, and the time of it."""
    motion, column = np.arange(len(tau))[:, None, None], np.arange(starts.shape[2])
    centers, width = tau[motion, starts], _distances(tau)[motion, starts]
    for _ in range(rounds):
        points = np.clip(centers[..., None] + width[..., None] * np.linspace(-1.0, 1.0, POINTS), 0.0, 1.0)
        samples = function(points.reshape(len(points), -1)).reshape(*points.shape, -1)
        # Around each start keep only the values of its own function: (n_motions, n_starts, n_functions, n).
        of_start = np.moveaxis(samples[:, :, column, :, column], 0, 2)
        lowest, at_lowest = of_start.min(3), of_start.argmin(3)[..., None]
        centers = np.take_along_axis(points, at_lowest, axis=3)[..., 0]
        drop = DROP * np.take_along_axis(_rises(of_start), at_lowest, axis=3)[..., 0]
        # Treat NaN as the smallest value, as NumPy's minimum does.
        best = np.argsort(np.where(np.isnan(lowest), -np.inf, lowest), axis=1, kind="stable")[:, :n_followed]
        lowest, centers, width, drop = (
            np.take_along_axis(table, best, axis=1) for table in (lowest, centers, width, drop)
        )
        # Give up a start that can no longer become the best: its points become those of the best.
        is_lost = lowest - drop > lowest[:, :1]
        centers, width = (np.where(is_lost, table[:, :1], table) for table in (centers, width))
        width = 2.0 * width / (POINTS - 1)
    return lowest[:, 0], centers[:, 0]


def _rises(values: np.ndarray) -> np.ndarray:
    # Larger one of the differences between each value (..., n) and its neighbors.
    with np.errstate(invalid="ignore"):  # values may be infinite
        rises = np.abs(np.diff(values, axis=-1, prepend=values[..., :1], append=values[..., -1:]))
    return np.maximum(rises[..., :-1], rises[..., 1:])


def _distances(tau: np.ndarray) -> np.ndarray:
    # Distance of each sample (n_motions, n) from the farther of the samples before and after it.
    first, last, is_apart = tau[:, :1], tau[:, -1:], np.diff(tau, axis=1) > CLOSE
    before = np.maximum.accumulate(np.where(is_apart, tau[:, :-1], first), axis=1)
    after = np.minimum.accumulate(np.where(is_apart, tau[:, 1:], last)[:, ::-1], axis=1)[:, ::-1]
    return np.maximum(tau - np.hstack([first, before]), np.hstack([after, last]) - tau)
