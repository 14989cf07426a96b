"""A robot with what stands around it: offsets of lengths, the tracker's axes and the point that it follows."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from cspr_jax.errors import InputError
from cspr_jax.numerics.linear.rotations import product
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.platform import PlatformRobot, across_line, platform_radius


class Setup(NamedTuple):
    """A robot, and how it is measured; kernels' axes.

    Fields:
        robot: robot, centred, z down.
        offsets: (n_cables,) lengths minus what readings say, m.
        orientation: (4,) of the robot's axes in the tracker's.
        shift: (3,) origin of the robot's axes in the tracker's, m.
        target: (3,) point that the tracker follows, from the mass centre or the joint, platform axes, m.
        per_reading: (n_cables,) length over reading at the nominal robot: m, or m/rad.
    """

    robot: AnyRobot
    offsets: Any
    orientation: Any
    shift: Any
    target: Any
    per_reading: Any


class EffectorPoses(NamedTuple):
    """Poses of the effector.

    Fields:
        positions: (k, 3) of the mass centre or the joint, m.
        quaternions: (k, 4) orientations, scalar first.
    """

    positions: Any
    quaternions: Any


def setup_of(robot: AnyRobot, target: Float[np.ndarray, "3"], *, are_angles: bool) -> Setup:
    """The nominal setup of a robot, with the tracker in the robot's axes."""
    n_cables, winches = robot.n_cables, robot.winches
    per_reading = np.ones(n_cables)
    if are_angles:
        if winches is None:
            raise InputError("winch", None, "given in the robot file where angles are measured", problem="missing")
        per_reading = np.asarray(winches.direction * winches.drum_radius / winches.gear_ratio)
    return Setup(robot, np.zeros(n_cables), np.array([1.0, 0, 0, 0]), np.zeros(3), target, per_reading)


def coordinates(robot: AnyRobot) -> Float[np.ndarray, "6 d"]:
    """Displacements, fixed axes, and turns, platform axes, of one metre of each coordinate of a pose."""
    row, columns = PATTERNS[robot.pattern], []
    for axis in row.forces:
        columns.append(np.eye(6)[axis])
    if isinstance(robot, PlatformRobot):
        radius = float(platform_radius(robot))
        turns = turning_axes(robot)
        columns += [np.concatenate([np.zeros(3), axis / radius]) for axis in turns]
    return np.stack(columns, axis=1)


def turning_axes(robot: AnyRobot) -> Float[np.ndarray, "r 3"]:
    """Axes, in the platform's, about which the effector turns."""
    if not isinstance(robot, PlatformRobot):
        return np.zeros((0, 3))
    row = PATTERNS[robot.pattern]
    return np.asarray(across_line(robot)).T if row.along_line else np.eye(3)[list(row.moments)]


def with_rotation(quaternion: jax.Array, vector: jax.Array, *, first: bool) -> jax.Array:
    """A quaternion rotated by a small rotation vector, rad, in its own axes (`first`) or in the fixed ones."""
    small = jnp.concatenate([jnp.ones(1), 0.5 * vector])
    small = small / jnp.sqrt(jnp.sum(small**2))
    return product(quaternion, small) if first else product(small, quaternion)


def small_rotations(vectors: Float[np.ndarray, "k 3"]) -> Float[np.ndarray, "k 4"]:
    """Quaternions of small rotation vectors, rad, as `with_rotation` takes them."""
    small = np.concatenate([np.ones((len(vectors), 1)), 0.5 * vectors], axis=1)
    return small / np.linalg.norm(small, axis=1, keepdims=True)
