"""Base of all maps of a sweep: robot, limits, amplitude function, and the targets of a grid."""

from __future__ import annotations

import abc
from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import numpy as np

from cspr_jax.build.problems import build_problem
from cspr_jax.config.equivalents import no_equivalent
from cspr_jax.config.hints import axis_question
from cspr_jax.config.robot import RobotFile
from cspr_jax.config.sweep import SweepFile
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.motion.given_limits import check_no_motors
from cspr_jax.motion.problem import touchable
from cspr_jax.numerics.linear.frames import frame_of
from cspr_jax.numerics.shapes import Bool, Float
from cspr_jax.numerics.tolerances import TOUCHED
from cspr_jax.robots.model.point_mass import AT_P0, plane_normal, rest_point, spool_radius
from cspr_jax.schema.tiles import Grid
from cspr_jax.schema.verdicts import FLAGS, NOT_PROVED, Verdict

# A refined margin may lie below its proved bound by this much, due to rounding.
CHECK_ERROR = 1e-8
# Robot at values of its parameters, and coordinates of axes.
RobotAt = Callable[[Mapping[str, float]], RobotFile]
Coordinates = Mapping[str, np.ndarray]
_OF_TARGETS = ("x", "y", "radius", "azimuth", "z")


class RobotsApartError(Exception):
    """Robots cannot be computed together: each needs a map of its own."""


class GridMap(abc.ABC):
    """The map of a sweep, ready to compute tiles; its row in `schema.map_kinds` names its class.

    Args:
        file: path of the sweep file, named in errors.
        for_bounds: whether the amplitude function may be "ideal", which only bounds have, no motion.

    Fields:
        any_cables: whether the robot may have more cables than degrees of freedom.
        motors: whether its verdicts take limits of winches into account.
        proves: whether its verdicts are proved, except those that say that they are not.

    Raises:
        ConfigError: the robot, the amplitude function or the limits cannot be used.
    """

    any_cables: ClassVar[bool] = False
    motors: ClassVar[bool] = False
    proves: ClassVar[bool] = False

    def __init__(self, robot_file: RobotFile, spec: SweepFile, file: object, *, for_bounds: bool = False) -> None:
        """Build what all tiles use."""
        self._keys, self._file = spec, file
        self._frame, self._z_axis = frame_of(robot_file.base_points, robot_file.z_axis), robot_file.z_axis
        self._problem = build_problem(
            robot_file,
            spec.trajectory,
            spec.limits,
            file,
            at="trajectory.",
            for_bounds=for_bounds,
            any_cables=self.any_cables,
        )
        try:
            if not self.motors:
                check_no_motors(self._problem.limits)
        except InputError as error:
            raise ConfigError(file, str(error)) from error

    def _scene_or_none(self, robot_file: RobotFile) -> Any:
        # Return the scene of the sweep; None without obstacles and without a shape of the platform.
        if not self._keys.obstacle_keys:
            return None
        from cspr_jax.build.scenes import scene_of  # loads the geometry of bodies, which other sweeps do without

        spec, frame = self._keys, self._frame
        return scene_of(self._problem.robot, robot_file, frame, spec, self._file, trajectory=spec.trajectory)

    @abc.abstractmethod
    def __call__(self, cells: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Answers of the cells of a tile."""

    @abc.abstractmethod
    def contradictions(self, answers: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Cells whose numbers contradict each other, which only a broken processor, driver or compiler can cause."""

    def undecided(self, answers: dict[str, np.ndarray]) -> int | None:
        """Number of cells whose motion, smallest number of arcs or infeasibility is not proved; None without proofs."""
        return int(((answers["verdict"] & NOT_PROVED) != 0).sum()) if self.proves else None

    def refuse_hopeless(self, grid: Grid) -> None:
        """Refuse a grid in which no cell can have an answer, for example with all targets out of reach."""
        self._refuse_out_of_reach(self._targets(self._corners(grid, _OF_TARGETS)), "axes")

    def _targets(self, cells: dict[str, np.ndarray]) -> np.ndarray:
        # Return targets in the kernels' axes. Radius and azimuth are about the vertical through the spools' centroid.
        if "radius" not in cells:
            return self._frame.inward(np.stack([cells["x"], cells["y"], cells["z"]], axis=1))
        radius, azimuth = cells["radius"], cells["azimuth"]
        level = np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), np.zeros_like(radius)], axis=1)
        return np.c_[self._frame.rotated(level)[:, :2], self._frame.depth(cells["z"])]

    def _start_positions(self, cells: dict[str, np.ndarray]) -> np.ndarray:
        # Return starts in the kernels' axes, from the axes of the grid and from `trajectory.from`.
        start, count = self._keys.trajectory.start, len(next(iter(cells.values())))
        fixed = start.position if start is not None and start.position is not None else [0.0, 0.0, 0.0]
        columns = [cells.get(f"from_{name}", np.full(count, fixed[i])) for i, name in enumerate("xyz")]
        return self._frame.inward(np.stack(columns, axis=1))

    def _corners(self, grid: Grid, names: tuple[str, ...]) -> dict[str, np.ndarray]:
        # Return cells that contain the extremes of depth and height. One azimuth is enough: that in which the spool
        # plane descends most, since no other target is deeper below the plane.
        derivative = self._frame.rotated(plane_normal(self._problem.robot))
        axes = {
            name: np.array([points.min(), points.max()])
            if name != "azimuth"
            else np.arctan2(derivative[1:2], derivative[:1])
            for name, points in grid.axes.items()
            if name in names
        }
        shape = tuple(len(points) for points in axes.values())
        return Grid(axes, shape).cells(tuple(slice(0, n) for n in shape))

    @property
    def _missed(self) -> float:
        # Return how far below zero the slack of a touched limit may be. Slacks of tensions are relative to
        # weight / n_cables, slacks of depths to z0, which is at least a tenth of the robot's radius.
        limits, weight = self._problem.limits, self._weight
        tensions = np.ravel([x for x in (limits.tension_min, limits.tension_max) if x is not None])
        return 10.0 * TOUCHED * max(1.0, float(np.max(tensions[np.isfinite(tensions)], initial=0.0)) / weight)

    @property
    def _weight(self) -> float:
        # Return the weight that each of equally loaded cables carries, N.
        robot = self._problem.robot
        return float(robot.mass * robot.gravity) / robot.n_cables

    def _refuse_out_of_reach(self, points: np.ndarray, key: str) -> None:
        depth = points @ np.asarray(plane_normal(self._problem.robot))
        floor = touchable(self._problem).limits.floor
        if not (depth > 0.0).any():
            level = np.abs(depth) <= AT_P0 * float(spool_radius(self._problem.robot))
            words = {True: "in the spool plane", False: "above the spool plane"}
            where = words[True] + " or above it" if len(set(level.tolist())) == 2 else words[bool(level[0])]
            question = "" if level.all() else f" ({axis_question(self._z_axis)})"
            raise ConfigError(self._file, f"{key}: every point is {where}: must be some below{question}")
        if floor is not None and not (points[:, 2] <= np.asarray(floor)).any():
            raise ConfigError(self._file, f"{key}: every point is below the floor: must be some above it")


