"""Blocks of motions: parts of arcs, cut at the knots of the amplitude function, and halved where open."""

import itertools
import math
from typing import NamedTuple

import numpy as np

from cspr_jax.trajectories.amplitudes import Amplitude

# Of a part more that a piece between knots gets as little as this is not worth a block.
SLIVER = 0.3
INSTANTS = 257  # at which parts along a motion are told


class Blocks(NamedTuple):
    """Blocks of motions.

    Fields:
        row: (k,) whose block it is.
        start: (k,) tau where it starts.
        stop: (k,) tau where it stops; no knot inside.
    """

    row: np.ndarray
    start: np.ndarray
    stop: np.ndarray

    def some(self, which: np.ndarray) -> "Blocks":
        """Blocks chosen by indices, or by a mask (k,)."""
        return Blocks(*(x[which] for x in self))

    def instants(self, places: np.ndarray) -> np.ndarray:
        """Instants at the same places of each block.

        Args:
            places: (m, 1), or (m, k) of each block's own, from -1 at its start to 1 at its stop.

        Returns:
            (m, k) tau.
        """
        return 0.5 * (self.start + self.stop) + places * (0.5 * (self.stop - self.start))

    def halves(self) -> "Blocks":
        """Both halves of each block, (2 k,)."""
        middle = 0.5 * (self.start + self.stop)
        return Blocks(
            np.repeat(self.row, 2),
            np.stack([self.start, middle], axis=1).ravel(),
            np.stack([middle, self.stop], axis=1).ravel(),
        )


def growing(amplitude: Amplitude, ramp: tuple[tuple[float, float], tuple[float, float]]) -> np.ndarray:
    """Parts of an arc along a motion from rest, more of them where it swings farther.

    Args:
        amplitude: A.
        ramp: values of A, and how many parts an arc has there; in between linear, beyond as at the nearer one.

    Returns:
        (m,) as `parts_of_arcs` takes them.
    """
    tau = np.linspace(0.0, 1.0, INSTANTS)
    piece = np.searchsorted(np.asarray(amplitude.knots), tau)
    coefficients, origins = np.asarray(amplitude.coefficients)[piece], np.asarray(amplitude.origins)[piece]
    values = np.polynomial.polynomial.polyval(tau - origins, coefficients.T, tensor=False)
    return np.interp(values, *ramp)


def parts_of_arcs(arcs: np.ndarray, knots: np.ndarray, parts: float | np.ndarray) -> Blocks:
    """Parts of all arcs of motions.

    Args:
        arcs: (n,) number of arcs of each motion, 1 or more.
        knots: of the amplitude function, inside ]0, 1[.
        parts: how many an arc, or nearly; or (m,) how many at instants tau from 0 to 1, equally far apart.

    Returns:
        the blocks, those of a motion side by side, in time.
    """
    pieces = list(itertools.pairwise([0.0, *knots.tolist(), 1.0]))
    each = np.broadcast_to(np.asarray(parts, float), max(np.size(parts), 2))
    tau = np.linspace(0.0, 1.0, len(each))
    # How many of an arc's parts lie before an instant, if the motion has one arc alone.
    before = np.append(0.0, np.cumsum(0.5 * (each[1:] + each[:-1]) * np.diff(tau)))

    def edges_of(p: int) -> np.ndarray:
        inside = []
        for start, stop in pieces:
            first, last = np.interp([start, stop], tau, before)
            # Equal within each piece, so that no sliver is left beside a knot.
            count = max(1, math.ceil(p * (last - first) - SLIVER))
            if np.ndim(parts) == 0:
                edges = np.linspace(start, stop, count + 1)
            else:
                edges = np.interp(np.linspace(first, last, count + 1), before, tau)
            inside += [[start], edges[1:-1]]
        return np.concatenate([*inside, [1.0]])

    edges = {p: edges_of(p) for p in np.unique(arcs).tolist()}
    own = [edges[int(p)] for p in arcs]
    row = np.repeat(np.arange(len(arcs)), [len(x) - 1 for x in own])
    nothing = np.zeros(0)
    start, stop = (np.concatenate([nothing, *(x[part] for x in own)]) for part in (slice(-1), slice(1, None)))
    return Blocks(row, start, stop)
