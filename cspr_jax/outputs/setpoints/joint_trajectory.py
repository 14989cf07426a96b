"""Set points as the message trajectory_msgs/JointTrajectory of ROS 2, in YAML and JSON.

The message and its points are defined in the files JointTrajectory.msg and JointTrajectoryPoint.msg of the repository
ros2/common_interfaces (folder trajectory_msgs/msg): header, joint_names, points; a point has positions, velocities,
accelerations and effort, in rad and N m for revolute joints and in m and N for prismatic ones, and time_from_start,
a builtin_interfaces/Duration of seconds and nanoseconds.

With winches, joints are motors; without, they are cables as prismatic joints, whose effort along the growing length is
the negative tension.
"""

import json
from collections.abc import Iterator

import numpy as np

from cspr_jax.machine.setpoints import SetPoints
from cspr_jax.schema.setpoints import CABLE, MOTOR, NANO

_HEADER = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}


def json_lines(points: SetPoints, rate: float, counts: np.ndarray | None) -> Iterator[str]:
    """Lines of a JSON file, one a point."""
    del rate, counts
    head = json.dumps({"header": _HEADER, "joint_names": _joint_names(points)}, allow_nan=False)
    yield head[:-1] + ', "points": ['
    rows = list(_points(points))
    for i, row in enumerate(rows):
        yield json.dumps(row, allow_nan=False) + ("," if i < len(rows) - 1 else "")
    yield "]}"


def yaml_lines(points: SetPoints, rate: float, counts: np.ndarray | None) -> Iterator[str]:
    """Lines of a YAML file."""
    del rate, counts
    yield 'header: {stamp: {sec: 0, nanosec: 0}, frame_id: ""}'
    yield f"joint_names: [{', '.join(_joint_names(points))}]"
    yield "points:"
    for row in _points(points):
        time = row.pop("time_from_start")
        for i, (name, values) in enumerate(row.items()):
            yield f"{'  ' if i else '- '}{name}: [{', '.join(map(_yaml_number, values))}]"
        yield f"  time_from_start: {{sec: {time['sec']}, nanosec: {time['nanosec']}}}"


def _joint_names(points: SetPoints) -> list[str]:
    kind = CABLE if points.angle is None else MOTOR
    return [f"{kind}_{k + 1}" for k in range(points.length.shape[1])]


def _points(points: SetPoints) -> Iterator[dict]:
    of_motors = (points.angle, points.speed, points.motor_acceleration, points.torque)
    of_cables = [points.length, points.rate, points.acceleration, -points.tension + 0.0]
    arrays = [array for array in of_motors if array is not None] or of_cables
    stamps = np.rint(points.t * NANO).astype(np.int64)
    # Times must increase: the row just before the end may have its time in nanoseconds.
    is_later = np.append(np.diff(stamps) > 0, True)
    names = ("positions", "velocities", "accelerations", "effort")
    for stamp, *values in zip(stamps[is_later].tolist(), *(array[is_later].tolist() for array in arrays), strict=True):
        time = dict(zip(("sec", "nanosec"), divmod(stamp, NANO), strict=True))
        yield dict(zip(names, values, strict=True)) | {"time_from_start": time}


def _yaml_number(value: float) -> str:
    # YAML 1.1 takes 1e-05 for a word: its numbers have a dot before the exponent.
    mantissa, exponent_letter, exponent = repr(value).partition("e")
    return mantissa + (".0" if exponent_letter and "." not in mantissa else "") + exponent_letter + exponent
