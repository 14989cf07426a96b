"""Shards: the file of one tile, immutable once it has its name. HDF5, with a seal."""

import dataclasses
import hashlib
import io
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from cspr_jax.schema.identity import canonical_json
from cspr_jax.schema.quantity import EARLIER
from cspr_jax.store import guard
from cspr_jax.store.netcdf import LAYOUT, UNREADABLE, dtype_of, file_size, new_dataset, reason
from cspr_jax.store.seal import DamagedError, sealed, unreadable, unsealed

LARGEST_SHARD = 64 << 20


@dataclasses.dataclass(frozen=True)
class Layout:
    """Layout that the shards of a run share.

    Fields:
        identity: of the sweep.
        store: names of the quantities.
        dtype: of quantities of kind "float".
    """

    identity: str
    store: list[str]
    dtype: str


@dataclasses.dataclass(frozen=True)
class Shard:
    """The content of a shard.

    Fields:
        index: of the tile.
        environment: hash of what computed it.
        near_zero: cells whose margin lies within 1e-9 of zero.
        values: (n_1, ..., n_k) for each stored quantity.
        undecided: cells whose answer is not proved; None: the map proves nothing, or an earlier version wrote it.
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
    """SHA-256 over name, type, shape and bytes of arrays, sorted by name.

    Args:
        values: the arrays.

    Returns:
        64 hexadecimal digits.
    """
    total = hashlib.sha256()
    for name in sorted(values):
        array = np.ascontiguousarray(values[name])
        total.update(canonical_json([name, array.dtype.str, list(array.shape)]).encode())
        total.update(array.data.cast("B") if array.size else b"")
    return total.hexdigest()


def encode(layout: Layout, shard: Shard) -> bytes:
    """A shard as bytes; equal shards give equal bytes.

    Args:
        layout: of the run.
        shard: its content.

    Returns:
        the file's content.
    """
    memory = io.BytesIO()
    with h5py.File(memory, "w", libver=LAYOUT) as file:
        file.attrs["header"] = canonical_json(_header(layout, shard))
        file.attrs["content_sha256"] = shard.digest
        for name in layout.store:
            array = shard.values[name]
            new_dataset(file, name, array.shape, dtype_of(name, layout.dtype), array.shape)[...] = array
    return sealed(memory.getvalue())


def _header(layout: Layout, shard: Shard) -> dict[str, Any]:
    of_shard = {name: getattr(shard, name) for name in ("environment", "near_zero", "undecided")}
    return {"identity": layout.identity, "tile": shard.index, **of_shard}


def read_shard(path: Path, layout: Layout, index: int, shape: tuple[int, ...]) -> Shard:
    """A shard, checked in every respect.

    Args:
        path: the file.
        layout: of the run.
        index: of the tile that it must hold.
        shape: of the tile.

    Returns:
        its content.

    Raises:
        DamagedError: it is anything else.
        StoreError: the system refuses to read anything at the moment.
    """
    file, header = _opened(path)
    with file:
        if header["identity"] != layout.identity:
            raise DamagedError("it belongs to another sweep")
        if header["tile"] != index:
            raise DamagedError(f"it holds tile {header['tile']}")
        try:
            if set(file) != set(layout.store):
                raise DamagedError("it holds other quantities")
            datasets = guard.datasets(file, layout.store)
            kinds = {name: dtype_of(name, layout.dtype) for name in layout.store}
            if any(one.dtype not in (kinds[name], *EARLIER.get(kinds[name], ())) for name, one in datasets.items()):
                raise DamagedError("it holds other types")
            if any(one.shape != shape for one in datasets.values()):
                raise DamagedError("it holds a tile of another shape")
            values = {name: one.values() for name, one in datasets.items()}
            written = file.attrs["content_sha256"]
        except UNREADABLE as error:
            raise DamagedError(f"HDF5 cannot read it: {reason(error)}") from error
    # Of the types in which it was written.
    if digest_of(values) != written:
        raise DamagedError("its content has changed")
    values = {name: array.astype(kinds[name], copy=False) for name, array in values.items()}
    return Shard(index, str(header["environment"]), int(header["near_zero"]), values, header.get("undecided"))


def owners(paths: Iterable[Path]) -> set[tuple[str, str]]:
    """Whose shards these are.

    Args:
        paths: of the shards; damaged ones are passed over.

    Returns:
        the identities of their sweeps, each with the hash of an environment.
    """
    identities = set()
    for path in paths:
        try:
            file, header = _opened(path)
        except DamagedError:
            continue
        file.close()
        identities.add((str(header["identity"]), str(header["environment"])))
    return identities


def _opened(path: Path) -> tuple[h5py.File, dict[str, Any]]:
    if not 0 <= file_size(path) <= LARGEST_SHARD:
        raise DamagedError("it is not a file of a fitting size")
    try:
        data = unsealed(path.read_bytes())
    except OSError as error:
        raise unreadable(path, error) from error
    try:
        file = h5py.File(io.BytesIO(data), "r")
        header = json.loads(file.attrs["header"])
        if not {"identity", "tile", "environment", "near_zero"} <= header.keys():
            raise DamagedError("its header is not whole")
    except UNREADABLE as error:
        raise DamagedError(f"HDF5 cannot read it: {reason(error)}") from error
    return file, header
