"""Tiles of a grid: blocks of one shape, computed one at a time."""

import dataclasses
import itertools
import math
from collections.abc import Iterator

import numpy as np

LARGEST_TILE = 65536


def tile_shape(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Shape of the tiles of a grid: whole trailing axes as long as they fit.

    Args:
        shape: of the grid.

    Returns:
        a shape with at most 65,536 cells.
    """
    tile, room = [], LARGEST_TILE
    for length in reversed(shape):
        tile.append(max(1, min(length, room)))
        room //= tile[-1]
    return tuple(reversed(tile))


def tile_places(shape: tuple[int, ...], tile: tuple[int, ...]) -> Iterator[tuple[slice, ...]]:
    """Where each tile of a grid lies; those at the border may be smaller.

    Args:
        shape: of the grid.
        tile: shape of a tile.

    Yields:
        one slice an axis.
    """
    starts = [range(0, n, step) for n, step in zip(shape, tile, strict=True)]
    for corner in itertools.product(*starts):
        yield tuple(slice(a, min(a + t, n)) for a, t, n in zip(corner, tile, shape, strict=True))


def place_shape(place: tuple[slice, ...]) -> tuple[int, ...]:
    """Shape of a tile.

    Args:
        place: where it lies.

    Returns:
        the shape.
    """
    return tuple(part.stop - part.start for part in place)


@dataclasses.dataclass(frozen=True)
class Grid:
    """The product of named axes.

    Fields:
        axes: coordinates, in the order of the dimensions.
        tile: shape of a tile.
    """

    axes: dict[str, np.ndarray]
    tile: tuple[int, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of points on each axis."""
        return tuple(len(points) for points in self.axes.values())

    @property
    def size(self) -> int:
        """Number of cells."""
        return math.prod(self.shape)

    def places(self) -> Iterator[tuple[slice, ...]]:
        """Where each tile lies; see `tile_places`.

        Returns:
            one slice an axis, of each tile.
        """
        return tile_places(self.shape, self.tile)

    def cells(self, place: tuple[slice, ...]) -> dict[str, np.ndarray]:
        """Coordinates of the cells of a tile.

        Args:
            place: of the tile.

        Returns:
            (n,) for each axis, the last axis fastest.
        """
        points = [axis[part] for axis, part in zip(self.axes.values(), place, strict=True)]
        return {name: mesh.ravel() for name, mesh in zip(self.axes, np.meshgrid(*points, indexing="ij"), strict=True)}
