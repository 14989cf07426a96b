"""Compiled code that one run leaves to the next.

jax writes an entry straight to its name, and never again: a run that is killed then would leave half an entry for ever.
So each run has a folder of its own, with links to all whole entries (copies, where the disk has no links), and hands
its new ones over when it ends. Kept entries bear a checksum in their names: an entry that was damaged is removed before
jax sees it. Entries are code that is executed: a folder in which others can place some is refused.
"""

import atexit
import contextlib
import errno
import importlib.util
import os
import re
import shutil
import socket
import stat
import sys
import threading
import warnings
import zlib
from collections.abc import Callable
from pathlib import Path

# Entries kept, the newest ones; one is a kernel for one shape, some 0.1 to 1 MB, or its program, a tenth of that.
LARGEST = 512
LARGEST_ENTRY = 1 << 28  # bytes
# With a largest size, jax notes beside each entry when it was used last.
MAX_SIZE = "JAX_COMPILATION_CACHE_MAX_SIZE"
_ENTRY, _USED = "-cache", "-atime"
_OWN, _MARK = "run", "~"
_TROUBLE = re.compile(r"Error (reading|writing) persistent compilation cache entry")
# This list holds the function that hands over the entries of this process, if there is one.
_pending: list[Callable[[], None]] = []
# Environment variable with the folder of the programs of `persistent_jit`: that of this run.
PROGRAMS = "CSPR_PROGRAMS"
# Whatever the umask says, others write into none of our folders.
PRIVATE = 0o700


def opened(folder: Path, warn: Callable[[str], None]) -> Path:
    """The folder of this run, with all entries so far; its new entries are handed over at the end of the process.

    Args:
        warn: called with a line for people, once, where something there is damaged or nothing can be written.

    Returns:
        the folder.

    Raises:
        OSError: it cannot be made, or others may write there.
    """
    if largest_size() >= 0 and importlib.util.find_spec("filelock") is None:
        raise OSError(errno.ENOTSUP, f"jax needs filelock for {MAX_SIZE}: pip install filelock")
    whole, run_folder = folder / "whole", folder / f"{_OWN}-{socket.gethostname()}-{os.getpid()}"
    check_owner(folder)
    whole.mkdir(mode=PRIVATE, exist_ok=True)
    check_owner(whole)
    _remove_leftovers(folder)
    shutil.rmtree(run_folder, ignore_errors=True)  # of a process of the same number
    run_folder.mkdir(mode=PRIVATE)
    damaged = _take(whole, run_folder)
    if damaged:
        entries = "a damaged entry" if damaged == 1 else f"{damaged} damaged entries"
        warn(f"{folder}: {entries} of compiled code removed; it is compiled again")
    process = os.getpid()

    def at_end() -> None:
        if os.getpid() == process:  # not in a forked child
            _hand_over(whole, run_folder)

    _pending.append(at_end)
    _quiet(folder, warn)
    return run_folder


def check_owner(folder: Path, *, may_be_shared: bool = False) -> None:
    """Refuse a folder in which others could place code for us to execute.

    Args:
        may_be_shared: whether all may write there as in /tmp, where nobody can replace a folder of ours.

    Raises:
        OSError: somebody else owns it or may write there, or it is none.
    """
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


def plain_bytes(path: Path, most: int = LARGEST_ENTRY) -> bytes:
    """Content of a plain file; nothing that lies in its place, such as a pipe, holds up the reader.

    Args:
        most: largest size, bytes.

    Returns:
        the content.

    Raises:
        OSError: no plain file, a larger one, or it cannot be read.
    """
    flags = (getattr(os, name, 0) for name in ("O_NOFOLLOW", "O_NONBLOCK", "O_BINARY"))
    descriptor = os.open(path, os.O_RDONLY | sum(flags))
    with os.fdopen(descriptor, "rb") as file:
        status = os.fstat(descriptor)
        if not stat.S_ISREG(status.st_mode) or status.st_size > most:
            raise OSError(errno.EINVAL, "no plain file of a usual size")
        return file.read()


def largest_size() -> int:
    """Bytes that jax is told to keep at most.

    Returns:
        the size; -1: no limit.
    """
    loaded = sys.modules.get("jax")
    if loaded is not None:
        return int(loaded.config.jax_compilation_cache_max_size)
    try:
        return int(os.environ.get(MAX_SIZE, "-1"))
    except ValueError:  # jax says so when it is imported
        return -1


