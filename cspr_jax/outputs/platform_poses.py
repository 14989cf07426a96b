"""Poses of a platform's own axes, at their origin, in place of poses of its mass centre."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from cspr_jax.build.robots import build_robot
from cspr_jax.config.keys.trajectory import TrajectoryKeys
from cspr_jax.config.robot import RobotFile
from cspr_jax.curves.files import reference_of
from cspr_jax.numerics.linear.frames import frame_of
from cspr_jax.numerics.linear.rotations import products
from cspr_jax.schema.quantities import TRAJECTORY

if TYPE_CHECKING:  # pictures need no plans
    from jaxtyping import Float

    from cspr_jax.plans.planning import PlannedMotions


def at_origin(plan: "PlannedMotions", columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Rows of a plan with position and orientation of a platform's own axes, where the plan asks for their origin."""
    quaternion = of_own_axes(plan.robot_file, columns["quaternion"])
    centre = np.asarray(plan.robot_file.centre_of_mass or [0.0] * 3)
    arm = Rotation.from_quat(np.roll(quaternion, -1, axis=1)).apply(centre)
    speed, omega = np.cross(columns["omega"], arm), columns["omega"]
    moved = {
        "position": columns["position"] - arm,
        "velocity": columns["velocity"] - speed,
        "acceleration": columns["acceleration"] - np.cross(columns["omega_dot"], arm) - np.cross(omega, speed),
        "quaternion": quaternion,
    }
    both = columns | moved | {"mass_centre": columns["position"]}
    return {name: both[name] for name in TRAJECTORY if name in both}  # the order that readers of tables expect


def of_own_axes(robot_file: RobotFile, quaternions: Float[np.ndarray, "n 4"]) -> Float[np.ndarray, "n 4"]:
    """Orientations of a platform's axes as in its file, from orientations relative to its reference orientation."""
    reference = reference_of(build_robot(robot_file, TrajectoryKeys(), robot_file.name))
    rotated = frame_of(robot_file.base_points, robot_file.z_axis).rotated_quaternions(reference)
    return products(quaternions, rotated[None])
