"""Clamped quintic B-splines on equal intervals of normalised time, and the samples at which motions are evaluated."""

from __future__ import annotations

from functools import lru_cache
from math import comb
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline

from cspr_jax.numerics.shapes import Float

DEGREE = 5
# Number of control points that determine the spline in one interval.
LOCAL = DEGREE + 1
# Weights of the first samples in an integral, over the distance of samples.
GREGORY = (3.0 / 8.0, 7.0 / 6.0, 23.0 / 24.0)


class Basis(NamedTuple):
    """Basis functions of splines with K control points on m intervals.

    Fields:
        knots: (K + 6,) knots of normalised time.
        tau: (m, n) samples of normalised time, equidistant, from start to end.
        functions: (m, n, 3, 6) values and two derivatives at the samples of the functions that are nonzero there.
        averages: (K,) Greville abscissae: times near which each control point has the largest weight.
        fit: (K, K) matrix from values at these times to control points.
        pieces: (m, 6, 6) matrices from control points to Bernstein coefficients of each interval.
    """

    knots: np.ndarray
    tau: np.ndarray
    functions: np.ndarray
    averages: np.ndarray
    fit: np.ndarray
    pieces: np.ndarray

    @property
    def controls(self) -> int:
        """Number K of control points."""
        return len(self.averages)

    @property
    def velocity_step(self) -> float:
        """Distance of the first two control points, over the first derivative at the start."""
        return 1.0 / (DEGREE * len(self.tau))

    @property
    def acceleration_step(self) -> float:
        """Shift of the third control point due to a second derivative at the start, over that derivative."""
        return 2.0 / (DEGREE * (DEGREE - 1) * len(self.tau) ** 2)

    @property
    def weights(self) -> np.ndarray:
        """Weights of the samples in an integral over normalised time, (m, n): Gregory's rule of order 4."""
        values = np.ones(self.tau.size)
        values[:3], values[-3:] = GREGORY, GREGORY[::-1]
        return values.reshape(self.tau.shape) / (self.tau.size - 1)

    def in_intervals(self, controls: np.ndarray) -> Float[np.ndarray, "... m 6 d"]:
        """Control points that determine the spline in each interval."""
        return np.stack([controls[..., m : m + LOCAL, :] for m in range(len(self.tau))], axis=-3)

    def evaluate(self, controls: np.ndarray) -> Float[np.ndarray, "... m n 3 d"]:
        """Values and two derivatives at all samples."""
        return np.einsum("mnrk,...mkd->...mnrd", self.functions, self.in_intervals(controls), optimize=True)


@lru_cache(maxsize=8)
def basis(intervals: int, samples: int) -> Basis:
    """Basis functions on a number of intervals, with a number of samples in each."""
    borders = np.linspace(0.0, 1.0, intervals + 1)
    knots = np.concatenate([np.zeros(DEGREE), borders, np.ones(DEGREE)])
    count = intervals + DEGREE
    spline = BSpline(knots, np.eye(count), DEGREE)
    tau = np.linspace(0.0, 1.0, intervals * samples).reshape(intervals, samples)
    derivatives = [spline.derivative(order)(tau) for order in range(3)]
    functions = [[table[m, :, m : m + LOCAL] for table in derivatives] for m in range(intervals)]
    averages = np.array([knots[k + 1 : k + 1 + DEGREE].mean() for k in range(count)])
    # Bernstein coefficients follow from the values at six points of each interval.
    fraction = np.linspace(0.0, 1.0, LOCAL)[:, None]
    power = np.arange(LOCAL)
    bernstein = np.array([comb(DEGREE, k) for k in power]) * fraction**power * (1.0 - fraction) ** power[::-1]
    values = spline(borders[:-1, None] + fraction.T / intervals)
    pieces = [np.linalg.solve(bernstein, values[m, :, m : m + LOCAL]) for m in range(intervals)]
    return Basis(
        knots, tau, np.swapaxes(np.array(functions), 1, 2), averages, np.linalg.inv(spline(averages)), np.array(pieces)
    )
