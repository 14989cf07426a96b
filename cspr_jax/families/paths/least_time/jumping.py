"""The fastest motions along sections with jumps of acceleration, for many sections at a time."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import NamedTuple

import jax
import numpy as np

from cspr_jax.families.paths.least_time.controllable import GridSolution, fastest, minmod_rates
from cspr_jax.families.paths.least_time.discrete import Discrete
from cspr_jax.families.paths.least_time.nodes import PathSpeeds
from cspr_jax.families.paths.least_time.timed import moving
from cspr_jax.numerics.batches import device_batch_size, padded
from cspr_jax.numerics.shapes import Float

TOGETHER = 32  # number of sections solved at a time, unless there is only one
REPEATS = 2  # number of times that changes of u within cells are taken from a solution
# In cells narrower than this fraction of the mean width, u changes as in a given motion.
NARROW = 0.5


class PathAccelerations(NamedTuple):
    """Path accelerations of a feasible motion along a section, near which a faster one is searched for in hard cases.

    Fields:
        coordinate: (k,) increasing s, m.
        acceleration: (k,) path acceleration, m/s^2.
    """

    coordinate: np.ndarray
    acceleration: np.ndarray

    def u_rate(self, nodes: Float[np.ndarray, "n_cells+1"]) -> Float[np.ndarray, "n_cells"]:
        """Changes of the path acceleration within cells, over their widths."""
        return np.diff(np.interp(nodes, *self)) / np.diff(nodes)


class Jumping(NamedTuple):
    """The fastest motion along a section.

    Fields:
        run: path speeds and accelerations; None if there is no motion.
        u_rate: (n_cells,) change of u along each cell, over its width.
        first: solution with constant u in each cell or, if that has no motion, with the changes of u of a given motion.
    """

    run: PathSpeeds | None
    u_rate: np.ndarray
    first: GridSolution


def solved_together(paths: Sequence[Discrete], u_rates: Sequence[np.ndarray]) -> list[GridSolution]:
    """Solutions of sections on their grids, in batches of equal shapes."""
    solutions: dict[int, GridSolution] = {}
    groups = defaultdict(list)
    for k, path in enumerate(paths):
        groups[path.start.u.shape].append(k)
    for members in groups.values():
        count = device_batch_size(TOGETHER)
        for first in range(0, len(members), count):
            chosen = members[first : first + count]
            columns = [
                ((p.start, p.end), p.grid.width, u_rates[k], p.cap(), tuple(np.asarray(x) for x in p.ends))
                for k, p in ((k, paths[k]) for k in chosen)
            ]
            stacked = jax.tree.map(lambda *x: np.stack(x), *columns)
            stacked = stacked if len(chosen) == 1 else padded(stacked, count)
            answer = fastest(*jax.tree.map(lambda x: np.moveaxis(x, 0, -1), stacked))
            answer = jax.tree.map(np.asarray, answer)
            for i, k in enumerate(chosen):
                solutions[k] = jax.tree.map(lambda x, i=i: x[..., i], answer)
    return [solutions[k] for k in range(len(paths))]


def run_of(solution: GridSolution, path: Discrete, u_rate: Float[np.ndarray, "n_cells"]) -> PathSpeeds | None:
    """Path speeds and accelerations of a solution."""
    if not _is_passable(solution):
        return None
    half = 0.5 * u_rate * path.grid.width
    u = np.asarray(solution.u)
    return moving(PathSpeeds(np.asarray(solution.x), u - half, u + half), path.grid.width)


def jumping_motions(paths: Sequence[Discrete], guesses: Sequence[PathAccelerations | None] = ()) -> list[Jumping]:
    """The fastest motions along sections.

    Within cells u changes at the same rate as from cell to cell, if such a motion exists.
    """
    u_rates = [np.zeros_like(path.grid.width) for path in paths]
    solutions = solved_together(paths, u_rates)
    guessed = {
        k: guess.u_rate(paths[k].grid.nodes)
        for k, guess in enumerate(guesses)
        if guess is not None and not _is_passable(solutions[k])
    }
    for k, solution in zip(guessed, solved_together([paths[k] for k in guessed], list(guessed.values())), strict=True):
        solutions[k], u_rates[k] = solution, guessed[k]
    motions = [
        Jumping(run_of(solution, path, u_rate), u_rate, solution)
        for solution, path, u_rate in zip(solutions, paths, u_rates, strict=True)
    ]
    going = [k for k, motion in enumerate(motions) if motion.run is not None]
    for _ in range(REPEATS):
        changes = [_changes(solutions[k], paths[k].grid.width, guessed.get(k)) for k in going]
        following = solved_together([paths[k] for k in going], changes)
        better = [run_of(s, paths[k], change) for k, s, change in zip(going, following, changes, strict=True)]
        for k, solution, change, run in zip(going, following, changes, better, strict=True):
            if run is not None:
                solutions[k], motions[k] = solution, motions[k]._replace(run=run, u_rate=change)
        going = [k for k, run in zip(going, better, strict=True) if run is not None]
    return motions


def _is_passable(solution: GridSolution) -> bool:
    return bool(solution.empty < 0 and solution.is_start)


def _changes(solution: GridSolution, width: np.ndarray, guessed: np.ndarray | None) -> np.ndarray:
    # Cells are narrow where the path almost turns back: there u changes at the given rate.
    change = minmod_rates(np.asarray(solution.u), width)
    return change if guessed is None else np.where(width < NARROW * width.mean(), guessed, change)


def again(paths: Sequence[Discrete], u_rates: Sequence[np.ndarray]) -> list[PathSpeeds | None]:
    """The fastest motions with given changes of u within cells."""
    solutions = solved_together(paths, u_rates)
    return [run_of(*case) for case in zip(solutions, paths, u_rates, strict=True)]
