"""Feasible accelerations at a time of a motion of a point mass, from its file."""

import dataclasses

import numpy as np

from cspr_jax.build.robots import build_limits, gravity_of, kernel_robot
from cspr_jax.errors import InputError
from cspr_jax.numerics.elementary import as_float64, double_precision
from cspr_jax.numerics.linear.frames import frame_of
from cspr_jax.outputs.plots.motions.motion_source import robot_and_plan
from cspr_jax.outputs.plots.selection import nearest
from cspr_jax.outputs.plots.style.labels import value
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.point_mass import PointMassRobot
from cspr_jax.robots.statics.wrench_sets import spanning, tension_range
from cspr_jax.store.reading.result import Result
from cspr_jax.workspaces.acceleration_search import faces_of, margins_and_verdicts

# Number of rows computed at a time: with many cables the faces of all rows would not fit into memory.
ROWS = 1 << 14


@dataclasses.dataclass(frozen=True)
class AccelerationSet:
    """Feasible accelerations at a time. Vectors are in the axes of the file, but with z upward.

    Fields:
        words: words for the time, such as "t = 1.2 s".
        position: (3,) position of the effector, as in the file, m.
        actual: (3,) actual acceleration of the effector, m/s^2.
        margin: distance of the actual acceleration from the nearest face, m/s^2; negative outside.
        normals: (n_faces, 3) unit vectors that point inside.
        offsets: (n_faces,) products of normals with points of the faces, m/s^2; -inf for a candidate that is no face.
        names: names of the faces.
        cables: (n_cables, 3) unit vectors from the effector to the spools.
        span: (n_cables,) change of acceleration from the smallest to the largest tension of each cable, m/s^2.
        apex: (3,) acceleration at the smallest tensions, m/s^2.
        falling: (3,) acceleration of free fall, m/s^2.
        motion: (n, 3) accelerations of the full motion, m/s^2.
        is_planar: whether the robot moves in a plane.
    """

    words: str
    position: np.ndarray
    actual: np.ndarray
    margin: float
    normals: np.ndarray
    offsets: np.ndarray
    names: list[str]
    cables: np.ndarray
    span: np.ndarray
    apex: np.ndarray
    falling: np.ndarray
    motion: np.ndarray
    is_planar: bool

    @property
    def slacks(self) -> np.ndarray:
        """Distances of the actual acceleration from the faces, (n_faces,); inf for a candidate that is no face."""
        return self.normals @ self.actual - self.offsets

    @property
    def nearest(self) -> int:
        """Index of the nearest face."""
        return int(np.argmin(self.slacks))

    @property
    def foot(self) -> np.ndarray:
        """The nearest point of the plane of the nearest face, (3,)."""
        return self.actual - self.slacks[self.nearest] * self.normals[self.nearest]


def acceleration_set(result: Result, file: str, at: dict[str, float]) -> AccelerationSet:
    """Feasible accelerations at a time of a motion."""
    robot_file, plan_file = robot_and_plan(result, file, "acceleration")
    if robot_file.is_platform:
        error = f'"acceleration" of {robot_file.kind}'
        raise InputError("--quantity", "acceleration", "must be of a motion of a point mass", problem=error)
    row, words = None, ""
    for axis, time in at.items():
        row, words = nearest(result, axis, time)  # refuses axes other than t
    with double_precision():
        robot, frame = (
            kernel_robot(robot_file, plan_file, file, any_cables=True),
            frame_of(robot_file.base_points, robot_file.z_axis),
        )
        low, high = (
            as_float64(tensions) for tensions in tension_range(robot, build_limits(robot_file, plan_file, file))
        )
        limits = Limits(tension_min=low, tension_max=high)
        positions, motion = frame.inward(result.data["position"]), frame.rotated(result.data["acceleration"])
        if row is None:
            row = _tightest(robot, limits, positions, motion)
            words = f"{value(result, 't', result.axes['t'][row])} (smallest margin)"
        current = slice(row, row + 1)
        faces = faces_of(robot, limits, positions[current])
        margin = margins_and_verdicts(robot, faces, faces, positions[current], motion[current])[0]
    if not np.asarray(faces.is_regular)[0]:
        raise InputError("--at", words, "a time at which the cables span the space, or the plane of a planar robot")
    upward = np.array([*frame.signs[:2], -1.0])
    rays = np.asarray(robot.base_points) - positions[row]
    return AccelerationSet(
        words=words,
        position=result.data["position"][row],
        actual=motion[row] * upward,
        margin=float(margin[0]),
        normals=np.asarray(faces.normals)[0] * upward,
        offsets=np.asarray(faces.offsets)[0],
        names=_names(robot_file.dof, len(rays), np.asarray(faces.of_largest)[0]),
        cables=rays / np.linalg.norm(rays, axis=1, keepdims=True) * upward,
        span=np.asarray(high - low) / robot_file.mass,
        apex=np.asarray(faces.apex)[0] * upward,
        falling=np.array([0.0, 0.0, -gravity_of(robot_file, plan_file)]),
        motion=motion * upward,
        is_planar=robot_file.is_planar,
    )


def _tightest(robot: PointMassRobot, limits: Limits, positions: np.ndarray, motion: np.ndarray) -> int:
    # Row with the smallest margin.
    margins = []
    for first in range(0, len(positions), ROWS):
        current, accelerations = positions[first : first + ROWS], motion[first : first + ROWS]
        faces = faces_of(robot, limits, current)
        margins.append(margins_and_verdicts(robot, faces, faces, current, accelerations)[0])
    return int(np.nanargmin(np.concatenate(margins)))


def _names(dof: int, count: int, of_largest: np.ndarray) -> list[str]:
    chosen = np.tile(spanning(count, dof) + 1, (2, 1)).tolist()
    words = [f"cable{'s' * (len(row) > 1)} {', '.join(map(str, row))}" for row in chosen]
    return [f"{word} (largest tension)" if largest else word for word, largest in zip(words, of_largest, strict=True)]
