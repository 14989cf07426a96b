"""Tables of measurements for calibration: readings of the cables and what a tracker saw, a row a pose; without jax.

A header line names the columns: `length_1`, ... or `angle_1`, ..., then `x`, `y`, `z` and `qw`, `qx`, `qy`, `qz` of a
tracker; `t` and `row` may be there, and are not read. Units may follow in brackets, as in `x [mm]`. Empty cells were
not measured. Lines that begin with # are comments.
"""

import dataclasses
import math
import re
from pathlib import Path

import numpy as np

from cspr_jax.config.formats.model import LARGEST_NUMBER
from cspr_jax.config.motions.heads import ANGLES, LENGTHS
from cspr_jax.config.motions.preamble import SEPARATORS, cells_of, is_comment, number_of
from cspr_jax.config.reading import read_text
from cspr_jax.config.wording import either
from cspr_jax.errors import ConfigError, shown
from cspr_jax.errors.suggestions import did_you_mean, look_alike

UNREAD = ("t", "row")
POSITION, QUATERNION = ("x", "y", "z"), ("qw", "qx", "qy", "qz")
# Largest difference of the norm of a quaternion from 1.
UNIT = 1e-3
_HEAD = re.compile(r"^([^\[\]()]*?)\s*(?:[\[(]([^\[\]()]*)[\])])?$")


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
    rows = [(i, line) for i, line in enumerate(read_text(path).split("\n"), 1) if line.strip() and not is_comment(line)]
    if len(rows) < 2:
        raise ConfigError(path, "no measurements: must be a line with the names of the columns, then a row a pose")
    line, head = rows[0]
    separator = next((separator for separator in SEPARATORS if separator in head), None)
    names, factors = _columns(path, line, cells_of(head, separator), n_cables)
    are_angles = any(name.startswith("angle_") for name in names)
    numbers = np.array([_row(path, i, cells_of(text, separator), names, separator) for i, text in rows[1:]]) * factors
    lines = tuple(i for i, _ in rows[1:])
    kind = "angle" if are_angles else "length"
    order = [*(f"{kind}_{i + 1}" for i in range(n_cables)), *POSITION, *QUATERNION]
    table = np.full((len(numbers), len(order)), np.nan)
    for k, name in enumerate(order):
        if name in names:
            table[:, k] = numbers[:, names.index(name)]
    quaternions = _unit(path, lines, table[:, n_cables + 3 :])
    return MeasurementTable(table[:, :n_cables], table[:, n_cables : n_cables + 3], quaternions, are_angles, lines)


def _columns(path: Path, line: int, heads: list[str], n_cables: int) -> tuple[list[str], np.ndarray]:
    readings = [f"{kind}_{i + 1}" for kind in ("length", "angle") for i in range(n_cables)]
    allowed = (*readings, *POSITION, *QUATERNION, *UNREAD)
    names, factors = list[str](), list[float]()
    for k, head in enumerate(heads, 1):
        position, match = f"line {line}, column {k}", _HEAD.match(head.strip())
        name, unit = (match[1].strip(), match[2]) if match else (head, None)
        if name not in allowed:
            words = f"length_1 to length_{n_cables} or angle_1 to angle_{n_cables}, x, y, z, qw, qx, qy, qz, t, row"
            question = did_you_mean(name, allowed)
            raise ConfigError(path, f"{position}: {shown(head)}: {question}must be one of {words}")
        if name in names:
            raise ConfigError(path, f"{position}: {shown(head)} stands twice: must stand once")
        units = ANGLES if name.startswith("angle_") else {"": 1.0} if name in (*QUATERNION, *UNREAD) else LENGTHS
        if unit is not None and unit.strip() not in units and name not in UNREAD:
            raise ConfigError(path, f"{position}: unit of {name} = {shown(unit)}: must be {either(tuple(units))}")
        names.append(name)
        factors.append(1.0 if unit is None or name in UNREAD else units[unit.strip()])
    kinds = {name.partition("_")[0] for name in names if name in readings}
    if len(kinds) != 1:
        words = (
            "lengths and angles: must be one of them"
            if kinds
            else f"no column length_1 or angle_1: must have {n_cables}"
        )
        raise ConfigError(path, f"line {line}: {words}")
    if 0 < len(set(names) & set(QUATERNION)) < len(QUATERNION):
        missing = next(name for name in QUATERNION if name not in names)
        raise ConfigError(path, f"line {line}: no column {missing}: must have {', '.join(QUATERNION)}, or none of them")
    return names, np.array(factors)


def _row(path: Path, line: int, cells: list[str], names: list[str], separator: str | None) -> list[float]:
    if len(cells) != len(names):
        raise ConfigError(path, f"line {line}: {len(cells)} values: must be {len(names)}, as in the header")
    numbers = []
    for k, (name, cell) in enumerate(zip(names, cells, strict=True), 1):
        is_empty = name in UNREAD or cell.lower() in ("", "nan")
        is_split = separator == "," and "," in cell
        number = math.nan if is_empty else number_of(cell)
        if not is_empty and (is_split or not abs(number) <= LARGEST_NUMBER):
            label = f"line {line}, column {k}: {name} = {shown(cell)}"
            raise ConfigError(path, f"{label}: must be a finite number, or empty{look_alike(cell[:100])}")
        numbers.append(number)
    return numbers


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
    rows = [(i, line) for i, line in enumerate(read_text(path).split("\n"), 1) if line.strip() and not is_comment(line)]
    columns = ["first", "second", "distance", "deviation"]
    separator = next((separator for separator in SEPARATORS if rows and separator in rows[0][1]), None)
    names = cells_of(rows[0][1], separator) if rows else []
    if names != columns or len(rows) < 2:
        raise ConfigError(
            path, f"line {rows[0][0] if rows else 1}: must be {', '.join(columns)}, then a row a distance"
        )
    table = []
    for line, text in rows[1:]:
        row = _row(path, line, cells_of(text, separator), names, separator)
        first, second, distance, deviation = row
        for name, cable in (("first", first), ("second", second)):
            if cable not in range(1, n_cables + 1):
                raise ConfigError(path, f"line {line}: {name} = {cable:g}: must be a cable, from 1 to {n_cables}")
        if first == second or not distance > 0.0 or not deviation > 0.0:
            raise ConfigError(path, f"line {line}: must be two cables, a distance > 0 and a deviation > 0, m")
        table.append(row)
    return np.array(table)
