"""Result files: HDF5 in netCDF-4 layout, never half-written under their final name."""

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from cspr_jax.errors import StoreError
from cspr_jax.quantities import AXES, QUANTITIES, Quantity, flag_attributes

LAYOUT = ("v110", "v110")


class ResultWriter:
    """An open result file; fill it tile by tile."""

    def __init__(self, file: h5py.File) -> None:
        """Keep the file."""
        self._file = file

    def write(self, place: tuple[slice, ...], values: dict[str, np.ndarray]) -> None:
        """Write one tile.

        Args:
            place: where it lies in the grid.
            values: an array of that shape for each stored quantity.
        """
        for name, array in values.items():
            self._file[name][place] = array


@contextlib.contextmanager
def new_file(path: Path, attributes: dict[str, Any]) -> Iterator[h5py.File]:
    """An HDF5 file that appears under its name only when it is whole.

    It is written beside its final place, flushed to the disk, and renamed.

    Args:
        path: final name.
        attributes: of the whole file.

    Yields:
        the open file.

    Raises:
        StoreError: the disk or the folder refuses.
    """
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with h5py.File(part, "w", libver=LAYOUT) as file:
            file.attrs.update(attributes)
            yield file
        publish(part, path)
    except OSError as error:
        raise StoreError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        with contextlib.suppress(OSError):  # its folder may be what is missing
            part.unlink()


@contextlib.contextmanager
def new_result(
    path: Path,
    axes: dict[str, np.ndarray],
    store: list[str],
    *,
    dtype: str,
    tile: tuple[int, ...],
    attributes: dict[str, Any],
) -> Iterator[ResultWriter]:
    """A result file over a grid, to be filled tile by tile; see `new_file`.

    Args:
        path: final name.
        axes: coordinates, in the order of the dimensions.
        store: names of the quantities.
        dtype: of quantities of kind "float".
        tile: chunk shape.
        attributes: of the whole file.

    Yields:
        the writer.

    Raises:
        StoreError: the disk or the folder refuses.
    """
    with new_file(path, attributes) as file:
        _make_datasets(file, axes, store, dtype, tile)
        yield ResultWriter(file)


def publish(part: Path, path: Path) -> None:
    """Give a finished file its final name, so that a crash leaves the old state or the new one.

    Args:
        part: the finished file, in the same folder.
        path: its name.
    """
    with open(part, "rb") as file:
        os.fsync(file.fileno())
    os.replace(part, path)
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)


def write_text(path: Path, text: str) -> None:
    """Write a small text file whole or not at all.

    Args:
        path: its name.
        text: its content.

    Raises:
        StoreError: the disk or the folder refuses.
    """
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        part.write_text(text, "utf-8")
        publish(part, path)
    except OSError as error:
        raise StoreError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        with contextlib.suppress(OSError):  # its folder may be what is missing
            part.unlink()


def _make_datasets(
    file: h5py.File, axes: dict[str, np.ndarray], store: list[str], dtype: str, tile: tuple[int, ...]
) -> None:
    for name, points in axes.items():
        scale = file.create_dataset(name, data=points, track_times=False)
        _describe(scale, AXES[name])
        scale.make_scale(name)
    shape = tuple(len(points) for points in axes.values())
    for name in store:
        quantity = QUANTITIES[name]
        kind = dtype if quantity.kind == "float" else quantity.kind
        data = file.create_dataset(
            name, shape, kind, chunks=tile, compression="gzip", shuffle=True, fletcher32=True, track_times=False
        )
        _describe(data, quantity)
        if name == "verdict":
            data.attrs.update(flag_attributes())
        for i, axis in enumerate(axes):
            data.dims[i].attach_scale(file[axis])


def _describe(data: h5py.Dataset, quantity: Quantity) -> None:
    data.attrs.update({"units": quantity.units, "long_name": quantity.long_name, "description": quantity.description})


def bytes_needed(shape: tuple[int, ...], store: list[str], dtype: str) -> int:
    """Room that a result file needs at most.

    Args:
        shape: of the grid.
        store: names of the quantities.
        dtype: of quantities of kind "float".

    Returns:
        bytes.
    """
    kinds = [dtype if QUANTITIES[name].kind == "float" else QUANTITIES[name].kind for name in store]
    return int(np.prod([float(n) for n in shape])) * sum(np.dtype(kind).itemsize for kind in kinds) + (1 << 20)
