"""Any sequence of runs, crashes, damage, changes and prunings: what is finished is right, what is right is kept."""

import contextlib
import shutil
import tempfile
from pathlib import Path

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule, run_state_machine_as_test
from support.reading import read_here

from cspr_jax.errors import RefusedError, StoppedError, StoreError
from cspr_jax.sweep.inspection import status, verify
from reliability.support import (
    ENVIRONMENT,
    Crash,
    FaultyDisk,
    Paper,
    content,
    go,
    sweep_of,
)

TILES = 4


class RunDirectory(RuleBasedStateMachine):
    """A run directory and what people, disks and processes do to it."""

    folder: Path
    sweep = None
    reference: dict[str, bytes]

    def __init__(self):
        super().__init__()
        self.home = Path(tempfile.mkdtemp(dir=RunDirectory.folder))
        self.directory = self.home / "run"
        self.damaged: set[str] = set()

    def teardown(self):
        shutil.rmtree(self.home)

    def shards(self):
        return sorted((self.directory / "shards").glob("0*.h5"))

    def whole(self):
        """Shards that nobody has damaged."""
        return {path.name for path in self.shards() if path.name not in self.damaged}

    def complete(self):
        """Whether the result is there and nobody has damaged it."""
        return (self.directory / "small.h5").exists() and "small.h5" not in self.damaged

    def run(self, **keywords):
        paper, before = Paper(self.sweep), self.whole()
        complete = self.complete()
        outcome = go(self.sweep, self.directory, paper=paper, **keywords)
        names = {f"{index:05d}.h5" for index in paper.computed}
        assert not names & before, "a whole shard was computed again"
        assert not (complete and names), "a finished result was computed again"
        assert outcome.result.read_bytes() == self.reference["small.h5"]
        if not complete:  # a finished result is left alone, and its shards with it
            self.damaged.clear()
        self.damaged.discard("small.h5")

    @rule()
    def run_to_the_end(self):
        self.run()

    @rule()
    def run_and_prune(self):
        self.run(prune=True)
        assert self.shards() == []
        self.damaged.clear()

    @rule(count=st.integers(0, TILES))
    def stop_after(self, count):
        damaged = set(self.damaged)
        try:
            go(self.sweep, self.directory, paper=Paper(self.sweep, stop_after=count))
            self.damaged.clear() if "small.h5" in damaged else None
            self.damaged.discard("small.h5")
        except StoppedError:
            self.forget()

    @rule(k=st.integers(1, 90), mode=st.sampled_from(["before", "half", "after", "power", "ENOSPC", "EIO"]))
    def run_on_a_failing_disk(self, k, mode):
        with contextlib.suppress(Crash, StoreError):
            go(self.sweep, self.directory, disk=FaultyDisk(k, mode))
        self.forget()

    def forget(self):
        """What was damaged may have been set aside and made again: ask the shards themselves."""
        self.damaged = {
            name
            for name in self.damaged
            if (path := self.find(name)).exists()
            and self.reference.get(str(path.relative_to(self.directory))) != path.read_bytes()
        }

    def find(self, name):
        return self.directory / name if name == "small.h5" else self.directory / "shards" / name

    @precondition(lambda self: self.shards())
    @rule(data=st.data(), bit=st.integers(0, 10**6))
    def flip_a_shard(self, data, bit):
        path = data.draw(st.sampled_from(self.shards()))
        content = bytearray(path.read_bytes() or b"x")
        content[bit // 8 % len(content)] ^= 1 << bit % 8
        path.write_bytes(content)
        self.damaged.add(path.name)
        self.forget()  # a second flip can undo the first

    @precondition(lambda self: self.shards())
    @rule(data=st.data(), part=st.floats(0.0, 0.99))
    def cut_a_shard(self, data, part):
        path = data.draw(st.sampled_from(self.shards()))
        path.write_bytes(path.read_bytes()[: int(part * path.stat().st_size)])
        self.damaged.add(path.name)

    @precondition(lambda self: self.shards())
    @rule(data=st.data())
    def remove_a_shard(self, data):
        path = data.draw(st.sampled_from(self.shards()))
        path.unlink()
        self.damaged.discard(path.name)

    @precondition(lambda self: (self.directory / "small.h5").exists())
    @rule()
    def spoil_the_result(self):
        (self.directory / "small.h5").write_bytes(b"\0" * 1000)
        self.damaged.add("small.h5")

    @precondition(lambda self: (self.directory / "run.json").exists())
    @rule()
    def spoil_the_record(self):
        (self.directory / "run.json").chmod(0o644)
        (self.directory / "run.json").write_text('{"identity": "x"}')

    @precondition(lambda self: (self.directory / "shards").is_dir())
    @rule()
    def leave_an_unfinished_file(self):
        (self.directory / "shards" / ".00001.h5.4.part").write_bytes(b"half")

    @precondition(lambda self: self.whole() or self.complete())
    @rule()
    def another_sweep_or_environment(self):
        before = content(self.directory)
        other = sweep_of(self.home / "other", tiles=TILES, trajectory="max_arcs = 9")
        try:
            go(other, self.directory)
            raise AssertionError("another sweep was let in")
        except RefusedError:
            pass
        try:
            go(self.sweep, self.directory, paper=Paper(self.sweep, ENVIRONMENT | {"jax": "9"}))
            assert self.complete()
        except RefusedError:
            assert content(self.directory) == before
        else:
            self.forget()

    @precondition(lambda self: (self.directory / "run.json").exists())
    @rule()
    def look(self):
        before = content(self.directory)
        try:
            assert status(self.directory)["tiles"] == TILES
            faults = len(verify(self.directory)["faults"])
            assert faults == len({name for name in self.damaged if self.find(name).exists()})
        except StoreError:  # a damaged record
            pass
        assert content(self.directory) == before

    @invariant()
    def nothing_wrong_stands_under_a_final_name(self):
        if self.damaged or not self.directory.exists():
            return
        found = {k: v for k, v in content(self.directory).items() if not k.startswith("quarantine")}
        for name, data in found.items():
            assert name.endswith(".part") or data == self.reference[name], name


@pytest.fixture(autouse=True)
def read_in_this_process(monkeypatch):
    """How files are read is what test_isolation.py is about."""
    read_here(monkeypatch)


def check(tmp_path_factory, examples, steps):
    folder = tmp_path_factory.mktemp("model")
    sweep = sweep_of(folder, tiles=TILES)
    go(sweep, folder / "reference")
    RunDirectory.folder, RunDirectory.sweep = folder, sweep
    RunDirectory.reference = content(folder / "reference")
    run_state_machine_as_test(
        RunDirectory, settings=settings(max_examples=examples, stateful_step_count=steps, print_blob=True)
    )


def test_any_sequence(tmp_path_factory):
    check(tmp_path_factory, 6, 12)


@pytest.mark.soak
def test_any_sequence_all(tmp_path_factory):
    check(tmp_path_factory, 200, 30)
