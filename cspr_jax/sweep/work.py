"""Protocol between a run and the executors that compute its tiles."""

import dataclasses
from collections.abc import Iterable, Iterator
from typing import Any, Protocol

from cspr_jax.store.shards import Shard
from cspr_jax.sweep.signals import Stop


@dataclasses.dataclass(frozen=True)
class Computed:
    """A tile, and the environment that computed it.

    Fields:
        shard: content of the tile.
        environment: environment of the process that computed it.
    """

    shard: Shard
    environment: dict[str, Any]


class Executor(Protocol):
    """Computes tiles, in any order."""

    def environment(self) -> dict[str, Any]:
        """Environment of the computation.

        Returns:
            the environment of the process, or of the workers.
        """
        ...

    def tiles(self, indices: Iterable[int], stop: Stop) -> Iterator[Computed]:
        """Compute tiles.

        Args:
            stop: request to stop, after which tiles in progress are finished and no others are begun.

        Yields:
            the tiles.
        """
        ...