def _take(whole: Path, run_folder: Path) -> int:
    # Bring entries into the folder of this run; return the number of damaged ones, which are removed.
    damaged, is_bounded = 0, largest_size() >= 0
    for entry in whole.iterdir():
        name, _, checksum = entry.name.rpartition(_MARK)
        try:
            data = plain_bytes(entry)
        except FileNotFoundError:  # another run has taken it away
            continue
        except OSError:
            data, checksum = b"", "unreadable"
        with contextlib.suppress(OSError):
            if name.endswith(_USED):  # which versions before 0.2 kept
                entry.unlink()
            elif checksum != _checksum(data):
                entry.unlink()
                damaged += 1
            else:
                _place(entry, data, run_folder / name)
                if is_bounded and name.endswith(_ENTRY):
                    used = run_folder / f"{name.removesuffix(_ENTRY)}{_USED}"
                    used.write_bytes(entry.stat().st_mtime_ns.to_bytes(8, "little"))
    return damaged


def _place(entry: Path, data: bytes, target: Path) -> None:
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
        _pending.pop()()


def _quiet(folder: Path, warn: Callable[[str], None]) -> None:
    # jax warns of every single entry that it cannot read or write: the first one is told in our words, the others not.
    usual, warned = warnings.showwarning, threading.Event()

    def show(message, category, filename, lineno, file=None, line=None):
        match = _TROUBLE.match(str(message))
        if match is None:
            usual(message, category, filename, lineno, file, line)
            return
        if match[1] == "writing":
            _write_no_more()
        if not warned.is_set():
            warned.set()
            action = "kept" if match[1] == "writing" else "read"
            reason = str(message).partition("': ")[2]
            warn(f"{folder}: compiled code cannot be {action}: {reason}; what is missing is compiled each time")

    warnings.showwarning = show


def _write_no_more() -> None:
    jax = sys.modules.get("jax")
    if jax is not None:
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 1e9)


def _hand_over(whole: Path, run_folder: Path) -> None:
    with contextlib.suppress(OSError):
        known = {entry.name.rpartition(_MARK)[0] for entry in whole.iterdir()}
        for entry in run_folder.iterdir():
            is_ours = not entry.name.endswith(_USED) and not entry.name.startswith(".")  # jax's times, and its lock
            if is_ours and entry.name not in known and _is_whole(data := plain_bytes(entry)):
                entry.replace(whole / f"{entry.name}{_MARK}{_checksum(data)}")
        entries = sorted(whole.iterdir(), key=lambda entry: entry.lstat().st_mtime, reverse=True)
        most, size = largest_size(), 0
        for i, entry in enumerate(entries):
            size += entry.lstat().st_size
            if i >= LARGEST or 0 <= most < size:
                entry.unlink(missing_ok=True)
    shutil.rmtree(run_folder, ignore_errors=True)


def _checksum(data: bytes) -> str:
    return f"{zlib.crc32(data):08x}"


def _is_whole(data: bytes) -> bool:
    # A full disk, or the end of the process, may have left half of it.
    if data[:1] == b"\x78":  # zlib's
        reader = zlib.decompressobj()
        try:
            reader.decompress(data)
        except zlib.error:
            return False
        return reader.eof
    for module in ("compression.zstd", "zstandard"):
        if (zstd := sys.modules.get(module)) is not None:
            return _is_whole_zstd(zstd, data)
    return bool(data)


def _is_whole_zstd(zstd, data: bytes) -> bool:
    # Two libraries of nearly the same interface; jax takes the one that there is.
    reader = zstd.ZstdDecompressor()
    try:
        if hasattr(reader, "decompressobj"):
            reader = reader.decompressobj()
        reader.decompress(data)
    except zstd.ZstdError:
        return False
    return bool(reader.eof)


def _remove_leftovers(folder: Path) -> None:
    # Runs of this machine that were killed have left these folders behind.
    for place in folder.glob(f"{_OWN}-{socket.gethostname()}-*"):
        process = place.name.rpartition("-")[2]
        if process.isdigit() and _is_gone(int(process)):
            shutil.rmtree(place, ignore_errors=True)


def _is_gone(process: int) -> bool:
    if os.name != "posix":  # signal 0 asks nothing there
        return False
    try:
        os.kill(process, 0)
    except OSError as error:
        return isinstance(error, ProcessLookupError)
    return False
