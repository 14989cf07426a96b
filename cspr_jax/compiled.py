"""Compiled code that one run leaves to the next.

jax writes an entry straight to its name, and never again: a run that is killed then would leave half an entry for ever.
So each run has a folder of its own, with links to all whole entries, and hands its new ones over when it ends.
"""

import atexit
import contextlib
import os
import shutil
import socket
from pathlib import Path

# Entries kept, the newest ones; one is a kernel for one shape, some 0.1 to 1 MB.
LARGEST = 512
_OWN = "run"


def opened(folder: Path) -> Path:
    """The folder of this run, with all that is known; what it adds is handed over at the end of the process.

    Args:
        folder: where everything is kept.

    Returns:
        the folder.

    Raises:
        OSError: it cannot be made.
    """
    _sweep(folder)
    whole, own = folder / "whole", folder / f"{_OWN}-{socket.gethostname()}-{os.getpid()}"
    whole.mkdir(exist_ok=True)
    own.mkdir(exist_ok=True)
    for entry in whole.iterdir():
        with contextlib.suppress(OSError):
            os.link(entry, own / entry.name)
    atexit.register(_hand_over, whole, own, os.getpid())
    return own


def _hand_over(whole: Path, own: Path, process: int) -> None:
    if os.getpid() != process:  # a forked child
        return
    with contextlib.suppress(OSError):
        for entry in own.iterdir():
            if not (whole / entry.name).exists():
                entry.replace(whole / entry.name)
        entries = sorted(whole.iterdir(), key=lambda entry: entry.stat().st_mtime, reverse=True)
        for entry in entries[LARGEST:]:
            entry.unlink(missing_ok=True)
    shutil.rmtree(own, ignore_errors=True)


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
