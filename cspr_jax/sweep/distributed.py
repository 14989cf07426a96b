"""Tiles on the workers of a dask.distributed scheduler, on this machine or on many."""

import collections
import contextlib
import math
import pickle
import socket
import time
import urllib.parse
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from typing import Any, cast

from cspr_jax.errors import ConfigError, RefusedError, ResourceError, StoppedError
from cspr_jax.schema.identity import differences
from cspr_jax.store.files.netcdf import reason
from cspr_jax.sweep.definition import Sweep
from cspr_jax.sweep.environment import environment
from cspr_jax.sweep.signals import Stop
from cspr_jax.sweep.tile import compute_tile
from cspr_jax.sweep.work import Computed

SECONDS_TO_CONNECT = 20
# Times after which a scheduler is given up.
SECONDS_TO_REACH = 3.5  # that cannot be reached
SECONDS_FOR_REFUSAL = 1.0  # that refuses connections
SECONDS_LOST = 3.0  # that was lost
# Workers may wait in a cluster's queue: times, s, after which the user is told, and after which the run gives up.
SECONDS_FOR_WORKERS = (5, 900)
# Interval of checks for a request to stop, s.
POLL_SECONDS = 0.5
# Tiles in progress for each thread of a worker: one is computed while another is sent.
AHEAD = 2


