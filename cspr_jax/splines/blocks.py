"""Affine bounds of a spline over blocks of time, each within a piece or over many of them.

Over a piece a polynomial lies within the hull of its Bernstein coefficients, so does what is left of it beside a
straight line. A block that holds many pieces gets one line, and the widest band that any of them needs.
"""

from typing import NamedTuple

import jax
import numpy as np

from cspr_jax.arithmetic.affine_bounds import ROUNDING, AffineBounds
from cspr_jax.arithmetic.batches import in_batches
from cspr_jax.arithmetic.rotation_bounds import rotation_bounds
from cspr_jax.robots.state_bounds import StateBounds

BATCH = 256


class _Parts(NamedTuple):
    # Overlaps of blocks and pieces: numbers of both, the piece's width, s, and where they lie in the piece (0 to 1) and
    # the block (-1 to 1).
    block: np.ndarray
    piece: np.ndarray
    width: np.ndarray
    of_piece: np.ndarray
    of_block: np.ndarray


def spline_bounds(
    knots: np.ndarray,
    position: np.ndarray,
    quaternion: np.ndarray | None,
    start: np.ndarray,
    end: np.ndarray,
    *,
    of_knots: np.ndarray | None = None,
    of_blocks: np.ndarray | None = None,
) -> StateBounds:
    """Bounds of the states over blocks of time, of one motion or of several, whose tables follow each other.

    Args:
        knots: (m + 1,) s, or (m + n,) those of n motions.
        position: (m, degree + 1, 3) Bernstein coefficients, m.
        quaternion: (m, degree + 1, 4) likewise; None for a point mass.
        start: (k,) s, increasing or not.
        end: (k,) s, later than `start`.
        of_knots: (m + n,) numbers of the motions, from 0 on; None: there is one.
        of_blocks: (k,) likewise.

    Returns:
        the bounds, leaves (k, ...).
    """
    of_knots = np.zeros(len(knots), int) if of_knots is None else of_knots
    parts = _overlaps(knots, of_knots, np.zeros(len(start), int) if of_blocks is None else of_blocks, start, end)
    width = parts.width[:, None, None]
    translation = _bands(position, parts, width)
    if quaternion is None:
        return StateBounds(*translation)
    turning = _bands(quaternion, parts, width)
    return StateBounds(*translation, *in_batches(_rotations, turning, size=BATCH))


@jax.jit
def _rotations(bands):
    return jax.vmap(rotation_bounds)(*bands)


def _overlaps(
    knots: np.ndarray, of_knots: np.ndarray, motion: np.ndarray, start: np.ndarray, end: np.ndarray
) -> _Parts:
    # NumPy orders complex numbers by their real parts first.
    places = of_knots + 1j * knots
    earliest, latest = np.searchsorted(of_knots, motion), np.searchsorted(of_knots, motion, side="right") - 2
    first = np.clip(np.searchsorted(places, motion + 1j * start, side="right") - 1, earliest, latest)
    last = np.maximum(np.clip(np.searchsorted(places, motion + 1j * end) - 1, earliest, latest), first)
    counts = last - first + 1
    block = np.repeat(np.arange(len(start)), counts)
    knot = first[block] + np.arange(len(block)) - np.repeat(np.cumsum(counts) - counts, counts)
    low, high, width = np.maximum(knots[knot], start[block]), np.minimum(knots[knot + 1], end[block]), np.diff(knots)
    of_piece = (np.stack([low, high]) - knots[knot]) / width[knot]
    of_block = 2.0 * (np.stack([low, high]) - start[block]) / (end - start)[block] - 1.0
    # Each motion has one knot more than pieces.
    return _Parts(block, knot - motion[block], width[knot], of_piece, of_block)


def _bands(table: np.ndarray, parts: _Parts, width: np.ndarray) -> list[AffineBounds]:
    # Bands of value, first and second derivative of Bernstein coefficients (m, degree + 1, n).
    coefficients, bands = table[parts.piece], []
    for order in range(3):
        degree = coefficients.shape[1] - 1
        bands.append(_band(_between(coefficients, *parts.of_piece), parts))
        if order < 2:
            coefficients = np.diff(coefficients, axis=1) * (degree / width) if degree else 0.0 * coefficients
    return bands


def _between(coefficients: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    # Bernstein coefficients over [low, high] instead of [0, 1], by the steps of de Casteljau.
    after = _split(coefficients, high[:, None, None])
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(high > 0.0, low / high, 0.0)[:, None, None]
    # Reversed, the part up to an instant is the part from there on.
    return _split(after[:, ::-1], 1.0 - share)[:, ::-1]


def _split(coefficients: np.ndarray, share: np.ndarray) -> np.ndarray:
    # Bernstein coefficients over [0, share].
    rows, ends = coefficients, [coefficients[:, :1]]
    while rows.shape[1] > 1:
        rows = rows[:, :-1] + share * np.diff(rows, axis=1)
        ends.append(rows[:, :1])
    return np.concatenate(ends, axis=1)


def _band(coefficients: np.ndarray, parts: _Parts) -> AffineBounds:
    degree = coefficients.shape[1] - 1
    starts = np.flatnonzero(np.diff(parts.block, prepend=-1))
    ends = np.append(starts[1:], len(parts.block)) - 1
    first, last = coefficients[starts, 0], coefficients[ends, -1]
    middle, slope = 0.5 * (first + last), 0.5 * (last - first)
    shares = np.linspace(0.0, 1.0, degree + 1) if degree else np.array([0.5])
    low, high = parts.of_block
    places = low[:, None] + (high - low)[:, None] * shares
    rest = coefficients - middle[parts.block, None] - slope[parts.block, None] * places[..., None]
    top, bottom = (
        reduce.reduceat(getattr(rest, name)(axis=1), starts)
        for reduce, name in ((np.maximum, "max"), (np.minimum, "min"))
    )
    size = np.maximum.reduceat(np.abs(coefficients).max(axis=1), starts)
    return AffineBounds(middle + 0.5 * (top + bottom), slope, 0.5 * (top - bottom) + 4.0 * ROUNDING * size)