class PlatformMap(GridMap):
    """A map of a platform; see `GridMap`."""

    def __init__(self, robot_file: RobotFile, spec: SweepFile, file: object) -> None:
        """Refuse a point mass."""
        if not robot_file.is_platform:
            raise ConfigError(file, f'robot "{robot_file.name}" is {robot_file.kind}: must be a platform in this map')
        super().__init__(robot_file, spec, file)

    @property
    def _is_redundant(self) -> bool:
        # With more than six cables there is no determinant.
        return self._problem.robot.n_cables > self._problem.robot.dof

    def contradictions(self, answers: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Cells whose numbers contradict each other; see `GridMap.contradictions`."""
        feasible = answers["arcs"] > 0
        margin = answers["margin"]
        smallest = margin if self._is_redundant else np.minimum(margin, answers["det_margin"])
        return {
            "a feasible cell with a margin below zero": feasible & ~(smallest > -self._missed * self._is_redundant),
            "a feasible cell that breaks a limit": feasible & ~(answers["limit_margin"] > -self._missed),
            "a margin below its proved bound": exceeds(answers["margin_bound"], margin),
            "an infeasible cell whose verdict is 0": ~feasible & (answers["verdict"] == 0),
            "a feasible cell without a duration": feasible & ~(answers["duration"] > 0.0),
            "a feasible cell that touches an obstacle": feasible & (answers.get("clearance", margin) <= -CHECK_ERROR),
        }


class PointMassMap(GridMap):
    """A map of a point mass; see `GridMap`."""

    def __init__(self, robot_file: RobotFile, spec: SweepFile, file: object, *, for_bounds: bool = False) -> None:
        """Refuse a platform."""
        if robot_file.is_platform:
            why = no_equivalent(robot_file)
            raise ConfigError(
                file, f'robot "{robot_file.name}" is a rigid platform: must be a point mass in this map{why}'
            )
        super().__init__(robot_file, spec, file, for_bounds=for_bounds)

    def _starts(self, cells: dict[str, np.ndarray]) -> np.ndarray:
        # Return the start in the kernels' axes.
        start = self._keys.trajectory.start
        return rest_point(np.asarray(cells["z0"])) if start is not None and start.rest else self._start_positions(cells)

    def contradictions(self, answers: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Cells whose numbers contradict each other; see `GridMap.contradictions`."""
        feasible, margin, verdict = answers["arcs"] > 0, answers["margin"], answers["verdict"]
        unsure = FLAGS(Verdict.FEWER_ARCS_UNDECIDED.value)
        lasts = np.isfinite(answers["duration"]) & (answers["duration"] > 0.0)
        return {
            "a feasible cell with a margin below zero": feasible & ~(margin > -max(CHECK_ERROR, self._missed)),
            "a feasible cell whose verdict is not": feasible & ((verdict & ~unsure) != 0),
            "an infeasible cell whose verdict is 0": ~feasible & (verdict == 0),
            "a margin below its proved bound": exceeds(answers["margin_bound"], margin),
            "a feasible cell without a duration": feasible & ~lasts,
            "a feasible cell that touches an obstacle": feasible & (answers.get("clearance", margin) <= -CHECK_ERROR),
        }


def exceeds(bound: Float[np.ndarray, "n"], margin: Float[np.ndarray, "n"]) -> Bool[np.ndarray, "n"]:
    """Tell where a bound exceeds its margin by more than rounding; the margin is -inf if cables span too little."""
    with np.errstate(invalid="ignore"):
        return bound > margin + CHECK_ERROR * (1.0 + np.abs(margin))
