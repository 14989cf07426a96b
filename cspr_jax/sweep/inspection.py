"""Content of a run directory: looked at without the lock, and without writing anything."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from cspr_jax.errors import StoreError, one_line
from cspr_jax.schema.tiles import Tiling
from cspr_jax.store.disk import Disk
from cspr_jax.store.folder import RunFolder
from cspr_jax.store.isolated import content
from cspr_jax.store.netcdf import file_size
from cspr_jax.store.record import Record, read_record
from cspr_jax.store.result import open_result
from cspr_jax.store.seal import DamagedError
from cspr_jax.store.shards import Layout, read_shard

LOG_TAIL = 1 << 16


def status(directory: Path) -> dict[str, Any]:
    """Progress of a run, from the names in its directory.

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
    """Read again everything of a run, or one result or motion file.

    Args:
        path: a run directory, or a file.

    Returns:
        plain values: counts, and "faults", a list of lines.

    Raises:
        StoreError: neither a run directory nor a file.
    """
    if path.is_file():
        # A link that a user names is followed.
        return _verify_file(path, {"schema": 1, "path": str(path), "faults": []})
    record = _record(path)
    folder = _folder(path, record)
    report: dict[str, Any] = {"schema": 1, "path": str(path), "tiles": 0, "shards": 0, "missing": 0, "faults": []}
    tiling = _tiling(record)
    run = record.settings["run"]
    layout = Layout(record.identity, list(run["store"]), run["dtype"])
    report["tiles"] = len(tiling)
    for index in range(len(tiling)):
        place = folder.shard(index)
        if not place.exists():
            report["missing"] += 1
            continue
        try:
            read_shard(place, layout, index, tiling.extent(index))
            report["shards"] += 1
        except DamagedError as error:
            report["faults"].append(one_line(f"{place}: {error}"))
    if folder.result.exists():
        # Shards may have been pruned: the result stands for them.
        _verify_result(folder.result, record, report)
    return report


def result_in(directory: Path) -> Path:
    """The result of a run directory.

    Args:
        directory: of the run.

    Returns:
        its path.

    Raises:
        StoreError: no run directory, or its run has not finished.
    """
    path = _folder(directory, _record(directory)).result
    if file_size(path) < 0:
        raise StoreError(one_line(f"{directory}: holds no finished result: run the sweep to its end"))
    return path


def _verify_file(path: Path, report: dict[str, Any]) -> dict[str, Any]:
    try:
        inside = content(path)
    except DamagedError as error:
        return report | {"result": str(path), "faults": [one_line(f"{path}: {error}")]}
    if inside is not None:
        return report | {"result": str(path)} | _counts(inside)
    try:
        result = open_result(path)
    except StoreError as error:
        return report | {"motion": str(path), "faults": [str(error)]}
    # Motions of earlier versions say nothing of their segments.
    segments = result.data.get("segment", np.empty(0)).size or None
    feasible = result.attributes.get("feasible")
    counts = {
        "rows": result.axes["t"].size,
        "segments": segments,
        "feasible": None if feasible is None else feasible > 0,
    }
    return report | {"motion": str(path)} | {key: value for key, value in counts.items() if value is not None}


def _verify_result(path: Path, record: Record, report: dict[str, Any]) -> None:
    report["result"] = str(path)
    try:
        if file_size(path) < 0:
            raise DamagedError("it is not a file")
        inside = content(path)
        if inside is None or inside["identity"] != record.identity:
            raise DamagedError("it belongs to another sweep")
    except DamagedError as error:
        report["faults"].append(one_line(f"{path}: {error}"))
    else:
        report |= {key: value for key, value in _counts(inside).items() if key not in report}


def _counts(inside: dict[str, Any]) -> dict[str, Any]:
    counts = {
        "cells": inside["cells"],
        "cells_near_zero": inside["near_zero"],
        "mixed": inside["mixed"],
        "tiles": inside["tiles"],
        "proved": inside["proved"],
    }
    return {name: count for name, count in counts.items() if count is not None}


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
            entry = json.loads(line)
        except ValueError:
            continue
        if isinstance(entry, dict):
            return entry
    return None
