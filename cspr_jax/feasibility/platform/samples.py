"""Samples along the arcs of many motions of a platform, and the smallest values around them."""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import numpy as np

from cspr_jax.arithmetic.batches import in_batches
from cspr_jax.feasibility.platform.kernels import SECTIONS, narrowed
from cspr_jax.feasibility.problem import Problem
from cspr_jax.trajectories.platform_segment import Kind, PoseSegment

SAMPLES = 64  # an arc
# Values that spread less along a motion are not narrowed.
LEVEL = 1e-9


def rows(segments: PoseSegment, which: np.ndarray) -> PoseSegment:
    """Segments chosen from many.

    Args:
        segments: leaves (n, ...).
        which: indices, or (n,) a mask.

    Returns:
        leaves (m, ...).
    """
    return jax.tree.map(lambda x: x[which], segments)


class Motions(NamedTuple):
    """Motions of a platform.

    Fields:
        segments: leaves (n, ...), of the parity of `arcs`.
        arcs: (n,) how many each has.
    """

    segments: PoseSegment
    arcs: np.ndarray

    def rows(self, which: np.ndarray) -> "Motions":
        """Motions chosen by indices, or by a mask (n,)."""
        return Motions(rows(self.segments, which), self.arcs[which])

    def steps(self, which: np.ndarray) -> np.ndarray:
        """Distance in tau between samples of chosen motions.

        Args:
            which: (m,) indices.

        Returns:
            (m,) of tau.
        """
        return 1.0 / (SAMPLES * self.arcs[which])

    def items(self, which: np.ndarray) -> tuple[PoseSegment, np.ndarray]:
        """Chosen motions as kernels take them.

        Args:
            which: (m,) indices.

        Returns:
            leaves (m, ...), and (m,) numbers of arcs as floats.
        """
        return rows(self.segments, which), self.arcs[which].astype(float)


class Samples(NamedTuple):
    """Values along arcs; those of one motion lie side by side.

    Fields:
        row: (k,) whose arc it is.
        arc: (k,) which one, from 0 on.
        values: of the kernel, arcs last.
    """

    row: np.ndarray
    arc: np.ndarray
    values: Any

    def least(self) -> np.ndarray:
        """The smallest of values (m, n_values, k) along each motion.

        Returns:
            (n_values, n).
        """
        return np.minimum.reduceat(self.values.min(0), np.flatnonzero(self.arc == 0), axis=1)

    def of(self, which: np.ndarray) -> "Samples":
        """Samples of some motions.

        Args:
            which: (n,) a mask.

        Returns:
            that of theirs.
        """
        some = which[self.row]
        values = jax.tree.map(lambda x: x[..., some], self.values)
        return Samples((np.cumsum(which) - 1)[self.row[some]], self.arc[some], values)

    def instants(self, motions: Motions, item: np.ndarray, place: np.ndarray) -> np.ndarray:
        """Instants at which arcs are at places.

        Args:
            motions: n of them.
            item: (j,) indices of arcs.
            place: (j,) counted in samples.

        Returns:
            (j,) tau.
        """
        return (self.arc[item] + place / SAMPLES) / motions.arcs[self.row[item]]


class Places(NamedTuple):
    """Instants around which values are narrowed down.

    Fields:
        which: (k,) the value.
        row: (k,) the motion.
        tau: (k,) the instant.
        width: (k,) how far on either side.
    """

    which: np.ndarray
    row: np.ndarray
    tau: np.ndarray
    width: np.ndarray


def along(kernel: Callable, motions: Motions, *, size: int) -> Samples:
    """Samples along all arcs of motions.

    Args:
        kernel: `kernels.moving_along` or `kernels.still_along` of a robot.
        motions: n of them.
        size: how many arcs are sampled in one call.

    Returns:
        the samples.
    """
    arcs = motions.arcs
    row = np.repeat(np.arange(len(arcs)), arcs)
    arc = np.arange(len(row)) - np.repeat(np.cumsum(arcs) - arcs, arcs)
    within = np.linspace(0.0, 1.0, SAMPLES + 1)

    def batch(items):
        own, which = items
        return kernel(within, (*motions.items(own), which.astype(float)))

    return Samples(row, arc, in_batches(batch, (row, arc), size=size, axis=-1))


class Narrowing(NamedTuple):
    """Finds smallest values of the criteria that depend on the motion, or of those that depend on the pose alone.

    Fields:
        problem: robot, limits, amplitude.
        kind: of the motions.
        pairs: of cables that can meet; None: for what depends on the motion.
        size: how many places are looked at in one call.
    """

    problem: Problem
    kind: Kind
    pairs: tuple | None
    size: int

    def around(self, motions: Motions, samples: Samples) -> np.ndarray:
        """The smallest values, narrowed down around the samples that may be near them.

        Args:
            motions: n of them.
            samples: values (m, n_values, k) along them.

        Returns:
            (n_values, n).
        """
        least = samples.least()
        place, which, item = low_points(samples.values, least[:, samples.row])
        row = samples.row[item]
        self.lower(least, motions, Places(which, row, samples.instants(motions, item, place), motions.steps(row)))
        return least

    def lower(self, least: np.ndarray, motions: Motions, places: Places, sections: int = SECTIONS) -> np.ndarray:
        """Put what lies around places into smallest values.

        Args:
            least: (n_values, n); written into.
            motions: n of them.
            places: k of them.
            sections: golden sections of each; 0: two points.

        Returns:
            (k,) what was found.
        """
        which, row, tau, width = places
        if not len(row):
            return np.zeros(0)
        items = (*motions.items(row), tau, width, which.astype(np.int32))
        kernel = partial(narrowed, self.problem, pairs=self.pairs, kind=self.kind, sections=sections)
        values = in_batches(kernel, items, size=self.size)
        np.minimum.at(least, (which, row), values)
        return values


def low_points(values: np.ndarray, least: np.ndarray) -> tuple[np.ndarray, ...]:
    """Samples no larger than their neighbours, where a parabola of twice the bend could reach the smallest value.

    Args:
        values: (m, n_values, n) samples side by side.
        least: (n_values, n).

    Returns:
        which of the m, of the n_values and of the n, (k,) each.
    """
    falls = values[1:] < values[:-1]
    side = np.ones_like(falls[:1])
    is_low = np.concatenate([side, falls]) & np.concatenate([~falls, side])
    is_low &= np.ptp(values, axis=0) > LEVEL
    place, which, row = np.nonzero(is_low)
    here, last = values[place, which, row], len(values) - 1
    before, after = (values[np.clip(place + k, 0, last), which, row] for k in (-1, 1))
    bend = before - 2.0 * here + after
    reaches = np.isfinite(bend) & (here - 0.25 * bend <= least[which, row])
    return place[reaches], which[reaches], row[reaches]
