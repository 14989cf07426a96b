"""Joining of maps: parts of one map that were computed separately, or maps that differ in the points of one axis.

The joined map is a run like any other, whose tiles are read instead of computed: it is published, checked and resumed
by `sweep.engine`. Parts of one map keep their identity, and give the bytes that one run would have given.
"""

import copy
import dataclasses
import math
import os
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cspr_jax.errors import InputError, RefusedError, StoreError, printable
from cspr_jax.schema.identity import differences, digest
from cspr_jax.schema.quantities import ARRANGEMENT
from cspr_jax.schema.tiles import Tiling
from cspr_jax.schema.verdicts import NOT_PROVED
from cspr_jax.store.documents import plain_json, read_record
from cspr_jax.store.files.checksum import DamagedError
from cspr_jax.store.files.disk import Disk
from cspr_jax.store.folder import RunFolder
from cspr_jax.store.reading.isolated import Reader
from cspr_jax.store.reading.result import open_result
from cspr_jax.store.shards import Shard
from cspr_jax.sweep.definition import Sweep, sweep_of_settings
from cspr_jax.sweep.signals import Stop
from cspr_jax.sweep.work import Computed

# Cells that two maps share may differ by rounding, since their batches have different shapes.
_SAME = {"float64": 1e-6, "float32": 1e-3}
_NEAR_ZERO = 1e-9


@dataclasses.dataclass(frozen=True)
class Part:
    """A map, or its finished tiles.

    Fields:
        path: path as the user gave it.
        sweep: sweep of the map.
        environment: environment that computed it.
        data: quantities over the full grid.
        present: mask of the finished cells, in the shape of the grid.
        shards: shards of finished tiles, by index, without their values; a result has none.
        says_proved: whether it tells how many of its cells are proved.
    """

    path: Path
    sweep: Sweep
    environment: dict[str, Any]
    data: dict[str, np.ndarray]
    present: np.ndarray
    shards: dict[int, Shard]
    says_proved: bool


def read_part(path: Path) -> Part:
    """A part from a run directory, or from a result."""
    return _run_part(path) if path.is_dir() else _result_part(path, path)


def _run_part(path: Path) -> Part:
    try:
        record = read_record(path / "run.json")
    except DamagedError as error:
        raise StoreError(printable(f"{path}: is no whole run directory: {error}")) from error
    sweep = sweep_of_settings(record.settings, path / record.source["file"], record.source["text"])
    folder, tiling = RunFolder(path, sweep.name, Disk()), sweep.grid.tiling
    if sweep.identity != record.identity:
        raise RefusedError(printable(f"{path}: was begun by an earlier version: run it again"))
    data = {name: np.zeros(sweep.grid.shape, kind) for name, kind in sweep.types.items()}
    present, shards = np.zeros(sweep.grid.shape, bool), dict[int, Shard]()
    with Reader() as reader:
        for index in range(len(tiling)):
            if not os.path.lexists(folder.shard(index)):
                continue
            try:
                shard = reader.shard(folder.shard(index), sweep.layout, index, tiling.extent(index))
            except DamagedError as error:
                raise StoreError(printable(f"{folder.shard(index)}: {error}: run the sweep again")) from error
            for name, values in shard.values.items():
                data[name][tiling.slices(index)] = values
            present[tiling.slices(index)] = True
            shards[index] = dataclasses.replace(shard, values={})
    if not present.all() and folder.result.is_file():  # the shards were pruned
        return _result_part(path, folder.result)
    says_proved = all(shard.undecided is not None for shard in shards.values())
    return Part(path, sweep, record.environment, data, present, shards, says_proved)


def _result_part(path: Path, file: Path) -> Part:
    result = open_result(file)
    if not result.is_map:
        raise StoreError(printable(f"{file}: is a motion: must be a map"))
    sweep = sweep_of_settings(result.settings, file)
    if sweep.identity != result.attributes.get("identity"):
        raise RefusedError(printable(f"{file}: was computed by an earlier version, or joined elsewhere: run it again"))
    try:
        environment = plain_json(result.attributes.get("environment_settings", "{}"))
    except DamagedError as error:
        raise StoreError(printable(f"{file}: its environment: {error}")) from error
    data = {name: result.data[name] for name in sweep.store}
    full = np.ones(sweep.grid.shape, bool)
    return Part(path, sweep, environment, data, full, {}, "proved" in result.attributes)


