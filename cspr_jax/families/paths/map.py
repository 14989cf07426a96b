"""Maps of least durations along paths from one position to each target."""

import numpy as np

from cspr_jax.config.keys.path import MAP_GRID, RAMP_TIME, PathTable, TargetPath
from cspr_jax.config.robot import RobotFile
from cspr_jax.config.sweep import SweepFile
from cspr_jax.curves.files import kept_to, placed_inward
from cspr_jax.curves.spline import Spline
from cspr_jax.families.paths.batch import least_times
from cspr_jax.families.paths.geometry.path_specs import path_through
from cspr_jax.families.paths.geometry.section import Section
from cspr_jax.maps.proved_map import ProvedMap, joined_columns, proved_columns
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.linear.frames import IDENTITY
from cspr_jax.verification.proved_answers import proved_answers


class PathsMap(ProvedMap):
    """The least duration of all motions along the path to each target; see `GridMap`."""

    motors = True

    def __init__(self, robot_file: RobotFile, spec: SweepFile, file: object) -> None:
        """Read the keys of paths; see `ProvedMap`."""
        super().__init__(robot_file, spec, file)
        self._path, self._pattern = spec.trajectory.path or TargetPath(), robot_file.own_pattern

    def __call__(self, cells: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Answers of the cells of a tile; see `GridMap.__call__`."""
        starts, ends = (
            self._frame.outward(positions) for positions in (self._start_positions(cells), self._targets(cells))
        )
        tables = [self._path.between(*pair, self._z_axis) for pair in zip(starts.tolist(), ends.tolist(), strict=True)]
        moves = np.array([table is not None for table in tables])
        columns = {name: np.full(len(moves), np.nan) for name in ("duration", "lower_bound")}
        paths = [
            self._sections(table, start, end)
            for table, start, end in zip(tables, starts, ends, strict=True)
            if table is not None
        ]
        grid = MAP_GRID if self._path.grid is None else self._path.grid
        ramp_time = RAMP_TIME if self._path.ramp_time is None else self._path.ramp_time
        fastest = least_times(self._problem, self._scene, paths, grid, ramp_time) if paths else None
        if fastest is not None:
            columns["duration"][moves] = np.where(np.isfinite(fastest.duration), fastest.duration, np.nan)
            columns["lower_bound"][moves] = fastest.lower_bound
        resting = None
        if not moves.all():
            resting = proved_answers(self._problem, [self._at_rest(end) for end in ends[~moves]], self._scene)
            for column in columns.values():
                column[~moves] = np.where(resting.feasible, 0.0, np.nan)
        parts = [(moves, None if fastest is None else fastest.answers), (~moves, resting)]
        return columns | joined_columns(
            [(mask, proved_columns(answers)) for mask, answers in parts if answers is not None]
        )

    def _sections(self, table: PathTable, start: np.ndarray, end: np.ndarray) -> list[Section]:
        # Return the path as a plan would have it, in the axes of the kernels.
        points = np.array([start, *(table.points or ()), end])
        units = None if self._unit is None else np.tile(self._unit, (len(points), 1))
        sections = path_through(table, points, units).sections()
        return [section._replace(curve=self._placed(section.curve)) for section in sections]

    def _placed(self, curve: Spline) -> Spline:
        return placed_inward(kept_to(self._pattern, curve, is_planar=False), self._frame, np.array(IDENTITY))

    def _at_rest(self, position: np.ndarray) -> Spline:
        # Return a motion that stays at rest for one second.
        unit = None if self._unit is None else as_float64(self._unit[None, None])
        return self._placed(Spline(as_float64(np.array([0.0, 1.0])), as_float64(position[None, None]), unit))