class Scheduler:
    """Tiles on the workers of a scheduler; dask computes the tiles of a lost worker again.

    Args:
        address: address of the scheduler, such as tcp://host:8786.
        accept_environment_change: whether workers may have different environments.
        stop: request to stop, which also ends waiting for workers.
        warn: function that is called with a line for the user.

    Raises:
        ConfigError: dask.distributed is not installed, or the address is wrong.
        ResourceError: there is no scheduler, or no worker.
        StoppedError: asked to stop before a worker came.
    """

    def __init__(
        self,
        sweep: Sweep,
        address: str,
        *,
        accept_environment_change: bool = False,
        stop: Stop | None = None,
        warn: Callable[[str], None] = lambda line: None,
    ) -> None:
        """Connect, and wait for the first worker."""
        try:
            import distributed
        except ImportError as error:
            raise ConfigError(
                "--scheduler", f"{address}: needs dask.distributed: pip install 'cspr_jax[dask]'"
            ) from error
        self._address, self._accept, self._warn = address, accept_environment_change, warn
        try:
            seconds = SECONDS_TO_CONNECT if _is_reached(address) else SECONDS_FOR_REFUSAL
            self._client = distributed.Client(address, timeout=seconds)
        except ValueError as error:
            raise ConfigError("--scheduler", f"{address}: must be an address such as tcp://host:8786") from error
        except (TypeError, RuntimeError) as error:  # tls:// without certificates; encryption required, but tcp://
            raise ConfigError(
                "--scheduler", f"{address}: {reason(error)}: must fit dask's TLS settings (docs/reliability.md)"
            ) from error
        except OSError as error:
            raise ResourceError(
                f"--scheduler {address}: no scheduler answers: start one, or mend the address"
            ) from error
        try:
            self._wait_for_workers(Stop() if stop is None else stop)  # a stop that nobody has requested is false
        except BaseException:
            self.close()
            raise
        # dask makes it again, like a tile, if its worker is lost.
        self._sweep = self._client.submit(bytes, pickle.dumps(sweep), pure=False)

    def _wait_for_workers(self, stop: Stop) -> None:
        begin, has_warned = time.monotonic(), False
        while not self._client.nthreads():
            waited = time.monotonic() - begin
            if stop.code is not None:
                raise StoppedError("stopped: no worker came; nothing was computed", stop.code)
            if waited > SECONDS_FOR_WORKERS[1]:
                raise ResourceError(f"--scheduler {self._address}: has no workers: start some")
            if waited > SECONDS_FOR_WORKERS[0] and not has_warned:
                minutes = SECONDS_FOR_WORKERS[1] // 60
                self._warn(f"--scheduler {self._address}: has no workers yet; waiting for {minutes} minutes")
                has_warned = True
            time.sleep(POLL_SECONDS)

    def environment(self) -> dict[str, Any]:
        """Environment that all workers share."""
        try:
            environments = list(self._client.run(environment).values())
        except Exception as error:  # dask raises errors of any type for modules that workers cannot import
            raise ResourceError(
                f"--scheduler {self._address}: a worker cannot run cspr_jax: {reason(error)}: install the same there"
            ) from error
        if not environments:
            raise ResourceError(f"--scheduler {self._address}: has lost its workers: start some")
        for other in environments[1:]:
            lines = differences(environments[0], other)
            if lines and not self._accept:
                raise RefusedError(
                    *(f"workers differ: {line}: --accept-environment-change takes them" for line in lines)
                )
        current = environment()
        if environments[0]["package"] != current["package"] and not self._accept:
            raise RefusedError(
                "workers run another cspr_jax than this process: install the same one, or --accept-environment-change"
            )
        return environments[0]

    def tiles(self, indices: Iterable[int], stop: Stop) -> Iterator[Computed]:
        """Compute tiles in any order."""
        from distributed import KilledWorker, wait

        waiting, running, has_warned = collections.deque(indices), set[Any](), False
        lost = _Lost(self._client)
        try:
            while running or (waiting and not stop):
                if lost.is_so():
                    raise ConnectionError
                # Workers come and go: the current number of threads determines how many tiles are in progress.
                threads = self._threads()
                if threads is None:
                    continue
                if not threads and stop:
                    return
                if not threads and not has_warned:
                    self._warn(f"--scheduler {self._address}: has lost its workers; waiting for others")
                has_warned = not threads
                while waiting and not stop and len(running) < AHEAD * threads:
                    running.add(self._client.submit(compute_tile, self._sweep, waiting.popleft(), pure=False))
                if not running:
                    time.sleep(POLL_SECONDS)
                    continue
                try:
                    done, running = wait(running, timeout=POLL_SECONDS, return_when="FIRST_COMPLETED")
                except TimeoutError:
                    continue
                for future in done:
                    yield future.result()
        except (CancelledError, OSError) as error:
            raise ResourceError("the scheduler is gone: start it, then run again to go on") from error
        except KilledWorker as error:
            raise ResourceError(
                "workers died again and again at one tile, perhaps for want of memory: run.tile must be smaller"
            ) from error

    def _threads(self) -> int | None:
        # None where the scheduler does not answer, since it is busy or lost.
        if self._client.status != "running":
            time.sleep(POLL_SECONDS)
            return None
        try:
            counts = self._client.sync(cast(Any, self._client.scheduler).ncores, callback_timeout=SECONDS_LOST)
        except OSError:
            return None
        return sum(counts.values())

    def close(self) -> None:
        """Leave the scheduler, and cancel tiles that are in progress there."""
        with contextlib.suppress(OSError, TimeoutError):
            self._client.close(timeout=SECONDS_LOST)


class _Lost:
    # Tells whether the connection has been lost for some time, during which dask tries to restore it.

    def __init__(self, client: Any) -> None:
        self._client, self._since = client, math.inf

    def is_so(self) -> bool:
        current = time.monotonic()
        self._since = math.inf if self._client.status == "running" else min(self._since, current)
        return current - self._since > SECONDS_LOST or self._client.status == "closed"


def _is_reached(address: str) -> bool:
    # dask would retry for as long as a slow scheduler may take to answer; errors of addresses are left to it.
    url = urllib.parse.urlsplit(address if "://" in address else f"tcp://{address}")
    try:
        if url.scheme in ("tcp", "tls") and url.hostname and url.port is not None:
            socket.create_connection((url.hostname, url.port), SECONDS_TO_REACH).close()
    except OSError:
        return False
    except ValueError:  # the port is no number
        return True
    return True
