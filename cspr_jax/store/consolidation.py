"""The result of a run: a copy of all shards in one file, which is checked after it was written."""

import dataclasses
import hashlib
import json
import os
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from cspr_jax.errors import StoreError
from cspr_jax.schema.identity import identity
from cspr_jax.schema.quantities import QUANTITIES, is_axis
from cspr_jax.schema.tiles import Grid
from cspr_jax.store.documents import Settings, document, plain_json
from cspr_jax.store.files import guard
from cspr_jax.store.files.checksum import DamagedError
from cspr_jax.store.files.disk import Disk
from cspr_jax.store.files.guard import ReadableDataset
from cspr_jax.store.files.netcdf import UNREADABLE, make_datasets, open_hdf5, plain, reason, set_attributes
from cspr_jax.store.files.publishing import new_file
from cspr_jax.store.shards import Layout, Shard, digest_of

LARGEST_TILE_BYTES = 1 << 24
LARGEST_AXIS_BYTES = 1 << 28
LARGEST_TILES = 100_000


@dataclasses.dataclass(frozen=True)
class Content:
    """Summary of a result that was read completely.

    Fields:
        identity: identity of the sweep.
        settings: settings of the sweep.
        cells: number of cells.
        tiles: number of tiles.
        near_zero: number of cells whose margin is within 1e-9 of zero.
        mixed: whether its shards come from different environments.
        proved: fraction of the cells whose answer is proved; None: unknown.
    """

    identity: str
    settings: dict[str, Any]
    cells: int
    tiles: int
    near_zero: int
    mixed: bool
    proved: float | None


def consolidate(
    disk: Disk,
    path: Path,
    layout: Layout,
    grid: Grid,
    shards: Iterator[Shard],
    attributes: dict[str, Any],
    *,
    between: Callable[[], None] = lambda: None,
) -> None:
    """Write the result, read it back, and only then give it its name."""
    digests, environments, near_zero, undecided = [], set(), 0, []
    with new_file(disk, path) as descriptor:
        with open_hdf5(disk, descriptor, attributes) as file:
            settings = json.loads(attributes["settings"])
            make_datasets(file, grid.axes, layout.store, dtype=layout.dtype, tile=grid.tile, settings=settings)
            for region, shard in zip(grid.tiling, shards, strict=True):
                between()
                for name in layout.store:
                    file[name][region] = shard.values[name]
                digests.append(shard.digest)
                environments.add(shard.environment)
                near_zero += shard.near_zero
                undecided.append(shard.undecided)
            mixed = int(environments != {attributes["environment"]})
            totals = {"cells_near_zero": near_zero, "mixed": mixed, "environments": " ".join(sorted(environments))}
            set_attributes(file, totals | _proved(undecided, grid.n_cells))
            set_attributes(file, {"content_sha256": _fold(grid.axes, digests)})
        with os.fdopen(os.dup(descriptor), "rb") as again, h5py.File(again, "r") as file:
            again_digests = _digests(file, grid, layout.store, between)
            if again_digests != digests or _fold(grid.axes, digests) != plain(file.attrs["content_sha256"]):
                raise StoreError(f"{path}: the disk does not give back what was written: check the disk")


def _proved(undecided: list[int | None], cells: int) -> dict[str, float]:
    # Fraction of the cells whose answer is proved, if every shard has that number.
    counts = [count for count in undecided if count is not None]
    return {"proved": 1.0 - sum(counts) / cells} if len(counts) == len(undecided) else {}


def _fold(axes: dict[str, np.ndarray], digests: list[str]) -> str:
    return hashlib.sha256("\n".join([digest_of(axes), *digests]).encode()).hexdigest()


def _digests(file: h5py.File, grid: Grid, store: list[str], between: Callable[[], None]) -> list[str]:
    digests = []
    for region in grid.tiling:
        between()
        digests.append(digest_of({name: np.asarray(file[name][region]) for name in store}))
    return digests


def content_of(path: Path, begun: Callable[[Iterable[ReadableDataset]], None] = lambda _: None) -> Content:
    """Read a result completely and compare it with its checksums, except its trailer."""
    try:
        with h5py.File(path, "r") as file:
            settings = plain_json(_text(file, "settings"))
            document(Settings, settings, "its settings")
            if identity(settings) != _text(file, "identity"):
                raise DamagedError("its settings and its identity do not fit")
            tile, store, axes = settings["run"]["tile"], settings["run"]["store"], settings["dimensions"]
            datasets = _stored_datasets(file, axes, store)
            grid = Grid({name: datasets[name].values().reshape(-1) for name in axes}, tuple(tile))
            _check_shapes(datasets, grid, store)
            begun(datasets.values())
            digests = _digests(file, grid, store, lambda: None)
            if _fold(grid.axes, digests) != _text(file, "content_sha256"):
                raise DamagedError("its content has changed")
            near_zero, mixed = (int(guard.numbers(file, name, "int64") or 0) for name in ("cells_near_zero", "mixed"))
            proved = guard.numbers(file, "proved", "float64")
            fraction = None if proved is None else float(proved)
    except (StoreError, *UNREADABLE, MemoryError) as error:
        raise DamagedError(f"it cannot be read: {reason(error)}") from error
    return Content(identity(settings), settings, grid.n_cells, len(grid.tiling), near_zero, bool(mixed), fraction)


def _text(file: h5py.File, name: str) -> str:
    text = guard.text(file, name)
    if text is None:
        raise DamagedError(f"it has no {name}")
    return text


def _stored_datasets(file: h5py.File, axes: list[str], store: list[str]) -> dict[str, ReadableDataset]:
    # Open only the datasets that the settings name; each is checked before its values are read.
    names = [*axes, *store]
    if len({*names}) < len(names) or not all(map(is_axis, axes)) or not {*store} <= QUANTITIES.keys():
        raise DamagedError("its settings name other quantities than cspr has")
    if h5py.h5g.open(file.id, b"/").get_num_objs() != len(names):
        raise DamagedError("it holds other datasets than its settings say")
    datasets = guard.datasets(file, names)
    if datasets.keys() != {*names}:
        raise DamagedError("it holds other datasets than its settings say")
    if any(datasets[name].memory_bytes > LARGEST_AXIS_BYTES for name in axes):
        raise DamagedError("its axes have no fitting size")
    guard.refuse_dense(datasets.values(), os.stat(file.filename).st_size)
    return datasets


def _check_shapes(datasets: dict[str, ReadableDataset], grid: Grid, store: list[str]) -> None:
    if any(datasets[name].shape != grid.shape for name in store) or len(grid.tile) != len(grid.shape):
        raise DamagedError("its datasets do not fit its axes")
    largest = 8.0 * float(np.prod([float(n) for n in grid.tile]))
    if largest > LARGEST_TILE_BYTES or not all(isinstance(n, int) and n > 0 for n in grid.tile):
        raise DamagedError("its tiles have no fitting size")
    if len(grid.tiling) > LARGEST_TILES:
        raise DamagedError(f"it has {len(grid.tiling)} tiles: must be at most {LARGEST_TILES}")
