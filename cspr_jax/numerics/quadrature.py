"""Integrals by Gauss-Legendre quadrature with 10 points, on intervals that are halved where their halves disagree.

Jumps and kinks of the integrand need not be known: the intervals around them shrink until they do not matter.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cspr_jax.numerics.shapes import Float

POINTS, WEIGHTS = np.polynomial.legendre.leggauss(10)
NARROWEST = 1e-14  # width of an interval, as a fraction of all of them, that is not halved
FRACTION = 0.01  # of the tolerance, which one interval may take
LARGEST_COUNT = 400_000  # of intervals, beyond which none is halved
LOOSEST = 1e-6  # largest relative error


def integrals(
    function: Callable[[np.ndarray], np.ndarray],
    edges: Float[np.ndarray, "n"],
    tolerance: float,
    floor: Float[np.ndarray, "m"] | float = 0.0,
) -> Float[np.ndarray, "m"]:
    """Integrals of m functions from the first edge to the last one, to a tolerance relative to them or to a floor.

    The floor ends the halving of functions that are only rounding noise. Integrals that do not converge are NaN.
    """
    low, high = np.asarray(edges[:-1], float), np.asarray(edges[1:], float)
    full, estimates = float(edges[-1] - edges[0]), _estimates(function, low, high)
    total, residual, count = np.zeros(estimates.shape[1]), np.zeros(estimates.shape[1]), len(low)
    while len(low):
        middle = 0.5 * (low + high)
        halves = _estimates(function, np.concatenate([low, middle]), np.concatenate([middle, high]))
        better = halves[: len(low)] + halves[len(low) :]
        errors, count = np.abs(better - estimates), count + 2 * len(low)
        scale = np.maximum(np.abs(total + better.sum(0)), floor)
        is_open = (errors > FRACTION * tolerance * scale).any(1) & (high - low > NARROWEST * full)
        is_open &= count < LARGEST_COUNT
        total, residual = total + better[~is_open].sum(0), residual + errors[~is_open].sum(0)
        low, high, middle = low[is_open], high[is_open], middle[is_open]
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
        estimates = halves[np.tile(is_open, 2)]
    return np.where(residual > LOOSEST * np.maximum(np.abs(total), floor), np.nan, total)


def _estimates(function: Callable[[np.ndarray], np.ndarray], low: np.ndarray, high: np.ndarray) -> np.ndarray:
    # Integrals over each interval, (k, m).
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    values = function((middle[:, None] + half[:, None] * POINTS).ravel()).reshape(len(low), len(POINTS), -1)
    return half[:, None] * np.einsum("p,kpm->km", WEIGHTS, values)
