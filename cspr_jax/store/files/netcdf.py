"""HDF5 in netCDF-4 layout: named axes with units, checksums on data and metadata."""

import contextlib
import os
import stat
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from cspr_jax.schema.map_kinds import quantity_of
from cspr_jax.schema.meanings import value_attributes
from cspr_jax.schema.quantities import QUANTITIES, Quantity, flag_attributes, row_of
from cspr_jax.store.files.checksum import write_trailer
from cspr_jax.store.files.disk import Disk
from cspr_jax.store.files.publishing import new_file
from cspr_jax.store.files.stream import DiskFile

# Versions of the HDF5 format in which metadata have checksums.
LAYOUT = ("v110", "v110")
# Errors that h5py raises for a file that is damaged or not HDF5.
UNREADABLE = (OSError, KeyError, ValueError, RuntimeError, IndexError, TypeError, AttributeError, ArithmeticError)


@contextlib.contextmanager
def new_hdf5(path: Path, attributes: dict[str, Any]) -> Iterator[h5py.File]:
    """An HDF5 file that appears under its name only when it is complete."""
    disk = Disk()
    with new_file(disk, path) as descriptor, open_hdf5(disk, descriptor, attributes) as file:
        yield file


@contextlib.contextmanager
def open_hdf5(disk: Disk, descriptor: int, attributes: dict[str, Any]) -> Iterator[h5py.File]:
    """Write HDF5 into an open, empty file; the checksum trailer is added when HDF5 has closed it."""
    through = DiskFile(disk, descriptor)
    try:
        with h5py.File(through, "w", libver=LAYOUT) as file:
            set_attributes(file, attributes)
            yield file
    except UNREADABLE:
        through.raise_failure()  # HDF5's error is only a consequence
        raise
    through.raise_failure()
    write_trailer(disk, descriptor, through.length)


def make_datasets(
    file: h5py.File,
    axes: dict[str, np.ndarray],
    store: list[str],
    *,
    dtype: str,
    tile: tuple[int, ...],
    settings: Mapping[str, Any] | None = None,
) -> None:
    """The empty datasets of a result over a grid, with their axes."""
    for name, points in axes.items():
        scale = file.create_dataset(name, data=points, track_times=False)
        describe(scale, row_of(name, settings))
        scale.make_scale(name)
    shape = tuple(len(points) for points in axes.values())
    for name in store:
        data = new_dataset(file, name, shape, dtype_of(name, dtype), tile)
        describe(data, quantity_of((settings or {}).get("map"), name))
        if QUANTITIES[name].unflagged:
            set_attributes(data, flag_attributes())
        set_attributes(data, value_attributes(QUANTITIES[name], settings))
        for i, axis in enumerate(axes):
            data.dims[i].attach_scale(file[axis])


def new_dataset(file: h5py.File, name: str, shape: tuple[int, ...], dtype: str, chunk: tuple[int, ...]) -> h5py.Dataset:
    """An empty dataset, compressed and with checksums."""
    return file.create_dataset(
        name, shape, dtype, chunks=chunk, compression="gzip", shuffle=True, fletcher32=True, track_times=False
    )


def dtype_of(name: str, dtype: str) -> str:
    """Type of a stored quantity."""
    kind = QUANTITIES[name].kind
    return dtype if kind == "float" else kind


def describe(data: h5py.Dataset, quantity: Quantity) -> None:
    """Write units and names as attributes of a dataset."""
    set_attributes(
        data, {"units": quantity.units, "long_name": quantity.long_name, "description": quantity.description}
    )


def set_attributes(item: h5py.HLObject, values: dict[str, Any]) -> None:
    """Write attributes, texts with variable length, since only those are read back as str."""
    for name, value in values.items():
        item.attrs[name] = value


def plain(value: Any) -> Any:
    """The value of an attribute in Python's own types."""
    if isinstance(value, bytes):
        return value.decode()
    return value.item() if isinstance(value, np.generic) else value


def bytes_needed(shape: tuple[int, ...], store: list[str], dtype: str) -> int:
    """Upper bound of the space that shards and result of a run need."""
    one = sum(np.dtype(dtype_of(name, dtype)).itemsize for name in store)
    # Shards and result hold the data twice; a tenth is for chunks that do not compress and for metadata.
    return int(2.1 * np.prod([float(n) for n in shape]) * one) + (1 << 20)


def reason(error: BaseException) -> str:
    """The first line of a library's error."""
    return str(error).splitlines()[0] if str(error) else type(error).__name__


def file_size(path: Path) -> int:
    """Size of a regular file."""
    try:
        status = os.lstat(path)
    except OSError:
        return -1
    return status.st_size if stat.S_ISREG(status.st_mode) else -1
