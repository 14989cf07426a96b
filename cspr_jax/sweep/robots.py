"""Robots of the cells of a sweep: axes may be parameters of the robot file."""

import itertools
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from cspr_jax.config.arrangements import Invariants, arrangement_points
from cspr_jax.config.equivalents import as_moved
from cspr_jax.config.missing_cables import without_cables
from cspr_jax.config.robot import RobotFile
from cspr_jax.config.sweep import SweepFile, axis_points
from cspr_jax.errors import ConfigError, InputError, shown
from cspr_jax.schema.map_kinds import MapKind
from cspr_jax.schema.quantities import ARRANGEMENT, PARAMETER, is_of_robot, parameter_values

# Keys of workspaces in which directions differ, so that mirrored robots have other workspaces.
_DIRECTIONS = (
    *("orientation", "quaternions", "wrenches", "wrench_box", "wrench_ellipsoid"),
    *("obstacle", "platform_box", "platform_hull"),
)


def robot_of(robot_file: RobotFile, spec: SweepFile, kind: MapKind, file: object) -> RobotFile:
    """The robot that a map moves: without the missing cables, or its equivalent point mass."""
    remaining = without_cables(robot_file, spec.without, file)
    return as_moved(remaining, [kind.patterns]) if kind.patterns else remaining


def robot_at(
    robot_file: RobotFile, spec: SweepFile, kind: MapKind, values: Mapping[str, float], file: object
) -> RobotFile:
    """The robot that a map moves where parameters of its file have other values."""
    try:
        return robot_of(robot_file.full.with_parameters(values), spec, kind, file)
    except InputError as error:
        at = "axes." if str(error).startswith(f"parameters.{ARRANGEMENT} ") else f"axes.{PARAMETER}"
        raise ConfigError(file, str(error).replace("parameters.", at, 1)) from error


def arrangement_axis(spec: SweepFile, robot_file: RobotFile, file: object) -> dict[str, np.ndarray]:
    """The axis of arrangements of a sweep file, if it has one."""
    if spec.axes.arrangement is None:
        return {}
    workspace = spec.workspace
    # Cables differ where some of them are gone, or have limits of their own.
    has_lists = isinstance(spec.without, list) or any(isinstance(limit, list) for limit in vars(spec.limits).values())
    has_directions = workspace is None or any(getattr(workspace, key) is not None for key in _DIRECTIONS)
    invariants = Invariants(points=spec.axes.parameter is None, cables=not has_lists, directions=not has_directions)
    try:
        points = arrangement_points(robot_file.full, spec.axes.arrangement, invariants)
    except InputError as error:
        raise ConfigError(file, f"axes.{error}") from error
    return {ARRANGEMENT: points}


def axes_of(spec: SweepFile, names: Iterable[str], robot_file: RobotFile, file: object) -> dict[str, np.ndarray]:
    """Points of the axes of a sweep file."""
    axes = arrangement_axis(spec, robot_file, file)
    return {name: axes[name] if name in axes else axis_points(spec.axes.named(name)) for name in names}


def robot_axes(axes: Mapping[str, Any]) -> list[str]:
    """Names of the axes along which robots differ."""
    return [name for name in axes if is_of_robot(name)]


def check_robots(
    robot_file: RobotFile, spec: SweepFile, kind: MapKind, axes: Mapping[str, np.ndarray], path: Path
) -> None:
    """Refuse axes of parameters that the robot does not have, or that give no robot at their ends."""
    names = robot_axes(axes)
    for name in names:
        parameter = name.removeprefix(PARAMETER)
        if parameter in (spec.parameters or {}):
            value = shown((spec.parameters or {})[parameter])
            raise ConfigError(path, f"parameters.{parameter} = {value}: must be absent beside axes.{name}")
    ends = [(float(axes[name].min()), float(axes[name].max())) for name in names]
    for corner in itertools.product(*ends) if names else ():
        robot_at(robot_file, spec, kind, parameter_values(dict(zip(names, corner, strict=True))), path)


def robots_of(cells: Mapping[str, np.ndarray]) -> Iterator[tuple[dict[str, float], np.ndarray]]:
    """Values of parameters, and indices of the cells that have them, of each robot of a tile."""
    names = robot_axes(cells)
    robots, robot_of_cell = np.unique(np.stack([cells[name] for name in names]), axis=1, return_inverse=True)
    order = np.argsort(robot_of_cell.ravel(), kind="stable")
    ends = np.cumsum(np.bincount(robot_of_cell.ravel()))
    for values, indices in zip(robots.T, np.split(order, ends[:-1]), strict=True):
        yield parameter_values(dict(zip(names, values, strict=True))), indices
