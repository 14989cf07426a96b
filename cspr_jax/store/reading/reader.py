"""Program of the process that reads files for another one; see `store.reading.isolated`."""

import contextlib
import dataclasses
import json
import math
import os
import resource
import socket
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any, BinaryIO

import h5py
import numpy as np
from h5py import h5a

from cspr_jax.errors import StoreError
from cspr_jax.schema.quantities import (
    AXES,
    FAILURES,
    FLIGHT,
    PATHS,
    QUANTITIES,
    SEGMENTS,
    TRAJECTORY,
    Quantity,
    is_parameter,
    register,
)
from cspr_jax.store.consolidation import content_of
from cspr_jax.store.documents import plain_json
from cspr_jax.store.files import guard
from cspr_jax.store.files.checksum import NO_TRAILER, DamagedError
from cspr_jax.store.files.netcdf import UNREADABLE, reason
from cspr_jax.store.shards import Layout, decode, header_of

# Largest size of a result, bytes, all of which is read into memory, and largest number of bytes of data per byte of a
# file: usually a few, but many if all are equal.
LARGEST_DATA, DENSEST = 8e9, 50
# Processor time, s, for inspecting a file, and for reading each byte and each chunk, on a slow machine.
_INSPECTION_SECONDS = 1.0
_PER_BYTE = 1.0 / 25e6
_PER_CHUNK = 1e-4
_MEMORY = 256 << 20
# Datasets with names of parts of vectors, which serve other programs.
_PART_NAMES = (b"axis", b"cable", b"component", b"each", b"couple", b"bound", b"level", b"edge", b"speed")
# Attribute that libraries for netCDF add to their files.
_OF_NETCDF = b"_NCProperties"
_LONG = ("settings", "environment_settings", "plan", "robot_settings")
_TEXTS = (
    *("Conventions", "title", "map", "identity", "z_axis", "robot", "software", "environment", "environments"),
    *("content_sha256", "family", "point"),
)
_INTEGERS, _NUMBERS = ("schema", "cells_near_zero", "mixed", "feasible"), ("mass", "z0", "proved")


def serve() -> None:
    """Serve requests about one file after the other, until there are no more.

    Standard input is a socket: each request arrives with an open file, and results are sent as JSON and arrays. The
    arguments of the command are two folders of `store.reading.isolated`, and the quantities that the parent process has
    registered.
    """
    for quantity in json.loads(sys.argv[3]):
        register(Quantity(**quantity))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    channel = socket.socket(fileno=0)
    out = channel.makefile("wb")
    _tell(out, {})  # the process is ready
    while (request := _next(channel)) is not None:
        words, file = request
        _grant(_INSPECTION_SECONDS, 0)
        answer(Path(f"/dev/fd/{file}"), words, out)
        os.close(file)


def answer(file: Path, words: dict[str, Any], out: BinaryIO) -> None:
    """Serve one request."""
    try:
        _ANSWERS[words["what"]](file, words, out)
    except MemoryError:
        if _Limits.are_foreign:
            _tell(out, {"failed": "too little memory to read a file: raise the limit (ulimit -v)"})
        else:
            _tell(out, {"refused": "it needs more memory than its size explains"})
    except (DamagedError, StoreError, *UNREADABLE) as error:
        _tell(out, {"refused": reason(error)})


def _next(channel: socket.socket) -> tuple[dict[str, Any], int] | None:
    data, files, _, _ = socket.recv_fds(channel, 8, 1)
    if not data:
        return None
    length = int.from_bytes(data + _exactly(channel, 8 - len(data)), "little")
    return json.loads(_exactly(channel, length)), files[0]


def _exactly(channel: socket.socket, count: int) -> bytes:
    data = b""
    while len(data) < count:
        part = channel.recv(count - len(data))
        if not part:
            raise EOFError
        data += part
    return data


def _check_netcdf(path: Path) -> None:
    # Files of other programs, and incomplete files of this program, have no trailer.
    with contextlib.suppress(*UNREADABLE), h5py.File(path, "r") as file:
        if h5a.exists(file.id, _OF_NETCDF):
            return
    raise DamagedError(NO_TRAILER)


def _dimensions(data: h5py.Dataset) -> list[str]:
    # Axes are dimension scales, and have no scales themselves.
    if data.is_scale:
        return [Path(data.name).name]
    return [Path(dimension[0].name).name for dimension in data.dims if len(dimension)]


def _parameters(attributes: dict[str, Any]) -> list[str]:
    # Axes of a map that are parameters of its robot, which its settings name.
    try:
        order = plain_json(str(attributes.get("settings"))).get("dimensions", ())
    except (DamagedError, AttributeError):
        return []
    return [name for name in order if is_parameter(name)][: guard.LARGEST_RANK] if isinstance(order, list) else []


