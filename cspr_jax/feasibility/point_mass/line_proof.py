"""Smallest margin of a motion along a straight line, with a proof: slacks are polynomials of tau between the knots.

In Bernstein's form the smallest coefficient over a block is a lower bound of the slack in it. Blocks whose bound lies
below what is attained elsewhere are halved until the two agree.
"""

import math
from typing import NamedTuple

import numpy as np

from cspr_jax.feasibility.point_mass.line_faces import LineFaces
from cspr_jax.trajectories.amplitudes import Amplitude

ROUNDS = 64
# Where bound and attained value agree, over gravity.
AGREED = 1e-12


class Proved(NamedTuple):
    """Smallest margin along one line.

    Fields:
        margin: a distance from the nearest face that is attained, m/s^2.
        bound: no instant has a smaller one, m/s^2.
        face: number of the nearest face.
    """

    margin: float
    bound: float
    face: int


def _bernstein(degree: int) -> np.ndarray:
    # From powers on [0, 1] to Bernstein coefficients.
    return np.array(
        [
            [math.comb(i, j) / math.comb(degree, j) if j <= i else 0.0 for j in range(degree + 1)]
            for i in range(degree + 1)
        ]
    )


def _about(table: np.ndarray, start: np.ndarray, width: np.ndarray) -> np.ndarray:
    # Powers of (x + start) * width ... : c_j x^j of polynomials (n, d + 1) over [start, start + width], x in [0, 1].
    degree = table.shape[1] - 1
    moved = np.zeros_like(table)
    for i in range(degree + 1):
        for j in range(i + 1):
            moved[:, j] += math.comb(i, j) * table[:, i] * start ** (i - j)
    return moved * width[:, None] ** np.arange(degree + 1)


class _Blocks(NamedTuple):
    face: np.ndarray
    piece: np.ndarray
    start: np.ndarray  # about the origin of the piece
    width: np.ndarray


def smallest_margin(faces: LineFaces, law: Amplitude, duration: float, gravity: float) -> Proved:
    """Smallest distance from the faces along one line.

    Args:
        faces: of the line, NumPy leaves without a leading dimension.
        law: s(tau), NumPy leaves.
        duration: s.
        gravity: m/s^2.

    Returns:
        what is attained and what is proved.
    """
    table, origins, knots = (np.asarray(x, float) for x in (law.coefficients, law.origins, law.knots))
    edges = np.concatenate([[0.0], knots, [1.0]])
    which = np.flatnonzero(faces.bounds)
    face, piece = (x.ravel() for x in np.meshgrid(which, np.arange(len(origins)), indexing="ij"))
    blocks = _Blocks(face, piece, edges[piece] - origins[piece], edges[piece + 1] - edges[piece])
    best, nearest, done = np.inf, int(which[0]), np.inf
    for _ in range(ROUNDS):
        low, ends = _of_blocks(faces, table, duration, blocks)
        if ends.min() < best:
            best, nearest = float(ends.min()), int(blocks.face[np.argmin(ends.min(1))])
        is_open = low < best - AGREED * gravity
        done = min(done, float(low[~is_open].min(initial=np.inf)))
        if not is_open.any():
            return Proved(best, done, nearest)
        halves = [x[is_open] for x in blocks]
        half = 0.5 * halves[3]
        blocks = _Blocks(
            *(
                np.concatenate(pair)
                for pair in zip(
                    (halves[0], halves[1], halves[2], half), (halves[0], halves[1], halves[2] + half, half), strict=True
                )
            )
        )
    low, _ = _of_blocks(faces, table, duration, blocks)
    return Proved(best, min(done, float(low.min())), nearest)


def _of_blocks(faces: LineFaces, table: np.ndarray, duration: float, blocks: _Blocks) -> tuple[np.ndarray, np.ndarray]:
    # Of each block a lower bound of the margin, (n,), and its values at both ends, (n, 2).
    s = _about(table[blocks.piece], blocks.start, blocks.width)
    degree = s.shape[1] - 1
    bend = np.zeros_like(s)
    powers = np.arange(2, degree + 1)
    bend[:, : degree - 1] = s[:, 2:] * powers * (powers - 1)
    bend /= (blocks.width * duration)[:, None] ** 2
    slack = faces.steepness[blocks.face, None] * bend - faces.slope[blocks.face, None] * s
    slack[:, 0] -= faces.offset[blocks.face]
    coefficients = slack @ _bernstein(degree).T
    places = np.stack([s[:, 0], s.sum(1)], axis=1)
    normal, turn = faces.normal[blocks.face], faces.turn[blocks.face]
    sizes = np.linalg.norm(normal[:, None] + turn[:, None] * places[..., None], axis=2)
    # The length of the normal is convex in s: largest at an end, smallest at its vertex.
    square = (turn**2).sum(1)
    vertex = -(normal * turn).sum(1) / np.where(square > 0.0, square, 1.0)
    at = np.clip(vertex, places.min(1), places.max(1))
    shortest = np.linalg.norm(normal + turn * at[:, None], axis=1)
    low = coefficients.min(1)
    return low / np.where(low > 0.0, sizes.max(1), shortest), coefficients[:, [0, -1]] / sizes
