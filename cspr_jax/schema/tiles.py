"""Tiles of a grid: blocks of equal shape that are computed one at a time."""

import dataclasses
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

LARGEST_TILE = 65536


class CellCost(NamedTuple):
    """Time that a cell of a kind of map takes on one core, measured once to within a factor of three.

    Fields:
        seconds: time without limits, and with 30 arcs, s.
        orientation: additional time for each orientation at a position, s.
        limits: factor on the costs of limits in `sweep.tile_sizes`.
        uncertainty: factor on the cost of an uncertainty there.
    """

    seconds: float = 1e-5
    orientation: float = 0.0
    limits: float = 1.0
    uncertainty: float = 1.0


ORDINARY_COST = CellCost()


def tile_shape(shape: tuple[int, ...], maximum: int = LARGEST_TILE) -> tuple[int, ...]:
    """Shape of the tiles of a grid: as many full trailing axes as fit, and equal parts of the next axis."""
    tile, capacity = [], maximum
    for length in reversed(shape):
        parts = -(-length // max(capacity, 1))
        tile.append(-(-length // parts))
        capacity //= tile[-1]
    return tuple(reversed(tile))


@dataclasses.dataclass(frozen=True)
class Tiling:
    """Tiles that cover a grid, in order, with the last axis fastest; tiles at the border may be smaller.

    Fields:
        shape: shape of the grid.
        tile: shape of a tile.
    """

    shape: tuple[int, ...]
    tile: tuple[int, ...]

    @property
    def counts(self) -> tuple[int, ...]:
        """Number of tiles along each axis."""
        return tuple(-(-n // t) for n, t in zip(self.shape, self.tile, strict=True))

    def __len__(self) -> int:
        return math.prod(self.counts)

    def __iter__(self) -> Iterator[tuple[slice, ...]]:
        return (self.slices(index) for index in range(len(self)))

    def slices(self, index: int) -> tuple[slice, ...]:
        """Slices of a tile, one for each axis."""
        corner = [int(i) * t for i, t in zip(np.unravel_index(index, self.counts), self.tile, strict=True)]
        return tuple(slice(a, min(a + t, n)) for a, t, n in zip(corner, self.tile, self.shape, strict=True))

    def extent(self, index: int) -> tuple[int, ...]:
        """Shape of one tile."""
        return tuple(part.stop - part.start for part in self.slices(index))


@dataclasses.dataclass(frozen=True)
class Grid:
    """The product of named axes.

    Fields:
        axes: coordinates of each axis, in the order of the dimensions.
        tile: shape of a tile.
    """

    axes: dict[str, np.ndarray]
    tile: tuple[int, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of points on each axis."""
        return tuple(len(points) for points in self.axes.values())

    @property
    def n_cells(self) -> int:
        """Number of cells."""
        return math.prod(self.shape)

    @property
    def tiling(self) -> Tiling:
        """Tiles of the grid."""
        return Tiling(self.shape, self.tile)

    def cells(self, slices: tuple[slice, ...]) -> dict[str, np.ndarray]:
        """Coordinates of the cells of a tile."""
        points = [axis[part] for axis, part in zip(self.axes.values(), slices, strict=True)]
        return {name: mesh.ravel() for name, mesh in zip(self.axes, np.meshgrid(*points, indexing="ij"), strict=True)}
