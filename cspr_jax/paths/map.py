"""Maps of least durations along paths from one place to each target."""

import functools
import operator

import numpy as np

from cspr_jax.arithmetic.elementary import leaf
from cspr_jax.arithmetic.frames import IDENTITY
from cspr_jax.build.orientations import given_quaternion
from cspr_jax.build.scenes import scene_of
from cspr_jax.config.path import MAP_GRID, RAMP_TIME, PathTable, TargetPath
from cspr_jax.config.robot import RobotFile
from cspr_jax.config.sweep import SweepFile
from cspr_jax.curves.files import kept_to, placed_inward
from cspr_jax.curves.spline import Spline
from cspr_jax.errors import ConfigError
from cspr_jax.maps.from_places import check_place
from cspr_jax.maps.grid_map import ROUNDING, GridMap, exceeds
from cspr_jax.motions.criteria import FLAGS, judged_poses
from cspr_jax.motions.proved_answers import ProvedAnswers, proved_answers
from cspr_jax.paths.courses import course_through
from cspr_jax.paths.many import least_times
from cspr_jax.paths.section import Section
from cspr_jax.robots.patterns import PATTERNS
from cspr_jax.robots.platform import PlatformRobot
from cspr_jax.schema.tiles import Grid
from cspr_jax.schema.verdicts import Verdict

# Contacts, and what can be said of a motion beside its contacts.
_CONTACTS = functools.reduce(operator.or_, FLAGS.values())
_BESIDE = _CONTACTS | Verdict.UNDECIDED | Verdict.UNCERTAINTY | Verdict.BELOW_FLOOR
_COLUMNS = {"tension_margin": "margin", "tension_margin_bound": "margin_bound"}


class PathsMap(GridMap):
    """The least duration of all motions along the path to each target; see `GridMap`."""

    proves = True
    any_cables = True

    def __init__(self, robot_file: RobotFile, keys: SweepFile, file: object) -> None:
        """Refuse robots that go along no path, and starts without a place."""
        super().__init__(robot_file, keys, file)
        check_place(robot_file, keys, file)
        if robot_file.own_pattern == "1T" or PATTERNS[robot_file.own_pattern].is_jointed:
            allowed = "must be one that moves in space or in a plane in this map"
            raise ConfigError(file, f'robot "{robot_file.name}" is {robot_file.kind}: {allowed}')
        start, axes = keys.trajectory.start, [getattr(keys.axes, f"from_{name}") for name in "xyz"]
        if start is None and None in axes:
            allowed = "{ position = [x, y, z] }, or axes from_x, from_y, from_z"
            raise ConfigError(file, f"trajectory.from is missing: {allowed}")
        for key in ("tilt_torsion", "beta_hat", *(() if robot_file.is_platform else ("quaternion",))):
            if start is not None and getattr(start, key) is not None:
                raise ConfigError(file, f'trajectory.from.{key}: must be absent with family = "path"')
        self._unit = None
        if isinstance(self._problem.robot, PlatformRobot):
            quaternion = None if start is None else start.quaternion
            self._unit = given_quaternion(quaternion, "trajectory.from.quaternion", file)
        self._path, self._pattern = keys.trajectory.path or TargetPath(), robot_file.own_pattern
        self._scene = scene_of(self._problem.robot, robot_file, self._frame, keys, file, trajectory=keys.trajectory)

    def __call__(self, cells: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Answers of the cells of a tile; see `GridMap.__call__`."""
        starts, ends = (self._frame.outward(places) for places in (self._start_places(cells), self._targets(cells)))
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
        still = None
        if not moves.all():
            still = proved_answers(self._problem, [self._still(end) for end in ends[~moves]], self._scene)
            for column in columns.values():
                column[~moves] = np.where(still.feasible, 0.0, np.nan)
        parts = [(moves, None if fastest is None else fastest.answers), (~moves, still)]
        return columns | _joined([(rows, _columns(answers)) for rows, answers in parts if answers is not None])

    def _sections(self, table: PathTable, start: np.ndarray, end: np.ndarray) -> list[Section]:
        # The path as a plan has it, in the axes of the kernels.
        points = np.array([start, *(table.points or ()), end])
        units = None if self._unit is None else np.tile(self._unit, (len(points), 1))
        sections = course_through(table, points, units).sections()
        return [section._replace(curve=self._placed(section.curve)) for section in sections]

    def _placed(self, curve: Spline) -> Spline:
        return placed_inward(kept_to(self._pattern, curve, is_planar=False), self._frame, np.array(IDENTITY))

    def _still(self, place: np.ndarray) -> Spline:
        # A second of rest in a place.
        unit = None if self._unit is None else leaf(self._unit[None, None])
        return self._placed(Spline(leaf(np.array([0.0, 1.0])), leaf(place[None, None]), unit))

    def refuse_hopeless(self, grid: Grid) -> None:
        """Refuse targets that are all out of reach; see `GridMap.refuse_hopeless`."""
        self._refuse_out_of_plane(grid)
        if judged_poses(self._problem.robot)[1]:
            super().refuse_hopeless(grid)

    def contradictions(self, answers: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Cells whose numbers contradict each other; see `GridMap.contradictions`."""
        feasible, duration, margin = answers["verdict"] == 0, answers["duration"], answers["tension_margin"]
        return {
            "a feasible cell without a duration": feasible & ~(duration >= 0.0),
            "an infeasible cell with a duration": ~feasible & np.isfinite(duration),
            "a duration below its proved bound": feasible & exceeds(answers["lower_bound"], duration),
            "a feasible cell with a margin below zero": feasible & ~(margin > -ROUNDING),
            "a margin below its proved bound": exceeds(answers["tension_margin_bound"], margin),
            "a feasible cell that touches an obstacle": feasible & (answers["clearance"] <= -ROUNDING),
        }


def _columns(answers: ProvedAnswers) -> dict[str, np.ndarray]:
    columns = {name: getattr(answers, name) for name in ("verdict", "tolerated", "not_tolerated")}
    columns |= {name: getattr(answers, source) for name, source in _COLUMNS.items()}
    clear = np.array([proof.least(proof.proof.high, _CONTACTS) for proof in answers.proof])
    return columns | {"clearance": np.where(answers.verdict & ~np.uint32(_BESIDE.value), np.nan, clear)}


def _joined(parts: list[tuple[np.ndarray, dict[str, np.ndarray]]]) -> dict[str, np.ndarray]:
    # Columns of all cells from those of some, with the cells that they are of.
    joined = {name: np.empty(len(parts[0][0]), column.dtype) for name, column in parts[0][1].items()}
    for rows, columns in parts:
        for name, column in columns.items():
            joined[name][rows] = column
    return joined
