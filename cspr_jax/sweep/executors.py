"""Executors that compute the tiles: this process, or several on this machine. One process publishes."""

import collections
import concurrent.futures
import contextlib
import multiprocessing
import os
import pickle
import signal
import sys
import threading
import time
from collections.abc import Generator, Iterable, Iterator
from concurrent.futures.process import BrokenProcessPool
from typing import Any

from cspr_jax.errors import ResourceError
from cspr_jax.sweep.definition import Sweep
from cspr_jax.sweep.environment import environment
from cspr_jax.sweep.signals import CODES, Stop
from cspr_jax.sweep.tile import TileMap, compute_tile
from cspr_jax.sweep.work import Computed

# Times that the workers may die, one after another, without a tile between.
DEATHS = 3
SAFE_PATH = "PYTHONSAFEPATH"
_NO_COMPLAINT = "ignore:resource_tracker:UserWarning"


class ThisProcess:
    """Tiles one after the other in this process.

    Args:
        tile_map: what computes one.
    """

    def __init__(self, tile_map: TileMap) -> None:
        """Keep the map."""
        self._tile_map = tile_map

    def environment(self) -> dict[str, Any]:
        """Environment of the computation.

        Returns:
            the environment of this process.
        """
        return environment()

    def tiles(self, indices: Iterable[int], stop: Stop) -> Iterator[Computed]:
        """Compute tiles in order.

        Args:
            indices: which ones.
            stop: when it is set, what is in progress is finished and nothing is begun.

        Yields:
            the tiles.
        """
        for index in indices:
            if stop:
                return
            yield self._tile_map(index)


# The sweep of a worker process: it is sent once, not with each tile.
_sweep: list[bytes] = []


def _worker_tile(index: int) -> Computed:
    return compute_tile(_sweep[0], index)


def _start_worker(parent: int, pickled: bytes) -> None:
    # Signals reach the whole group: the parent decides. And no worker outlives it.
    _sweep[:] = [pickled]
    for number in CODES:
        signal.signal(number, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(0.5)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


class Processes:
    """Tiles in several processes of this machine.

    Args:
        sweep: the sweep.
        count: how many processes.
    """

    def __init__(self, sweep: Sweep, count: int) -> None:
        """Start nothing yet."""
        self._pickled, self._count = pickle.dumps(sweep), count

    def environment(self) -> dict[str, Any]:
        """Environment of the computation: workers are the same program on the same machine.

        Returns:
            the environment of this process.
        """
        return environment()

    def tiles(self, indices: Iterable[int], stop: Stop) -> Iterator[Computed]:
        """Compute tiles in any order; one whose worker died is computed again.

        Args:
            indices: which ones.
            stop: when it is set, what is in progress is finished and nothing is begun.

        Yields:
            the tiles.

        Raises:
            ResourceError: workers that keep dying.
        """
        waiting, deaths = dict.fromkeys(indices), 0
        while waiting and not stop:
            try:
                with contextlib.closing(self._pool_tiles(collections.deque(waiting), stop)) as tiles:
                    for computed in tiles:
                        del waiting[computed.shard.index]
                        deaths = 0
                        yield computed
            except BrokenProcessPool as error:
                deaths += 1
                if deaths >= DEATHS:
                    raise ResourceError(
                        f"workers died {deaths} times without finishing a tile, perhaps for want of memory: "
                        "--workers or run.tile must be smaller"
                    ) from error

    def _pool_tiles(self, waiting: collections.deque[int], stop: Stop) -> Generator[Computed, None, None]:
        # A second Ctrl-C ends everything at once; what then cleans up behind Python need not complain about it.
        if _NO_COMPLAINT not in sys.warnoptions:
            sys.warnoptions.append(_NO_COMPLAINT)
        context = multiprocessing.get_context("spawn")
        with _safe_path():
            pool = concurrent.futures.ProcessPoolExecutor(
                self._count, mp_context=context, initializer=_start_worker, initargs=(os.getpid(), self._pickled)
            )
        stop.at_once = lambda: _kill(pool)
        running: set[concurrent.futures.Future[Computed]] = set()
        try:
            while running or (waiting and not stop):
                while waiting and not stop and len(running) < self._count:
                    with _signals_blocked(), _safe_path():  # workers inherit that, from their first moment on
                        running.add(pool.submit(_worker_tile, waiting.popleft()))
                done, running = concurrent.futures.wait(
                    running, timeout=0.1, return_when=concurrent.futures.FIRST_COMPLETED
                )
                for future in done:
                    yield future.result()
        except BrokenProcessPool:
            # The pool asks the others to end, but they ignore signals, and may wait for a lock that the dead one held.
            _kill(pool)
            raise
        finally:
            if running:
                _kill(pool)
            pool.shutdown(wait=True, cancel_futures=True)
            stop.at_once = lambda: None


@contextlib.contextmanager
def _signals_blocked() -> Iterator[None]:
    before = signal.pthread_sigmask(signal.SIG_BLOCK, CODES)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def _safe_path() -> Iterator[None]:
    # A child of multiprocessing is started with `python -c`, which looks for modules in the working folder first: a
    # file struct.py that lies there would be executed. It reads this variable; no option of its own can be given.
    before = os.environ.get(SAFE_PATH)
    os.environ[SAFE_PATH] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[SAFE_PATH]
        else:
            os.environ[SAFE_PATH] = before


def _kill(pool: concurrent.futures.ProcessPoolExecutor) -> None:
    # Python 3.14 has kill_workers() for this.
    for process in list((pool._processes or {}).values()):
        with contextlib.suppress(OSError, ValueError):  # it may be gone
            process.kill()
