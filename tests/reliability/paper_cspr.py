"""The command line, but its tiles are plain NumPy and take a given time: for kills, signals and limits.

Usage: python paper_cspr.py SECONDS_A_TILE run SWEEP.toml -o DIR ...
The environment can limit it: PAPER_MEMORY (bytes of address space), PAPER_CORES (how many),
PAPER_USER (who runs it, if root does).
"""

import contextlib
import os
import resource
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))
if "PAPER_MEMORY" in os.environ:
    resource.setrlimit(resource.RLIMIT_AS, (int(os.environ["PAPER_MEMORY"]),) * 2)
if "PAPER_CORES" in os.environ:
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[: int(os.environ["PAPER_CORES"])])

from cspr_jax import cli
from cspr_jax.api import sweeps
from reliability.support import Paper


class Slow(Paper):
    """Paper that takes its time."""

    def tiles(self, indices, stop):
        for index in indices:
            if stop:
                return
            end = time.monotonic() + SECONDS
            while time.monotonic() < end:  # a signal does not shorten a tile
                time.sleep(0.01)
            yield from super().tiles([index], stop) if not stop else self._one(index)

    def _one(self, index):
        # The tile in progress when the signal came is finished.
        from cspr_jax.sweep.signals import Stop

        yield from super().tiles([index], Stop())


@contextlib.contextmanager
def paper(job, prepare):
    if "PAPER_USER" in os.environ and os.getuid() == 0:  # root may write everywhere
        os.setgroups([])
        os.setgid(int(os.environ["PAPER_USER"]))
        os.setuid(int(os.environ["PAPER_USER"]))
    yield Slow(job.sweep)


if __name__ == "__main__":
    SECONDS = float(sys.argv[1])
    sweeps._executor = paper
    sys.exit(cli.main(sys.argv[2:]))
