"""Affine bounds of piecewise polynomials over blocks of their variable, each within a piece or over many of them.

Over a piece a polynomial lies within the hull of its Bernstein coefficients, and so does its deviation from a straight
line. A block that holds many pieces gets one line, and the largest deviation of any of them. A block within one piece
may get a parabola instead, from which deviations are smaller.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cspr_jax.numerics.bounds.affine_bounds import AffineBounds
from cspr_jax.numerics.shapes import Float
from cspr_jax.numerics.tolerances import ROUNDING


class PieceParts(NamedTuple):
    """Overlaps of k blocks and m pieces.

    Fields:
        block: (n_parts,) index of the block of each overlap, increasing.
        piece: (n_parts,) index of its piece.
        of_piece: (2, n_parts) its start and end within the piece, from 0 to 1.
        of_block: (2, n_parts) its start and end within the block, from -1 to 1.
        width: (n_parts,) width of the piece.
    """

    block: np.ndarray
    piece: np.ndarray
    of_piece: np.ndarray
    of_block: np.ndarray
    width: np.ndarray


def overlaps(
    knots: Float[np.ndarray, "m+1"],
    start: Float[np.ndarray, "k"],
    end: Float[np.ndarray, "k"],
    tables: tuple[np.ndarray, np.ndarray] | None = None,
) -> PieceParts:
    """Overlaps of blocks and pieces."""
    of_knots, of_blocks = (np.zeros(len(knots), int), np.zeros(len(start), int)) if tables is None else tables
    # Complex numbers sort by their real parts, the tables, and then by their imaginary parts, the knots.
    ordered = of_knots + 1j * knots
    earliest, latest = np.searchsorted(of_knots, of_blocks), np.searchsorted(of_knots, of_blocks, side="right") - 2
    first = np.clip(np.searchsorted(ordered, of_blocks + 1j * start, side="right") - 1, earliest, latest)
    last = np.maximum(np.clip(np.searchsorted(ordered, of_blocks + 1j * end) - 1, earliest, latest), first)
    counts = last - first + 1
    block = np.repeat(np.arange(len(start)), counts)
    knot = first[block] + np.arange(len(block)) - np.repeat(np.cumsum(counts) - counts, counts)
    low, high, width = np.maximum(knots[knot], start[block]), np.minimum(knots[knot + 1], end[block]), np.diff(knots)
    of_piece = (np.stack([low, high]) - knots[knot]) / width[knot]
    # A block whose start equals its end in floating point gets NaN, hence no bounds.
    with np.errstate(invalid="ignore"):
        of_block = 2.0 * (np.stack([low, high]) - start[block]) / (end - start)[block] - 1.0
    # Each table has one more knot than pieces.
    return PieceParts(block, knot - of_blocks[block], of_piece, of_block, width[knot])


def piecewise_bounds(
    table: Float[np.ndarray, "m degree+1 n"], parts: PieceParts, orders: int = 3, *, parabolas: bool = False
) -> list[AffineBounds]:
    """Bounds of a piecewise polynomial and of its derivatives."""
    if parabolas and (np.diff(parts.block) != 1).any():
        raise ValueError("parabolas are of blocks within one piece")
    coefficients, bounds = table[parts.piece], []
    for order in range(orders):
        degree = coefficients.shape[1] - 1
        between = _between(coefficients, *parts.of_piece)
        bounds.append(_parabola(between) if parabolas else _affine(between, parts))
        if order + 1 < orders:
            steps = degree / parts.width[:, None, None]
            coefficients = np.diff(coefficients, axis=1) * steps if degree else 0.0 * coefficients
    return bounds


def bernstein_of_powers(coefficients: Float[np.ndarray, "... degree+1 n"]) -> Float[np.ndarray, "... degree+1 n"]:
    """Bernstein coefficients of polynomials over [0, 1]."""
    degree = coefficients.shape[-2] - 1
    matrix = np.array([[math.comb(i, j) / math.comb(degree, j) for j in range(degree + 1)] for i in range(degree + 1)])
    return matrix @ coefficients


def _between(coefficients: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    # Bernstein coefficients over [low, high] instead of [0, 1], by the steps of de Casteljau.
    if not low.any() and (high == 1.0).all():
        return coefficients
    after = _split(coefficients, high[:, None, None])
    with np.errstate(divide="ignore", invalid="ignore"):
        fraction = np.where(high > 0.0, low / high, 0.0)[:, None, None]
    # In reverse order the part up to a fraction is the part from it on.
    return _split(after[:, ::-1], 1.0 - fraction)[:, ::-1]


def _split(coefficients: np.ndarray, fraction: np.ndarray) -> np.ndarray:
    # Bernstein coefficients over [0, fraction].
    remaining, ends = coefficients, [coefficients[:, :1]]
    while remaining.shape[1] > 1:
        remaining = remaining[:, :-1] + fraction * np.diff(remaining, axis=1)
        ends.append(remaining[:, :1])
    return np.concatenate(ends, axis=1)


def _affine(coefficients: np.ndarray, parts: PieceParts) -> AffineBounds:
    degree = coefficients.shape[1] - 1
    starts = np.flatnonzero(np.diff(parts.block, prepend=-1))
    ends = np.append(starts[1:], len(parts.block)) - 1
    first, last = coefficients[starts, 0], coefficients[ends, -1]
    middle, linear = 0.5 * (first + last), 0.5 * (last - first)
    fractions = np.linspace(0.0, 1.0, degree + 1) if degree else np.array([0.5])
    low, high = parts.of_block
    s = low[:, None] + (high - low)[:, None] * fractions
    rest = coefficients - middle[parts.block, None] - linear[parts.block, None] * s[..., None]
    top, bottom = (
        reduce.reduceat(getattr(rest, name)(axis=1), starts)
        for reduce, name in ((np.maximum, "max"), (np.minimum, "min"))
    )
    magnitude = np.maximum.reduceat(np.abs(coefficients).max(axis=1), starts)
    return AffineBounds(middle + 0.5 * (top + bottom), linear, 0.5 * (top - bottom) + 4.0 * ROUNDING * magnitude)


def _parabola(coefficients: np.ndarray) -> AffineBounds:
    # The parabola has the mean second difference of the coefficients, which are Bernstein coefficients over the block.
    # Move their axis to the front, along which sums are fast.
    control, degree = np.ascontiguousarray(np.moveaxis(coefficients, 1, 0)), coefficients.shape[1] - 1
    number, scale = np.arange(degree + 1)[:, None, None], max(degree * (degree - 1), 1)
    # Coefficients of s and of s^2 over [-1, 1].
    s = 2.0 * number / max(degree, 1) - 1.0
    squares = 4.0 * number * (number - 1) / scale - 2.0 * s - 1.0
    first, last = control[0], control[-1]
    square = np.zeros_like(first) if degree < 2 else scale / 8.0 * np.diff(control, 2, axis=0).mean(0)
    middle, linear = 0.5 * (first + last) - square, 0.5 * (last - first)
    rest = control - middle - linear * s - square * squares
    top, bottom = rest.max(axis=0), rest.min(axis=0)
    largest = np.abs(control).max(axis=0) + np.abs(square)
    return AffineBounds(middle + 0.5 * (top + bottom), linear, 0.5 * (top - bottom) + 4.0 * ROUNDING * largest, square)
