"""Search for the fastest motions of many pairs of poses on few intervals, from few starts and neighbours' motions.

If a neighbouring pair has a much faster motion, or a pair has none, the neighbour's motion is moved to the pair's own
poses, and a new search starts from it.
"""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import KDTree

from cspr_jax.families.free.search.interior_point import BARRIERS, optima, started
from cspr_jax.families.free.search.starts import Starts, starts
from cspr_jax.families.free.search.tasks import Tasks

# Indices of the first starts: a line, and swings of one arc and of two.
FIRST = (0, 1, 3)
# Weight of the barriers, and softness, of a search from one of the starts, and of one from a neighbour's motion.
FROM_START, FROM_NEIGHBOUR = (BARRIERS[0], 10.0), (1e-2, 1.0)
NEAR = 8  # number of neighbours of a pair
VISITS = 2  # number of rounds of searches from neighbours' motions
# A neighbour's motion is tried if it is faster by this fraction plus the relative distance of the poses.
FASTER = 0.02
RATIO = 2.0  # largest ratio of lengths for which durations are scaled


class Neighbours:
    """The best motions found so far between pairs of poses.

    Fields:
        controls: (n, K, d) control points.
        duration: (n,) s; inf where none is found.
    """

    def __init__(self, tasks: Tasks, depths: Sequence[float]) -> None:
        """Start without motions."""
        self._tasks, self._depths, count = tasks, depths, len(depths)
        self.controls = np.zeros((count, tasks.basis.controls, tasks.ends.shape[-1]))
        self.duration = np.full(count, np.inf)
        ends = tasks.ends[:, 0]
        self._lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        flat = ends.reshape(count, -1)
        distance, near = (part.reshape(count, -1) for part in KDTree(flat).query(flat, min(NEAR + 1, count)))
        owners = np.repeat(np.arange(count), near.shape[1])
        pairs = np.flatnonzero(owners != near.ravel())
        self._pairs, self._others, self._distance = owners[pairs], near.ravel()[pairs], distance.ravel()[pairs]
        self._tried = np.full(len(pairs), np.inf)

    @property
    def lacking(self) -> np.ndarray:
        """Indices of the pairs without a motion."""
        return np.flatnonzero(~np.isfinite(self.duration))

    def search(self) -> None:
        """Search from the first starts, from neighbours' motions, then, where none is found, from the other starts."""
        self._from_starts(np.arange(len(self.duration)), others=False)
        self._from_neighbours()
        if len(self.lacking):
            self._from_starts(self.lacking, others=True)

    def search_from(self, begun: Starts) -> None:
        """Search from given motions alone."""
        self._improve(begun.task, begun.controls[:, 0], begun.duration[:, 0], FROM_START)

    def _from_starts(self, pairs: np.ndarray, *, others: bool) -> None:
        parts = [starts(self._tasks.take(pairs[i : i + 1]), self._depths[k]) for i, k in enumerate(pairs.tolist())]
        chosen = np.flatnonzero(np.isin(np.arange(len(parts[0].task)), FIRST, invert=others))
        controls, duration = (np.concatenate([part[i][chosen, 0] for part in parts]) for i in (1, 2))
        self._improve(np.repeat(pairs, len(chosen)), controls, duration, FROM_START)

    def _improve(self, pairs: np.ndarray, controls: np.ndarray, duration: np.ndarray, how: tuple[float, float]) -> None:
        # Search from motions; a pair may have none or several of them.
        tasks = self._tasks.take(pairs)
        result = optima(tasks, started(tasks, controls[:, None], duration[:, None], how[0]), *how)
        times = np.where(result.is_optimal, result.unknowns.duration[:, 0], np.inf)
        controls = tasks.controls(result.unknowns)[:, 0]
        for k in np.flatnonzero(times < np.inf).tolist():
            if times[k] < self.duration[pairs[k]]:
                self.duration[pairs[k]], self.controls[pairs[k]] = times[k], controls[k]

    def _from_neighbours(self) -> None:
        pairs, others = self._pairs, self._others
        longest = np.maximum(np.maximum(self._lengths[pairs], self._lengths[others]), 1e-9)
        ratio = np.clip(self._lengths[pairs] / np.maximum(self._lengths[others], 1e-9), 1.0 / RATIO, RATIO)
        fraction = 1.0 + FASTER + self._distance / longest
        for _ in range(VISITS):
            # Try each motion only once.
            expected = self.duration[others] * np.sqrt(ratio)
            helps = (expected * fraction < self.duration[pairs]) & (self.duration[others] < self._tried)
            best = np.full(len(self.duration), np.inf)
            np.minimum.at(best, pairs[helps], expected[helps])
            chosen = np.flatnonzero(helps & (expected == best[pairs]))
            chosen = chosen[np.unique(pairs[chosen], return_index=True)[1]]
            if not len(chosen):
                break
            self._tried[chosen] = self.duration[others[chosen]]
            self._improve(pairs[chosen], self._moved(others[chosen], pairs[chosen]), expected[chosen], FROM_NEIGHBOUR)

    def _moved(self, source: np.ndarray, to: np.ndarray) -> np.ndarray:
        # Return motions of some pairs, moved to the poses of others.
        tau = self._tasks.basis.averages[:, None]
        fraction = 3.0 * tau**2 - 2.0 * tau**3
        shift = self._tasks.ends[to, 0] - self._tasks.ends[source, 0]
        return self.controls[source] + shift[:, :1] * (1.0 - fraction) + shift[:, 1:] * fraction
