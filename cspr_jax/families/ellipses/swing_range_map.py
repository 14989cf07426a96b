"""Maps of throws from swings: where an object can be thrown from ellipses about a given point."""

import numpy as np

from cspr_jax.config.keys.launch import LaunchSearch
from cspr_jax.config.robot import RobotFile
from cspr_jax.config.sweep import SweepFile
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.families.ellipses.hull import hull_of
from cspr_jax.families.ellipses.swing_range import other_limit, swing_range
from cspr_jax.maps.release_box import box_of
from cspr_jax.maps.releases_map import ReleasesMap

_OF_SWINGS = ("release_speed", "flight_time", "swing_amplitude", "release_x", "release_y", "release_z")


class SwingRangeMap(ReleasesMap):
    """The slowest release from an ellipse to each landing point; see `GridMap`."""

    def __init__(self, robot_file: RobotFile, sweep_file: SweepFile, file: object) -> None:
        """Refuse limits that the formulas do not cover, and keys of searches."""
        super().__init__(robot_file, sweep_file, file)
        search = sweep_file.launch or LaunchSearch()
        for name in ("max_duration", "population"):
            if name in search.model_fields_set:
                raise ConfigError(file, f'launch.{name}: must be absent in this map; it is for map = "launch-range"')
        limit = other_limit(self._problem.limits)
        if limit is not None:
            raise ConfigError(file, f"limits.{limit}: must be absent in this map, which knows a floor alone")
        try:
            hull_of(self._problem.robot)
        except InputError as error:
            raise ConfigError(file, f"robot.{error}") from error
        try:
            ranges = (search.release_x, search.release_y, search.release_z)
            self._box = box_of(self._problem.robot, self._frame, ranges)
        except InputError as error:
            raise ConfigError(file, f"launch.{error}") from error

    def __call__(self, cells: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Answers of the cells of a tile; see `GridMap.__call__`."""
        floor = self._problem.limits.floor
        depth = None if floor is None else float(floor)
        answers = swing_range(self._problem.robot, self._starts(cells), self._targets(cells), self._box, depth)
        return vars(answers.placed(self._frame))

    def contradictions(self, answers: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Cells whose numbers contradict each other; see `GridMap.contradictions`."""
        feasible, speed = answers["verdict"] == 0, answers["release_speed"]
        has_floor = self._problem.limits.floor is not None
        return {
            "a feasible cell with a margin below zero": feasible
            & ~(answers["largest_margin"] > -self._missed * has_floor),
            "a feasible cell without a launch": feasible & ~((speed >= 0.0) & (answers["flight_time"] > 0.0)),
            "an infeasible cell with a launch": ~feasible
            & np.logical_or.reduce([np.isfinite(answers[name]) for name in _OF_SWINGS]),
        }
