"""Scenes of robots: the bodies that their cables and platforms can meet, built from checked files."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cspr_jax.build.robots import build_robot
from cspr_jax.config.keys.obstacles import ObstacleKeys
from cspr_jax.config.keys.trajectory import TrajectoryKeys
from cspr_jax.config.robot import RobotFile
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.motion.waypoints import Waypoints
from cspr_jax.numerics.linear.frames import Frame
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.contacts.clearance import Scene, scene
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.shapes import Body, Obstacle, in_kernel_axes, inward, rotated
from cspr_jax.robots.statics.kernel_axes import centred
from cspr_jax.robots.statics.reference_pose import aligned


def robot_scene(
    robot: AnyRobot,
    frame: Frame,
    obstacles: Sequence[Obstacle] = (),
    body: Body | None = None,
    rotation: Float[np.ndarray, "3 3"] | None = None,
) -> Scene:
    """A robot among the bodies that its cables can meet."""
    diameter = 0.0 if robot.cable_diameter is None else np.asarray(robot.cable_diameter)
    kernel_body = None if body is None else in_kernel_axes(body, frame)
    if kernel_body is not None and rotation is not None:
        kernel_body = rotated(kernel_body, rotation)
    return scene(robot, diameter=diameter, obstacles=[inward(one, frame) for one in obstacles], body=kernel_body)


def build_scene(
    robot: AnyRobot,
    robot_file: RobotFile,
    frame: Frame,
    spec: ObstacleKeys,
    file: object,
    *,
    at: str = "",
    rotation: np.ndarray | None = None,
) -> Scene:
    """Scene of a plan or sweep."""
    pattern = PATTERNS[robot.pattern]
    for name in spec.obstacle_keys if robot_file.pairs is not None else ():
        why = "a point mass on three cables moves in place of the platform, and touches other bodies"
        raise ConfigError(file, f'{at}{name}: must be absent, but in plans with family = "spline": here {why}')
    for name in ("platform_box", "platform_hull"):
        if getattr(spec, name) is not None and not pattern.is_body:
            raise ConfigError(file, f"{at}{name}: must be absent: {robot_file.kind} has no shape")
    # Shapes have the same origin as the arms of the kernels: the mass centre, or a joint.
    centre = None if pattern.is_jointed else robot_file.centre_of_mass
    try:
        body = spec.body(centre or (0.0, 0.0, 0.0), robot_file.platform_points or ())
    except InputError as error:
        allowed = "must be points: those where the cables are attached lie in a plane"
        raise ConfigError(file, f"{at}platform_hull = true: {allowed}") from error
    return robot_scene(robot, frame, spec.bodies, body, rotation)


def scene_of(
    robot: AnyRobot,
    robot_file: RobotFile,
    frame: Frame,
    spec: ObstacleKeys,
    file: object,
    *,
    trajectory: TrajectoryKeys,
) -> Scene:
    """Scene of the robot of a problem, in which platforms have their reference axes; see `build_scene`."""
    written = centred(build_robot(robot_file, trajectory, file))[0]
    rotation = aligned(written)[1] if isinstance(written, PlatformRobot) else None
    return build_scene(robot, robot_file, frame, spec, file, rotation=rotation)


def scene_of_leg(robot: AnyRobot, waypoints: Waypoints) -> Scene:
    """Scene of the robot of a problem in a leg of a plan."""
    plan_file = waypoints.plan_file
    return scene_of(robot, waypoints.robot_file, waypoints.frame, plan_file, waypoints.path, trajectory=plan_file)
