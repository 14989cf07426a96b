"""Robots and limits for the kernels, built from checked files."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal, overload

import numpy as np

from cspr_jax.config.keys.limits import LimitKeys
from cspr_jax.config.keys.trajectory import TrajectoryKeys
from cspr_jax.config.robot import RobotFile, resolve_robot
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.errors.arguments import Parameters
from cspr_jax.motion.given_limits import check_bounded, limits_of, pair_limits
from cspr_jax.robots.cables import with_cables
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.platform import PlatformRobot, platform_robot
from cspr_jax.robots.model.point_mass import STANDARD_GRAVITY, PointMassRobot, point_mass_robot
from cspr_jax.robots.model.robot import MOVED, check_moved
from cspr_jax.robots.static_equilibrium import slack_at_rest
from cspr_jax.robots.statics.kernel_axes import centred
from cspr_jax.robots.statics.reference_pose import reference_pose

# Names of the catalogue, from which type checkers infer whether `load_robot` returns a point mass or a platform.
PointMassName = Literal[
    "boralugoda-planar-three",
    "boralugoda-planar-two",
    "boralugoda-rectangle",
    "boralugoda-triangle",
    "cdpyr-3t",
    "laval-large",
    "prototype",
    "transition-planar",
    "transition-prototype",
]
PlatformName = Literal[
    "caspr-seven",
    "cogiro",
    "cogiro-500",
    "fast",
    "greenline",
    "ipanema-1",
    "ipanema-1-iros",
    "ipanema-2",
    "ipanema-2-iros",
    "kntu-planar",
    "launch-robot",
    "laval-mssm",
    "nist-robocrane",
]


def build_limits(robot_file: RobotFile, spec: LimitKeys, file: object) -> Limits:
    """Limits of a plan or sweep; where it gives none, those of the robot."""
    pairs, written = robot_file.pairs, robot_file.as_written
    of_robot = vars(robot_file) | ({} if written.winch is None else written.winch.limits)
    try:
        values = robot_file.of_own_cables(vars(spec))
        limits = limits_of(robot_file, values, of_robot, "", len(written.base_points))
        return limits if pairs is None else pair_limits(limits, pairs)
    except InputError as error:
        raise ConfigError(file, str(error)) from error


def gravity_of(robot_file: RobotFile, spec: TrajectoryKeys) -> float:
    """Gravity: the plan's or sweep's, else the robot's, else 9.81 m/s^2."""
    return spec.gravity or robot_file.gravity or STANDARD_GRAVITY


def build_robot(robot_file: RobotFile, spec: TrajectoryKeys, file: object) -> PointMassRobot | PlatformRobot:
    """The robot of a file, in its own axes and with its own limits."""
    settings: dict[str, Any] = {name: getattr(robot_file, name) for name in ("mass", "name", "z_axis")}
    settings |= {"gravity": gravity_of(robot_file, spec), "limits": build_limits(robot_file, LimitKeys(), file)}
    settings |= {"pattern": robot_file.own_pattern}
    try:
        if not robot_file.is_platform:
            return with_cables(point_mass_robot(robot_file.base_points, **settings), **_of_cables(robot_file))
        settings |= {name: getattr(robot_file, name) for name in ("platform_points", "inertia", "centre_of_mass")}
        robot = platform_robot(robot_file.base_points, **settings)
        return with_cables(robot, **_of_cables(robot_file))
    except InputError as error:
        raise ConfigError(file, robot_file.typed(error)) from error


def _of_cables(robot_file: RobotFile) -> dict[str, Any]:
    names = ("cable_diameter", "pulley_radius", "pulley_axes", "axial_stiffness")
    winch = robot_file.winch
    return {name: getattr(robot_file, name) for name in names} | {"winch": None if winch is None else dict(winch)}


@overload
def load_robot(reference: PointMassName, parameters: Parameters = None) -> PointMassRobot: ...
@overload
def load_robot(reference: PlatformName, parameters: Parameters = None) -> PlatformRobot: ...
@overload
def load_robot(reference: str | Path, parameters: Parameters = None) -> Any: ...
def load_robot(reference: str | Path, parameters: Parameters = None) -> PointMassRobot | PlatformRobot:
    """Load a robot of the catalogue, or of a file, with its axes and its limits.

    Args:
        reference: a catalogue name, or the path of a robot file.
        parameters: values of parameters of the file, [[parameter]], by name.

    Returns:
        the robot: a point mass or a platform.

    Raises:
        ConfigError: there is no such robot, its file has a mistake, or it has no such parameter or value.
    """
    robot_file = resolve_robot(str(reference), reference, Path.cwd(), parameters)
    return build_robot(robot_file, TrajectoryKeys(), reference)


def kernel_robot(
    robot_file: RobotFile, spec: TrajectoryKeys, file: object, *, any_cables: bool = False, pulleys: bool = False
) -> Any:
    """The robot of a file, as the kernels take it; a platform's axes are still those of the file."""
    robot: Any = build_robot(robot_file, spec, file)
    source, key = robot_file.placed("base_points", file)
    try:
        # With any number of cables, the rows of families name the patterns of motion that they serve.
        if robot.pattern in MOVED or not any_cables:
            check_moved(robot, pulleys=pulleys)
        if not is_redundant_platform(robot):
            check_bounded(robot.limits)
    except InputError as error:
        raise ConfigError(source, key.removesuffix("base_points") + str(error)) from error
    if robot.n_cables != robot.dof and not any_cables:
        raise ConfigError(
            source,
            f'{key}: {robot.n_cables} points: must be {robot.dof} for family "{spec.family}" '
            "(it does not exist yet for more cables than degrees of freedom)",
        )
    return centred(robot)[0]


def error_at_rest(robot_file: RobotFile) -> str | None:
    """Reason why a robot cannot hang still in its reference orientation, if it cannot."""
    robot_file = robot_file.equivalent() if robot_file.translation_only else robot_file
    try:
        is_redundant = len(robot_file.base_points) > robot_file.dof
        if is_redundant or robot_file.own_pattern not in MOVED or robot_file.pulley_radius is not None:
            return slack_at_rest(
                centred(shared := build_robot(robot_file, TrajectoryKeys(), robot_file.name))[0], shared.limits
            )
        if robot_file.is_platform:
            robot = kernel_robot(robot_file, TrajectoryKeys(), robot_file.name)
            reference_pose(robot, float(np.linalg.norm(np.asarray(robot.base_points), axis=1).mean()))
        else:
            build_robot(robot_file, TrajectoryKeys(), robot_file.name)
    except (ConfigError, InputError) as error:
        return str(error)
    return None


def is_redundant_platform(robot: PointMassRobot | PlatformRobot) -> bool:
    """Tell whether a platform has redundant cables: its verdicts rest on margins, so tension_max may be infinite."""
    return isinstance(robot, PlatformRobot) and robot.n_cables > robot.dof
