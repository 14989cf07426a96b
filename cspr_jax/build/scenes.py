"""Scenes of motions: what workspaces take, of a robot whose platform has its reference axes."""

from cspr_jax.build.robots import build_robot
from cspr_jax.build.surroundings import build_scene
from cspr_jax.config.keys.obstacles import SurroundingsKeys
from cspr_jax.config.keys.trajectory import TrajectoryKeys
from cspr_jax.config.robot import RobotFile
from cspr_jax.numerics.linear.frames import Frame
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.statics.kernel_axes import centred
from cspr_jax.robots.statics.reference_pose import aligned


def scene_of(
    robot: AnyRobot,
    robot_file: RobotFile,
    frame: Frame,
    keys: SurroundingsKeys,
    file: object,
    *,
    trajectory: TrajectoryKeys,
) -> Scene:
    """Scene of the robot of a problem, whose platform has its reference axes; see `build_scene`."""
    written = centred(build_robot(robot_file, trajectory, file))[0]
    rotation = aligned(written)[1] if isinstance(written, PlatformRobot) else None
    return build_scene(robot, robot_file, frame, keys, file, rotation=rotation)
