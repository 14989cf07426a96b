"""Robots in the axes of the kernels: origin at the centroid of the spools, z down."""

from __future__ import annotations

import dataclasses
from typing import Any, TypeVar

import numpy as np

from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.linear.frames import Frame, frame_of
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.limits import NO_LIMITS
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.point_mass import PointMassRobot
from cspr_jax.robots.model.pulleys import Pulleys
from cspr_jax.robots.model.robot import Robot, check_moved
from cspr_jax.robots.statics.reference_pose import aligned

RobotKind = TypeVar("RobotKind", bound=PointMassRobot | PlatformRobot)


def centred(robot: RobotKind) -> tuple[RobotKind, Frame]:
    """A robot as the kernels take it: origin at the centroid of its spools, z down, without limits."""
    frame = frame_of(robot.base_points, robot.z_axis)
    changes: dict[str, Any] = {"base_points": as_float64(frame.inward(robot.base_points)), "z_axis": "down"}
    if isinstance(robot, PlatformRobot):
        changes["platform_points"] = as_float64(frame.rotated(robot.platform_points))
        changes["inertia"] = frame.rotated_tensor(as_float64(robot.inertia))
        if robot.centre_of_mass is not None:
            changes["centre_of_mass"] = as_float64(frame.rotated(robot.centre_of_mass))
    if robot.pulleys is not None:
        changes["pulleys"] = Pulleys(robot.pulleys.radius, as_float64(frame.rotated(robot.pulleys.axes)))
    return dataclasses.replace(robot, limits=NO_LIMITS, **changes), frame


def prepared(robot: RobotKind, *, pulleys: bool = False) -> tuple[RobotKind, Frame]:
    """A robot as the kernels take it, a platform also in its reference axes."""
    check_moved(robot, pulleys=pulleys)
    moved, frame = centred(robot)
    return (aligned(moved)[0] if isinstance(moved, PlatformRobot) else moved), frame  # type: ignore[return-value]


def coordinate_signs(robot: Robot, frame: Frame) -> Float[np.ndarray, "dof"]:
    """Signs of forces and moments in the axes of the robot file; a rod's moments are about axes of its own."""
    row = PATTERNS[robot.pattern]
    turning = np.ones(2) if row.along_line else frame.signs[list(row.moments)]
    return np.concatenate([frame.signs[list(row.forces)], turning])
