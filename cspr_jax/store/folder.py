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

from cspr_jax.errors import RefusedError, StoreError
from cspr_jax.store.disk import Disk
from cspr_jax.store.publishing import make_folders, refusal

_SHARD = re.compile(r"(\d{5,})\.h5")
# What a lock says; empty when it is new.
_HOLDER = re.compile(rb"(?:process \d+ on [^\n]*\n)?")


class RunFolder:
    """Names and upkeep of a run directory.

    Args:
        path: the directory.
        name: of the sweep; its result is `name`.h5.
        disk: what to write with.
    """

    def __init__(self, path: Path, name: str, disk: Disk) -> None:
        """Nothing is touched yet."""
        self.path, self.disk = path, disk
        self.result = path / f"{name}.h5"
        self.record = path / "run.json"
        self.shards = path / "shards"
        self.quarantine = path / "quarantine"
        self.log = path / "log.jsonl"
        self.lock = path / "LOCK"

    def shard(self, index: int) -> Path:
        """Path of the shard of a tile.

        Args:
            index: of the tile.

        Returns:
            its path.
        """
        return self.shards / f"{index:05d}.h5"

    def shard_names(self) -> dict[Path, int]:
        """Names of shards that are present; other names in their folder are nobody's business.

        Returns:
            the index that each name says, sorted.
        """
        matches = {path: _SHARD.fullmatch(path.name) for path in sorted(self.shards.glob("*"))}
        return {path: int(match[1]) for path, match in matches.items() if match}

    def make(self) -> None:
        """Make the directory; its parents too.

        Raises:
            StoreError: the disk or a folder refuses.
        """
        make_folders(self.disk, self.path)

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Hold the lock of the directory; it is free as soon as its holder dies.

        Yields:
            nothing.

        Raises:
            RefusedError: another process holds it.
            StoreError: the disk or the folder refuses.
        """
        path = self.lock
        try:
            file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK, 0o644)
        except OSError as error:
            raise refusal(path, error) from error
        try:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                holder = os.pread(file, 200, 0).decode("utf-8", "replace").strip() or "another process"
                raise RefusedError(f"{self.path}: is being written by {holder}; wait for it or stop it") from error
            except OSError as error:
                raise StoreError(f"{path}: cannot be locked: {error.strerror}") from error
            if not stat.S_ISREG(os.fstat(file).st_mode) or not _HOLDER.fullmatch(os.pread(file, 400, 0)):
                raise RefusedError(f"{path}: is somebody's file, not a lock of cspr: choose another -o")
            with contextlib.suppress(OSError):  # it only serves the message of others
                os.ftruncate(file, 0)
                os.pwrite(file, f"process {os.getpid()} on {socket.gethostname()}\n".encode(), 0)
            yield
        finally:
            os.close(file)

    def sweep_leftovers(self) -> None:
        """Remove what dead processes left unfinished; only under the lock.

        Raises:
            StoreError: the disk or the folder refuses.
        """
        own = rf"\.(?:run\.json|{re.escape(self.result.name)}|\d{{5,}}\.h5)\.\d+\.part"
        for folder in (self.path, self.shards):
            for part in sorted(folder.glob(".*.part")):
                if not re.fullmatch(own, part.name) or not part.is_file():
                    continue
                try:
                    self.disk.unlink(part)
                except OSError as error:
                    raise refusal(part, error) from error

    def set_aside(self, path: Path) -> Path:
        """Move something damaged into quarantine/; nothing there is ever deleted by the program.

        Args:
            path: a file, folder or link of the run.

        Returns:
            where it is now.

        Raises:
            StoreError: the disk or the folder refuses.
        """
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
        """Add a line to log.jsonl, which no decision ever reads.

        Args:
            event: what happened.
            **fields: details.

        Raises:
            StoreError: the disk or the folder refuses.
        """
        now = time.strftime("%Y-%m-%dT%H:%M:%S%z", time.localtime())
        line = json.dumps({"time": now, "event": event, "pid": os.getpid(), **fields})
        try:
            self.disk.append(self.log, (line + "\n").encode())
        except OSError as error:
            raise refusal(self.log, error) from error
