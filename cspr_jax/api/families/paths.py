"""Least times along many paths for one robot, from Python."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any, Literal

import numpy as np

from cspr_jax.api.arguments.check_keys import NAME, check_keys
from cspr_jax.api.arguments.checks import GridSize, LimitsOrSpec, RobotOrFile, checked
from cspr_jax.build.problems import build_problem
from cspr_jax.build.robots import build_robot
from cspr_jax.build.scenes import scene_of
from cspr_jax.config.equivalents import as_moved
from cspr_jax.config.keys.path import GRID, PathTable
from cspr_jax.config.plan import checked_plan
from cspr_jax.config.reading import checked as checked_table
from cspr_jax.config.robot import RobotFile, resolve_robot
from cspr_jax.curves.files import kept_to, placed_inward, reference_of
from cspr_jax.curves.spline import Spline
from cspr_jax.errors import InputError
from cspr_jax.errors.arguments import PointsOfPaths, Positive, QuaternionsOfPaths, RampTime
from cspr_jax.families.paths.batch import least_times
from cspr_jax.families.paths.geometry.path_specs import path_through
from cspr_jax.families.paths.geometry.section import Section
from cspr_jax.motion.given_limits import check_no_means
from cspr_jax.motion.motion import Placed
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.numerics.linear.frames import frame_of
from cspr_jax.schema.columns import Columns
from cspr_jax.schema.families import FAMILIES


@dataclasses.dataclass(frozen=True)
class LeastTimePaths(Columns):
    """The fastest motions along n paths of one robot.

    Fields:
        verdict: (n,) `Verdict` flags; 0 if proved feasible.
        duration: (n,) s; inf where no motion is proved feasible.
        lower_bound: (n,) rigorous lower bound of the time of any motion forward along the path with the same stops, s;
            NaN if none is found.
        margin: (n,) smallest distance of a tension from its limits, N.
        margin_bound: (n,) proved lower bound of the margin, N.
        motions: n motions in the axes of the robot, slow ones where none is feasible.
        coordinates: for each path the coordinates of its nodes, m; each section starts again at 0.
        speeds: for each path the path speeds at its nodes, m/s; NaN if there is no motion.
    """

    verdict: np.ndarray
    duration: np.ndarray
    lower_bound: np.ndarray
    margin: np.ndarray
    margin_bound: np.ndarray
    motions: list[Placed[Spline]]
    coordinates: list[np.ndarray]
    speeds: list[np.ndarray]

    @property
    def feasible(self) -> np.ndarray:
        """Tell along which paths a motion is proved feasible, (n,)."""
        return self.verdict == 0


@checked(motion="spline")
def least_time_paths(
    robot: RobotOrFile,
    paths: PointsOfPaths,
    quaternions: QuaternionsOfPaths | None = None,
    *,
    kind: Literal["line", "polyline", "cubic", "quintic"] | None = None,
    corner: Literal["stop", "blend"] | None = None,
    blend_tolerance: Positive | None = None,
    grid: GridSize = GRID,
    ramp_time: RampTime = 0.0,
    limits: LimitsOrSpec = None,
) -> LeastTimePaths:
    """Find motions along many paths in the least time that the limits allow, each from zero speed to zero speed.

    Args:
        robot: a robot, a name in the catalogue, or the path of a robot file.
        paths: n arrays (k, 3) of points of the mass centre, in the axes of the robot, m; or one array (n, k, 3).
        quaternions: n arrays (k, 4) of orientations at the points, scalar first; None: the platform's own axes.
        kind: how points are joined: "line" (a stop at every point), "polyline", "cubic" or "quintic"; None: "cubic".
        corner: corners of polylines, "stop" or "blend"; None: "stop".
        blend_tolerance: largest distance of a blended path from the corner, m.
        grid: number of cells into which each part of a path between stops is divided.
        ramp_time: time in which accelerations rise and fall, s; 0 if they may jump.
        limits: replace those of the robot, as for `check`.

    Returns:
        the motions.

    Raises:
        InputError: points that do not define a path, or an impossible argument.
    """
    spec = checked_plan(check_keys(robot, limits), NAME)
    settings = {
        "kind": kind or "cubic",
        "corner": corner,
        "grid": grid,
        "ramp_time": ramp_time,
        "blend_tolerance": blend_tolerance,
    }
    table = checked_table(PathTable, {key: value for key, value in settings.items() if value is not None}, NAME)
    if not len(paths):
        raise InputError("paths", None, "must hold at least one path", problem="none")
    with double_precision():
        file = as_moved(resolve_robot(spec.robot, NAME, Path(), spec.parameters), [FAMILIES["path"].legs])
        problem = build_problem(file, spec, spec, NAME, any_cables=True)
        check_no_means(problem.limits, "limits.")
        axes = frame_of(file.base_points, file.z_axis)
        reference = reference_of(build_robot(file, spec, NAME))
        sections = [
            [_placed(file, section, axes, reference) for section in _sections(i, file, table, points, quaternions)]
            for i, points in enumerate(paths)
        ]
        scene = scene_of(problem.robot, file, axes, spec, NAME, trajectory=spec)
        times = least_times(problem, scene, sections, grid, ramp_time)
    planes = [[section.plane for section in path] for path in times.sections]
    return LeastTimePaths(
        verdict=times.answers.verdict,
        duration=times.duration,
        lower_bound=times.lower_bound,
        margin=times.answers.margin,
        margin_bound=times.answers.margin_bound,
        motions=[Placed(motion, axes) for motion in times.motions],
        coordinates=[np.concatenate([plane.coordinate for plane in path]) for path in planes],
        speeds=[np.concatenate([plane.speed for plane in path]) for path in planes],
    )


def _sections(i: int, file: RobotFile, table: PathTable, points: Any, quaternions: Any) -> list[Section]:
    # Return the sections of one path, in the axes of the robot.
    positions = _numbers(f"paths[{i}]", points, 3)
    units = None
    if file.is_platform:
        units = np.tile([1.0, 0.0, 0.0, 0.0], (len(positions), 1))
        if quaternions is not None:
            name = f"quaternions[{i}]"
            units = _numbers(name, quaternions[i] if i < len(quaternions) else [], 4)
            sizes = np.linalg.norm(units, axis=-1, keepdims=True)
            if len(units) != len(positions) or not (sizes > 0.0).all():
                raise InputError(
                    name, None, f"must be {len(positions)}, none of them zero", problem=f"{len(units)} of them"
                )
            units = units / sizes
    elif quaternions is not None:
        raise InputError("quaternions", None, "must be absent for a point mass", problem="given")
    try:
        return path_through(table, positions, units).sections()
    except InputError as error:
        raise InputError(f"paths[{i}], {error.key}", error.value, error.allowed, problem=error.problem) from error


def _numbers(name: str, values: Any, width: int) -> np.ndarray:
    # Return finite numbers as an array.
    try:
        array = np.asarray(values)
    except ValueError as error:  # rows of different lengths
        raise InputError(
            name, None, f"finite numbers of shape (k, {width})", problem="rows of several lengths"
        ) from error
    if array.ndim != 2 or array.shape[1] != width or array.dtype.kind not in "iuf" or not np.isfinite(array).all():
        raise InputError(name, None, f"finite numbers of shape (k, {width})", problem=f"shape {array.shape}")
    return array.astype(float)


def _placed(file: RobotFile, section: Section, axes: Any, reference: np.ndarray) -> Section:
    curve = kept_to(file.own_pattern, section.curve, is_planar=False)
    return section._replace(curve=placed_inward(curve, axes, reference))
