"""Logs of machines: tables of cable lengths or motor angles over time, with tensions beside them, as CSV.

Columns are named in a header line: `t`, and `length_1`, `length_2`, ... or `angle_1`, ..., optionally `tension_1`, ...;
a unit may follow in brackets, as in `t [ms]`, `length_1 [mm]` or `angle_2 [deg]`. All other columns are left out, so
that set points and motions that this program writes are logs too. Separators are commas, semicolons or tabs. Lines that
begin with # are comments; empty cells and nan are gaps. Times increase, in any steps.
"""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import numpy as np

from cspr_jax.config.headed_tables import HeadedTable, read_headed
from cspr_jax.config.motions.heads import ANGLES, LENGTHS, TIMES
from cspr_jax.errors import ConfigError

_HEAD = re.compile(r"(length|angle|tension)_?([1-9]\d{0,3})|(t|time)")
FORCES = {"N": 1.0, "kN": 1000.0, "mN": 0.001}
UNITS = {"t": TIMES, "length": LENGTHS, "angle": ANGLES, "tension": FORCES}
_WORDS = "t, length_1, length_2, ... or angle_1, angle_2, ..., and tension_1, ... if there are any"


@dataclasses.dataclass(frozen=True)
class CableLog:
    """A log of n rows of m cables; gaps are NaN.

    Fields:
        times: (n,) s, increasing; None: the file has none.
        lengths: (n, m) lengths of the cables, m; None: the file has angles.
        angles: (n, m) angles of the motors, rad; None: the file has lengths.
        tensions: (n, m) N; None: the file has none.
        lines: (n,) numbers of the lines of the file.
        notes: lines for the user.
    """

    times: np.ndarray | None
    lengths: np.ndarray | None
    angles: np.ndarray | None
    tensions: np.ndarray | None
    lines: np.ndarray
    notes: tuple[str, ...] = ()


def read_cable_log(path: Path, n_cables: int | None = None, *, needs_times: bool = False) -> CableLog:
    """Read a log, of a robot with so many cables if that is known."""
    table = read_headed(path, _WORDS)
    groups = _groups(table, _columns(table), n_cables, needs_times=needs_times)
    columns = [(k, table.factor(k, UNITS[name])) for name, indices in groups.items() for k in indices]
    numbers = table.numbers(*zip(*columns, strict=True))
    ends = np.cumsum([len(indices) for indices in groups.values()])[:-1]
    values = dict(zip(groups, np.split(numbers, ends, axis=1), strict=True))
    lines = np.array(table.lines)
    times = values["t"][:, 0] if "t" in values else None
    if times is not None:
        _check_times(path, times, lines)
    both = "lengths are taken, and angles left out" if {"length", "angle"} <= values.keys() else ""
    angles = None if "length" in values else values["angle"]
    return CableLog(times, values.get("length"), angles, values.get("tension"), lines, (both,) if both else ())


def _columns(table: HeadedTable) -> dict[tuple[str, int], int]:
    # Indices of columns by the name of their quantity and the number of the cable.
    columns: dict[tuple[str, int], int] = {}
    for k in range(len(table.heads)):
        match = _HEAD.fullmatch(table.name_and_unit(k)[0])
        if match is None:
            continue
        key = ("t", 0) if match[3] else (match[1], int(match[2]))
        if key in columns:
            raise table.error("stands twice: must stand once", k)
        columns[key] = k
    return columns


def _groups(
    table: HeadedTable, columns: dict[tuple[str, int], int], n_cables: int | None, *, needs_times: bool
) -> dict[str, list[int]]:
    # Columns of each quantity, in the order of the cables.
    numbers = {name: sorted(n for key, n in columns if key == name) for name in UNITS}
    if not numbers["length"] and not numbers["angle"]:
        raise table.error(f"no column length_1 or angle_1: must have {_WORDS}")
    if needs_times and not numbers["t"]:
        raise table.error(f"no column t: must have {_WORDS}")
    for name in ("length", "angle", "tension"):
        indices = numbers[name]
        count = n_cables or len(numbers["length"] or numbers["angle"])
        if indices and indices != list(range(1, count + 1)):
            heads = ", ".join(f"{name}_{n}" for n in indices)
            raise table.error(f"columns {heads}: must be {name}_1 to {name}_{count}, one a cable")
    return {name: [columns[name, n] for n in indices] for name, indices in numbers.items() if indices}


def _check_times(path: Path, times: np.ndarray, lines: np.ndarray) -> None:
    gaps = np.flatnonzero(np.isnan(times))
    if len(gaps):
        raise ConfigError(path, f"line {lines[gaps[0]]}: t is empty: must be a time in each row")
    late = np.flatnonzero(np.diff(times) <= 0.0)
    if len(late):
        i = int(late[0])
        words = f"must be more than {times[i]:.9g}, the time before it"
        raise ConfigError(path, f"line {lines[i + 1]}: t = {times[i + 1]:.9g}: {words}")
