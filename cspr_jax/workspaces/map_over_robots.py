"""Maps of workspaces over parameters of the robot, and over arrangements of its cables: robots as lanes of kernels."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from cspr_jax.config.sweep import SweepFile
from cspr_jax.maps.grid_map import Axes, RobotAt, RobotsApartError
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.linear.frames import Frame
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.arrangements import arrangement_of
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.schema.quantities import ARRANGEMENT, is_of_robot, parameter_values
from cspr_jax.workspaces.map import WorkspaceMap
from cspr_jax.workspaces.search_over_robots import RobotRows, RobotSamples, SearchOverRobots

# Number of arrangements from which the structure of wrench matrices is taken.
TRIED = 6


class WorkspacesOfRobots(WorkspaceMap):
    """Workspaces of many robots, each pose with a robot of its own; see `WorkspaceMap`.

    Raises:
        RobotsApartError: conditions or robots are not such that they can be computed together.
    """

    def __init__(self, robot_at: RobotAt, spec: SweepFile, file: object, axes: Axes) -> None:
        """Prepare the map from a few of the robots."""
        first = {name: float(axes[name][0]) for name in axes if is_of_robot(name) and name != ARRANGEMENT}
        farthest = {name: float(axes[name][np.abs(axes[name] - first[name]).argmax()]) for name in first}
        self._names = [name for name in first if farthest[name] != first[name]]
        middle = {name: 0.5 * (first[name] + farthest[name]) for name in first}
        values = [first, *(first | {name: farthest[name]} for name in self._names), middle]
        super().__init__(robot_at(parameter_values(first)), spec, file)
        self._numbers = np.sort(axes[ARRANGEMENT]) if ARRANGEMENT in axes else None
        self._refuse_others(spec)
        others = [WorkspaceMap(robot_at(parameter_values(each)), spec, file).sample() for each in values[1:]]
        samples = [self.sample(), *others]
        robots = [self._beside(robot, frame) for robot, frame, _ in samples]
        count = self._robot.n_cables
        numbers = np.zeros(0) if self._numbers is None else self._numbers
        self._arrangements = np.array([arrangement_of(int(number), count) for number in numbers], np.int32)
        tried = self._arrangements[:: -(-len(numbers) // TRIED)] if len(numbers) else None
        table = np.array([[each[name] for name in self._names] for each in values])
        searches = {}
        for name in self._poses.searches:
            requirements = [required[name] for *_, required in samples]
            searches[name] = SearchOverRobots(RobotSamples(robots, requirements, table, tried))
        self._poses = dataclasses.replace(self._poses, searches=searches)

    def _refuse_others(self, spec: SweepFile) -> None:
        poses, limits = self._poses, self._limits
        others = (poses.around, poses.speeds, poses.capacity, limits.floor, limits.cable_length_max)
        is_apart = any(other is not None for other in (*others, spec.without, self._cells, self._samples))
        if is_apart or poses.elastic or (self._numbers is not None and not isinstance(self._robot, PlatformRobot)):
            raise RobotsApartError

    def _beside(self, robot: AnyRobot, frame: Frame) -> AnyRobot:
        # A robot in the axes of the first one.
        base = self._frame.inward(frame.outward(np.asarray(robot.base_points)))
        is_moved = not np.allclose(base, robot.base_points, rtol=0.0, atol=1e-12 * np.abs(base).max())
        centres: list[Any] = [getattr(one, "centre_of_mass", None) for one in (robot, self._robot)]
        if (is_moved and "radius" in self._keys.axes.model_fields_set) or not np.array_equal(*centres):
            raise RobotsApartError
        return dataclasses.replace(robot, base_points=as_float64(base))

    def _robots_of(self, cells: dict[str, np.ndarray]) -> RobotRows:
        values = (
            np.stack([cells[name] for name in self._names], axis=1) if self._names else np.zeros((_count(cells), 0))
        )
        if self._numbers is None:
            return RobotRows(values, None)
        return RobotRows(values, self._arrangements[np.searchsorted(self._numbers, cells[ARRANGEMENT])])


def _count(cells: dict[str, np.ndarray]) -> int:
    return len(next(iter(cells.values())))
