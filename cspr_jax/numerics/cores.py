"""Number of cores that a process computes on: all available ones, or fewer where several processes work at once."""

import math
import os
from pathlib import Path, PurePosixPath

# Environment variable with the number of cores; XLA starts as many threads.
VARIABLE = "NPROC"
_GROUPS, _MOUNTED = Path("/proc/self/cgroup"), Path("/sys/fs/cgroup")


def cores() -> int:
    """Number of cores that this process computes on."""
    fraction = os.environ.get(VARIABLE, "")
    if fraction.isascii() and fraction.isdigit() and int(fraction) > 0:
        return int(fraction)
    affinity = getattr(os, "sched_getaffinity", None)  # not on macOS
    count = len(affinity(0)) if affinity is not None else os.cpu_count() or 1
    return max(1, math.ceil(min(count, quota())))


def quota(groups: Path = _GROUPS, mounted: Path = _MOUNTED) -> float:
    """Quota of time, in cores, that Linux's control groups (versions 1 and 2) grant this process."""
    try:
        lines = groups.read_text("utf-8", "replace").splitlines()
    except OSError:
        return math.inf
    minimum = math.inf
    for line in lines:
        _, _, rest = line.partition(":")
        controllers, _, group = rest.partition(":")
        if controllers and "cpu" not in controllers.split(","):
            continue
        # In a container the path may be the host's, of which only the last parts, or none, exist in the mounted folder.
        # Version 1 has a folder for its controllers; where both versions are in use, version 2 has a folder of its own.
        for root in [mounted / controllers, mounted / "cpu"] if controllers else [mounted, mounted / "unified"]:
            path = PurePosixPath(group.lstrip("/"))
            for level in (path, *path.parents):
                minimum = min(minimum, _granted(root / level))
    return minimum


def _granted(folder: Path) -> float:
    for names in (("cpu.max",), ("cpu.cfs_quota_us", "cpu.cfs_period_us")):
        try:
            words = " ".join((folder / name).read_text("ascii") for name in names).split()
            time, period = float(words[0]), float(words[1])
        except (OSError, ValueError, IndexError):  # the file is missing, or says "max"
            continue
        if time > 0.0 and period > 0.0:
            return time / period
    return math.inf
