"""Blocks of a segment for a first pass; knots of the amplitude function are ends of blocks."""

from __future__ import annotations

import itertools
import math

import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from cspr_jax.motion.amplitudes import Amplitude
from cspr_jax.numerics.elementary import maximum_of
from cspr_jax.numerics.shapes import Float, Int, Num

# Number of intervals between the samples of one block.
INTERVALS = 16
# Rows and columns of the table are padded to multiples of this, so that most calls have one shape.
STEP = 32


def blocks(
    amplitude: Amplitude, max_arcs: int, *, density: int = 1, minimum: int = 1
) -> tuple[Num[np.ndarray, "n_rows n_edges"], Int[np.ndarray, "n_rows"]]:
    """Edges of about density (p + 4) blocks for each number of arcs p; no block contains a knot."""
    pieces = list(itertools.pairwise([0.0, *np.asarray(amplitude.knots).tolist(), 1.0]))
    n_rows = _rounded(max_arcs + 1)
    rows = []
    for arcs in range(n_rows):
        n_blocks = max(density * (arcs + 4), minimum)
        cuts = [np.linspace(a, b, 1 + math.ceil(n_blocks * (b - a) - 1e-9))[:-1] for a, b in pieces]
        rows.append(np.concatenate([*cuts, [1.0]]))
    counts = np.array([len(row) - 1 for row in rows], np.int32)
    table = np.ones((n_rows, _rounded(int(counts.max()) + 1)))
    for row, target in zip(rows, table, strict=True):
        target[: len(row)] = row
    return table, counts


def _rounded(count: int) -> int:
    return -(-count // STEP) * STEP


def over_blocks(
    edges: Float[Array, "n_rows n_edges"],
    counts: Int[Array, "n_rows"],
    arcs: Num[Array, "n"],
    first,
    step,
    *,
    together: int = 1,
):
    """Fold a function over the blocks of each segment."""
    index = arcs.astype(jnp.int32)
    count, flat, row = counts[index], edges.reshape(-1), edges.shape[1] * index

    def body(i, state):
        later = together * i + jnp.arange(together, dtype=jnp.int32)[:, None]
        at = row[None] + jnp.minimum(later, count[None] - 1)
        return step(state, flat[at], flat[at + 1])

    return lax.fori_loop(0, (maximum_of(count) + (together - 1)) // together, body, first)
