"""What a run directory holds: looked at without the lock, and without writing anything."""

import json
from pathlib import Path
from typing import Any

from cspr_jax.errors import StoreError, one_line
from cspr_jax.store.consolidation import Content, read_content
from cspr_jax.store.disk import Disk
from cspr_jax.store.folder import RunFolder
from cspr_jax.store.record import Record, read_record
from cspr_jax.store.seal import DamagedError
from cspr_jax.store.shards import Layout, read_shard
from cspr_jax.tiles import Tiling

LOG_TAIL = 1 << 16


def status(directory: Path) -> dict[str, Any]:
    """How far a run has come, from the names in its directory.

    Args:
        directory: of the run.

    Returns:
        plain values: "identity", "tiles", "shards", "quarantined", "unfinished", "result", "last" (of log.jsonl).

    Raises:
        StoreError: no run directory.
    """
    record = _record(directory)
    folder = _folder(directory, record)
    tiles = len(_tiling(record))
    return {
        "schema": 1,
        "directory": str(directory),
        "sweep": record.source.get("file"),
        "identity": record.identity,
        "tiles": tiles,
        "shards": sum(1 for index in range(tiles) if folder.shard(index).is_file()),
        "quarantined": len(list(folder.quarantine.glob("*"))),
        "unfinished": len(list(directory.glob(".*.part"))) + len(list(folder.shards.glob(".*.part"))),
        "result": str(folder.result) if folder.result.is_file() else None,
        "last": _last(folder.log),
    }


def verify(path: Path) -> dict[str, Any]:
    """Read again everything of a run, or one result file.

    Args:
        path: a run directory, or a result file.

    Returns:
        plain values: counts, and "faults", a list of lines.

    Raises:
        StoreError: neither a run directory nor a file.
    """
    if path.is_file():
        # A link that a user names is followed.
        return _verify_result(path.resolve(), None, {"schema": 1, "path": str(path), "faults": []})
    record = _record(path)
    folder = _folder(path, record)
    found: dict[str, Any] = {"schema": 1, "path": str(path), "tiles": 0, "shards": 0, "missing": 0, "faults": []}
    tiling = _tiling(record)
    run = record.settings["run"]
    layout = Layout(record.identity, list(run["store"]), run["dtype"])
    found["tiles"] = len(tiling)
    for index in range(len(tiling)):
        place = folder.shard(index)
        if not place.exists():
            found["missing"] += 1
            continue
        try:
            read_shard(place, layout, index, tiling.extent(index))
            found["shards"] += 1
        except DamagedError as error:
            found["faults"].append(one_line(f"{place}: {error}"))
    if folder.result.exists():
        # Shards may have been pruned: the result stands for them.
        _verify_result(folder.result, record, found)
    return found


def _verify_result(path: Path, record: Record | None, found: dict[str, Any]) -> dict[str, Any]:
    content: Content | None = None
    try:
        content = read_content(path)
        if record is not None and content.identity != record.identity:
            raise DamagedError("it belongs to another sweep")
    except DamagedError as error:
        found["faults"].append(one_line(f"{path}: {error}"))
    found["result"] = str(path)
    if content is not None:
        found |= {"cells": content.cells, "cells_near_zero": content.near_zero, "mixed": content.mixed}
        found.setdefault("tiles", content.tiles)
    return found


def _record(directory: Path) -> Record:
    path = directory / "run.json"
    if not path.exists():
        raise StoreError(f"{directory}: is not a run directory: it has no run.json")
    try:
        record = read_record(path)
    except DamagedError as error:
        raise StoreError(f"{path}: {error}: run the sweep again to make it anew") from error
    return record


def _folder(directory: Path, record: Record) -> RunFolder:
    return RunFolder(directory, Path(str(record.source.get("file", "result.toml"))).stem, Disk())


def _tiling(record: Record) -> Tiling:
    # From the settings alone: an axis is a range with a count, or a list.
    axes = record.settings["axes"]
    counts = [len(a) if isinstance(a, list) else a["count"] for a in (axes[d] for d in record.settings["dimensions"])]
    return Tiling(tuple(counts), tuple(record.settings["run"]["tile"]))


def _last(log: Path) -> dict[str, Any] | None:
    # The last line of the log that is whole.
    try:
        with open(log, "rb") as file:
            file.seek(max(0, log.stat().st_size - LOG_TAIL))
            lines = file.read().splitlines()
    except OSError:
        return None
    for line in reversed(lines):
        try:
            found = json.loads(line)
        except ValueError:
            continue
        if isinstance(found, dict):
            return found
    return None
