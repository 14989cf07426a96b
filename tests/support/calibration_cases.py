"""Random robots of any pattern, off by errors, and what their cables read at poses."""

import numpy as np
from oracles import calibration as oracle
from scipy.spatial.transform import Rotation

import cspr_jax
from support import cable_robots


def body_case(seed, count, noise, *, n=8, pattern="3R3T", error=2e-3):
    """A random robot, one off by errors, poses, and readings of the latter."""
    rng = np.random.default_rng(seed)
    robot = cable_robots.any_robot(rng, pattern, n)
    poses = [robot.pose(rng) for _ in range(count)]
    positions, rotations = np.array([pose[0] for pose in poses]), np.array([pose[1] for pose in poses])
    free = {"1T": [2], "2T": [0, 2], "1R2T": [0, 2]}.get(pattern, [0, 1, 2])
    spools, points = robot.base.copy(), robot.platform.copy()
    spools[:, free] += error * rng.normal(size=(n, len(free)))
    if pattern == "2R3T":
        line = points[np.abs(points).max(1).argmax()]
        points = points + error * rng.normal(size=(n, 1)) * line / np.linalg.norm(line)
    elif pattern not in cable_robots.POINT_MASSES:
        points[:, free] += error * rng.normal(size=(n, len(free)))
    offsets = error * rng.normal(size=n)
    readings = oracle.lengths(spools, points, positions, rotations) - offsets
    return robot, spools, points, offsets, positions, rotations, readings + noise * rng.normal(size=readings.shape)


def built(robot, **changes):
    """The package's robot."""
    if robot.pattern in cable_robots.POINT_MASSES:
        return cspr_jax.point_mass(robot.base, mass=robot.mass, pattern=robot.pattern, z_axis="up", **changes)
    inertia = robot.mass * np.diag([0.1, 0.12, 0.09])
    named = {"mass": robot.mass, "inertia": inertia, "pattern": robot.pattern, "z_axis": "up", **changes}
    return cspr_jax.platform(robot.base, robot.platform, centre_of_mass=robot.arm, **named)


def quaternions_of(rotations):
    return Rotation.from_matrix(rotations).as_quat(scalar_first=True)
