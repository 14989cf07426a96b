"""Smallest slacks of motions along straight lines, with a proof.

Between knots a law of time is a polynomial, and slacks are smooth functions of it, but for tensions of which one or the
other is the least: one of them, kept over a block, bounds the slack from below. Of each block the ends are looked at,
and a bound of the second derivative by interval arithmetic says how far below their chord a slack can lie. Blocks whose
bound lies below what is attained elsewhere are halved until the two agree.
"""

import math
from typing import NamedTuple

import jax
import numpy as np

from cspr_jax.arithmetic.interval_jets import Interval, Jet, lowest
from cspr_jax.feasibility.point_mass.line_slacks import Instants, LineSlacks, slacks, tensions_at, tensions_over
from cspr_jax.trajectories.amplitudes import Amplitude

ROUNDS = 64
# Where bound and attained value agree: of distances over gravity, of others as they are.
AGREED = 1e-12
# Numbers that are looked at together, blocks by faces by cables, and blocks after which halving ends: what is proved by
# then is the answer.
TOGETHER, MOST = 1 << 20, 2_000_000


class Proved(NamedTuple):
    """Smallest slacks of n motions, by group.

    Fields:
        attained: (n, n_groups) a value that is attained.
        bound: (n, n_groups) no instant has a smaller one.
    """

    attained: np.ndarray
    bound: np.ndarray


class _Blocks(NamedTuple):
    line: np.ndarray
    piece: np.ndarray
    start: np.ndarray  # about the origin of the piece
    width: np.ndarray


def smallest_slacks(
    lines: LineSlacks, laws: Amplitude, durations: np.ndarray, gravity: float, *, enough: float = math.inf
) -> Proved:
    """Smallest slacks along lines.

    Args:
        lines: NumPy leaves with a leading dimension n.
        laws: s(tau), likewise.
        durations: (n,) s.
        gravity: m/s^2.
        enough: bounds above this one, of distances over gravity, need not be sharp.

    Returns:
        by `LineSlacks.names`; those of faces in m/s^2, of speeds 1 - (rate / limit)^2.
    """
    scales = np.array([gravity if name in lines.low else 1.0 for name in lines.names])
    blocks = _first(laws)
    best = np.full((len(durations), len(scales)), np.inf)
    done, seen = best.copy(), 0
    for _ in range(ROUNDS):
        low, attained = _of_blocks(lines, laws, durations, blocks)
        np.minimum.at(best, blocks.line, attained)
        sharp = (low >= best[blocks.line] - AGREED * scales) | (low > enough * scales)
        is_open, seen = ~sharp.all(1), seen + len(low)
        is_open &= seen < MOST
        np.minimum.at(done, blocks.line[~is_open], low[~is_open])
        if not is_open.any():
            return Proved(best, done)
        blocks = _halved(_Blocks(*(x[is_open] for x in blocks)))
    low, _ = _of_blocks(lines, laws, durations, blocks)
    np.minimum.at(done, blocks.line, low)
    return Proved(best, done)


def _first(laws: Amplitude) -> _Blocks:
    # One block a piece.
    count, pieces = laws.origins.shape
    ends = np.zeros((count, 1)), np.asarray(laws.knots, float), np.ones((count, 1))
    edges = np.concatenate(ends, axis=1)
    line, piece = (x.ravel() for x in np.meshgrid(np.arange(count), np.arange(pieces), indexing="ij"))
    return _Blocks(line, piece, (edges[:, :-1] - laws.origins).ravel(), np.diff(edges).ravel())


def _halved(blocks: _Blocks) -> _Blocks:
    half = 0.5 * blocks.width
    left = (blocks.line, blocks.piece, blocks.start, half)
    right = (blocks.line, blocks.piece, blocks.start + half, half)
    return _Blocks(*(np.concatenate(pair) for pair in zip(left, right, strict=True)))


def _of_blocks(
    lines: LineSlacks, laws: Amplitude, durations: np.ndarray, blocks: _Blocks
) -> tuple[np.ndarray, np.ndarray]:
    # Of each block a lower bound of each group, and the smaller one of its values at both ends, (n, n_groups) each.
    parts, size = [], max(TOGETHER // max(lines.along[0].size, 1), 1)
    for i in range(0, len(blocks.line), size):
        part = _Blocks(*(x[i : i + size] for x in blocks))
        own = jax.tree.map(lambda x, part=part: x[part.line], lines)
        s = _about(np.asarray(laws.coefficients)[part.line, part.piece], part.start, part.width)
        per_time = (1.0 / (part.width * durations[part.line]))[:, None]
        ends = [_at_end(s, end, per_time) for end in (0, 1)]
        over = _over(s, per_time)
        found = [_of_group(own, name, ends, over) for name in lines.names]
        parts.append([np.stack(x, axis=1) for x in zip(*found, strict=True)])
    low, attained = (np.concatenate(x) for x in zip(*parts, strict=True))
    return low, attained


def _of_group(line: LineSlacks, name: str, ends: list[Instants], over: Instants) -> tuple[np.ndarray, np.ndarray]:
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        if name not in line.low:
            values = np.stack([slacks(line, name, end) for end in ends])
            return lowest(values, slacks(line, name, over)).min(1), values.min((0, 2))
        values = np.stack([slacks(line, name, end, tensions_at(line, name, end.s)) for end in ends])
        tensions, beyond = tensions_over(line, name, ends[0].s, ends[1].s)
        chosen = tensions if tensions.any() else None
        kept = np.stack([slacks(line, name, end, chosen) for end in ends])
        low = lowest(kept, slacks(line, name, over, chosen))
    return np.where(beyond, np.inf, low).min(1), values.min((0, 2))


def _about(table: np.ndarray, start: np.ndarray, width: np.ndarray) -> np.ndarray:
    # Powers of x in [0, 1] of polynomials (n, d + 1) over [start, start + width].
    degree = table.shape[1] - 1
    moved = np.zeros_like(table)
    for i in range(degree + 1):
        for j in range(i + 1):
            moved[:, j] += math.comb(i, j) * table[:, i] * start ** (i - j)
    return moved * width[:, None] ** np.arange(degree + 1)


def _derivatives(s: np.ndarray, order: int) -> list[np.ndarray]:
    # Powers of x of s and of its derivatives with respect to x.
    found = [s]
    for _ in range(order):
        last = found[-1]
        found.append(last[:, 1:] * np.arange(1, last.shape[1]) if last.shape[1] > 1 else np.zeros_like(last))
    return found


def _at_end(s: np.ndarray, end: int, per_time: np.ndarray) -> Instants:
    values = [(x.sum(1) if end else x[:, 0])[:, None] for x in _derivatives(s, 2)]
    return Instants(values[0], (values[1] * per_time) ** 2, values[2] * per_time**2)


def _over(s: np.ndarray, per_time: np.ndarray) -> Instants:
    ranges = [_range(x) for x in _derivatives(s, 4)]
    speed = Jet(*ranges[1:4]) ** 2 * per_time**2
    return Instants(Jet(*ranges[:3]), speed, Jet(*ranges[2:]) * per_time**2)


def _range(powers: np.ndarray) -> Interval:
    # Of polynomials over [0, 1], by their Bernstein coefficients.
    degree = powers.shape[1] - 1
    weights = np.array(
        [
            [math.comb(i, j) / math.comb(degree, j) if j <= i else 0.0 for j in range(degree + 1)]
            for i in range(degree + 1)
        ]
    )
    coefficients = powers @ weights.T
    return coefficients.min(1)[:, None], coefficients.max(1)[:, None]
