"""Executors that compute the tiles: this process, or several on this machine. One process publishes."""

import collections
import concurrent.futures
import contextlib
import pickle
from collections.abc import Generator, Iterable, Iterator
from concurrent.futures.process import BrokenProcessPool
from typing import Any

from cspr_jax.errors import ResourceError
from cspr_jax.runtime.processes import Workers, usual_count
from cspr_jax.sweep.definition import Sweep
from cspr_jax.sweep.environment import environment
from cspr_jax.sweep.signals import Stop
from cspr_jax.sweep.tile import TileMap, compute_tile
from cspr_jax.sweep.work import Computed

# Largest number of times that workers may die in a row, without finishing a tile.
DEATHS = 3
# If nobody says how many workers, each gets at least so many tiles, since it compiles for itself.
TILES_EACH = 4


class ThisProcess:
    """Tiles one after the other in this process."""

    def __init__(self, tile_map: TileMap) -> None:
        """Keep the map."""
        self._tile_map = tile_map

    def environment(self) -> dict[str, Any]:
        """Environment of the computation."""
        return environment()

    def tiles(self, indices: Iterable[int], stop: Stop) -> Iterator[Computed]:
        """Compute tiles in order."""
        for index in indices:
            if stop:
                return
            yield self._tile_map(index)


# The sweep of a worker process: it is sent once, not with each tile.
_sweep: list[bytes] = []


def _worker_tile(index: int) -> Computed:
    return compute_tile(_sweep[0], index)


def _take(pickled: bytes) -> None:
    _sweep[:] = [pickled]


def usual_workers(sweep: Sweep) -> int:
    """Number of processes for a sweep where nobody says how many."""
    return usual_count(len(sweep.grid.tiling) // TILES_EACH) if sweep.kind.by_processes else 1


class Processes:
    """Tiles in several processes of this machine.

    Args:
        count: how many processes.
    """

    def __init__(self, sweep: Sweep, count: int) -> None:
        """Start nothing yet."""
        self._pickled, self._count = pickle.dumps(sweep), count

    def environment(self) -> dict[str, Any]:
        """Environment of the computation: workers are the same program on the same machine."""
        return environment()

    def tiles(self, indices: Iterable[int], stop: Stop) -> Iterator[Computed]:
        """Compute tiles in any order; one whose worker died is computed again."""
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
        workers = Workers(self._count, _take, self._pickled)
        stop.at_once = workers.kill
        running: set[concurrent.futures.Future[Computed]] = set()
        try:
            while running or (waiting and not stop):
                while waiting and not stop and len(running) < self._count:
                    running.add(workers.submit(_worker_tile, waiting.popleft()))
                done, running = concurrent.futures.wait(
                    running, timeout=0.1, return_when=concurrent.futures.FIRST_COMPLETED
                )
                for future in done:
                    yield future.result()
        except BrokenProcessPool:
            # The pool asks the others to end, but they ignore signals, and may wait for a lock that the dead one held.
            workers.kill()
            raise
        finally:
            if running:
                workers.kill()
            workers.close()
            stop.at_once = lambda: None
