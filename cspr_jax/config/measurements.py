"""Tables of measurements for calibration: readings of the cables and what a tracker saw, a row a pose; without jax.

A header line names the columns: `length_1`, ... or `angle_1`, ..., then `x`, `y`, `z` and `qw`, `qx`, `qy`, `qz` of a
tracker; `t` and `row` may be there, and are not read. Units may follow in brackets, as in `x [mm]`. Empty cells were
not measured. Lines that begin with # are comments.
"""

import dataclasses
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from cspr_jax.config.headed_tables import HeadedTable, read_headed
from cspr_jax.config.motions.heads import ANGLES, LENGTHS
from cspr_jax.errors import ConfigError
from cspr_jax.errors.suggestions import did_you_mean

UNREAD = ("t", "row")
POSITION, QUATERNION = ("x", "y", "z"), ("qw", "qx", "qy", "qz")
DISTANCE = ("first", "second", "distance", "deviation")
# Largest difference of the norm of a quaternion from 1.
UNIT = 1e-3


@dataclasses.dataclass(frozen=True)
class MeasurementTable:
    """Measurements of k poses in the axes of the file, NaN where nothing was measured.

    Fields:
        readings: (k, n_cables) lengths, m, or angles, rad.
        positions: (k, 3) m.
        quaternions: (k, 4) unit quaternions, scalar first.
        are_angles: whether the readings are angles.
        lines: (k,) lines of the file.
    """

    readings: np.ndarray
    positions: np.ndarray
    quaternions: np.ndarray
    are_angles: bool
    lines: tuple[int, ...]


def read_measurements(path: Path, n_cables: int) -> MeasurementTable:
    """A table of measurements of a robot."""
    table = read_headed(path, "length_1, ... or angle_1, ..., then x, y, z, qw, qx, qy, qz of a tracker")
    columns = _columns(table, n_cables)
    are_angles = any(name.startswith("angle_") for name in columns)
    kind = "angle" if are_angles else "length"
    order = [*(f"{kind}_{i + 1}" for i in range(n_cables)), *POSITION, *QUATERNION]
    is_there = np.array([name in columns for name in order])
    present = [columns[name] for name in order if name in columns]
    numbers = np.full((len(table.rows), len(order)), np.nan)
    factors = [table.factor(columns[name], _units(name)) for name in order if name in columns]
    numbers[:, is_there] = table.numbers(present, factors)
    quaternions = _unit(path, table.lines, numbers[:, n_cables + 3 :])
    readings, positions = numbers[:, :n_cables], numbers[:, n_cables : n_cables + 3]
    return MeasurementTable(readings, positions, quaternions, are_angles, table.lines)


def _units(name: str) -> Mapping[str, float]:
    return {} if name in QUATERNION else ANGLES if name.startswith("angle_") else LENGTHS


def _columns(table: HeadedTable, n_cables: int) -> dict[str, int]:
    # Indices of columns by their names.
    readings = [f"{kind}_{i + 1}" for kind in ("length", "angle") for i in range(n_cables)]
    allowed, columns = (*readings, *POSITION, *QUATERNION, *UNREAD), dict[str, int]()
    for k in range(len(table.heads)):
        name = table.name_and_unit(k)[0]
        if name not in allowed:
            words = f"length_1 to length_{n_cables} or angle_1 to angle_{n_cables}, x, y, z, qw, qx, qy, qz, t, row"
            raise table.error(f"{did_you_mean(name, allowed)}must be one of {words}", k)
        if name in columns:
            raise table.error("stands twice: must stand once", k)
        columns[name] = k
    kinds = {name.partition("_")[0] for name in columns if name in readings}
    if len(kinds) != 1:
        words = "lengths and angles: must be one of them"
        raise table.error(words if kinds else f"no column length_1 or angle_1: must have {n_cables}")
    missing = [name for name in QUATERNION if name not in columns]
    if 0 < len(missing) < len(QUATERNION):
        raise table.error(f"no column {missing[0]}: must have {', '.join(QUATERNION)}, or none of them")
    return columns


def _unit(path: Path, lines: tuple[int, ...], quaternions: np.ndarray) -> np.ndarray:
    is_number = np.isfinite(quaternions)
    for line, measured in zip(lines, is_number, strict=True):
        if measured.any() and not measured.all():
            missing = QUATERNION[int(np.argmin(measured))]
            raise ConfigError(path, f"line {line}: {missing} is empty: must be a number, as the others of {QUATERNION}")
    norms = np.linalg.norm(quaternions, axis=1)
    for k in np.flatnonzero(is_number.all(1) & ~(np.abs(norms - 1.0) <= UNIT)):
        values = ", ".join(f"{value:g}" for value in quaternions[k])
        raise ConfigError(path, f"line {lines[k]}: quaternion ({values}) of length {norms[k]:.6g}: must be of length 1")
    return quaternions / np.where(is_number.all(1), norms, 1.0)[:, None]


def read_distances(path: Path, n_cables: int) -> np.ndarray:
    """Measured distances between spools: rows of two cables, counted from 1, the distance and its deviation, m."""
    table = read_headed(path, ", ".join(DISTANCE))
    if [table.name_and_unit(k)[0] for k in range(len(table.heads))] != list(DISTANCE):
        raise table.error(f"must be {', '.join(DISTANCE)}, then a row a distance")
    factors = [table.factor(k, units) for k, units in enumerate(({}, {}, LENGTHS, LENGTHS))]
    rows = table.numbers(range(len(DISTANCE)), factors)
    for line, row in zip(table.lines, rows, strict=True):
        first, second, distance, deviation = row
        for name, cable in (("first", first), ("second", second)):
            if cable not in range(1, n_cables + 1):
                raise ConfigError(path, f"line {line}: {name} = {cable:g}: must be a cable, from 1 to {n_cables}")
        if first == second or not distance > 0.0 or not deviation > 0.0:
            raise ConfigError(path, f"line {line}: must be two cables, a distance > 0 and a deviation > 0, m")
    return rows
