"""Amplitude functions of one shape, so that a kernel compiles once for all of them."""

import dataclasses

import numpy as np

from cspr_jax.motion.amplitudes import Amplitude

COLUMNS = 10


def of_one_shape(amplitude: Amplitude) -> Amplitude:
    """The same function in three pieces of ten coefficients: one that has a single piece is cut where it is smooth."""
    pieces, columns = amplitude.coefficients.shape
    knots, origins = np.asarray(amplitude.knots), np.asarray(amplitude.origins)
    table = np.pad(np.asarray(amplitude.coefficients), ((0, 0), (0, COLUMNS - columns)))
    if pieces == 1:
        knots, origins, table = np.array([1.0, 2.0]) / 3.0, np.repeat(origins, 3), np.repeat(table, 3, axis=0)
    return dataclasses.replace(amplitude, knots=knots, origins=origins, coefficients=table)
