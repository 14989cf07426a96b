"""Compiled code of this process, which lies in a number of mapped parts of memory that the system limits.

A compiled function takes some ten parts of the 65,530 that Linux allows. Where no more are allowed, the compiler ends
the process, so that a long session with motions of ever new forms would be lost.
"""

import gc
import time
from pathlib import Path

import jax

MAPS, LARGEST = Path("/proc/self/maps"), Path("/proc/sys/vm/max_map_count")
FULL = 0.75  # fraction of the largest number of mapped parts above which code is released
PERIOD = 5.0  # time between two looks at the number, which take up to 50 ms, s
_latest = 0.0


def is_crowded() -> bool:
    """Tell whether little more code can be mapped; systems other than Linux have no such limit."""
    try:
        return MAPS.read_bytes().count(b"\n") > FULL * int(LARGEST.read_text("ascii"))
    except (OSError, ValueError):
        return False


def limit_compiled_code() -> None:
    """Release compiled code where little more can be mapped; functions that are called again are compiled again."""
    global _latest
    if time.monotonic() < _latest + PERIOD:
        return
    _latest = time.monotonic()
    if is_crowded():
        jax.clear_caches()
        gc.collect()
