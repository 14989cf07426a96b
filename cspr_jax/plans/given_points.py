"""Plans whose positions are those of the origin of the platform's axes, converted to positions of the mass centre."""

from pathlib import Path
from typing import Any

import numpy as np

from cspr_jax.build.orientations import pose_quaternions
from cspr_jax.build.robots import build_robot
from cspr_jax.config.keys.pose import Pose
from cspr_jax.config.plan import PlanFile
from cspr_jax.config.robot import RobotFile
from cspr_jax.curves.files import centre_from, reference_of
from cspr_jax.errors import ConfigError
from cspr_jax.motion.waypoints import Waypoints
from cspr_jax.numerics.linear.frames import frame_of

# Keys that always refer to the mass centre, whatever point the positions of poses refer to.
OTHERS = ("ellipse", "path", "launch", "first_control_point", "velocity", "acceleration")


def with_mass_centres(robot_file: RobotFile, plan_file: PlanFile, path: Path) -> PlanFile:
    """The plan with positions of the mass centre; `plan_file.point` says which point its positions are of."""
    centre = centre_from(robot_file.as_written, plan_file.point)
    if centre is None or not centre.any():
        return plan_file
    _refuse_others(plan_file, path)
    frame = frame_of(robot_file.base_points, robot_file.z_axis)
    placed = [i for i, pose in enumerate(plan_file.pose) if pose.position is not None]
    positions = np.zeros((len(plan_file.pose), 3))
    for i in placed:
        positions[i] = frame.inward(plan_file.pose[i].position)
    arm, units = frame.rotated(centre), None
    shifts = np.broadcast_to(arm, positions.shape)  # for a platform that only translates
    if robot_file.is_platform and placed:
        units = pose_quaternions(
            Waypoints(robot_file, plan_file, path, frame, plan_file.family, 0, len(positions) - 1), positions
        )
        arm = _rotations(reference_of(build_robot(robot_file, plan_file, path))).apply(arm)
        shifts = _rotations(units).apply(arm)
    poses = list(plan_file.pose)
    for i in placed:
        changes = {"position": np.asarray(frame.outward(positions[i] + shifts[i])).tolist()}
        if poses[i].tilt_torsion is not None and units is not None:
            # The azimuth counts from a direction that depends on the given position: convert it to a quaternion.
            changes |= {"tilt_torsion": None, "quaternion": frame.rotated_quaternions(units[i]).tolist()}
        poses[i] = poses[i].model_copy(update=changes)
    return plan_file.model_copy(update={"pose": poses})


def _refuse_others(plan_file: PlanFile, path: Path) -> None:
    tables: list[tuple[str, Pose | PlanFile]] = [("", plan_file)]
    tables += [(f"pose[{i}].", pose) for i, pose in enumerate(plan_file.pose)]
    for prefix, table in tables:
        for key in OTHERS:
            if getattr(table, key, None) is not None:
                raise ConfigError(
                    path, f'point = "origin": must be "mass-centre" with {prefix}{key}, which is of the mass centre'
                )


def _rotations(quaternions: np.ndarray) -> Any:
    from scipy.spatial.transform import Rotation  # only such plans need it

    return Rotation.from_quat(np.roll(quaternions, -1, axis=-1))
