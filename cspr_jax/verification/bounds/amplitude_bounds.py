"""Affine bounds of amplitude functions, and of other laws of normalised time, over blocks of time."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from cspr_jax.motion.amplitudes import Amplitude
from cspr_jax.numerics.bounds.affine_bounds import AffineBounds
from cspr_jax.numerics.bounds.piecewise_bounds import bernstein_of_powers, overlaps, piecewise_bounds
from cspr_jax.numerics.shapes import Float
from cspr_jax.numerics.tolerances import ROUNDING


class TimeBounds(NamedTuple):
    """Bounds over k blocks of time; leaves (k,).

    Fields:
        tau: bounds of the normalised time.
        values: bounds of the amplitude function and its derivatives with respect to tau.
    """

    tau: AffineBounds
    values: tuple[AffineBounds, ...]


def normalised(duration: Any, start: Float[np.ndarray, "k"], end: Float[np.ndarray, "k"]) -> AffineBounds:
    """Bounds of the normalised time over blocks."""
    first, last = (np.clip(np.asarray(x) / np.asarray(duration, float), 0.0, 1.0) for x in (start, end))
    return AffineBounds(0.5 * (first + last), 0.5 * (last - first), np.full(len(first), ROUNDING))


def time_bounds(
    amplitude: Amplitude, duration: Any, start: Float[np.ndarray, "k"], end: Float[np.ndarray, "k"], *, orders: int = 3
) -> TimeBounds:
    """Bounds of an amplitude function over blocks of time."""
    tau = normalised(duration, start, end)
    knots = np.concatenate([[0.0], np.asarray(amplitude.knots, float), [1.0]])
    pieces, errors = _pieces(amplitude, knots, orders)
    # Extend blocks by the rounding error of the normalised time.
    first, last = tau.middle - tau.linear, tau.middle + tau.linear
    bounds = piecewise_bounds(pieces, overlaps(knots, first, last), orders)
    slack = [error + np.asarray(amplitude.largest)[order + 1] * ROUNDING for order, error in enumerate(errors)]
    values = tuple(
        AffineBounds(each.middle[:, 0], each.linear[:, 0], each.radius[:, 0] + more)
        for each, more in zip(bounds, slack, strict=True)
    )
    return TimeBounds(tau, values)


def _pieces(amplitude: Amplitude, knots: np.ndarray, orders: int) -> tuple[np.ndarray, list[float]]:
    # Bernstein coefficients (n_pieces, degree + 1, 1), and bounds of their rounding errors, for each derivative.
    powers, origins = np.asarray(amplitude.coefficients, float), np.asarray(amplitude.origins, float)
    degree = int(np.flatnonzero(powers.any(0)).max(initial=0))
    powers, radii = powers[:, : degree + 1], np.abs(np.stack([knots[:-1], knots[1:]]) - origins).max(0)
    shift = (knots[:-1] - origins)[:, None]
    moved = np.stack(
        [
            sum(math.comb(i, j) * powers[:, i : i + 1] * shift ** (i - j) for i in range(j, degree + 1))
            for j in range(degree + 1)
        ],
        axis=1,
    )
    errors = [
        float(
            max(
                (math.perm(i, order) * np.abs(powers[:, i]) * radii ** (i - order) for i in range(order, degree + 1)),
                key=np.max,
                default=np.zeros(1),
            ).max()
        )
        * (degree + 1)
        for order in range(orders)
    ]
    scaled = moved * np.diff(knots)[:, None, None] ** np.arange(degree + 1)[:, None]
    return bernstein_of_powers(scaled), [4.0 * ROUNDING * error for error in errors]
