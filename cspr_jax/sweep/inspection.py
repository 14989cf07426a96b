"""Inspection of a run directory, without its lock and without writing anything."""

import contextlib
import datetime
import functools
import math
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from cspr_jax.errors import StoreError, printable
from cspr_jax.runtime.progress import RateEstimate
from cspr_jax.schema.tiles import Tiling
from cspr_jax.store.consolidation import Content
from cspr_jax.store.documents import Entry, Record, Settings, document, plain_json, read_record
from cspr_jax.store.files.checksum import DamagedError, read_regular
from cspr_jax.store.files.disk import Disk
from cspr_jax.store.files.netcdf import file_size
from cspr_jax.store.folder import RunFolder
from cspr_jax.store.reading.isolated import Reader
from cspr_jax.store.reading.result import open_result
from cspr_jax.store.shards import Layout

LOG_TAIL = 1 << 16


def status(directory: Path) -> dict[str, Any]:
    """Progress of a run, from names of files in its directory."""
    record = _record(directory)
    folder = _folder(directory, record)
    tiling = _settings(record).tiling
    there = [index for index in range(len(tiling)) if file_size(folder.shard(index)) >= 0]
    cells, done = math.prod(tiling.shape), sum(math.prod(tiling.extent(index)) for index in there)
    result, entries = file_size(folder.result) >= 0, _entries(folder.log)
    done, time_now = cells if result else done, time.time()
    estimate = _rate_estimate(entries, tiling, done, time_now)
    state, words = ("finished", "finished") if result else _state(folder.is_held(), entries, time_now)
    return {
        "schema": 1,
        "directory": str(directory),
        "sweep": record.source["file"],
        "identity": record.identity,
        "tiles": len(tiling),
        "shards": len(there),
        "quarantined": len(list(folder.quarantine.glob("*"))),
        "unfinished": len(folder.leftovers()),
        "result": str(folder.result) if result else None,
        "last": entries[0] if entries else None,
        "cells": cells,
        "cells_done": done,
        "cells_per_second": estimate.rate,
        "seconds_left": _left(estimate, cells - done, time_now if state == "running" else None),
        "state": state,
        "state_text": words,
    }


def verify(path: Path) -> dict[str, Any]:
    """Verify all files of a run, or a single result or motion file, by reading them."""
    if path.is_file():
        # Follow links that a user names.
        return _verify_file(path, {"schema": 1, "path": str(path), "faults": []})
    record = _record(path)
    folder, tiling = _folder(path, record), _settings(record).tiling
    report: dict[str, Any] = {"schema": 1, "path": str(path), "tiles": len(tiling), "shards": 0, "missing": 0}
    report |= {"faults": [], "unreadable": []}
    run = record.settings["run"]
    layout = Layout(record.identity, list(run["store"]), run["dtype"])
    with Reader() as reader:
        for index in range(len(tiling)):
            shard_path = folder.shard(index)
            if not os.path.lexists(shard_path):
                report["missing"] += 1
            elif _is_read(
                report, shard_path, functools.partial(reader.shard, shard_path, layout, index, tiling.extent(index))
            ):
                report["shards"] += 1
        if os.path.lexists(folder.result):
            # Shards may have been pruned, since the result contains them.
            report["result"] = str(folder.result)
            _is_read(report, folder.result, lambda: _count_result(folder.result, record, report, reader))
    return report


def _is_read(report: dict[str, Any], path: Path, read: Callable[[], object]) -> bool:
    # Report damaged files; a file that the system or the disk refuses to read may be intact.
    try:
        read()
    except DamagedError as error:
        report["faults"].append(printable(f"{path}: {error}"))
        return False
    except StoreError as error:
        report["unreadable"].append(printable(str(error)))
        return False
    return True


def result_in(directory: Path) -> Path:
    """The result of a run directory."""
    path = _folder(directory, _record(directory)).result
    if file_size(path) < 0:
        raise StoreError(printable(f"{directory}: holds no finished result: run the sweep to its end"))
    return path


