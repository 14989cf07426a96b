"""Files of set points, read back: plain CSV, trajectories of joints of ROS 2, tables of counts."""

import csv
import json
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from cspr_jax.config.reading import read_text
from cspr_jax.errors import ConfigError, shown
from cspr_jax.schema.setpoints import MOTOR, NANO, SETPOINT_FORMATS

_HEAD = re.compile(r"^([a-z_]+?)_([1-9]\d{0,3})$")
_CYCLE = re.compile(r"^# cycle time (\d[\d.e+-]*) s$")
# Names of the arrays of joints: of motors, and of cables.
_OF_JOINTS = {
    "positions": ("angle", "length"),
    "velocities": ("speed", "rate"),
    "accelerations": ("motor_acceleration", "acceleration"),
    "effort": ("torque", "tension"),
}


def read_set_points(path: Path) -> dict[str, np.ndarray]:
    """Set points of a file: "t" (m,) s, and arrays (m, n) by the names of `machine.setpoints.SetPoints`, or counts."""
    if path.suffix not in SETPOINT_FORMATS:
        raise ConfigError(path, f"must end in {' or '.join(SETPOINT_FORMATS)}")
    text = read_text(path)
    if path.suffix == ".csv":
        points = _columns(path, csv.reader(text.splitlines()))
    elif path.suffix == ".txt":
        points = _cycles(path, text)
    else:
        points = _joints(path, _parsed(path, text))
    if not all(np.isfinite(array).all() for array in points.values()):
        raise ConfigError(path, "must hold only finite numbers")
    return points


def _columns(path: Path, rows: Iterable[list[str]]) -> dict[str, np.ndarray]:
    heads, *body = [row for row in rows if row] or [[]]
    if not body or len({len(row) for row in (heads, *body)}) != 1:
        raise ConfigError(path, "must be a header line and rows of as many numbers")
    try:
        table = np.array(body, float)
    except ValueError as error:
        raise ConfigError(path, f"must hold only numbers below its header line: {error}") from None
    indices: dict[str, list[int]] = {}
    for k, head in enumerate(heads):
        name, number = ("t", 1) if head == "t" else (m[1], int(m[2])) if (m := _HEAD.match(head)) else ("", 0)
        if not name or number != len(indices.setdefault(name, [])) + 1:
            raise ConfigError(path, f"{shown(head)}: heads must be t, and names with the numbers of cables from 1 on")
        indices[name].append(k)
    return {name: table[:, columns[0] if name == "t" else columns] for name, columns in indices.items()}


def _cycles(path: Path, text: str) -> dict[str, np.ndarray]:
    first, *rows = text.splitlines() or [""]
    try:
        match = _CYCLE.match(first)
        cycle = float(match[1]) if match else 0.0
    except ValueError:
        cycle = 0.0
    if not cycle > 0.0:
        raise ConfigError(path, f"{shown(first)}: the first line must be # cycle time, a number > 0, s")
    columns = _columns(path, (row.split("\t") for row in rows))
    return {"t": np.arange(len(rows) - 1) * cycle, **columns}


def _parsed(path: Path, text: str) -> Any:
    try:
        if path.suffix == ".json":
            return json.loads(text)
        import yaml  # few commands read YAML

        return yaml.load(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    except ValueError as error:
        raise ConfigError(path, f"no JSON: {error}") from None
    except Exception as error:
        if type(error).__module__.partition(".")[0] != "yaml":
            raise
        raise ConfigError(path, f"no YAML: {' '.join(str(error).split())}") from None


def _seconds(sec: Any, nanosec: Any) -> float:
    # Words would be multiplied as well.
    if not isinstance(sec, int) or not isinstance(nanosec, int):
        raise TypeError
    return (sec * NANO + nanosec) / NANO


def _joints(path: Path, message: Any) -> dict[str, np.ndarray]:
    try:
        names, points = message["joint_names"], message["points"]
        is_cable = not str(names[0]).startswith(MOTOR)
        times = np.array([_seconds(**point["time_from_start"]) for point in points])
        arrays = {
            quantities[is_cable]: np.array([point[name] for point in points], float)
            for name, quantities in _OF_JOINTS.items()
            if points and name in points[0]
        }
    except (KeyError, TypeError, IndexError, ValueError, OverflowError):
        raise ConfigError(path, "must be a JointTrajectory: joint_names, and points with time_from_start") from None
    if any(array.shape != (len(points), len(names)) for array in arrays.values()):
        raise ConfigError(path, f"points must hold {len(names)} numbers each: one a joint")
    if "tension" in arrays:
        arrays["tension"] = -arrays["tension"]
    return {"t": times, **arrays}
