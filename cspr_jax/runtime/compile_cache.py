"""Cache of compiled code from run to run.

jax writes an entry directly under its final name and never again, so that a killed run would leave half an entry for
ever. Therefore each run has a folder of its own, with links to all complete entries (copies, where the disk has no
links), and moves its new entries to the common folder when it ends. The content of a kept entry ends with its name, and
the name of its file with a checksum: an entry that is damaged, or a copy of another, is removed before jax sees it; an
entry that cannot be used is replaced by newly compiled code. Entries are code that is executed: a folder into which
others can write is refused.
"""

import atexit
import builtins
import contextlib
import dataclasses
import errno
import hashlib
import importlib.util
import os
import re
import shutil
import socket
import stat
import sys
import threading
import warnings
from collections.abc import Callable
from pathlib import Path

from cspr_jax.runtime.packed import is_complete, is_too_large

# Number of entries kept, the newest ones. An entry is a kernel for one shape, of some 0.1 to 1 MB, or its program, a
# tenth of that.
LARGEST = 512
LARGEST_ENTRY = 1 << 28  # bytes
# Frame that readers of zstd skip (RFC 8878, 3.1.2); readers of zlib stop at the end of their own data.
_SKIPPED = b"\x50\x2a\x4d\x18"
# Version of the format of entries; it is part of the folder's name, so that each format has a folder of its own.
FORMAT = 2
# If this sets a largest size, jax writes the time of last use beside each entry.
MAX_SIZE = "JAX_COMPILATION_CACHE_MAX_SIZE"
_ENTRY, _USED = "-cache", "-atime"
_OWN, _SEPARATOR = "run", "~"
_TROUBLE = re.compile(r"Error (reading|writing) persistent compilation cache entry for '(.*?)': ((\w+).*)", re.DOTALL)
# Environment variable with this run's folder for programs of `persistent_jit`.
PROGRAMS = "CSPR_PROGRAMS"
# Mode of folders: others cannot write into them, whatever the umask.
PRIVATE = 0o700


@dataclasses.dataclass
class _KeptEntries:
    # Entries taken from former runs, each with its kept file and the identity of its file in the folder of this run.
    entries: Path
    folder: Path
    process: int
    origins: dict[str, tuple[Path, tuple[int, int]]] = dataclasses.field(default_factory=dict)
    unusable: set[str] = dataclasses.field(default_factory=set)


# The entries of this process, if it has a folder.
_pending: list[_KeptEntries] = []


def opened(folder: Path, warn: Callable[[str], None]) -> Path:
    """Open a folder for this run with all entries so far; its new entries are kept at the end of the process."""
    if largest_size() >= 0 and importlib.util.find_spec("filelock") is None:
        raise OSError(errno.ENOTSUP, f"jax needs filelock for {MAX_SIZE}: pip install filelock")
    full, run_folder = folder / "whole", folder / f"{_OWN}-{socket.gethostname()}-{os.getpid()}"
    check_owner(folder)
    full.mkdir(mode=PRIVATE, exist_ok=True)
    check_owner(full)
    _remove_leftovers(folder)
    shutil.rmtree(run_folder, ignore_errors=True)  # left by a process of the same number
    run_folder.mkdir(mode=PRIVATE)
    run = _KeptEntries(full, run_folder, os.getpid())
    damaged = _take(run)
    if damaged:
        entries = "a damaged entry" if damaged == 1 else f"{damaged} damaged entries"
        warn(f"{folder}: {entries} of compiled code removed; it is compiled again")
    _pending.append(run)
    _quiet(folder, warn)
    return run_folder


