"""Margins of a platform's motions: smallest attained values, refined from samples by parabolas."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from cspr_jax.numerics.shapes import Bool, Float, Int

ROUNDS = 5  # number of parabolas, each about the lowest point of the previous one
NEARER = 3.0  # ratio of the point distances of one parabola and the next
LEVEL = 1e-9  # values with a smaller spread are not refined


class Samples(NamedTuple):
    """Samples of criteria along motions.

    Fields:
        criteria: (n_values,) indices of the criteria.
        motion: (k,) motion of each block.
        tau: (m, k) times, increasing.
        values: (m, n_values, k) values of the criteria.
    """

    criteria: np.ndarray
    motion: np.ndarray
    tau: np.ndarray
    values: np.ndarray


def narrowed(
    values_at: Callable[[np.ndarray, np.ndarray], np.ndarray],
    minima: Float[np.ndarray, "n_criteria n"],
    samples: Samples,
    selected: Bool[np.ndarray, "n"],
) -> None:
    """Refine the smallest values around samples."""
    sample, value, item = low_points(samples, selected)
    if not len(sample):
        return
    motion, criterion, tau = samples.motion[item], samples.criteria[value], samples.tau[sample, item]
    last = len(samples.tau) - 1
    beside = [np.abs(samples.tau[np.clip(sample + k, 0, last), item] - tau) for k in (-1, 1)]
    width = np.maximum(*beside)
    for _ in range(ROUNDS):
        points = np.clip(tau[:, None] + width[:, None] * np.array([-1.0, 0.0, 1.0]), 0.0, 1.0)
        values = _values(values_at, minima, motion, points, criterion)
        tau = _vertex(points, values)
        width = width / NEARER
    _values(values_at, minima, motion, tau[:, None], criterion)


def low_points(samples: Samples, selected: Bool[np.ndarray, "n"]) -> tuple[Int[np.ndarray, "j"], ...]:
    """Samples not larger than their neighbours, at which a parabola of twice their curvature could be smallest."""
    values, motion = samples.values, samples.motion
    smallest = np.full((values.shape[1], len(selected)), np.inf)
    lowest = values.min(0)
    for minimum, block_values in zip(smallest, lowest, strict=True):
        np.minimum.at(minimum, motion, block_values)
    falls = values[1:] < values[:-1]
    side = np.ones_like(falls[:1])
    is_low = np.concatenate([side, falls]) & np.concatenate([~falls, side])
    with np.errstate(invalid="ignore"):  # inf - inf between neighbours
        is_low &= (np.ptp(values, axis=0) > LEVEL) & selected[motion]
    sample, value, item = np.nonzero(is_low)
    current, last = values[sample, value, item], len(values) - 1
    before, after = (values[np.clip(sample + k, 0, last), value, item] for k in (-1, 1))
    with np.errstate(invalid="ignore"):
        second_derivative = before - 2.0 * current + after
    reaches = np.isfinite(second_derivative) & (current - 0.25 * second_derivative <= smallest[value, motion[item]])
    return sample[reaches], value[reaches], item[reaches]


def _values(values_at: Callable, minima: np.ndarray, motion: np.ndarray, points: np.ndarray, criterion: np.ndarray):
    # Return values (j, m) of each candidate's own criterion, and lower the smallest values of all criteria.
    count = points.shape[1]
    motions = np.repeat(motion, count)
    attained = values_at(motions, points.ravel())
    for lowest, values in zip(minima, attained, strict=True):
        np.fmin.at(lowest, motions, values)
    return attained[np.repeat(criterion, count), np.arange(len(motions))].reshape(points.shape)


def _vertex(points: np.ndarray, values: np.ndarray) -> np.ndarray:
    # Return the vertex of the parabola through three points; if it has no minimum within them, the lowest point.
    (a, b, c), (x, y, z) = points.T, values.T
    with np.errstate(invalid="ignore", divide="ignore"):
        top = (b - a) ** 2 * (y - z) - (b - c) ** 2 * (y - x)
        bottom = (b - a) * (y - z) - (b - c) * (y - x)
        vertex = b - 0.5 * top / bottom
    best = points[np.arange(len(points)), np.nanargmin(np.where(np.isnan(values), np.inf, values), axis=1)]
    is_inside = np.isfinite(vertex) & (vertex >= a) & (vertex <= c) & (bottom < 0.0)
    return np.where(is_inside, vertex, best)
