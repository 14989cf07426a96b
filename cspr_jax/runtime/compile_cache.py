"""Compiled code that one run leaves to the next.

jax writes an entry straight to its name, and never again: a run that is killed then would leave half an entry for ever.
So each run has a folder of its own, with links to all whole entries, and hands its new ones over when it ends. What is
kept bears a checksum in its name: an entry that was damaged is removed before jax sees it.
"""

import atexit
import contextlib
import os
import re
import shutil
import socket
import sys
import threading
import warnings
import zlib
from collections.abc import Callable
from pathlib import Path

# Entries kept, the newest ones; one is a kernel for one shape, some 0.1 to 1 MB.
LARGEST = 512
_OWN, _MARK = "run", "~"
_TROUBLE = re.compile(r"Error (reading|writing) persistent compilation cache entry")
# What hands over the entries of this process, once.
_pending: list[Callable[[], None]] = []


def opened(folder: Path, warn: Callable[[str], None]) -> Path:
    """The folder of this run, with all that is known; what it adds is handed over at the end of the process.

    Args:
        folder: where everything is kept.
        warn: called with a line for people, once, where something there is damaged or nothing can be written.

    Returns:
        the folder.

    Raises:
        OSError: it cannot be made.
    """
    _sweep(folder)
    whole, own = folder / "whole", folder / f"{_OWN}-{socket.gethostname()}-{os.getpid()}"
    whole.mkdir(exist_ok=True)
    own.mkdir(exist_ok=True)
    damaged = 0
    for entry in whole.iterdir():
        with contextlib.suppress(OSError):  # another run may have taken it away
            name, _, checksum = entry.name.rpartition(_MARK)
            if checksum == _checksum(entry):
                os.link(entry, own / name)
            else:
                damaged += 1
                entry.unlink()
    if damaged:
        entries = "a damaged entry" if damaged == 1 else f"{damaged} damaged entries"
        warn(f"{folder}: {entries} of compiled code removed; it is compiled again")
    process = os.getpid()

    def at_end() -> None:
        if os.getpid() == process:  # not in a forked child
            _hand_over(whole, own)

    _pending.append(at_end)
    _quiet(folder, warn)
    return own


@atexit.register
def hand_over() -> None:
    """Hand over what this process has compiled; later calls do nothing."""
    while _pending:
        _pending.pop()()


def _quiet(folder: Path, warn: Callable[[str], None]) -> None:
    # jax warns of every single entry that it cannot read or write: the first one is told in our words, the others not.
    usual, told = warnings.showwarning, threading.Event()

    def show(message, category, filename, lineno, file=None, line=None):
        match = _TROUBLE.match(str(message))
        if match is None:
            usual(message, category, filename, lineno, file, line)
            return
        if match[1] == "writing":
            _write_no_more()
        if not told.is_set():
            told.set()
            action = "kept" if match[1] == "writing" else "read"
            reason = str(message).partition("': ")[2]
            warn(f"{folder}: compiled code cannot be {action}: {reason}; what is missing is compiled each time")

    warnings.showwarning = show


def _write_no_more() -> None:
    jax = sys.modules.get("jax")
    if jax is not None:
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 1e9)


def _hand_over(whole: Path, own: Path) -> None:
    with contextlib.suppress(OSError):
        known = {entry.name.rpartition(_MARK)[0] for entry in whole.iterdir()}
        for entry in own.iterdir():
            if entry.name not in known and _is_whole(entry):
                entry.replace(whole / f"{entry.name}{_MARK}{_checksum(entry)}")
        entries = sorted(whole.iterdir(), key=lambda entry: entry.stat().st_mtime, reverse=True)
        for entry in entries[LARGEST:]:
            entry.unlink(missing_ok=True)
    shutil.rmtree(own, ignore_errors=True)


def _checksum(entry: Path) -> str:
    return f"{zlib.crc32(entry.read_bytes()):08x}"


def _is_whole(entry: Path) -> bool:
    # A full disk, or the end of the process, may have left half of it.
    data = entry.read_bytes()
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


def _sweep(folder: Path) -> None:
    # What runs of this machine that were killed have left.
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
