"""Guarded reading of HDF5 files of unknown origin: only numbers and short texts of limited size, within the file.

Anybody can write a matching checksum. HDF5 follows links into other files (a pipe keeps it waiting for ever), unpacks
any amount of memory from a few bytes, and builds any type that a file describes. So every object is looked up by its
name, and its link, layout, filters, type and size are checked, in this order, before it is read.
"""

import math
from collections.abc import Iterable
from typing import NamedTuple

import h5py
import numpy as np
from h5py import h5a, h5d, h5g, h5l, h5o, h5s, h5t, h5z

from cspr_jax.store.files.checksum import DamagedError

LARGEST_CHUNKS = 100_000  # largest number of tiles of a map, each of which is a chunk
LARGEST_CHUNK = 1 << 24  # bytes
# Bytes: settings contain a sweep file and a robot file of up to 1 MB each as JSON.
LARGEST_TEXT = 8 << 20
LARGEST_RANK = 16
LARGEST_ROWS = 1000  # largest number of rows of an attribute with a row for each cable
# Largest ratio of compression: Deflate packs at most 1032 bytes into one.
DENSEST = 1100
_PLENTY = 64 << 20
_PER_CHUNK = 256
# Attributes of datasets that this program writes, and those of HDF5's dimension scales.
_ATTRIBUTES = (
    *("units", "long_name", "description", "flag_masks", "flag_values", "flag_meanings"),
    *("CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST", "DIMENSION_LABELS"),
)
# Attributes of other programs that change what numbers mean.
_SCALING = ("scale_factor", "add_offset")
_FILTERS = {h5z.FILTER_DEFLATE, h5z.FILTER_SHUFFLE, h5z.FILTER_FLETCHER32}
_TYPES = {
    "float64": (h5t.IEEE_F64LE, h5t.IEEE_F64BE),
    "float32": (h5t.IEEE_F32LE, h5t.IEEE_F32BE),
    "int64": (h5t.STD_I64LE, h5t.STD_I64BE),
    "int16": (h5t.STD_I16LE, h5t.STD_I16BE),
    "uint32": (h5t.STD_U32LE, h5t.STD_U32BE),
    "uint16": (h5t.STD_U16LE, h5t.STD_U16BE),
}


class ReadableDataset(NamedTuple):
    """A dataset that may be read.

    Fields:
        data: the open dataset.
        shape: its shape.
        dtype: name of its type in NumPy.
        memory_bytes: size in memory.
        chunks: number of chunks.
        file_bytes: size in the file.
    """

    data: h5d.DatasetID
    shape: tuple[int, ...]
    dtype: str
    memory_bytes: int
    chunks: int
    file_bytes: int

    def values(self) -> np.ndarray:
        """All values of the dataset."""
        array = np.empty(self.shape, self.dtype)
        if array.size:
            self.data.read(h5s.ALL, h5s.ALL, array)
        return array


def datasets(file: h5py.File, names: Iterable[str], *, is_joined: bool = False) -> dict[str, ReadableDataset]:
    """Open those of the named datasets that a file contains, without inspecting anything else."""
    return {name: _dataset(file, name, is_joined) for name in names if file.id.links.exists(name.encode())}


def refuse_dense(datasets: Iterable[ReadableDataset], file_bytes: int, *, densest: int = DENSEST) -> None:
    """Refuse datasets that claim much more, or much less, than the size of their file explains."""
    readable = list(datasets)
    total, maximum = sum(one.memory_bytes for one in readable), _PLENTY + densest * file_bytes
    if total > maximum:
        raise DamagedError(
            f"it says it holds {total / 1e9:.3g} GB: must be at most {maximum / 1e9:.3g} GB in a file of its size"
        )
    explained = sum(one.file_bytes + _PER_CHUNK * one.chunks for one in readable)
    if file_bytes > _PLENTY + 1.2 * explained:
        raise DamagedError(f"{(file_bytes - explained) / 1e9:.3g} GB of it are none of its quantities")


def refuse_others(file: h5py.File, objects: int, attributes: int) -> None:
    """Refuse a file with more objects or attributes than those requested."""
    there = h5g.open(file.id, b"/").get_num_objs(), h5a.get_num_attrs(file.id)
    if there != (objects, attributes):
        raise DamagedError(
            f"it has {there[0]} objects and {there[1]} attributes: {objects} and {attributes} of them are cspr's"
        )