def check_owner(folder: Path, *, may_be_shared: bool = False) -> None:
    """Refuse a folder in which others could place code for us to execute."""
    status = folder.lstat() if not may_be_shared else folder.stat()
    if not stat.S_ISDIR(status.st_mode):
        raise OSError(errno.ENOTDIR, "is no folder")
    if os.name != "posix":
        return
    trusted = (os.geteuid(), 0) if may_be_shared else (os.geteuid(),)
    if status.st_uid not in trusted:
        raise OSError(errno.EPERM, f"{folder} belongs to another user, whose code would be executed")
    is_sticky = may_be_shared and status.st_mode & stat.S_ISVTX
    if status.st_mode & (stat.S_IWGRP | stat.S_IWOTH) and not is_sticky:
        raise OSError(errno.EPERM, f"others may write into {folder}, and their code would be executed: chmod go-w")


def plain_bytes(path: Path, maximum: int = LARGEST_ENTRY) -> bytes:
    """Content of a regular file; anything else of that name, such as a pipe, is refused, not waited for."""
    flags = (getattr(os, name, 0) for name in ("O_NOFOLLOW", "O_NONBLOCK", "O_BINARY"))
    descriptor = os.open(path, os.O_RDONLY | sum(flags))
    with os.fdopen(descriptor, "rb") as file:
        status = os.fstat(descriptor)
        if not stat.S_ISREG(status.st_mode) or status.st_size > maximum:
            raise OSError(errno.EINVAL, "no plain file of a usual size")
        return file.read()


def largest_size() -> int:
    """Largest number of bytes that jax is set to keep."""
    loaded = sys.modules.get("jax")
    if loaded is not None:
        return int(loaded.config.jax_compilation_cache_max_size)
    try:
        return int(os.environ.get(MAX_SIZE, "-1"))
    except ValueError:  # jax reports the error when it is imported
        return -1


def _take(run: _KeptEntries) -> int:
    # Bring entries into the folder of this run; return the number of damaged ones, which are removed.
    damaged, is_bounded = 0, largest_size() >= 0
    for entry in run.entries.iterdir():
        name, _, checksum = entry.name.rpartition(_SEPARATOR)
        try:
            data = plain_bytes(entry)
        except FileNotFoundError:  # another run has removed it
            continue
        except OSError:
            data, checksum = b"", "unreadable"
        with contextlib.suppress(OSError):
            if checksum != checksum_of(name, data) or not data.endswith(_ending(name)) or is_too_large(data):
                entry.unlink()
                damaged += 1
            else:
                target = run.folder / name
                _link_or_copy(entry, data, target)
                run.origins[name] = entry, _identity_of(target)
                if is_bounded and name.endswith(_ENTRY):
                    used = run.folder / f"{name.removesuffix(_ENTRY)}{_USED}"
                    used.write_bytes(entry.stat().st_mtime_ns.to_bytes(8, "little"))
    return damaged


def _identity_of(path: Path) -> tuple[int, int]:
    # The identity of a file changes when another file replaces it.
    status = path.lstat()
    return status.st_ino, status.st_mtime_ns


def _link_or_copy(entry: Path, data: bytes, target: Path) -> None:
    try:
        os.link(entry, target)
    except OSError:  # no links on this disk, or too many to one file
        try:
            target.write_bytes(data)
        except OSError:
            target.unlink(missing_ok=True)  # jax must not see half of it
            raise


@atexit.register
def hand_over() -> None:
    """Hand over the code that this process has compiled; later calls do nothing."""
    while _pending:
        run = _pending.pop()
        if os.getpid() == run.process:  # not in a forked child
            with contextlib.suppress(OSError):
                _hand_over(run)
            shutil.rmtree(run.folder, ignore_errors=True)


def set_aside(beginning: str) -> int:
    """Remove kept entries that cannot be used, so that newly compiled code replaces them."""
    count = 0
    for run in _pending:
        names = {name for name in run.origins if name.startswith(beginning)} - run.unusable
        run.unusable |= names
        count += len(names)
        for name in names:
            target = run.folder / name
            with contextlib.suppress(OSError):
                if _identity_of(target) == run.origins[name][1]:  # jax never replaces an entry itself
                    target.unlink()
    return count


