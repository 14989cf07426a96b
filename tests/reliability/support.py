"""A sweep whose cells are plain NumPy, disks that fail, and what a run directory must be after a crash."""

import contextlib
import dataclasses
import errno
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from cspr_jax.schema.identity import digest
from cspr_jax.store.documents import read_record
from cspr_jax.store.files.disk import Disk
from cspr_jax.store.shards import Shard
from cspr_jax.sweep.definition import Sweep, read_sweep
from cspr_jax.sweep.engine import Hooks, Options, Run, RunSummary
from cspr_jax.sweep.signals import Stop
from cspr_jax.sweep.work import Computed

ENVIRONMENT = {"package": "0" * 64, "jax": "0.0", "cpu_model": "paper"}
SWEEP = """schema = 1
map = "minimum-arcs"
robot = "prototype"
[axes]
x = {x}
y = [0.1, 0.2, 0.3]
z = [1.0, 1.5]
z0 = [1.7]
[trajectory]
from = {{ rest = true }}
{trajectory}
[run]
tile = [1, 3, 1, 1]
store = {store}
{run}
"""
STORE = ["arcs", "verdict", "margin", "duration"]


def sweep_of(folder: Path, *, tiles: int = 12, trajectory: str = "", run: str = "", store=STORE) -> Sweep:
    """A sweep of an even number of tiles of three cells, its file in the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "small.toml"
    x = json.dumps([0.1 * i for i in range(tiles // 2)])
    path.write_text(SWEEP.format(x=x, trajectory=trajectory, run=run, store=json.dumps(store)))
    return read_sweep(path)


def values_of(sweep: Sweep, index: int) -> dict[str, np.ndarray]:
    """What a tile holds: numbers that follow from its index and the sweep."""
    rng = np.random.default_rng([index, int(sweep.identity[:8], 16)])
    shape = sweep.grid.tiling.extent(index)
    kind = sweep.spec.run.dtype
    found = {
        "arcs": rng.integers(0, 30, shape).astype(np.int16),
        "verdict": rng.integers(0, 500, shape).astype(np.uint32),
        "margin": rng.normal(size=shape).astype(kind),
        "duration": rng.uniform(1.0, 9.0, shape).astype(kind),
    }
    return {name: found[name] for name in sweep.store}


@dataclasses.dataclass
class Paper:
    """Computes tiles without jax. `order` turns the indices round; `stop_after` asks to stop after so many."""

    sweep: Sweep
    known: dict = dataclasses.field(default_factory=lambda: dict(ENVIRONMENT))
    backwards: bool = False
    stop_after: int | None = None
    computed: list[int] = dataclasses.field(default_factory=list)

    def environment(self) -> dict:
        return dict(self.known)

    def tiles(self, indices, stop: Stop) -> Iterator[Computed]:
        for index in list(indices)[:: -1 if self.backwards else 1]:
            if self.stop_after is not None and len(self.computed) >= self.stop_after:
                stop.ask(2)
            if stop:
                return
            self.computed.append(index)
            yield Computed(Shard(index, digest(self.known), 0, values_of(self.sweep, index)), dict(self.known))


def go(
    sweep: Sweep, directory: Path, *, disk: Disk | None = None, paper: Paper | None = None, **options: bool
) -> RunSummary:
    """Run to the end, as the command line does; raises what a run raises."""
    acknowledged: list[int] = []
    run = Run(sweep, directory, Options(**options), Hooks(on_tile=lambda done, total: acknowledged.append(done)), disk)
    path = run.finished()
    if path is not None:
        return RunSummary(path, 0, len(sweep.grid.tiling))
    return run.go(paper or Paper(sweep))


class Crash(BaseException):
    """The machine is off."""


FAULTS = {
    "ENOSPC": OSError(errno.ENOSPC, "No space left on device"),
    "EIO": OSError(errno.EIO, "Input/output error"),
    "EROFS": OSError(errno.EROFS, "Read-only file system"),
    "EDQUOT": OSError(errno.EDQUOT, "Disk quota exceeded"),
    "EINTR": InterruptedError(errno.EINTR, "Interrupted system call"),
}
CALLS = ("create", "write", "truncate", "sync", "replace", "sync_folder", "unlink", "make_folder", "append")


class FaultyDisk(Disk):
    """A disk on which call number `at` goes wrong.

    mode: "before", "after" or "half" (of a write): the machine is off from then on; "power": off after the
    call, and what was not flushed is gone; a name of FAULTS: that call fails, or all from it on if `lasting`;
    "short": that write writes one byte less than it should, and says so.
    """

    def __init__(self, at: int | None = None, mode: str = "after", *, lasting: bool = False) -> None:
        self.at, self.mode, self.lasting = at, mode, lasting
        self.count, self.off, self.log = 0, False, []
        self._files: dict[int, Path] = {}
        self._unflushed: dict[Path, int] = {}
        self._renamed: dict[Path, tuple[Path, bytes | None]] = {}

    def _call(self, name: str, *arguments):
        if self.off:
            raise Crash
        self.count += 1
        self.log.append((name, *arguments))
        hit = self.at is not None and (self.count == self.at or (self.lasting and self.count > self.at))
        if not hit:
            return self._done(name, *arguments)
        if self.mode in FAULTS:
            raise FAULTS[self.mode]
        if self.mode == "short":
            if name == "write" and len(arguments[1]) > 1:
                return self._done(name, arguments[0], arguments[1][:-1], arguments[2])
            return self._done(name, *arguments)
        self.off = True
        if self.mode == "half" and name == "write":
            self._done(name, arguments[0], arguments[1][: len(arguments[1]) // 2], arguments[2])
        if self.mode in ("after", "power"):
            self._done(name, *arguments)
        if self.mode == "power":
            self._lose()
        raise Crash

    def _done(self, name: str, *arguments):
        if name == "replace":
            part, path = arguments
            old = path.read_bytes() if path.is_file() else None
            self._renamed[path] = (part, old)
        # Flushing is what `_lose` pretends; the real disk need not.
        found = None if name in ("sync", "sync_folder") else getattr(super(), name)(*arguments)
        if name == "create":
            self._files[found] = arguments[0]
            self._unflushed[arguments[0]] = 1
        elif name in ("write", "truncate"):
            self._unflushed[self._files[arguments[0]]] = 1
        elif name == "sync":
            self._unflushed.pop(self._files[arguments[0]], None)
        elif name == "replace":
            if arguments[0] in self._unflushed:
                self._unflushed[arguments[1]] = self._unflushed.pop(arguments[0])
        elif name == "sync_folder":
            self._renamed = {path: how for path, how in self._renamed.items() if path.parent != arguments[0]}
        return found

    def _lose(self) -> None:
        # Data that were not flushed are gone; names that were not flushed are the old ones.
        for path in self._unflushed:
            with contextlib.suppress(FileNotFoundError):
                path.write_bytes(b"")
        for path, (part, old) in self._renamed.items():
            if path.is_file():
                part.write_bytes(path.read_bytes())
                path.unlink() if old is None else path.write_bytes(old)


def _forward(name: str):
    def method(self, *arguments, **keywords):
        return self._call(name, *arguments, *keywords.values())

    return method


for _name in CALLS:
    setattr(FaultyDisk, _name, _forward(_name))


def content(directory: Path) -> dict[str, bytes]:
    """Every file below a directory but those that may differ between equal runs."""
    found = {str(p.relative_to(directory)): p.read_bytes() for p in directory.rglob("*") if p.is_file()}
    return {name: data for name, data in found.items() if name not in ("log.jsonl", "LOCK", "run.json")}


def check_prefix(directory: Path, reference: dict[str, bytes]) -> None:
    """After a crash: only what an uninterrupted run has at some moment, and unfinished files under other names."""
    if not directory.exists():
        return
    for name, data in content(directory).items():
        if not name.endswith(".part"):
            assert reference.get(name) == data, name
    if (directory / "run.json").exists():
        read_record(directory / "run.json")


def check_same(directory: Path, reference: dict[str, bytes]) -> None:
    """After the end: byte by byte what an uninterrupted run leaves, and nothing else."""
    found = content(directory)
    assert found.keys() == reference.keys()
    assert [name for name in found if found[name] != reference[name]] == []
