"""Worker processes on this machine, which share its cores and end with their parent.

Threads of one process run work outside of XLA one after the other, while XLA's own threads wait in loops: if much work
is outside of XLA, as many processes as cores, each with a single thread, are faster.
"""

import concurrent.futures
import contextlib
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from typing import Any

from cspr_jax.errors import ConfigError, ResourceError
from cspr_jax.numerics.cores import VARIABLE, cores
from cspr_jax.runtime.process_environment import check_threads

SAFE_PATH = "PYTHONSAFEPATH"
LARGEST = 256  # largest number of workers
LARGEST_USUAL = 8  # largest number of workers where the user gives none, since each takes a GB
GROUPS = 6  # groups of items for each worker: whoever is done first takes another group
_SIGNALS = (signal.SIGINT, signal.SIGTERM)
_NO_COMPLAINT = "ignore:resource_tracker:UserWarning"


def check_count(count: int | None) -> None:
    """Refuse an impossible number of workers."""
    if count is not None and not (isinstance(count, int) and 1 <= count <= LARGEST):
        raise ConfigError("--workers", f"{count}: must be an integer from 1 to {LARGEST}")


def usual_count(parts: int) -> int:
    """Default number of processes for work that is faster in several."""
    import jax

    return max(1, min(cores(), LARGEST_USUAL, parts)) if jax.default_backend() == "cpu" else 1


class Workers:
    """Worker processes, started when there is work for them.

    They ignore Ctrl-C and SIGTERM, which the full process group receives: the process that started them handles these.

    Args:
        count: number of processes.
        begin: function that each worker calls first; None: no function.
        arguments: arguments of `begin`.

    Raises:
        ResourceError: threads of the workers could not be started.
    """

    def __init__(self, count: int, begin: Callable[..., None] | None = None, *arguments: Any) -> None:
        """Start nothing yet."""
        check_threads(count)
        # A second Ctrl-C ends everything at once; Python's resource tracker need not complain about that.
        if _NO_COMPLAINT not in sys.warnoptions:
            sys.warnoptions.append(_NO_COMPLAINT)
        # multiprocessing starts children by `python -c`, which looks for modules in the working folder first and would
        # execute a file struct.py there. This variable prevents that; no option can be given.
        self._settings = {SAFE_PATH: "1", VARIABLE: str(max(cores() // count, 1))}
        with _environment(self._settings):
            self._pool = concurrent.futures.ProcessPoolExecutor(
                count,
                mp_context=multiprocessing.get_context("spawn"),
                initializer=_start,
                initargs=(os.getpid(), begin, arguments),
            )

    def submit(self, function: Callable, *arguments: Any) -> concurrent.futures.Future:
        """Have a worker call a function."""
        with _signals_blocked(), _environment(self._settings):  # workers inherit both when they start
            return self._pool.submit(function, *arguments)

    def kill(self) -> None:
        """End all workers now."""
        # Python 3.14 has kill_workers() for this.
        for process in list((self._pool._processes or {}).values()):
            with contextlib.suppress(OSError, ValueError):  # the process may have ended
                process.kill()

    def close(self) -> None:
        """Wait for running work to end, and cancel work that has not begun."""
        self._pool.shutdown(wait=True, cancel_futures=True)


class Spread:
    """Distribution of work on many items over worker processes, which end with the `with` block.

    Args:
        count: number of processes; with one, this process does the work.
    """

    def __init__(self, count: int) -> None:
        """Start nothing yet."""
        self._count, self._workers = count, Workers(count) if count > 1 else None

    def __enter__(self) -> "Spread":
        """Begin."""
        return self

    def __exit__(self, kind: type[BaseException] | None, *about: object) -> None:
        """End the workers."""
        if self._workers is not None:
            if kind is not None:
                self._workers.kill()
            self._workers.close()

    def __call__(self, function: Callable[[list], list], items: Sequence, costs: Sequence[float]) -> list:
        """Results of a function, in order."""
        if self._workers is None:
            return function(list(items))
        groups = balanced(costs, GROUPS * self._count)
        try:
            futures = [self._workers.submit(function, [items[k] for k in group]) for group in groups]
            results = {
                k: one
                for group, future in zip(groups, futures, strict=True)
                for k, one in zip(group, future.result(), strict=True)
            }
        except BrokenProcessPool as error:
            raise ResourceError("a worker died, perhaps for want of memory: --workers must be smaller") from error
        return [results[k] for k in range(len(items))]


def balanced(costs: Sequence[float], count: int) -> list[list[int]]:
    """Groups of items, by index, that take nearly equally long."""
    groups: list[list[int]] = [[] for _ in range(min(count, len(costs)))]
    totals = [0.0] * len(groups)
    for k in sorted(range(len(costs)), key=lambda k: -costs[k]):
        smallest = min(range(len(groups)), key=lambda g: (totals[g], len(groups[g])))
        groups[smallest].append(k)
        totals[smallest] += costs[k]
    return [groups[k] for k in sorted(range(len(groups)), key=lambda k: -totals[k])]


def _start(parent: int, begin: Callable[..., None] | None, arguments: tuple) -> None:
    for number in _SIGNALS:
        signal.signal(number, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(0.5)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
    if begin is not None:
        begin(*arguments)


@contextlib.contextmanager
def _signals_blocked() -> Iterator[None]:
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def _environment(settings: dict[str, str]) -> Iterator[None]:
    before = {name: os.environ.get(name) for name in settings}
    os.environ.update(settings)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