def text(item: h5py.HLObject, name: str, *, largest: int = LARGEST_TEXT) -> str | None:
    """An attribute that is one text, of variable length or, in files of earlier versions, of fixed length."""
    if not h5a.exists(item.id, name.encode()):
        return None
    attribute = h5a.open(item.id, name.encode())
    kind = attribute.get_type()
    if attribute.get_space().get_simple_extent_type() != h5s.SCALAR or kind.get_class() != h5t.STRING:
        raise DamagedError(f"its {name} must be one text")
    is_variable = kind.is_variable_str()
    # The length of such a text is known only after reading it, within the memory limit of this process.
    data = item.attrs[name].encode("utf-8", "surrogateescape") if is_variable else b""
    length = len(data) if is_variable else kind.get_size()
    if length > largest:
        raise DamagedError(f"its {name} has {length} bytes: must be at most {largest}")
    if not is_variable:
        array = np.empty((), f"S{length}")
        attribute.read(array, mtype=kind)
        data = array.item()
    try:
        return data.decode()
    except UnicodeDecodeError as error:
        raise DamagedError(f"its {name} is not UTF-8 text") from error


def numbers(item: h5py.HLObject, name: str, dtype: str, shape: tuple[int | None, ...] = ()) -> np.ndarray | None:
    """An attribute that is a number, or a few."""
    if not h5a.exists(item.id, name.encode()):
        return None
    attribute = h5a.open(item.id, name.encode())
    space = attribute.get_space()
    extent = () if space.get_simple_extent_type() == h5s.NULL else tuple(int(n) for n in space.get_simple_extent_dims())
    extent = () if extent == (1,) and not shape else extent  # netCDF writes numbers as lists of one
    fits = len(extent) == len(shape) and space.get_simple_extent_type() != h5s.NULL
    fits = fits and all(1 <= n <= LARGEST_ROWS if m is None else n == m for n, m in zip(extent, shape, strict=True))
    if not fits or _dtype(attribute.get_type()) != dtype:
        raise DamagedError(f"its {name} has another type or shape than cspr writes")
    array = np.empty(extent, dtype)
    attribute.read(array)
    return array


def _dataset(file: h5py.File, name: str, is_joined: bool) -> ReadableDataset:
    key = name.encode()
    if file.id.links.get_info(key).type != h5l.TYPE_HARD:
        raise DamagedError(f"{name} is a link: must be a dataset of this file")
    if h5o.get_info(file.id, key).type != h5o.TYPE_DATASET:
        raise DamagedError(f"{name} is not a dataset")
    data = h5d.open(file.id, key)
    count = sum(h5a.exists(data, one.encode()) for one in _ATTRIBUTES)
    if any(h5a.exists(data, one.encode()) for one in _SCALING) or (not is_joined and h5a.get_num_attrs(data) > count):
        raise DamagedError(f"{name} has attributes that are none of cspr")
    creation = data.get_create_plist()
    # Check the layout before the dataspace, for which HDF5 would open the other files of a virtual dataset.
    if creation.get_layout() not in (h5d.COMPACT, h5d.CONTIGUOUS, h5d.CHUNKED) or creation.get_external_count():
        raise DamagedError(f"{name}: its data lie in other files: must be in this one")
    filters = [creation.get_filter(i)[0] for i in range(creation.get_nfilters())]
    if len(set(filters)) < len(filters) or not _FILTERS.issuperset(filters):
        raise DamagedError(f"{name} is packed in a way that cspr does not use")
    dtype, space = _dtype(data.get_type()), data.get_space()
    if dtype is None or space.get_simple_extent_type() != h5s.SIMPLE or data.rank > LARGEST_RANK:
        raise DamagedError(f"{name} is not an array of plain numbers")
    shape = tuple(int(n) for n in space.get_simple_extent_dims())
    item, chunks = np.dtype(dtype).itemsize, 1
    if creation.get_layout() == h5d.CHUNKED:
        chunk = creation.get_chunk()
        chunks = math.prod(-(-n // m) for n, m in zip(shape, chunk, strict=True))
        if math.prod(chunk) * item > LARGEST_CHUNK or chunks > LARGEST_CHUNKS:
            raise DamagedError(f"{name} has {chunks} chunks of {list(chunk)}: more or larger ones than cspr makes")
    return ReadableDataset(data, shape, dtype, math.prod(shape) * item, chunks, int(data.get_storage_size()))


def _dtype(kind: h5t.TypeID) -> str | None:
    # Compare a type with these before anything is built from it.
    return next((name for name, types in _TYPES.items() if any(kind.equal(one) for one in types)), None)