def _result(path: Path, words: dict[str, Any], out: BinaryIO) -> None:
    if not words["has_trailer"]:
        _check_netcdf(path)
    with h5py.File(path, "r") as file:
        attributes = _attributes(file)
        tables = (AXES, QUANTITIES) if "map" in attributes else (TRAJECTORY, SEGMENTS, FLIGHT, FAILURES, PATHS)
        is_joined = not words["has_trailer"]
        if is_joined and not {"map", "settings"} <= attributes.keys():
            raise DamagedError("a joined map must keep the attributes of one of them: combine_attrs='override'")
        parameters = _parameters(attributes) if "map" in attributes else []
        names = [*(name for table in tables for name in table), *parameters]
        datasets = guard.datasets(file, names, is_joined=is_joined)
        names_of_parts = [name for name in _PART_NAMES if "map" not in attributes and file.id.links.exists(name)]
        if not is_joined:
            guard.refuse_others(file, len(datasets) + len(names_of_parts), len(attributes))
        guard.refuse_dense(datasets.values(), path.stat().st_size, densest=DENSEST)
        total = sum(one.memory_bytes for one in datasets.values())
        if total > LARGEST_DATA:
            raise DamagedError(f"it holds {total / 1e9:.3g} GB of data: must be at most {LARGEST_DATA / 1e9:.3g} GB")
        arrays = [[name, one.dtype, one.shape] for name, one in datasets.items()]
        dimensions = {name: _dimensions(file[name]) for name in datasets} if is_joined else None
        _tell(out, {"attributes": attributes, "arrays": arrays, "dimensions": dimensions})
        _grant_for(datasets.values())
        for one in datasets.values():
            values = one.values()
            _tell(out, {})  # the file could be read
            _send(out, values)
        out.flush()


def _content(path: Path, words: dict[str, Any], out: BinaryIO) -> None:
    with h5py.File(path, "r") as file:
        motion = guard.text(file, "map") is None
    if motion:
        _tell(out, {"motion": True})
        return

    def go_on(datasets: Iterable[guard.ReadableDataset]) -> None:
        _tell(out, {})  # the slow part begins
        _grant_for(datasets)

    _tell(out, {"content": dataclasses.asdict(content_of(path, go_on))})


def _shard(path: Path, words: dict[str, Any], out: BinaryIO) -> None:
    shard = decode(path, Layout(**words["layout"]), words["index"], tuple(words["shape"]), _grant_for)
    plain = {field.name: getattr(shard, field.name) for field in dataclasses.fields(shard) if field.name != "values"}
    _tell(out, {"shard": plain, "arrays": [[name, array.dtype.name] for name, array in shard.values.items()]})
    for array in shard.values.values():
        _send(out, array)
    out.flush()


def _header(path: Path, words: dict[str, Any], out: BinaryIO) -> None:
    with h5py.File(path, "r") as file:
        _tell(out, {"header": header_of(file).model_dump()})


_ANSWERS = {"result": _result, "content": _content, "shard": _shard, "header": _header}


def _attributes(file: h5py.File) -> dict[str, Any]:
    # Read only attributes that this program writes.
    attributes: dict[str, Any] = {name: guard.text(file, name) for name in _LONG}
    attributes |= {name: guard.text(file, name, largest=1 << 16) for name in _TEXTS}
    for names, dtype in ((_INTEGERS, "int64"), (_NUMBERS, "float64")):
        for name in names:
            value = guard.numbers(file, name, dtype)
            attributes[name] = None if value is None else value.item()
    points = guard.numbers(file, "base_points", "float64", (None, 3))
    attributes["base_points"] = None if points is None else points.tolist()
    return {name: value for name, value in attributes.items() if value is not None}


def _tell(out: BinaryIO, answer: dict[str, Any]) -> None:
    data = json.dumps(answer).encode()
    out.write(len(data).to_bytes(8, "little") + data)
    out.flush()


def _send(out: BinaryIO, values: np.ndarray) -> None:
    if values.size:
        out.write(values.reshape(-1).data.cast("B"))


def _grant_for(datasets: Iterable[guard.ReadableDataset]) -> None:
    readable = list(datasets)
    seconds = sum(one.memory_bytes * _PER_BYTE + one.chunks * _PER_CHUNK for one in readable)
    _grant(_INSPECTION_SECONDS + seconds, 2 * max((one.memory_bytes for one in readable), default=0))


def _grant(seconds: float, memory: int) -> None:
    # Limit processor time instead of elapsed time, so that a busy machine does not make a file unreadable.
    used = resource.getrusage(resource.RUSAGE_SELF)
    _limit(resource.RLIMIT_CPU, math.ceil(used.ru_utime + used.ru_stime + seconds))
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[0])
    except OSError:
        return  # only Linux provides the number, and only there does the limit work
    _limit(resource.RLIMIT_AS, pages * resource.getpagesize() + _MEMORY + memory)


class _Limits:
    # True if the system's limits are lower than ours: a failure at those does not mean that the file is damaged.
    are_foreign = False


def _limit(what: int, maximum: int) -> None:
    hard = resource.getrlimit(what)[1]
    if hard != resource.RLIM_INFINITY and hard < maximum:
        maximum, _Limits.are_foreign = hard, True
    resource.setrlimit(what, (maximum, hard))
