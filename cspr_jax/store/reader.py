"""Work of the process that reads one file for another one: see `store.isolated`."""

import dataclasses
import json
import math
import os
import resource
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any, BinaryIO

import h5py

from cspr_jax.errors import StoreError
from cspr_jax.schema.motion_quantities import FLIGHT, SEGMENTS, TRAJECTORY
from cspr_jax.schema.quantities import AXES, QUANTITIES, register
from cspr_jax.schema.quantity import Quantity
from cspr_jax.store import guard
from cspr_jax.store.consolidation import content_of
from cspr_jax.store.netcdf import UNREADABLE, reason
from cspr_jax.store.seal import DamagedError

# The file is this process's standard input.
FILE = Path("/dev/fd/0")
# A result is read into memory as a whole; one byte of a file that is more than noise stands for a few of its data.
LARGEST_DATA, DENSEST = 8e9, 50
# Seconds of the processor to find out what a file holds; those that reading it takes on slow machines.
_LOOK, _PER_BYTE, _PER_CHUNK = 1.0, 1.0 / 25e6, 1e-4
_MEMORY = 256 << 20
# Names of parts of vectors, for other programs.
_MARKS = (b"axis", b"cable", b"component", b"each", b"couple", b"bound", b"level")
_LONG = ("settings", "environment_settings", "plan", "robot_settings")
_TEXTS = (
    *("Conventions", "title", "map", "identity", "z_axis", "robot", "software", "environment", "environments"),
    *("content_sha256", "family"),
)
_INTEGERS, _NUMBERS = ("schema", "cells_near_zero", "mixed", "feasible"), ("mass", "z0", "proved")


def serve() -> None:
    """Answer with what the file on standard input holds: what was found as JSON, then each array behind an answer.

    The words of the command: what is asked for, two folders of `store.isolated`, and the quantities that the process
    that asks has registered.
    """
    for row in json.loads(sys.argv[4]):
        register(Quantity(**row))
    out = os.fdopen(os.dup(1), "wb")
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    _grant(_LOOK, 0)
    try:
        (_result if sys.argv[1] == "result" else _content)(out)
    except MemoryError:
        _answer(out, {"refused": "it needs more memory than its size explains"})
    except (DamagedError, StoreError, *UNREADABLE) as error:
        _answer(out, {"refused": reason(error)})


def _result(out: BinaryIO) -> None:
    with h5py.File(FILE, "r") as file:
        attributes = _attributes(file)
        tables = (AXES, QUANTITIES) if "map" in attributes else (TRAJECTORY, SEGMENTS, FLIGHT)
        datasets = guard.datasets(file, [name for table in tables for name in table])
        marks = [name for name in _MARKS if "map" not in attributes and file.id.links.exists(name)]
        guard.refuse_others(file, len(datasets) + len(marks), len(attributes))
        guard.refuse_dense(datasets.values(), FILE.stat().st_size, densest=DENSEST)
        total = sum(one.size for one in datasets.values())
        if total > LARGEST_DATA:
            raise DamagedError(f"it holds {total / 1e9:.3g} GB of data: must be at most {LARGEST_DATA / 1e9:.3g} GB")
        arrays = [[name, one.dtype, one.shape] for name, one in datasets.items()]
        _answer(out, {"attributes": attributes, "arrays": arrays})
        _grant_for(datasets.values())
        for one in datasets.values():
            values = one.values()
            _answer(out, {})  # it could be read
            if one.size:
                out.write(values.reshape(-1).data.cast("B"))
        out.flush()


def _content(out: BinaryIO) -> None:
    with h5py.File(FILE, "r") as file:
        motion = guard.text(file, "map") is None
    if motion:
        _answer(out, {"motion": True})
        return

    def go_on(datasets: Iterable[guard.Found]) -> None:
        _answer(out, {})  # what takes long begins
        _grant_for(datasets)

    _answer(out, {"content": dataclasses.asdict(content_of(FILE, go_on))})


def _attributes(file: h5py.File) -> dict[str, Any]:
    # Those that this program writes; whatever else there is stays where it is.
    attributes: dict[str, Any] = {name: guard.text(file, name) for name in _LONG}
    attributes |= {name: guard.text(file, name, largest=1 << 16) for name in _TEXTS}
    for names, dtype in ((_INTEGERS, "int64"), (_NUMBERS, "float64")):
        for name in names:
            value = guard.numbers(file, name, dtype)
            attributes[name] = None if value is None else value.item()
    points = guard.numbers(file, "base_points", "float64", (None, 3))
    attributes["base_points"] = None if points is None else points.tolist()
    return {name: value for name, value in attributes.items() if value is not None}


def _answer(out: BinaryIO, answer: dict[str, Any]) -> None:
    data = json.dumps(answer).encode()
    out.write(len(data).to_bytes(8, "little") + data)
    out.flush()


def _grant_for(datasets: Iterable[guard.Found]) -> None:
    every = list(datasets)
    seconds = sum(one.size * _PER_BYTE + one.chunks * _PER_CHUNK for one in every)
    _grant(_LOOK + seconds, 2 * max((one.size for one in every), default=0))


def _grant(seconds: float, memory: int) -> None:
    # Time of the processor, not of the clock: a busy machine is no fault of the file.
    used = resource.getrusage(resource.RUSAGE_SELF)
    _limit(resource.RLIMIT_CPU, math.ceil(used.ru_utime + used.ru_stime + seconds))
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[0])
    except OSError:
        return  # only Linux says it, and only there does the limit work
    _limit(resource.RLIMIT_AS, pages * resource.getpagesize() + _MEMORY + memory)


def _limit(what: int, most: int) -> None:
    hard = resource.getrlimit(what)[1]
    resource.setrlimit(what, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))