def _quiet(folder: Path, warn: Callable[[str], None]) -> None:
    # jax warns of each entry that it cannot read or write: report the first in our own words, and drop the others.
    usual, warned = warnings.showwarning, threading.Event()

    def show(message, category, filename, lineno, file=None, line=None):
        match = _TROUBLE.match(str(message))
        if match is None:
            usual(message, category, filename, lineno, file, line)
            return
        action, name, reason, kind = match.groups()
        ending = "what is missing is compiled each time"
        if action == "writing":
            _write_no_more()
        elif not _is_of_system(kind) and set_aside(f"{name}-"):
            ending = "it is removed and compiled again"
        if not warned.is_set():
            warned.set()
            verb = "kept" if action == "writing" else "read"
            warn(f"{folder}: compiled code cannot be {verb}: {reason.partition(chr(10))[0]}; {ending}")

    warnings.showwarning = show


def _is_of_system(kind: str) -> bool:
    # Such an error does not mean that the entry is unusable.
    error = getattr(builtins, kind, None)
    return isinstance(error, type) and issubclass(error, OSError | MemoryError)


def _write_no_more() -> None:
    jax = sys.modules.get("jax")
    if jax is not None:
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 1e9)


def _hand_over(run: _KeptEntries) -> None:
    for name in run.unusable:
        run.origins.pop(name)[0].unlink(missing_ok=True)
    names = {entry.name.rpartition(_SEPARATOR)[0] for entry in run.entries.iterdir()}
    for entry in run.folder.iterdir():
        if entry.name.endswith(_USED) or entry.name.startswith("."):  # jax's files of times, and its lock
            continue
        with contextlib.suppress(OSError):
            before, identity = run.origins.get(entry.name, (None, None))
            if entry.name in names and (before is None or _identity_of(entry) == identity):
                continue
            data = plain_bytes(entry)
            if is_complete(data):
                if before is not None:
                    before.unlink(missing_ok=True)
                ending = _ending(entry.name)
                data = data.removesuffix(ending) + ending
                ended = entry.with_name(f".{entry.name}")
                ended.write_bytes(data)
                ended.replace(run.entries / f"{entry.name}{_SEPARATOR}{checksum_of(entry.name, data)}")
    _trim(run.entries)


def _trim(entries: Path) -> None:
    # Other runs may remove entries at the same time.
    sizes = {}
    for entry in entries.iterdir():
        with contextlib.suppress(FileNotFoundError):
            status = entry.lstat()
            sizes[entry] = status.st_mtime, status.st_size
    maximum, total = largest_size(), 0
    for i, entry in enumerate(sorted(sizes, key=lambda entry: sizes[entry], reverse=True)):
        total += sizes[entry][1]
        if i >= LARGEST or 0 <= maximum < total:
            entry.unlink(missing_ok=True)


def _ending(name: str) -> bytes:
    # A kept entry contains its name, so that a copy under another name is detected.
    words = os.fsencode(f"{__name__}: {name}")
    return _SKIPPED + len(words).to_bytes(4, "little") + words


def checksum_of(name: str, data: bytes) -> str:
    """Checksum in the name of a kept entry."""
    return hashlib.sha256(os.fsencode(name) + b"\0" + data).hexdigest()[:16]


def _remove_leftovers(folder: Path) -> None:
    # Remove folders that killed runs of this machine have left.
    for run_folder in folder.glob(f"{_OWN}-{socket.gethostname()}-*"):
        process = run_folder.name.rpartition("-")[2]
        if process.isdigit() and _is_gone(int(process)):
            shutil.rmtree(run_folder, ignore_errors=True)


def _is_gone(process: int) -> bool:
    if os.name != "posix":  # there signal 0 is no mere query
        return False
    try:
        os.kill(process, 0)
    except OSError as error:
        return isinstance(error, ProcessLookupError)
    return False