class Merged:
    """Tiles of a joined map, for `sweep.engine.Run`.

    Args:
        parts: two or more parts.
        accept_environment_change: whether parts may come from different environments.

    Fields:
        sweep: sweep of the joined map.

    Raises:
        RefusedError: parts do not fit together, with a line for each reason; or cells are missing.
    """

    def __init__(self, parts: Sequence[Part], *, accept_environment_change: bool = False) -> None:
        """Join the parts in memory, without writing anything."""
        _refuse_conflicts(parts, accept_environment_change)
        self._parts = parts
        self.sweep = _joined(parts)
        axes = self.sweep.grid.axes
        self._owner = np.full(self.sweep.grid.shape, -1, np.int32)
        self._data = {name: np.zeros(self.sweep.grid.shape, kind) for name, kind in self.sweep.types.items()}
        for number, part in enumerate(parts):
            # The joined axis is sorted; the others are as in all parts, in any order.
            indices = (
                np.arange(len(points)) if np.array_equal(points, axes[name]) else np.searchsorted(axes[name], points)
                for name, points in part.sweep.grid.axes.items()
            )
            self._take(number, part, np.ix_(*indices))
        tiling = self.sweep.grid.tiling
        missing = [index for index, region in enumerate(tiling) if (self._owner[region] < 0).any()]
        if missing:
            raise RefusedError(_missing_line(missing, tiling))

    def _take(self, number: int, part: Part, cells: tuple[np.ndarray, ...]) -> None:
        owner = self._owner[cells]
        both = part.present & (owner >= 0)
        for name, values in part.data.items() if both.any() else ():
            differing = both & ~_agree(self._data[name][cells], values)
            if differing.any():
                others = self._parts[owner[differing][0]].path
                raise RefusedError(
                    printable(f"{part.path}: {name}: {differing.sum()} cells differ from those of {others}: must agree")
                )
        new = part.present & (owner < 0)
        for name, values in part.data.items():
            self._data[name][cells] = np.where(new, values, self._data[name][cells])
        self._owner[cells] = np.where(new, number, owner)

    def environment(self) -> dict[str, Any]:
        """Environment of the joined map."""
        return self._parts[0].environment

    def tiles(self, indices: Iterable[int], stop: Stop) -> Iterator[Computed]:
        """The tiles, in order."""
        for index in indices:
            if stop:
                return
            yield Computed(self._shard(index), self.environment())

    def _shard(self, index: int) -> Shard:
        region = self.sweep.grid.tiling.slices(index)
        values = {name: np.ascontiguousarray(data[region]) for name, data in self._data.items()}
        for part in self._parts:
            if part.sweep.identity == self.sweep.identity and index in part.shards:
                return dataclasses.replace(part.shards[index], values=values)
        owners = sorted({digest(self._parts[number].environment) for number in np.unique(self._owner[region])})
        near_zero = int((np.abs(values["margin"]) < _NEAR_ZERO).sum()) if "margin" in values else 0
        undecided = _undecided(values) if all(part.says_proved for part in self._parts) else None
        return Shard(index, owners[0] if len(owners) == 1 else digest(owners), near_zero, values, undecided)


def _undecided(values: dict[str, np.ndarray]) -> int | None:
    # Number of cells whose answer is not proved, counted as in `maps.grid_map`; None: it needs quantities not stored.
    if "undecided_fraction" in values:
        return int((values["undecided_fraction"] > 0.0).sum())
    return int(((values["verdict"] & NOT_PROVED) != 0).sum()) if "verdict" in values else None


def _refuse_conflicts(parts: Sequence[Part], accept: bool) -> None:
    if len(parts) < 2:
        raise InputError("merge", len(parts), "two run directories or results, or more")
    first, lines = parts[0], list[str]()
    free = set(_free_axes(parts))
    if len(free) > 1:
        lines.append(f"axes {', '.join(sorted(free))} differ: must be one of them at most")
    for part in parts[1:]:
        conflicts = differences(_fixed(part.sweep.settings, free), _fixed(first.sweep.settings, free))
        if part.sweep.grid.axes.keys() != first.sweep.grid.axes.keys():
            conflicts = conflicts or ["axes differ"]
        lines += [f"{part.path}: {line} ({first.path}): must be equal" for line in conflicts]
        if not accept:
            conflicts = differences(part.environment, first.environment)
            lines += [f"{part.path}: {line}: --accept-environment-change joins them" for line in conflicts]
    if lines:
        raise RefusedError(*(printable(line) for line in lines))


def _free_axes(parts: Sequence[Part]) -> list[str]:
    # Axes on which some part has other points than the first part.
    first = parts[0].sweep.grid.axes
    return [
        name
        for name, points in first.items()
        if any(not np.array_equal(points, part.sweep.grid.axes.get(name, points)) for part in parts)
    ]


def _fixed(settings: dict[str, Any], free: set[str]) -> dict[str, Any]:
    # Settings that all parts must share, except how axes with equal points are written, and the shape of tiles.
    axes = [name for name in settings["axes"] if name not in free]
    run = {key: value for key, value in settings["run"].items() if key != "tile"}
    return settings | {"axes": axes, "run": run, "arrangements": None}


def _joined(parts: Sequence[Part]) -> Sweep:
    first = parts[0].sweep
    free = _free_axes(parts)
    if not free:
        return first
    (axis,) = free
    settings = copy.deepcopy(first.settings)
    points = np.unique(np.concatenate([part.sweep.grid.axes[axis] for part in parts]))
    settings["axes"][axis] = points.astype(int).tolist() if axis == ARRANGEMENT else points.tolist()
    settings.pop("arrangements", None)
    shape = [len(points) if name == axis else len(values) for name, values in first.grid.axes.items()]
    settings["run"]["tile"] = [min(tile, length) for tile, length in zip(first.grid.tile, shape, strict=True)]
    return sweep_of_settings(settings, first.file, first.text)


def _agree(values: np.ndarray, others: np.ndarray) -> np.ndarray:
    if values.dtype.kind != "f":
        return values == others
    same = _SAME[values.dtype.name]
    return np.isclose(values, others, rtol=same, atol=same, equal_nan=True)


def _missing_line(missing: list[int], tiling: Tiling) -> str:
    # Words such as "tiles 3:5, 8:9 of 12".
    starts = [index for index in missing if index - 1 not in missing]
    ends = [index + 1 for index in missing if index + 1 not in missing]
    ranges = ", ".join(f"{start}:{end}" for start, end in zip(starts[:8], ends, strict=False))
    more = ", ..." if len(starts) > 8 else ""
    cells = sum(math.prod(tiling.extent(index)) for index in missing)
    return (
        f"tiles {ranges}{more} of {len(tiling)} ({cells:,} cells) are in none of them: cspr run --tiles computes them"
    )
