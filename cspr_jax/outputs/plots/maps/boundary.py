"""Boundary of the points of a grid that are inside: a surface of triangles in space, lines in a plane."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cspr_jax.numerics.shapes import Float
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.store.reading.result import Result

# Margins of conditions of a workspace: a pose is outside where one of them is not positive.
MARGINS = ("wrench_margin", "closure_margin", "clearance", "floor_margin", "length_margin", "speed_margin")
# Margins that files of earlier versions lack, with the flags that report their conditions there.
LATER = {"floor_margin": Verdict.BELOW_FLOOR, "length_margin": Verdict.CABLE_TOO_LONG}
WITHOUT_MARGIN = (Verdict.BELOW_FLOOR | Verdict.CABLE_TOO_LONG).value
# Smallest distance of the boundary from points of the grid, as a fraction of the distance of neighbours.
OFF = 1e-6
# Cuts of a simplex, by its numbers of corners inside and outside: each piece joins edges, named by their corners inside
# (first) and outside (second). In a simplex that is right-handed in this order, triangles face the outside.
CUTS: dict[tuple[int, int], list[list[tuple[int, int]]]] = {
    (1, 2): [[(0, 0), (0, 1)]],
    (2, 1): [[(0, 0), (1, 0)]],
    (1, 3): [[(0, 0), (0, 1), (0, 2)]],
    (3, 1): [[(0, 0), (1, 0), (2, 0)]],
    (2, 2): [[(0, 0), (0, 1), (1, 1)], [(0, 0), (1, 1), (1, 0)]],
}


class BoundarySides(NamedTuple):
    """Points of a grid, and the side of the boundary on which each lies.

    Fields:
        points: points of each of the d axes, increasing.
        verdict: (n_1, ..., n_d) flags; 0: inside.
        margins: arrays (n_1, ..., n_d), positive inside; NaN where not requested.
        unmeasured: flags of the conditions for which there is no margin.
    """

    points: list[np.ndarray]
    verdict: np.ndarray
    margins: list[np.ndarray]
    unmeasured: int = WITHOUT_MARGIN


class Boundary(NamedTuple):
    """A closed boundary, which follows the end of the grid where points there are inside.

    Fields:
        corners: (n, d) corners between two neighbours on different sides, or at the end of the grid.
        pieces: (m, d) indices of the corners of lines, or of triangles, anticlockwise as seen from outside.
        is_end: (m,) whether a piece lies at the end of the grid, beyond which nothing is known.
    """

    corners: np.ndarray
    pieces: np.ndarray
    is_end: np.ndarray


def sides_of(result: Result, axes: list[str], index: dict[str, int]) -> BoundarySides:
    """Points of a map of a workspace, and their sides."""
    # The points of an axis may be in any order, and repeated.
    orders = [np.unique(result.axes[axis], return_index=True)[1] for axis in axes]

    def part(name: str) -> np.ndarray:
        data = result.data[name][tuple(index.get(axis, 0) if axis not in axes else slice(None) for axis in result.axes)]
        varying = [axis for axis in result.axes if axis in axes]
        return data.transpose([varying.index(axis) for axis in axes])[np.ix_(*orders)]

    points = [result.axes[axis][order] for axis, order in zip(axes, orders, strict=True)]
    margins = [part(name).astype(float) for name in MARGINS if name in result.data]
    unmeasured = sum(flag.value for name, flag in LATER.items() if name not in result.data)
    return BoundarySides(points, part("verdict"), margins, unmeasured)


def boundary(sides: BoundarySides) -> Boundary:
    """The boundary of the inside, by marching simplices: six tetrahedra, or two triangles, for each cell.

    It crosses exactly those edges of the grid, and diagonals of these simplices, that join a point inside and one
    outside, so that it separates the points as their verdicts do. Where margins decide, it crosses where the first of
    them is zero by linear interpolation; elsewhere half-way.
    """
    # Surround the grid with a layer of zero thickness that is outside.
    is_in = np.pad(sides.verdict == 0, 1)
    number = np.pad(np.arange(sides.verdict.size).reshape(sides.verdict.shape), 1, constant_values=-1).reshape(-1)
    edges = np.concatenate([_cut(is_in.reshape(-1), corners, sign) for corners, sign in _simplices(is_in)])
    inner, outer = number[edges[..., 0]], number[edges[..., 1]]
    pairs, pieces = np.unique(np.stack([inner, outer], -1).reshape(-1, 2), axis=0, return_inverse=True)
    pieces = pieces.reshape(inner.shape)
    # Remove pieces in the layer of zero thickness that have the same corner twice.
    full = (np.diff(np.sort(pieces, axis=1), axis=1) > 0).all(1)
    return Boundary(_crossings(sides, pairs), pieces[full], (outer < 0).any(1)[full])


def _simplices(is_in: np.ndarray) -> list[tuple[np.ndarray, int]]:
    # Divide each cell that is cut into d! simplices, along paths from its first corner to its last, one axis after the
    # other: (n, d + 1) indices in the flat grid, and 1 for right-handed ones, -1 for others.
    count = is_in.ndim
    lower = np.arange(is_in.size).reshape(is_in.shape)[(slice(-1),) * count].reshape(-1)
    steps = np.array([int(np.prod(is_in.shape[k + 1 :])) for k in range(count)])
    offsets = np.array(list(itertools.product((0, 1), repeat=count))) @ steps
    sure = np.stack([is_in.reshape(-1)[lower + step] for step in offsets])
    lower = lower[sure.any(0) & ~sure.all(0)]
    orders = list(itertools.permutations(range(count)))
    paths = [np.concatenate([[0], np.cumsum(steps[list(order)])]) for order in orders]
    return [(lower[:, None] + path, _hand(order)) for path, order in zip(paths, orders, strict=True)]


def _hand(order: Sequence[int]) -> int:
    # The sign of a permutation: 1 if it is even, else -1.
    return 1 if sum(a > b for a, b in itertools.combinations(order, 2)) % 2 == 0 else -1


def _cut(is_in: np.ndarray, simplices: np.ndarray, hand: int) -> np.ndarray:
    # For each corner of a piece, the points inside and outside between which it lies, (n_pieces, d, 2).
    count, sides = simplices.shape[1], is_in[simplices]
    pieces = [np.empty((0, count - 1, 2), int)]
    for pattern in itertools.product((True, False), repeat=count):
        inner, outer = ([k for k in range(count) if pattern[k] is side] for side in (True, False))
        matching = simplices[(sides == pattern).all(1)]
        for piece in CUTS.get((len(inner), len(outer)), []):
            oriented = piece if hand * _hand([*inner, *outer]) > 0 else piece[::-1]
            ends = np.array([[inner[i], outer[j]] for i, j in oriented])
            pieces.append(matching[:, ends])
    return np.concatenate(pieces)


def _crossings(sides: BoundarySides, pairs: np.ndarray) -> np.ndarray:
    # Crossings (n, d) between (n, 2) points, of which the first is inside; the second is -1 beyond the end of the grid,
    # where the crossing is at the first.
    inner, outer = pairs[:, 0], np.where(pairs[:, 1] < 0, pairs[:, 0], pairs[:, 1])
    part = np.where(sides.verdict.reshape(-1)[outer] & sides.unmeasured, 0.5, np.inf)
    for margin in sides.margins:
        near, far = margin.reshape(-1)[inner], margin.reshape(-1)[outer]
        with np.errstate(all="ignore"):
            tells = np.isfinite(near) & np.isfinite(far) & (near > 0.0) & (far <= 0.0)
            part = np.where(tells, np.minimum(part, near / (near - far)), part)
    part = np.clip(np.where(np.isfinite(part), part, 0.5), OFF, 1.0 - OFF)
    grid = np.stack([x.reshape(-1) for x in np.meshgrid(*sides.points, indexing="ij")], axis=1)
    return grid[inner] + part[:, None] * (grid[outer] - grid[inner])


def step_of(sides: BoundarySides) -> Float[np.ndarray, "n 3 2"]:
    """Triangles of a plane in which the boundary may lie: those between neighbours on different sides."""
    is_in = sides.verdict == 0
    grid = np.stack([x.reshape(-1) for x in np.meshgrid(*sides.points, indexing="ij")], axis=1)
    corners = np.concatenate([simplices for simplices, _ in _simplices(is_in)])
    inside = is_in.reshape(-1)[corners]
    return grid[corners[inside.any(1) & ~inside.all(1)]]


def outlines(sides: BoundarySides) -> list[tuple[np.ndarray, bool]]:
    """The boundary in a plane as lines, and whether each is closed."""
    surface = boundary(sides)
    lines = []
    for is_end in (True, False):
        for chain in _chains(surface.pieces[surface.is_end == is_end]):
            corners = surface.corners[chain]
            # Leave out corners on diagonals, whose position is arbitrary: corners on the sides of the cell suffice.
            on_edge = np.isin(corners[:, 0], sides.points[0]) | np.isin(corners[:, 1], sides.points[1])
            if not on_edge[0]:  # a closed line that starts on one
                corners, on_edge = np.roll(corners[:-1], -1, axis=0), np.roll(on_edge[:-1], -1)
                corners, on_edge = np.append(corners, corners[:1], axis=0), np.append(on_edge, on_edge[:1])
            lines.append((corners[on_edge], is_end))
    return lines


def _chains(lines: np.ndarray) -> list[np.ndarray]:
    # Corners, in order, of chains of pieces, of which at most two meet in a corner.
    ends: dict[int, list[int]] = {}
    for a, b in lines.tolist():
        ends.setdefault(a, []).append(b)
        ends.setdefault(b, []).append(a)
    chains = []
    for start in sorted(ends, key=lambda corner: (len(ends[corner]) != 1, corner)):
        while ends[start]:
            chain = [start]
            while ends[chain[-1]]:
                following = ends[chain[-1]].pop()
                ends[following].remove(chain[-1])
                chain.append(following)
            chains.append(np.array(chain))
    return chains
