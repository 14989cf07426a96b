"""Orientations of a file in the axes of the kernels."""

from __future__ import annotations

import numpy as np

from cspr_jax.errors import ConfigError, shown
from cspr_jax.motion.waypoints import Waypoints
from cspr_jax.numerics.linear.frames import IDENTITY, Frame
from cspr_jax.numerics.linear.rotations import cylindrical_frames, from_tilt_torsion
from cspr_jax.numerics.shapes import Float
from cspr_jax.numerics.tolerances import UNIT_NORM


def orientations(
    frame: Frame, points: Float[np.ndarray, "n 3"], angles: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "n 4"]:
    """Orientations of tilt and torsion in the cylindrical frame of their positions, (3.98), in the kernels' axes."""
    return frame.rotated_quaternions(from_tilt_torsion(angles + cylindrical_frames(frame.rotated(points))))


def given_quaternion(quaternion: list[float] | None, key: str, file: object) -> Float[np.ndarray, "4"]:
    """Orientation given as a quaternion, whose norm may differ from 1 by rounding."""
    unit_quaternion = np.asarray(IDENTITY if quaternion is None else quaternion)
    norm = float(np.linalg.norm(unit_quaternion))
    if abs(norm - 1.0) > UNIT_NORM:
        raise ConfigError(file, f"{key} = {shown(quaternion)}: must have length 1 (it has {norm:.7g})")
    return unit_quaternion / norm


def pose_quaternions(waypoints: Waypoints, points: Float[np.ndarray, "n_poses 3"]) -> Float[np.ndarray, "n_poses 4"]:
    """Orientations of waypoints, given as quaternions or as tilt and torsion, in the kernels' axes."""
    frame, poses = waypoints.frame, waypoints.poses
    units = [
        given_quaternion(pose.quaternion, f"{waypoints.name(i)}.quaternion", waypoints.path)
        for i, pose in enumerate(poses)
    ]
    angles = np.array([pose.tilt_torsion or [0.0] * 3 for pose in poses])
    is_tilted = np.array([pose.tilt_torsion is not None for pose in poses])
    return np.where(is_tilted[:, None], orientations(frame, points, angles), frame.rotated_quaternions(np.array(units)))
