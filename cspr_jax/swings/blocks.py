"""Blocks of a segment for a first look: cuts between the knots of the amplitude function."""

import itertools
import math

import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from cspr_jax.motions.amplitudes import Amplitude

# Intervals between the samples of one block.
INTERVALS = 16
# Rows and columns of the table are multiples of this, so that most calls have one shape.
STEP = 32


def blocks(amplitude: Amplitude, max_arcs: int, *, density: int = 1, least: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Edges of about density (p + 4) blocks for each number of arcs p, none across a knot.

    Args:
        max_arcs: largest number of arcs.
        density: 1 for a first look.
        least: smallest number of blocks.

    Returns:
        edges (n_rows, n_edges), n_rows > max_arcs, with row p for p arcs, padded with ones; and the
        number of blocks of each row (n_rows,).
    """
    pieces = list(itertools.pairwise([0.0, *np.asarray(amplitude.knots).tolist(), 1.0]))
    n_rows = _rounded(max_arcs + 1)
    rows = []
    for arcs in range(n_rows):
        n_blocks = max(density * (arcs + 4), least)
        cuts = [np.linspace(a, b, 1 + math.ceil(n_blocks * (b - a) - 1e-9))[:-1] for a, b in pieces]
        rows.append(np.concatenate([*cuts, [1.0]]))
    counts = np.array([len(row) - 1 for row in rows], np.int32)
    table = np.ones((n_rows, _rounded(int(counts.max()) + 1)))
    for row, target in zip(rows, table, strict=True):
        target[: len(row)] = row
    return table, counts


def _rounded(count: int) -> int:
    return -(-count // STEP) * STEP


def over_blocks(edges: Array, counts: Array, arcs: Array, first, step, *, together: int = 1):
    """Fold a function over the blocks of each segment.

    Args:
        edges: (n_rows, n_edges) as `blocks` gives them.
        counts: (n_rows,).
        arcs: (n,) number of arcs of each segment.
        first: state to start from.
        step: (state, start, stop) -> state, with start and stop (together, n). A segment with fewer blocks sees its
            last block again.
        together: how many blocks of each segment a step takes.

    Returns:
        the last state.
    """
    index = arcs.astype(jnp.int32)
    count, flat, row = counts[index], edges.reshape(-1), edges.shape[1] * index

    def body(i, state):
        later = together * i + jnp.arange(together, dtype=jnp.int32)[:, None]
        place = row[None] + jnp.minimum(later, count[None] - 1)
        return step(state, flat[place], flat[place + 1])

    return lax.fori_loop(0, (jnp.max(count) + (together - 1)) // together, body, first)
