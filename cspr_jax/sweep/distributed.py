"""Tiles on the workers of a dask.distributed scheduler, on this machine or on many."""

import contextlib
import pickle
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from typing import Any

from cspr_jax.errors import ConfigError, RefusedError, ResourceError
from cspr_jax.identity import differences
from cspr_jax.sweep.definition import Sweep
from cspr_jax.sweep.environment import environment
from cspr_jax.sweep.signals import Stop
from cspr_jax.sweep.tile import compute_tile
from cspr_jax.sweep.work import Computed

SECONDS_TO_CONNECT = 20
# A cluster's queue may let workers wait; people are told after the first of these.
SECONDS_FOR_WORKERS = (5, 900)
# Tiles in flight for each thread of a worker: one computes while another travels.
AHEAD = 2


class Scheduler:
    """Tiles on the workers of a scheduler; dask computes the tiles of a lost worker again.

    Args:
        sweep: the sweep.
        address: of the scheduler, such as tcp://host:8786.
        accept_environment_change: whether workers may differ from one another.
        warn: called with a line for people.

    Raises:
        ConfigError: dask.distributed is not installed, or the address is wrong.
        ResourceError: no scheduler or no worker there.
    """

    def __init__(
        self,
        sweep: Sweep,
        address: str,
        *,
        accept_environment_change: bool = False,
        warn: Callable[[str], None] = lambda line: None,
    ) -> None:
        """Connect, and wait for the first worker."""
        try:
            import distributed
        except ImportError as error:
            raise ConfigError(
                "--scheduler", f"{address}: needs dask.distributed: pip install 'cspr_jax[dask]'"
            ) from error
        self._pickled, self._accept = pickle.dumps(sweep), accept_environment_change
        try:
            self._client = distributed.Client(address, timeout=SECONDS_TO_CONNECT, set_as_default=False)
        except ValueError as error:
            raise ConfigError("--scheduler", f"{address}: must be an address such as tcp://host:8786") from error
        except OSError as error:
            raise ResourceError(
                f"--scheduler {address}: no scheduler answers: start one, or mend the address"
            ) from error
        if not self._has_workers(SECONDS_FOR_WORKERS[0]):
            warn(f"--scheduler {address}: has no workers yet; waiting for {SECONDS_FOR_WORKERS[1] // 60} minutes")
            if not self._has_workers(SECONDS_FOR_WORKERS[1]):
                self.close()
                raise ResourceError(f"--scheduler {address}: has no workers: start some")

    def _has_workers(self, seconds: float) -> bool:
        try:
            self._client.wait_for_workers(1, timeout=seconds)
        except TimeoutError:
            return False
        return True

    def environment(self) -> dict[str, Any]:
        """What all workers have in common.

        Returns:
            the environment of a worker.

        Raises:
            RefusedError: workers that differ, or another version of the program than here.
        """
        found = list(self._client.run(environment).values())
        for other in found[1:]:
            lines = differences(found[0], other)
            if lines and not self._accept:
                raise RefusedError(
                    "\n".join(f"workers differ: {line}: --accept-environment-change takes them" for line in lines)
                )
        here = environment()
        if found[0]["package"] != here["package"] and not self._accept:
            raise RefusedError(
                "workers run another cspr_jax than this process: install the same one, or --accept-environment-change"
            )
        return found[0]

    def tiles(self, indices: Iterable[int], stop: Stop) -> Iterator[Computed]:
        """Compute tiles in any order.

        Args:
            indices: which ones.
            stop: when it is set, what is in progress is finished and nothing is begun.

        Yields:
            the tiles.

        Raises:
            ResourceError: a tile whose workers keep dying.
        """
        from distributed import KilledWorker, as_completed

        waiting = iter(list(indices))

        def submit(index: int) -> Any:
            return self._client.submit(compute_tile, self._pickled, index, pure=False)

        def top_up() -> None:
            # Workers come and go: as many as there are now decide how much is in flight.
            room = AHEAD * max(1, sum(self._client.nthreads().values())) - running.count()
            for _, index in zip(range(0 if stop else room), waiting, strict=False):
                running.add(submit(index))

        running = as_completed([], loop=self._client.loop)
        try:
            top_up()
            for future in running:
                yield future.result()
                top_up()
        except (CancelledError, OSError) as error:
            raise ResourceError("the scheduler is gone: start it, then run again to go on") from error
        except KilledWorker as error:
            raise ResourceError(
                "workers died again and again at one tile, perhaps for want of memory: run.tile must be smaller"
            ) from error

    def close(self) -> None:
        """Leave the scheduler; what is in flight there is given up."""
        with contextlib.suppress(OSError, TimeoutError):
            self._client.close()
