"""Maps of launches: where one Bezier segment from a given position can throw an object."""

from typing import Any

import numpy as np

from cspr_jax.config.keys.launch import LaunchSearch
from cspr_jax.config.robot import RobotFile
from cspr_jax.config.sweep import SweepFile
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.families.beziers.launches.launch_range import launch_range
from cspr_jax.families.beziers.launches.release import bounds_of
from cspr_jax.maps.releases_map import ReleasesMap

_OF_LAUNCHES = ("duration", "release_time", "flight_time", "release_x", "release_y", "release_z")


class LaunchRangeMap(ReleasesMap):
    """The launch of least speed to each landing point; see `GridMap`."""

    def __init__(self, robot_file: RobotFile, spec: SweepFile, file: object) -> None:
        """Refuse bounds that leave no release."""
        super().__init__(robot_file, spec, file)
        search = self._search = spec.launch or LaunchSearch()
        try:
            ranges = (search.release_x, search.release_y, search.release_z)
            self._bounds = bounds_of(self._problem, self._frame, ranges, search.max_duration)
        except InputError as error:
            raise ConfigError(file, f"launch.{error}") from error

    def __call__(self, cells: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Answers of the cells of a tile; see `GridMap.__call__`."""
        arguments: Any = (self._starts(cells), self._targets(cells), self._bounds, self._search.population)
        return vars(launch_range(self._problem, *arguments).placed(self._frame))

    def contradictions(self, answers: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Cells whose numbers contradict each other; see `GridMap.contradictions`."""
        feasible, margin, speed = answers["verdict"] == 0, answers["largest_margin"], answers["release_speed"]
        release, duration = answers["release_time"], answers["duration"]
        return {
            "a feasible cell with a margin below zero": feasible & ~(margin > 0.0),
            "a feasible cell without a launch": feasible & ~((speed >= 0.0) & (answers["flight_time"] > 0.0)),
            "a release outside of the segment": feasible & ~((release > 0.0) & (release < duration)),
            "an infeasible cell with a launch": ~feasible
            & np.logical_or.reduce([np.isfinite(x) for x in (speed, *(answers[name] for name in _OF_LAUNCHES))]),
        }
