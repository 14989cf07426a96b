"""Executors that compute tiles: in this process, or in several on this machine. This process alone publishes them."""

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

# Largest number of times in a row that workers may die without finishing a tile.
DEATHS = 3
# Smallest number of tiles for each worker, by default, since each compiles for itself.
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


# The sweep of a worker process, which is sent once, not with each tile.
_sweep: list[bytes] = []


def _worker_tile(index: int) -> Computed:
    return compute_tile(_sweep[0], index)


def _take(pickled: bytes) -> None:
    _sweep[:] = [pickled]


def usual_workers(sweep: Sweep) -> int:
    """Default number of processes for a sweep."""
    return usual_count(len(sweep.grid.tiling) // TILES_EACH) if sweep.kind.by_processes else 1


class Processes:
    """Tiles in several processes of this machine.

    Args:
        count: number of processes.
    """

    def __init__(self, sweep: Sweep, count: int) -> None:
        """Start nothing yet."""
        self._pickled, self._count = pickle.dumps(sweep), count

    def environment(self) -> dict[str, Any]:
        """Environment of the computation, the same for workers and this process."""
        return environment()

    def tiles(self, indices: Iterable[int], stop: Stop) -> Iterator[Computed]:
        """Compute tiles in any order; a tile whose worker died is computed again."""
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
            # Other workers ignore the signals of the pool, and may wait for a lock that the dead one held.
            workers.kill()
            raise
        finally:
            if running:
                workers.kill()
            workers.close()
            stop.at_once = lambda: None
