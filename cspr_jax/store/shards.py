"""Shards: HDF5 files of one tile each, with a checksum trailer, which never change once they have their names."""

import dataclasses
import hashlib
import io
import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, BinaryIO

import h5py
import numpy as np

from cspr_jax.errors import printable
from cspr_jax.schema.identity import canonical_json
from cspr_jax.schema.quantities import EARLIER
from cspr_jax.store.documents import Header, document, plain_json
from cspr_jax.store.files import guard
from cspr_jax.store.files.checksum import DamagedError, with_trailer
from cspr_jax.store.files.guard import ReadableDataset
from cspr_jax.store.files.netcdf import LAYOUT, UNREADABLE, dtype_of, new_dataset, reason

LARGEST_SHARD = 64 << 20


@dataclasses.dataclass(frozen=True)
class Layout:
    """Layout that the shards of a run share.

    Fields:
        identity: identity of the sweep.
        store: names of the quantities.
        dtype: type of quantities of kind "float".
    """

    identity: str
    store: list[str]
    dtype: str


@dataclasses.dataclass(frozen=True)
class Shard:
    """The content of a shard.

    Fields:
        index: index of the tile.
        environment: hash of the environment that computed it.
        near_zero: number of cells whose margin is within 1e-9 of zero.
        values: array (n_1, ..., n_k) of each stored quantity.
        undecided: number of cells whose answer is not proved; None: the map proves nothing, or the file is older.
    """

    index: int
    environment: str
    near_zero: int
    values: dict[str, np.ndarray]
    undecided: int | None = None

    @property
    def digest(self) -> str:
        """SHA-256 of names, types, shapes and values."""
        return digest_of(self.values)


def digest_of(values: dict[str, np.ndarray]) -> str:
    """SHA-256 of name, type, shape and bytes of arrays, sorted by name."""
    total = hashlib.sha256()
    for name in sorted(values):
        array = np.ascontiguousarray(values[name])
        total.update(canonical_json([name, array.dtype.str, list(array.shape)]).encode())
        total.update(array.data.cast("B") if array.size else b"")
    return total.hexdigest()


def encode(layout: Layout, shard: Shard) -> bytes:
    """A shard as bytes; equal shards give equal bytes."""
    memory = io.BytesIO()
    with h5py.File(memory, "w", libver=LAYOUT) as file:
        file.attrs["header"] = canonical_json(_header(layout, shard))
        file.attrs["content_sha256"] = shard.digest
        for name in layout.store:
            array = shard.values[name]
            new_dataset(file, name, array.shape, dtype_of(name, layout.dtype), array.shape)[...] = array
    return with_trailer(memory.getvalue())


def _header(layout: Layout, shard: Shard) -> dict[str, Any]:
    of_shard = {name: getattr(shard, name) for name in ("environment", "near_zero", "undecided")}
    return {"identity": layout.identity, "tile": shard.index, **of_shard}


def decode(
    source: Path | BinaryIO,
    layout: Layout,
    index: int,
    shape: tuple[int, ...],
    begun: Callable[[Iterable[ReadableDataset]], None] = lambda _: None,
) -> Shard:
    """Decode a shard and check it completely, except its trailer."""
    kinds = {name: dtype_of(name, layout.dtype) for name in layout.store}
    try:
        with h5py.File(source, "r") as file:
            header = header_of(file)
            if header.identity != layout.identity:
                raise DamagedError("it belongs to another sweep")
            if header.tile != index:
                raise DamagedError(f"it holds tile {header.tile}")
            if set(file) != set(layout.store):
                raise DamagedError("it holds other quantities")
            datasets = guard.datasets(file, layout.store)
            if any(one.dtype not in (kinds[name], *EARLIER.get(kinds[name], ())) for name, one in datasets.items()):
                raise DamagedError("it holds other types")
            if any(one.shape != shape for one in datasets.values()):
                raise DamagedError("it holds a tile of another shape")
            begun(datasets.values())
            values = {name: one.values() for name, one in datasets.items()}
            written = file.attrs["content_sha256"]
    except UNREADABLE as error:
        raise DamagedError(printable(f"HDF5 cannot read it: {reason(error)}")) from error
    # The digest refers to the types in which the values were written.
    if not isinstance(written, str) or digest_of(values) != written:
        raise DamagedError("its content has changed")
    if max(header.near_zero, header.undecided or 0) > math.prod(shape):
        raise DamagedError("it counts more cells than it has")
    values = {name: array.astype(kinds[name], copy=False) for name, array in values.items()}
    return Shard(index, header.environment, header.near_zero, values, header.undecided)


def header_of(file: h5py.File) -> Header:
    """Header of a shard."""
    text = file.attrs.get("header")
    if not isinstance(text, str):
        raise DamagedError("it has no header")
    return document(Header, plain_json(text), "its header")
