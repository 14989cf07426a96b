"""Logs of machines: tables of cable lengths or motor angles over time, with tensions beside them, as CSV.

Columns are named in a header line: `t`, and `length_1`, `length_2`, ... or `angle_1`, ..., optionally `tension_1`, ...;
a unit may follow in brackets, as in `t [ms]`, `length_1 [mm]` or `angle_2 [deg]`. All other columns are left out, so
that set points and motions that this program writes are logs too. Separators are commas, semicolons or tabs. Lines that
begin with # are comments; empty cells and nan are gaps. Times increase, in any steps.
"""

from __future__ import annotations

import dataclasses
import math
import re
from pathlib import Path

import numpy as np

from cspr_jax.config.motions.heads import ANGLES, LENGTHS, TIMES
from cspr_jax.config.reading import decoded, opened
from cspr_jax.errors import ConfigError, shown
from cspr_jax.errors.suggestions import look_alike

LARGEST_FILE = 1 << 28  # bytes
LARGEST_ROWS = 2_000_000
LARGEST_NUMBER = 1e12
GAPS = ("", "nan", "na", "null", "none")
_HEAD = re.compile(r"^(length|angle|tension)_?([1-9]\d{0,3})$|^(t|time)$")
_UNIT = re.compile(r"^(.*?)\s*[\[(]\s*([^\])]*?)\s*[\])]$")
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
    rows = [(number, text) for number, text in enumerate(_text(path).split("\n"), 1) if _has_content(text)]
    if len(rows) < 2:
        raise ConfigError(path, f"{len(rows)} lines: must be a header line and rows below it: {_WORDS}")
    if len(rows) - 1 > LARGEST_ROWS:
        raise ConfigError(path, f"{len(rows) - 1} rows: must be at most {LARGEST_ROWS}")
    (head_line, head), *body = rows
    delimiter = next((separator for separator in (";", "\t") if separator in head), ",")
    heads = [cell.strip().strip('"') for cell in head.split(delimiter)]
    columns, factors = _columns(path, head_line, heads)
    table = _numbers(path, body, heads, columns, delimiter)
    groups = _groups(path, head_line, columns, n_cables, needs_times=needs_times)
    values = {name: table[:, order] * np.array([factors[k] for k in order]) for name, order in groups.items()}
    lines = np.array([number for number, _ in body])
    times = values["t"][:, 0] if "t" in values else None
    if times is not None:
        _check_times(path, times, lines)
    both = "lengths are taken, and angles left out" if {"length", "angle"} <= values.keys() else ""
    angles = None if "length" in values else values["angle"]
    return CableLog(times, values.get("length"), angles, values.get("tension"), lines, (both,) if both else ())


def _text(path: Path) -> str:
    with opened(path) as file:
        data = file.read(LARGEST_FILE + 1)
    if len(data) > LARGEST_FILE:
        raise ConfigError(path, f"is longer than {LARGEST_FILE} bytes: must be shorter")
    if data.startswith((b"\x89HDF", b"PK\x03\x04")) or b"\0" in data[:4096]:
        raise ConfigError(path, "is not a table of text: must be CSV")
    return decoded(data, path)


def _has_content(text: str) -> bool:
    return bool(text.strip(" \t,;")) and not text.lstrip().startswith("#")


def _columns(path: Path, line: int, heads: list[str]) -> tuple[dict[tuple[str, int], int], dict[int, float]]:
    # Places of columns by name and number of the cable, and factors to SI units.
    columns: dict[tuple[str, int], int] = {}
    factors: dict[int, float] = {}
    for k, head in enumerate(heads):
        with_unit = _UNIT.match(head)
        name, unit = (with_unit[1], with_unit[2]) if with_unit else (head, "")
        match = _HEAD.match(name.strip().lower())
        if match is None:
            continue
        kind = "t" if match[3] else match[1]
        key = kind, 0 if match[3] else int(match[2])
        label = f"line {line}, column {k + 1}: {shown(head)}"
        if key in columns:
            raise ConfigError(path, f"{label}: stands twice: must stand once")
        if unit and unit not in UNITS[kind]:
            raise ConfigError(path, f"{label}: unit {shown(unit)}: must be {', '.join(UNITS[kind])}")
        columns[key], factors[k] = k, UNITS[kind].get(unit, 1.0)
    return columns, factors


def _numbers(
    path: Path, body: list[tuple[int, str]], heads: list[str], columns: dict[tuple[str, int], int], delimiter: str
) -> np.ndarray:
    read = sorted(columns.values())
    table = np.full((len(body), len(heads)), np.nan)
    for i, (line, text) in enumerate(body):
        cells = text.split(delimiter)
        if len(cells) != len(heads):
            raise ConfigError(path, f"line {line}: {len(cells)} values: must be {len(heads)}, as in the header")
        for k in read:
            try:
                table[i, k] = float(cells[k])
            except ValueError:
                table[i, k] = _number(path, line, k, heads[k], cells[k].strip().strip('"'), delimiter)
            if abs(table[i, k]) > LARGEST_NUMBER:
                raise ConfigError(path, f"{_at(line, k, heads[k], cells[k].strip())}: must be a finite number")
    return table


def _number(path: Path, line: int, k: int, head: str, cell: str, delimiter: str) -> float:
    if cell.lower() in GAPS:
        return math.nan
    try:
        return float(cell.replace(",", ".") if delimiter != "," else cell)
    except ValueError:
        words = f"must be a number, or empty for a gap{look_alike(cell[:100])}"
        raise ConfigError(path, f"{_at(line, k, head, cell)}: {words}") from None


def _at(line: int, k: int, head: str, cell: str) -> str:
    return f"line {line}, column {k + 1}: {head} = {shown(cell)}"


def _groups(
    path: Path, line: int, columns: dict[tuple[str, int], int], n_cables: int | None, *, needs_times: bool
) -> dict[str, list[int]]:
    # Columns of each quantity, in the order of the cables.
    numbers = {name: sorted(n for key, n in columns if key == name) for name in UNITS}
    if not numbers["length"] and not numbers["angle"]:
        raise ConfigError(path, f"line {line}: no column length_1 or angle_1: must have {_WORDS}")
    if needs_times and not numbers["t"]:
        raise ConfigError(path, f"line {line}: no column t: must have {_WORDS}")
    for name in ("length", "angle", "tension"):
        indices = numbers[name]
        count = n_cables or len(numbers["length"] or numbers["angle"])
        if indices and indices != list(range(1, count + 1)):
            heads = ", ".join(f"{name}_{n}" for n in indices)
            raise ConfigError(path, f"line {line}: columns {heads}: must be {name}_1 to {name}_{count}, one a cable")
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
