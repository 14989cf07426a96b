"""Computation and check of a tile of a sweep."""

import functools
import pickle
from collections.abc import Mapping

import jax
import numpy as np

from cspr_jax.config.missing_cables import ANY_ONE
from cspr_jax.config.robot import RobotFile
from cspr_jax.errors import ResourceError, SelfCheckError
from cspr_jax.maps.grid_map import GridMap, RobotsApartError
from cspr_jax.numerics.batches import in_threads, short_batches
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.schema.identity import digest
from cspr_jax.schema.quantities import is_of_robot
from cspr_jax.store.shards import Shard
from cspr_jax.sweep.definition import Sweep
from cspr_jax.sweep.environment import environment
from cspr_jax.sweep.robots import robot_at, robot_axes, robots_of
from cspr_jax.sweep.work import Computed

# Margins this close to zero may have another sign on another processor; results contain the number of such cells.
NEAR_ZERO = 1e-9


class TileMap:
    """The map of a sweep, prepared to compute its tiles.

    Raises:
        ConfigError: robot, amplitude function or limits cannot be used, or nothing in the grid can be reached.
    """

    def __init__(self, sweep: Sweep) -> None:
        """Refuse a sweep that cannot be computed."""
        self._sweep = sweep
        with double_precision():
            # Each robot of a tile has a map of its own where axes are parameters, unless a kind has robots as lanes.
            self._one = _over_robots(sweep) if robot_axes(sweep.grid.axes) else _map_of(sweep, sweep.robot)
            if self._one is not None:
                self._one.refuse_hopeless(sweep.grid)

    def __call__(self, index: int) -> Computed:
        """Compute a tile."""
        tiling = self._sweep.grid.tiling
        try:
            with double_precision():
                answers, undecided = self._answers(index, self._sweep.grid.cells(tiling.slices(index)))
        except (MemoryError, jax.errors.JaxRuntimeError) as error:
            if isinstance(error, MemoryError) or "RESOURCE_EXHAUSTED" in str(error):
                raise ResourceError(
                    f"{self._sweep.file}: run.tile = {list(self._sweep.grid.tile)}: does not fit into memory: "
                    "must be smaller"
                ) from error
            raise
        # Counts and flags fit into their small types, since max_arcs is at most 1000.
        values = {n: answers[n].astype(kind).reshape(tiling.extent(index)) for n, kind in self._sweep.types.items()}
        this_environment = environment()
        return Computed(
            Shard(index, digest(this_environment), _near_zero(answers), values, undecided), this_environment
        )

    def _answers(self, index: int, cells: dict[str, np.ndarray]) -> tuple[dict[str, np.ndarray], int | None]:
        # Answers of the cells of a tile, robot by robot, and the number of them that are undecided.
        if self._one is not None:
            answers = self._one(cells)
            _refuse(index, self._one.contradictions(answers))
            return answers, self._one.undecided(answers)
        sweep, robots = self._sweep, list(robots_of(cells))
        others = {name: points for name, points in cells.items() if not is_of_robot(name)}

        def of_robot(robot: tuple[dict[str, float], np.ndarray]) -> tuple[dict[str, np.ndarray], int | None]:
            values, indices = robot
            one = _map_of(sweep, robot_at(sweep.robot, sweep.spec, sweep.kind, values, sweep.file))
            answers = one({name: points[indices] for name, points in others.items()})
            _refuse(index, one.contradictions(answers))
            return answers, one.undecided(answers)

        with short_batches():
            parts, counts = zip(*in_threads(of_robot, robots), strict=True)
        order = np.argsort(np.concatenate([indices for _, indices in robots]))
        # Answers without a number for each cell are not stored.
        names = [name for name, values in parts[0].items() if np.ndim(values)]
        answers = {name: np.concatenate([part[name] for part in parts])[order] for name in names}
        return answers, None if None in counts else sum(counts)


def _over_robots(sweep: Sweep) -> GridMap | None:
    def robot(values: Mapping[str, float]) -> RobotFile:
        return robot_at(sweep.robot, sweep.spec, sweep.kind, values, sweep.file)

    make = sweep.kind.load_over_robots()
    try:
        return None if make is None else make(robot, sweep.spec, sweep.file, sweep.grid.axes)
    except RobotsApartError:
        return None


def _map_of(sweep: Sweep, robot_file: RobotFile) -> GridMap:
    make = sweep.kind.load()
    if sweep.spec.without != ANY_ONE:
        return make(robot_file, sweep.spec, sweep.file)
    from cspr_jax.workspaces.any_cable_gone import AnyCableGone  # other maps do without workspaces

    return AnyCableGone(make, robot_file, sweep.spec, sweep.file)


def _near_zero(answers: dict[str, np.ndarray]) -> int:
    return int((np.abs(answers["margin"]) < NEAR_ZERO).sum()) if "margin" in answers else 0


def _refuse(index: int, contradictions: dict[str, np.ndarray]) -> None:
    # Contradictions mean that a processor, driver or compiler is faulty.
    for error, cells in contradictions.items():
        if cells.any():
            raise SelfCheckError(
                f"tile {index}: {int(cells.sum())} of {cells.size} cells: {error}; nothing of it was kept; "
                "check the machine, then run again"
            )


@functools.lru_cache(maxsize=2)
def _tile_map(pickled: bytes) -> TileMap:
    return TileMap(pickle.loads(pickled))


def compute_tile(pickled: bytes, index: int) -> Computed:
    """Compute a tile in a worker process, which unpickles the sweep at its first tile."""
    return _tile_map(pickled)(index)
