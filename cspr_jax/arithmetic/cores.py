"""Cores of this machine that a process computes on: all that it may use, or a share where several work beside it."""

import os

# How many; XLA starts as many threads.
SHARE = "NPROC"


def cores() -> int:
    """Number of cores that this process computes on.

    Returns:
        the number, at least 1: what the environment variable `SHARE` says, else all that it may use.
    """
    given = os.environ.get(SHARE, "")
    if given.isascii() and given.isdigit() and int(given) > 0:
        return int(given)
    allowed = getattr(os, "sched_getaffinity", None)  # not on macOS
    return len(allowed(0)) if allowed is not None else os.cpu_count() or 1
