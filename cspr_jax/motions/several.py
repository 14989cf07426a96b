"""Several motions of one family on one amplitude function, so that bounds of blocks of all are computed together."""

import dataclasses
from collections.abc import Callable
from typing import Any

import jax
import numpy as np

from cspr_jax.arithmetic.batches import in_batches
from cspr_jax.arithmetic.elementary import leaf
from cspr_jax.motions.amplitude_bounds import time_bounds
from cspr_jax.robots.state_bounds import StateBounds

BATCH = 64


class SeveralMotions:
    """Motions between points or poses, with numbers of arcs."""

    def __init__(
        self, motions: Any, durations: np.ndarray, kernel: Callable[[Any], StateBounds], *, orders: int = 3
    ) -> None:
        """Keep what all have in common.

        Args:
            motions: one motion whose segment and number of arcs have a leading dimension n.
            durations: (n,) s.
            kernel: compiled, gives the bounds of k blocks, from segments and numbers of arcs (k, ...), and bounds of
                the amplitude function.
            orders: number of functions that the kernel takes: of A, and of its derivatives.
        """
        self._motions, self.durations, self._kernel, self._orders = motions, np.asarray(durations), kernel, orders

    def __getitem__(self, i: int) -> Any:
        segment, arcs = self._rows(i)
        return dataclasses.replace(self._motions, segment=segment, arcs=leaf(arcs))

    def taken(self, chosen: np.ndarray) -> "SeveralMotions":
        """Some of the motions.

        Args:
            chosen: (m,) numbers, or (n,) mask.

        Returns:
            them.
        """
        segment, arcs = self._rows(chosen)
        motions = dataclasses.replace(self._motions, segment=segment, arcs=arcs)
        return SeveralMotions(motions, self.durations[chosen], self._kernel, orders=self._orders)

    def bounds(self, motion: np.ndarray, start: np.ndarray, end: np.ndarray) -> StateBounds:
        """Bounds of the states over blocks; see `motions.motion.BoundedMotion.bounds`.

        Args:
            motion: (k,) numbers of the motions, from 0 on.
            start: (k,) s.
            end: (k,) s.

        Returns:
            the bounds, leaves (k, ...).
        """
        blocks = time_bounds(self._motions.amplitude, self.durations[motion], start, end, orders=self._orders)
        return in_batches(self._kernel, (*self._rows(motion), blocks), size=BATCH)

    def _rows(self, chosen: Any) -> Any:
        return jax.tree.map(lambda leaves: np.asarray(leaves)[chosen], (self._motions.segment, self._motions.arcs))
