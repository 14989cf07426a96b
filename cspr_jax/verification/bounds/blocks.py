"""Blocks of motions: parts of arcs, cut at the knots of the amplitude function, and halved while undecided."""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np

from cspr_jax.motion.amplitudes import Amplitude
from cspr_jax.numerics.shapes import Float, Num

# The rest of a piece between knots adds a block only if it is longer than this fraction of a block.
SLIVER = 0.3
SAMPLES = 1025  # number of tau at which the number of parts of an arc is tabulated


class Blocks(NamedTuple):
    """Blocks of motions.

    Fields:
        row: (k,) index of the motion to which the block belongs.
        start: (k,) tau at its start.
        stop: (k,) tau at its end; there is no knot inside.
    """

    row: np.ndarray
    start: np.ndarray
    stop: np.ndarray

    def part(self, rows: np.ndarray) -> "Blocks":
        """Blocks chosen by indices, or by a mask (k,)."""
        return Blocks(*(x[rows] for x in self))

    def times(self, positions: np.ndarray) -> Float[np.ndarray, "m k"]:
        """Times at given positions, from -1 to 1, in each block."""
        return 0.5 * (self.start + self.stop) + positions * (0.5 * (self.stop - self.start))

    def halves(self) -> "Blocks":
        """Both halves of each block, (2 k,)."""
        middle = 0.5 * (self.start + self.stop)
        return Blocks(
            np.repeat(self.row, 2),
            np.stack([self.start, middle], axis=1).ravel(),
            np.stack([middle, self.stop], axis=1).ravel(),
        )


class Parts(NamedTuple):
    """Number of parts into which an arc is cut, at equidistant tau from 0 to 1.

    Fields:
        at_cusps: (m,) the number where tau is at a cusp.
        at_middles: (m,) the number where tau is halfway between two cusps; in between it follows the squared sine of
            the phase.
    """

    at_cusps: np.ndarray
    at_middles: np.ndarray

    def of(self, arcs: int) -> Float[np.ndarray, "m"]:
        """Number of parts of an arc, along a motion with a number of arcs."""
        fraction = np.sin(math.pi * arcs * np.linspace(0.0, 1.0, len(self.at_cusps))) ** 2
        return self.at_cusps + (self.at_middles - self.at_cusps) * fraction


def growing(amplitude: Amplitude, at_cusps: tuple[float, float], at_middles: tuple[float, float]) -> Parts:
    """Number of parts of an arc along a motion from rest, which increases with the amplitude."""
    tau = np.linspace(0.0, 1.0, SAMPLES)
    piece = np.searchsorted(np.asarray(amplitude.knots), tau)
    coefficients, origins = np.asarray(amplitude.coefficients)[piece], np.asarray(amplitude.origins)[piece]
    values = np.polynomial.polynomial.polyval(tau - origins, coefficients.T, tensor=False)
    return Parts(*(np.interp(values, (0.0, 1.0), ramp) for ramp in (at_cusps, at_middles)))


def parts_of_arcs(arcs: Num[np.ndarray, "n"], knots: Float[np.ndarray, "n_knots"], parts: float | Parts) -> Blocks:
    """Cut all arcs of motions into blocks."""
    numbers, group = np.unique(arcs, return_inverse=True)
    edges = [_edges(int(p), [0.0, *knots.tolist(), 1.0], parts) for p in numbers]
    lengths = np.array([len(x) for x in edges], int)
    # All edges are in one array: find where the edges of each motion begin, and the edge at which each block starts.
    begins, counts = (np.cumsum(lengths) - lengths)[group], (lengths - 1)[group]
    row = np.repeat(np.arange(len(arcs)), counts)
    first = np.arange(len(row)) + np.repeat(begins - (np.cumsum(counts) - counts), counts)
    all_edges = np.concatenate([np.zeros(0), *edges])
    return Blocks(row, all_edges[first], all_edges[first + 1])


def _edges(arcs: int, knots: list[float], parts: float | Parts) -> np.ndarray:
    # Edges of the blocks of a motion; its two ends are among the knots.
    each = parts.of(arcs) if isinstance(parts, Parts) else np.full(2, float(parts))
    tau = np.linspace(0.0, 1.0, len(each))
    # Number of parts before each tau.
    before = arcs * np.append(0.0, np.cumsum(0.5 * (each[1:] + each[:-1]) * np.diff(tau)))
    inside = []
    for start, stop in itertools.pairwise(knots):
        first, last = np.interp([start, stop], tau, before)
        # Divide each piece into equal blocks, so that no short one is left beside a knot.
        count = max(1, math.ceil(last - first - SLIVER))
        if isinstance(parts, Parts):
            edges = np.interp(np.linspace(first, last, count + 1), before, tau)
        else:
            edges = np.linspace(start, stop, count + 1)
        inside += [[start], edges[1:-1]]
    return np.concatenate([*inside, [1.0]])
