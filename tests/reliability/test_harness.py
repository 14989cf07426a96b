"""The harness is alive: with any one safeguard taken out, a test of this folder fails."""

import hashlib
import os
import signal
import time

import pytest

from cspr_jax.errors import RefusedError
from cspr_jax.store import documents, folder, shards
from cspr_jax.store.files import checksum, publishing
from cspr_jax.store.files.disk import Disk
from cspr_jax.sweep import engine
from reliability import support, test_crashes, test_damage
from reliability.support import content, go, sweep_of


@pytest.fixture
def job(tmp_path_factory):
    return test_crashes.make_job(tmp_path_factory.mktemp("job"), 2, ["arcs", "margin"])


def without_sync(monkeypatch):
    for kind in (Disk, support.FaultyDisk):
        monkeypatch.setattr(kind, "sync", lambda self, file: None)


def without_folder_sync(monkeypatch):
    for kind in (Disk, support.FaultyDisk):
        monkeypatch.setattr(kind, "sync_folder", lambda self, path: None)


def without_replace(monkeypatch):
    """Files are written where they shall stand."""
    monkeypatch.setattr(publishing, "part_of", lambda path: path)
    monkeypatch.setattr(Disk, "create", lambda self, path, mode=0o644: os.open(path, os.O_RDWR | os.O_CREAT, mode))
    for kind in (Disk, support.FaultyDisk):
        monkeypatch.setattr(kind, "replace", lambda self, part, path: None)


@pytest.mark.parametrize("mutation", [without_sync, without_folder_sync])
def test_without_flushing(job, tmp_path, monkeypatch, mutation):
    mutation(monkeypatch)
    with pytest.raises((AssertionError, ValueError)):
        test_crashes.test_the_order_of_calls(job, tmp_path)


def test_power_loss_shows_it_too(job, tmp_path, monkeypatch):
    without_sync(monkeypatch)
    sweep, reference, _ = job
    disk = support.FaultyDisk()
    go(sweep, tmp_path / "whole", disk=disk)
    with pytest.raises((AssertionError, checksum.DamagedError)):
        test_crashes.every_crash((sweep, reference, disk.count), tmp_path, lambda k: ["power"])


def test_without_renaming(job, tmp_path, monkeypatch):
    without_replace(monkeypatch)
    with pytest.raises((AssertionError, checksum.DamagedError)):
        test_crashes.every_crash(job, tmp_path, lambda k: test_crashes.CRASHES)


def test_without_checksums(tmp_path, monkeypatch):
    """Neither the seal nor the content is compared."""
    sweep = sweep_of(tmp_path, tiles=4)
    go(sweep, tmp_path / "run")
    finished = sweep, tmp_path / "run", content(tmp_path / "run")
    monkeypatch.setattr(shards.Shard, "digest", property(lambda self: Anything()))
    monkeypatch.setattr(checksum, "_check", lambda line, digest: None)
    with pytest.raises((AssertionError, TypeError, ValueError)):
        test_damage.test_flipped_bits(finished, tmp_path / "copy")


class Anything(str):
    """Equal to everything."""

    __hash__ = str.__hash__

    def __eq__(self, other):
        return True

    def __ne__(self, other):
        return False


@pytest.mark.soak
def test_without_the_record_s_checksum(tmp_path, monkeypatch):
    sweep = sweep_of(tmp_path, tiles=4)
    go(sweep, tmp_path / "run")
    finished = sweep, tmp_path / "run", content(tmp_path / "run")
    monkeypatch.setattr(documents, "digest", lambda value: Anything(hashlib.sha256(b"").hexdigest()))
    with pytest.raises((AssertionError, RefusedError)):
        # Most flips in the record break its schema, too.
        test_damage.check_flips(test_damage.flips(finished, tmp_path / "copy", 300), 300)


def test_without_verifying_on_resume(tmp_path, monkeypatch):
    """A tile that is there counts as done."""
    sweep = sweep_of(tmp_path, tiles=4)
    go(sweep, tmp_path / "run")
    finished = sweep, tmp_path / "run", content(tmp_path / "run")
    monkeypatch.setattr(
        engine.Run, "_verified", lambda self, e: [int(p.stem) for p in self._folder.shards.glob("0*.h5")]
    )
    with pytest.raises(Exception, match="changed"):
        test_damage.test_flipped_bits(finished, tmp_path / "copy")


def test_without_the_lock(tmp_path, monkeypatch):
    """Two runs in one directory, one inside the other's tiles: the lock is what refuses the second."""
    sweep = sweep_of(tmp_path, tiles=4)

    class Nested(support.Paper):
        def tiles(self, indices, stop):
            for computed in super().tiles(indices, stop):
                if len(self.computed) == 2:
                    go(sweep, tmp_path / "run")
                yield computed

    with pytest.raises(RefusedError, match="is being written"):
        go(sweep, tmp_path / "run", paper=Nested(sweep))
    monkeypatch.setattr(folder.fcntl, "flock", lambda file, how: None)
    go(sweep, tmp_path / "run", paper=Nested(sweep))  # nobody refuses


def test_without_the_flag_a_signal_would_raise():
    """The handler sets a flag and raises nothing; a second signal would end the process."""
    from cspr_jax.sweep.signals import stop_signals

    with stop_signals() as stop:
        assert not stop
        signal.raise_signal(signal.SIGTERM)
        until = time.monotonic() + 10.0
        while not stop and time.monotonic() < until:  # a thread of its own looks
            time.sleep(0.01)
        assert stop and stop.code == 143
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
