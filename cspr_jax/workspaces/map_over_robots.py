"""Maps of workspaces over parameters of the robot, and over arrangements of its cables: robots as lanes of kernels."""

from __future__ import annotations

import dataclasses
import itertools
from typing import Any, cast

import numpy as np

from cspr_jax.config.sweep import SweepFile
from cspr_jax.maps.grid_map import Coordinates, RobotAt, RobotsApartError
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.linear.frames import Frame
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.arrangements import arrangement_of
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.schema.quantities import ARRANGEMENT, is_of_robot, parameter_values
from cspr_jax.workspaces.map import WorkspaceMap
from cspr_jax.workspaces.poses.geometry import mass_centres
from cspr_jax.workspaces.search import Poses
from cspr_jax.workspaces.search_over_robots import RobotRows, RobotSamples, SearchOverRobots

# Number of arrangements from which the structure of wrench matrices is taken.
TRIED = 6
# Largest number of parameters: samples are up to a power of three.
MAX_PARAMETERS = 4
# Number of samples of more parameters.
MAX_SAMPLES = 60
# A cable whose limit has less than this derivative does not decide a margin.
SMALLEST_DERIVATIVE = 1e-9


class WorkspacesOfRobots(WorkspaceMap):
    """Workspaces of many robots, each pose with a robot of its own; see `WorkspaceMap`.

    Raises:
        RobotsApartError: conditions or robots are not such that they can be computed together.
    """

    def __init__(
        self, robot_at: RobotAt, spec: SweepFile, file: object, axes: Coordinates, *, screens: bool = False
    ) -> None:
        """Prepare the map from a few of the robots; of one that only screens there may be any number of parameters."""
        points = {name: np.unique(axes[name]) for name in axes if is_of_robot(name) and name != ARRANGEMENT}
        self._names = [name for name in points if len(points[name]) > 1]
        values = _sampled(points, self._names, screens=screens)
        super().__init__(robot_at(parameter_values(values[0])), spec, file)
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

    @property
    def parameter_axes(self) -> list[str]:
        """Names of the axes of parameters by which the robots differ, in the order of derivatives."""
        return list(self._names)

    def facets(self, cells: dict[str, np.ndarray]) -> tuple[Float[np.ndarray, "f n"], Float[np.ndarray, "k f n"]]:
        """Margins of the conditions on the cables along each facet normal, and derivatives by the parameters."""
        poses = self._poses_with_robots(cells)
        parts = [cast("SearchOverRobots", search).facets(poses) for search in self._poses.searches.values()]
        return np.concatenate([x for x, _ in parts]), np.concatenate([x for _, x in parts], axis=1)

    def limits_of_facet(self, cells: dict[str, np.ndarray], facet: int) -> tuple[list[int], list[int]]:
        """Cables that are at their smallest, and at their largest tension, where one facet normal has its margin."""
        poses = self._poses_with_robots(cells)
        for search in self._poses.searches.values():
            one = cast("SearchOverRobots", search)
            if facet < one.facet_count:
                low, high = one.by_limits(poses, facet)
                return np.flatnonzero(np.abs(low[:, 0]) > SMALLEST_DERIVATIVE).tolist(), np.flatnonzero(
                    high[:, 0] > SMALLEST_DERIVATIVE
                ).tolist()
            facet -= one.facet_count
        return [], []

    def _poses_with_robots(self, cells: dict[str, np.ndarray]) -> Poses:
        positions, quaternions = self._poses_of(cells)
        centres = mass_centres(self._robot, self._poses.origins(positions, quaternions), quaternions)
        return Poses(centres, quaternions, None, self._robots_of(cells))

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


def _sampled(points: dict[str, np.ndarray], names: list[str], *, screens: bool) -> list[dict[str, float]]:
    # Values of the samples: all smallest ones, the largest of each, then all choices of the smallest, the middle and
    # the largest, at which limits that are the smaller of two affine functions are seen to be no affine function.
    if len(names) > MAX_PARAMETERS and not screens:
        raise RobotsApartError
    first = {name: float(values[0]) for name, values in points.items()}
    singles = [first | {name: float(points[name][-1])} for name in names]
    three = [np.unique(points[name][[0, len(points[name]) // 2, -1]]).tolist() for name in names]
    if len(names) <= MAX_PARAMETERS:
        choices = list(itertools.product(*three))
    else:
        random = np.random.default_rng(0)
        choices = [tuple(random.choice(each) for each in three) for _ in range(MAX_SAMPLES)]
    return [first, *singles, *(first | dict(zip(names, each, strict=True)) for each in choices)]


def _count(cells: dict[str, np.ndarray]) -> int:
    return len(next(iter(cells.values())))
