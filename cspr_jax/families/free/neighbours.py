"""Search for the fastest motions of many pairs of poses on few intervals, from few starts and from neighbours' motions.

Only where a neighbour is much faster, or where nothing is found, its motion is moved to the own poses, and a search
begins from there.
"""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import KDTree

from cspr_jax.families.free.search.interior_point import BARRIERS, optima, started
from cspr_jax.families.free.search.starts import starts
from cspr_jax.families.free.search.tasks import Tasks

# Numbers of the starts from which searches begin: a line, and swings of one arc and of two.
FIRST = (0, 1, 3)
# Weight of the barriers, and softness, of a search from a start, and from a neighbour's motion.
FROM_START, FROM_NEIGHBOUR = (BARRIERS[0], 10.0), (1e-2, 1.0)
# Neighbours of a pair; how many of them can help; part of its time by which one must be faster, besides the distance
# over the way; largest ratio of ways that counts.
NEAR, VISITS, FASTER, RATIO = 8, 2, 0.02, 2.0


class Neighbours:
    """The best motions that are found between pairs of poses.

    Fields:
        controls: (n, K, d) control points.
        duration: (n,) s; inf where none is found.
    """

    def __init__(self, tasks: Tasks, depths: Sequence[float]) -> None:
        """Begin without any."""
        self._tasks, self._depths, count = tasks, depths, len(depths)
        self.controls = np.zeros((count, tasks.basis.controls, tasks.places.shape[-1]))
        self.duration = np.full(count, np.inf)
        ends = tasks.places[:, 0]
        self._way = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        flat = ends.reshape(count, -1)
        distance, near = (part.reshape(count, -1) for part in KDTree(flat).query(flat, min(NEAR + 1, count)))
        rows = np.repeat(np.arange(count), near.shape[1])
        pairs = np.flatnonzero(rows != near.ravel())
        self._rows, self._others, self._distance = rows[pairs], near.ravel()[pairs], distance.ravel()[pairs]
        self._tried = np.full(len(pairs), np.inf)

    @property
    def lacking(self) -> np.ndarray:
        """Numbers of the pairs for which nothing is found."""
        return np.flatnonzero(~np.isfinite(self.duration))

    def search(self) -> None:
        """Search from the first starts, from neighbours, and where nothing is found from the other starts."""
        self._from_starts(np.arange(len(self.duration)), others=False)
        self._from_neighbours()
        if len(self.lacking):
            self._from_starts(self.lacking, others=True)

    def _from_starts(self, rows: np.ndarray, *, others: bool) -> None:
        parts = [starts(self._tasks.taken(rows[i : i + 1]), self._depths[k]) for i, k in enumerate(rows.tolist())]
        chosen = np.flatnonzero(np.isin(np.arange(len(parts[0].task)), FIRST, invert=others))
        controls, duration = (np.concatenate([part[i][chosen, 0] for part in parts]) for i in (1, 2))
        self._improve(np.repeat(rows, len(chosen)), controls, duration, FROM_START)

    def _improve(self, rows: np.ndarray, controls: np.ndarray, duration: np.ndarray, how: tuple[float, float]) -> None:
        # Search from motions, none or several ones for a pair.
        tasks = self._tasks.taken(rows)
        result = optima(tasks, started(tasks, controls[:, None], duration[:, None], how[0]), *how)
        times = np.where(result.is_optimal, result.unknowns.duration[:, 0], np.inf)
        controls = tasks.controls(result.unknowns)[:, 0]
        for k in np.flatnonzero(times < np.inf).tolist():
            if times[k] < self.duration[rows[k]]:
                self.duration[rows[k]], self.controls[rows[k]] = times[k], controls[k]

    def _from_neighbours(self) -> None:
        rows, others = self._rows, self._others
        longest = np.maximum(np.maximum(self._way[rows], self._way[others]), 1e-9)
        ratio = np.clip(self._way[rows] / np.maximum(self._way[others], 1e-9), 1.0 / RATIO, RATIO)
        fraction = 1.0 + FASTER + self._distance / longest
        for _ in range(VISITS):
            # A motion is tried once.
            expected = self.duration[others] * np.sqrt(ratio)
            helps = (expected * fraction < self.duration[rows]) & (self.duration[others] < self._tried)
            best = np.full(len(self.duration), np.inf)
            np.minimum.at(best, rows[helps], expected[helps])
            chosen = np.flatnonzero(helps & (expected == best[rows]))
            chosen = chosen[np.unique(rows[chosen], return_index=True)[1]]
            if not len(chosen):
                break
            self._tried[chosen] = self.duration[others[chosen]]
            self._improve(rows[chosen], self._moved(others[chosen], rows[chosen]), expected[chosen], FROM_NEIGHBOUR)

    def _moved(self, source: np.ndarray, to: np.ndarray) -> np.ndarray:
        # Motions of some pairs, moved to the poses of others.
        tau = self._tasks.basis.averages[:, None]
        fraction = 3.0 * tau**2 - 2.0 * tau**3
        shift = self._tasks.places[to, 0] - self._tasks.places[source, 0]
        return self.controls[source] + shift[:, :1] * (1.0 - fraction) + shift[:, 1:] * fraction