def _verify_file(path: Path, report: dict[str, Any]) -> dict[str, Any]:
    try:
        inside = None
        if path.suffix.lower() != ".csv":
            with Reader() as reader:
                inside = reader.content(path, follow=True)
    except DamagedError as error:
        return report | {"result": str(path), "faults": [printable(f"{path}: {error}")]}
    if inside is not None:
        return report | {"result": str(path)} | _counts(inside)
    try:
        result = open_result(path)
    except StoreError as error:
        return report | {"motion": str(path), "faults": [str(error)]}
    # Motions of earlier versions have no quantities of segments.
    segments = result.data.get("segment", np.empty(0)).size or None
    feasible = result.attributes.get("feasible")
    counts = {
        "rows": result.axes["t"].size,
        "segments": segments,
        "feasible": None if feasible is None else feasible > 0,
    }
    return report | {"motion": str(path)} | {key: value for key, value in counts.items() if value is not None}


def _count_result(path: Path, record: Record, report: dict[str, Any], reader: Reader) -> None:
    inside = reader.content(path)
    if inside is None or inside.identity != record.identity:
        raise DamagedError("it belongs to another sweep")
    report |= {key: value for key, value in _counts(inside).items() if key not in report}


def _counts(inside: Content) -> dict[str, Any]:
    counts = {
        "cells": inside.cells,
        "cells_near_zero": inside.near_zero,
        "mixed": inside.mixed,
        "tiles": inside.tiles,
        "proved": inside.proved,
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
    return RunFolder(directory, Path(record.source["file"]).stem, Disk())


def _settings(record: Record) -> Settings:
    return document(Settings, record.settings, "its settings")


def _entries(log: Path) -> list[dict[str, Any]]:
    # Last complete lines of the log, the newest first, for information only.
    try:
        lines = read_regular(log, LOG_TAIL, last=True).splitlines()
    except (DamagedError, StoreError):
        return []
    entries = []
    for line in reversed(lines):
        with contextlib.suppress(DamagedError):
            entries.append(document(Entry, plain_json(line), "its log").model_dump())
    return entries


def _seconds(entry: dict[str, Any]) -> float | None:
    # Time of an entry, of which earlier versions wrote only the time of day.
    seconds = entry.get("seconds")
    if isinstance(seconds, int | float):
        return float(seconds)
    with contextlib.suppress(ValueError):
        return datetime.datetime.strptime(entry["time"], "%Y-%m-%dT%H:%M:%S%z").timestamp()
    return None


def _rate_estimate(entries: list[dict[str, Any]], tiling: Tiling, done: int, time_now: float) -> RateEstimate:
    # Estimate the rate like the process that wrote last, from its entries in the log, the newest first.
    events = list[tuple[float, int]]()
    for entry in entries:
        seconds, index = _seconds(entry), entry.get("index")
        if entry["event"] == "started" and seconds is not None:
            events.append((seconds, 0))
            break
        if entry["event"] == "tile" and seconds is not None and isinstance(index, int) and 0 <= index < len(tiling):
            events.append((seconds, math.prod(tiling.extent(index))))
    clock = [time_now]
    estimate, cells = RateEstimate(lambda: clock[0]), done - sum(count for _, count in events)
    for seconds, count in reversed(events):
        clock[0], cells = seconds, cells + count
        estimate.advance(cells, math.prod(tiling.shape))
    clock[0] = time_now
    return estimate


def _left(estimate: RateEstimate, cells: int, time_now: float | None) -> float | None:
    # The remaining time decreases while a process computes.
    if estimate.rate is None or estimate.ends is None:
        return None
    return cells / estimate.rate if time_now is None else max(estimate.ends - time_now, 0.0)


def _state(is_held: bool | None, entries: list[dict[str, Any]], time_now: float) -> tuple[str, str]:
    # State of a run: a word for programs, and a text for people.
    last = entries[0] if entries else None
    if is_held is None:
        return "unknown", "whether it runs cannot be told here: its disk has no locks"
    if is_held:
        seconds = None if last is None else _seconds(last)
        if last is None or seconds is None:
            return "running", "running"
        ago = datetime.timedelta(seconds=round(max(time_now - seconds, 0.0)))
        what = "last tile" if last["event"] == "tile" else f"before the first tile, {last['event']}"
        return "running", f"running, {what} {ago} ago"
    if last is not None and last["event"] == "stopped":
        by = f" by {last['by']}" if last.get("by") in ("SIGTERM", "Ctrl-C") else ""
        return "stopped", f"stopped{by} at {last['time']}: run again to resume"
    if last is not None and last["event"] == "finished":
        return "stopped", f"the tiles that were asked for are there since {last['time']}: run again for the others"
    at = f" after {last['time']}" if last is not None else ""
    return "killed", f"killed{at}: run again to resume"
