"""Motions of one family with one amplitude function, so that their blocks are bounded together."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Hashable, Sequence
from typing import Any

import jax
import numpy as np

from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.shapes import Float, Int
from cspr_jax.robots.bounds.state_bounds import StateBounds
from cspr_jax.verification.bounds.amplitude_bounds import time_bounds

BATCH = 64


class MotionBatch:
    """Motions between points or poses, with numbers of arcs."""

    def __init__(
        self, motions: Any, durations: Float[np.ndarray, "n"], kernel: Callable[[Any], StateBounds], *, orders: int = 3
    ) -> None:
        """Keep data that all motions share."""
        self._motions, self.durations, self._kernel, self._orders = motions, np.asarray(durations), kernel, orders

    @classmethod
    def of(cls, motions: Sequence[Any], kernel: Callable[[Any], StateBounds], *, orders: int = 3) -> "MotionBatch":
        """Motions of one `batch_key` as a batch."""
        cases = jax.tree.map(lambda *leaves: np.stack(leaves), *[(each.segment, each.arcs) for each in motions])
        joined = dataclasses.replace(motions[0], segment=cases[0], arcs=cases[1])
        return cls(joined, np.array([float(each.duration()) for each in motions]), kernel, orders=orders)

    def __getitem__(self, i: int) -> Any:
        segment, arcs = self._select(i)
        return dataclasses.replace(self._motions, segment=segment, arcs=as_float64(arcs))

    def take(self, chosen: np.ndarray) -> "MotionBatch":
        """Some of the motions."""
        segment, arcs = self._select(chosen)
        motions = dataclasses.replace(self._motions, segment=segment, arcs=arcs)
        return MotionBatch(motions, self.durations[chosen], self._kernel, orders=self._orders)

    def bounds(
        self, motion: Int[np.ndarray, "k"], start: Float[np.ndarray, "k"], end: Float[np.ndarray, "k"]
    ) -> StateBounds:
        """Bounds of the states over blocks; see `motion.motion.BoundedMotion.bounds`."""
        blocks = time_bounds(self._motions.amplitude, self.durations[motion], start, end, orders=self._orders)
        return in_batches(self._kernel, (*self._select(motion), blocks), batch_size=BATCH)

    def _select(self, chosen: Any) -> Any:
        return jax.tree.map(lambda leaves: np.asarray(leaves)[chosen], (self._motions.segment, self._motions.arcs))


def batch_key(motion: Any) -> Hashable:
    """Key that motions share which one batch can hold: kind, shapes of their data, and amplitude function."""
    leaves, structure = jax.tree.flatten(motion)
    amplitude = tuple(np.asarray(array).tobytes() for array in jax.tree.leaves(motion.amplitude))
    return structure, tuple(np.shape(array) for array in leaves), amplitude
