"""Bodies that the cables and the platform of a robot can meet, built from checked files."""

from collections.abc import Sequence

import numpy as np

from cspr_jax.arithmetic.frames import Frame
from cspr_jax.config.obstacles import SurroundingsKeys
from cspr_jax.config.robot import RobotFile
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.clearance import Scene, scene
from cspr_jax.robots.patterns import PATTERNS
from cspr_jax.robots.shapes import Body, Obstacle, inward, rotated, turned


def surroundings(
    robot: AnyRobot,
    frame: Frame,
    obstacles: Sequence[Obstacle] = (),
    body: Body | None = None,
    rotation: np.ndarray | None = None,
) -> Scene:
    """A robot among the bodies that its cables can meet.

    Args:
        robot: centred, z down.
        frame: axes of the robot file.
        obstacles: bodies fixed in space, in the axes of the file.
        body: shape of the platform, in platform axes as in the file, from the mass centre, or from the joint.
        rotation: (3, 3) from the platform axes of the centred robot to those of `robot`; None: they are the same.

    Returns:
        the scene in the kernels' coordinates.
    """
    diameter = 0.0 if robot.cable_diameter is None else np.asarray(robot.cable_diameter)
    kernel_body = None if body is None else turned(body, frame)
    if kernel_body is not None and rotation is not None:
        kernel_body = rotated(kernel_body, rotation)
    return scene(robot, diameter=diameter, obstacles=[inward(one, frame) for one in obstacles], body=kernel_body)


def build_scene(
    robot: AnyRobot,
    robot_file: RobotFile,
    frame: Frame,
    keys: SurroundingsKeys,
    file: object,
    *,
    at: str = "",
    rotation: np.ndarray | None = None,
) -> Scene:
    """Scene of a plan or sweep.

    Args:
        robot: centred, z down.
        frame: axes of the robot file.
        file: named in errors.
        at: prefix of the keys in errors.
        rotation: as for `surroundings`; of a problem's robot that of `robots.reference_pose.aligned`.

    Returns:
        the scene in the kernels' coordinates.

    Raises:
        ConfigError: a shape of a robot that has none, the hull of points that lie in a plane, or surroundings of a
            point mass that stands for a platform.
    """
    row = PATTERNS[robot.pattern]
    for name in keys.surroundings if robot_file.pairs is not None else ():
        why = "a point mass on three cables moves in place of the platform, and touches other bodies"
        raise ConfigError(file, f'{at}{name}: must be absent, but in plans with family = "spline": here {why}')
    for name in ("platform_box", "platform_hull"):
        if getattr(keys, name) is not None and not row.is_body:
            raise ConfigError(file, f"{at}{name}: must be absent: {robot_file.kind} has no shape")
    # Shapes have the same origin as the arms of the kernels: the mass centre, or a joint.
    centre = None if row.is_jointed else robot_file.centre_of_mass
    try:
        body = keys.body(centre or (0.0, 0.0, 0.0), robot_file.platform_points or ())
    except InputError as error:
        allowed = "must be points: those where the cables are attached lie in a plane"
        raise ConfigError(file, f"{at}platform_hull = true: {allowed}") from error
    return surroundings(robot, frame, keys.bodies, body, rotation)
