"""The directory of a run, which is its own manifest: a tile is done if its shard is there and verifies."""

import contextlib
import fcntl
import json
import os
import re
import socket
import stat
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from cspr_jax.errors import RefusedError, StoreError, printable
from cspr_jax.store.files.disk import Disk, check_plain, open_plain
from cspr_jax.store.files.publishing import PART, make_folders, refusal

_SHARD = re.compile(r"(\d{5,})\.h5")
# Content of a lock, which names its holder; a new one is empty.
_HOLDER = re.compile(rb"(?:process \d+ on [^\n]*\n)?")
_NO_LOCKS = (
    "network disks and FUSE may have no locks: choose -o on another disk; other programs read a result that is copied "
    "here with HDF5_USE_FILE_LOCKING=FALSE"
)


class RunFolder:
    """Names, lock and cleaning of a run directory.

    Args:
        name: name of the sweep; its result is `name`.h5.
    """

    def __init__(self, path: Path, name: str, disk: Disk) -> None:
        """Keep the names, without any access to the disk."""
        self.path, self.disk = path, disk
        self.result = path / f"{name}.h5"
        self.record = path / "run.json"
        self.shards = path / "shards"
        self.quarantine = path / "quarantine"
        self.log = path / "log.jsonl"
        self.lock = path / "LOCK"
        self._held: os.stat_result | None = None

    def shard(self, index: int) -> Path:
        """Path of the shard of a tile."""
        return self.shards / f"{index:05d}.h5"

    def shard_names(self) -> dict[Path, int]:
        """Paths of the shards that exist, with the indices of their tiles; other files are ignored."""
        matches = {path: _SHARD.fullmatch(path.name) for path in sorted(self.shards.glob("*"))}
        return {path: int(match[1]) for path, match in matches.items() if match}

    def make(self) -> None:
        """Make the directory and its parents."""
        make_folders(self.disk, self.path)

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Hold the lock of the directory, which becomes free as soon as its holder dies."""
        path = self.lock
        try:
            check_plain(self.log)
        except OSError as error:
            raise refusal(self.log, error) from error
        try:
            file = open_plain(path, os.O_RDWR)
        except OSError as error:
            raise refusal(path, error) from error
        try:
            try:
                _lock(file)
            except BlockingIOError as error:
                holder = os.pread(file, 200, 0).decode("utf-8", "replace").strip() or "another process"
                line = f"{self.path}: is being written by {holder}; wait for it or stop it"
                raise RefusedError(printable(line)) from error
            except OSError as error:
                raise StoreError(printable(f"{path}: cannot be locked: {error.strerror}: {_NO_LOCKS}")) from error
            if not _HOLDER.fullmatch(os.pread(file, 400, 0)):
                raise RefusedError(f"{path}: is somebody's file, not a lock of cspr: choose another -o")
            with contextlib.suppress(OSError):  # this only serves error messages of other processes
                os.ftruncate(file, 0)
                os.pwrite(file, f"process {os.getpid()} on {socket.gethostname()}\n".encode(), 0)
            self._held = os.fstat(file)
            self.check_held()
            yield
        finally:
            self._held = None
            os.close(file)

    def is_held(self) -> bool | None:
        """Tell whether a process holds the lock, without writing anything."""
        try:
            file = os.open(self.lock, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_NOCTTY)
        except FileNotFoundError:
            return False
        except OSError:
            return None
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
        except OSError:
            return None
        finally:
            os.close(file)
        return False

    def check_held(self) -> None:
        """Refuse to continue writing if this process has lost the lock, or a folder of the run is now a link."""
        for folder in (self.shards, self.quarantine):
            if folder.is_symlink():
                raise RefusedError(printable(f"{folder}: is a link: must be a folder of the run: choose another -o"))
        try:
            there = os.lstat(self.lock)
        except FileNotFoundError:
            if not self.path.is_dir():
                return  # then nothing can be written there either
            there = None
        except OSError as error:
            raise refusal(self.lock, error) from error
        if there is None or self._held is None or not os.path.samestat(there, self._held):
            raise RefusedError(
                printable(f"{self.lock}: was removed or replaced, so that another process may write here: run it again")
            )

    def leftovers(self) -> list[Path]:
        """Files that processes began to write and did not finish."""
        pattern = re.compile(rf"\.(?:run\.json|{re.escape(self.result.name)}|\d{{5,}}\.h5){PART}")
        parts = [part for folder in (self.path, self.shards) for part in sorted(folder.glob(".*.part"))]
        return [part for part in parts if pattern.fullmatch(part.name) and _is_file(part)]

    def remove_leftovers(self) -> None:
        """Remove files that dead processes left unfinished; the caller must hold the lock."""
        self.check_held()
        for part in self.leftovers():
            try:
                self.disk.unlink(part)
            except OSError as error:
                raise refusal(part, error) from error

    def set_aside(self, path: Path) -> Path:
        """Move a damaged file into quarantine/, where the program never deletes anything."""
        self.check_held()
        make_folders(self.disk, self.quarantine)
        number = 0
        while os.path.lexists(target := self.quarantine / f"{path.name}.{number}"):
            number += 1
        try:
            self.disk.replace(path, target)
            self.disk.sync_folder(path.parent)
            self.disk.sync_folder(self.quarantine)
        except OSError as error:
            raise refusal(target, error) from error
        return target

    def note(self, event: str, **fields: Any) -> None:
        """Add a line to log.jsonl, which is for information only."""
        time_stamp = time.strftime("%Y-%m-%dT%H:%M:%S%z", time.localtime())
        seconds = round(time.time(), 3)
        line = json.dumps({"time": time_stamp, "event": event, "pid": os.getpid(), "seconds": seconds, **fields})
        try:
            self.disk.append(self.log, (line + "\n").encode())
        except OSError as error:
            raise refusal(self.log, error) from error


def _lock(file: int) -> None:
    # Try again: a process that only tests the lock holds it for a moment.
    for _ in range(5):
        with contextlib.suppress(BlockingIOError):
            return fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        time.sleep(0.02)
    return fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _is_file(path: Path) -> bool:
    try:
        return stat.S_ISREG(os.lstat(path).st_mode)
    except OSError:
        return False
