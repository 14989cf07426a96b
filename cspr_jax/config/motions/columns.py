"""Columns of a table of a motion: which quantity each holds, and in which unit.

Units follow the names (`config.motions.heads`), or stand in a row of their own or in a line `# units: mm, deg, ms`.
Other directives are `# interpolation: quintic`, `# ends: periodic` and `# z: up`.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from cspr_jax.config.motions.heads import (
    ANGLES,
    GROUPS,
    KIND_OF,
    KINDS,
    LENGTHS,
    NAMES,
    NO_UNIT,
    TIMES,
    WRITTEN,
    Head,
    kind_of_unit,
    resolved,
    unit_of,
)
from cspr_jax.config.motions.table import POINTS, Z_AXES
from cspr_jax.config.wording import either
from cspr_jax.errors import ConfigError, shown
from cspr_jax.errors.suggestions import did_you_mean, nearest
from cspr_jax.numerics.shapes import Float
from cspr_jax.schema.quantities import TRAJECTORY

# Columns that this program writes in addition to the motion.
_BESIDE = re.compile(rf"(?:{'|'.join(sorted(TRAJECTORY.keys() - WRITTEN.keys() - {'t'}))})(?:_\w+)?|feasible")
# Order of the columns of tables without a header, by their number.
PLAIN = {
    3: ("t", "x", "z"),
    4: ("t", "x", "y", "z"),
    8: ("t", "x", "y", "z", "qw", "qx", "qy", "qz"),
}
# Tables of paths have no times.
PLAIN_PATH = {len(names) - 1: names[1:] for names in PLAIN.values() if "y" in names}
_VALUES = {
    "point": POINTS,
    "interpolation": ("cubic", "quintic", "hermite"),
    "ends": ("rest", "natural", "periodic"),
    "z": Z_AXES,
}
DIRECTIVES = (*_VALUES, "units")
MAX_LISTED = 24  # largest number of columns that a message lists
MAX_SUGGESTIONS = 5  # largest number of columns that are not read and still get a line of their own


def plain_names(count: int, has_times: bool) -> tuple[str, ...]:
    """Names of the columns of a table that has no header."""
    return (PLAIN if has_times else PLAIN_PATH).get(count, ())


@dataclasses.dataclass(frozen=True)
class MotionColumns:
    """Columns of a table.

    Fields:
        names: one of `NAMES` for each column; empty for a column that is not read.
        heads: heads of all columns, as the file has them.
        factors: (columns,) from the units of the file to SI.
        is_written: whether this program wrote the table; then two rows have the same time where legs meet.
        notes: lines for the user.
        is_named: whether the file names its columns.
        has_time_unit: whether the file says the unit of its times.
    """

    names: tuple[str, ...]
    heads: tuple[str, ...]
    factors: np.ndarray
    is_written: bool
    notes: tuple[str, ...] = ()
    is_named: bool = True
    has_time_unit: bool = False

    @property
    def written_point(self) -> str | None:
        """Point whose positions a table of this program has: the origin if columns of the mass centre follow."""
        return None if not self.is_written else "origin" if "mass_centre_x" in self.heads else "mass-centre"

    def has(self, group: str) -> bool:
        """Tell whether the table has columns of a group of `GROUPS`."""
        return any(name in self.names for name in GROUPS[group][0])

    def values(self, group: str, rows: Float[np.ndarray, "n columns"]) -> np.ndarray | None:
        """Values of a group of columns, in SI units."""
        if not self.has(group):
            return None
        values = np.zeros((len(rows), len(GROUPS[group][0])))
        for i, name in enumerate(GROUPS[group][0]):
            if name in self.names:
                k = self.names.index(name)
                values[:, i] = rows[:, k] * self.factors[k]
        return values


def directives(comments: list[tuple[int, str]], path: Path) -> dict[str, str]:
    """Directives among the comments of a file."""
    values: dict[str, str] = {}
    for line, text in comments:
        name, separator, value = (part.strip().lower() for part in text.partition(":"))
        name = {"z_axis": "z", "unit": "units"}.get(name, name)
        if not separator or name not in DIRECTIVES:
            continue
        if name != "units" and value not in _VALUES[name]:
            allowed = either(_VALUES[name])
            question = did_you_mean(value, _VALUES[name])
            raise ConfigError(path, f"line {line}: {name} = {shown(value)}: {question}must be {allowed}")
        values[name] = value
    return values


def columns(
    heads: list[str] | None,
    count: int,
    units: str,
    path: Path,
    line: int,
    *,
    has_times: bool = True,
    own_units: dict[int, str] | None = None,
    notes: Iterable[str] = (),
) -> MotionColumns:
    """Find out which columns a table has, from its heads, units and directives."""
    common, plain = _common(units, path), PLAIN if has_times else PLAIN_PATH
    if heads is None and count not in plain:
        counts, words = ", ".join(map(str, plain)), "t, x, y, z, ..." if has_times else "x, y, z, ..."
        raise ConfigError(
            path, f"line {line}: {count} columns without a header: must be {counts}, or name them: {words}"
        )
    parts, placed = ([Head(name, "") for name in plain[count]], {}) if heads is None else identified(heads, has_times)
    texts = list(plain[count]) if heads is None else heads
    names, factors = list[str](), list[float]()
    for column, (name, unit) in enumerate(parts):
        location, other = f"line {line}, column {column + 1}", (own_units or {}).get(column, "")
        if name and name in names:
            raise ConfigError(path, f"{location}: {shown(texts[column])} stands twice: must stand once")
        if name and not {unit, other}.intersection(NO_UNIT) and unit_of(unit) != unit_of(other):
            raise ConfigError(path, f"{location}: units {shown(unit)} and {shown(other)}: must be one")
        names.append(name)
        factors.append(_factor(name, other if unit in NO_UNIT else unit, common, location, path) if name else 1.0)
    is_written = "position_x" in texts and "velocity_x" in texts
    lines = [*notes, *_unread(texts, names)]
    if placed:
        words = ", ".join(f"{shown(texts[k])} as {name}" for k, name in placed.items())
        lines.insert(0, f"columns taken by unit and position: {words}")
    if heads is None:
        lines.insert(0, f"no line names its columns: taken as {_described(parts, own_units or {}, common)}")
    stamps = [k for k, name in enumerate(names) if name == "t"]
    has_time_unit = any(unit_of(word) in TIMES for word in re.split(r"[,;\s]+", units))
    has_time_unit |= any({parts[k].unit, (own_units or {}).get(k, "")}.difference(NO_UNIT) for k in stamps)
    result = MotionColumns(
        tuple(names), tuple(texts), np.array(factors), is_written, tuple(lines), heads is not None, has_time_unit
    )
    _check(result, path, line, has_times)
    return result


def identified(heads: list[str], has_times: bool) -> tuple[list[Head], dict[int, str]]:
    """Names and units of heads; and, by column, the names that are inferred from units or from the order of columns.

    A column that alone has a unit of time holds the times. If all columns have units, they may be in the order of
    `PLAIN`.
    """
    parts, plain = resolved(heads), plain_names(len(heads), has_times)
    names, placed = [part.name for part in parts], dict[int, str]()
    timed = [k for k, part in enumerate(parts) if not part.name and kind_of_unit(part.unit) == "time"]
    if has_times and "t" not in names and len(timed) == 1:
        names[timed[0]] = placed[timed[0]] = "t"
    free = {k: name for k, name in enumerate(plain) if not names[k]}
    # A number in a name may be that of a cable.
    fits = [
        kind_of_unit(parts[k].unit) == KIND_OF[name] and not re.search(r"\d", heads[k].split("[")[0].split("(")[0])
        for k, name in free.items()
    ]
    if all(fits) and all(k in free or names[k] == name for k, name in enumerate(plain)):
        placed |= free
    return [part._replace(name=placed.get(k, part.name)) for k, part in enumerate(parts)], placed


def _unread(heads: list[str], names: list[str]) -> list[str]:
    # Notes about columns that are not read, with suggestions for the first few.
    unread = [
        head for head, name in zip(heads, names, strict=True) if not name and head and not _BESIDE.fullmatch(head)
    ]
    lines = []
    for k, head in enumerate(unread[:MAX_SUGGESTIONS]):
        near = nearest(head.partition("[")[0].strip().lower(), [other for other in NAMES if other not in names])
        question = f"did you mean {near}? " if near else ""
        names_read = f"known: {', '.join(NAMES)}" if not k else "known: as above"
        lines.append(f"column {shown(head)} is not read: {question}{names_read}")
    more = len(unread) - MAX_SUGGESTIONS
    return lines + ([f"{more} more column{'s are' if more > 1 else ' is'} not read"] if more > 0 else [])


def _described(parts: list[Head], own_units: dict[int, str], common: dict[int, str]) -> str:
    # Names and units for the note that says how columns without names are read.
    words = []
    for k, (name, _) in enumerate(parts):
        unit = unit_of(own_units.get(k, "")) or common.get(id(KINDS[KIND_OF[name]][0]), "")
        words.append(f"{name} [{unit}]" if unit else name)
    return ", ".join(words) + (" (scalar first)" if "qw" in words else "")


def _common(units: str, path: Path) -> dict[int, str]:
    # Units of times, lengths and angles that hold for the whole file, by the `id` of the tables of such units.
    common = {id(TIMES): "s", id(LENGTHS): "m", id(ANGLES): "rad"}
    said: set[int] = set()
    for word in map(unit_of, filter(None, re.split(r"[,;\s]+", units))):
        table = next((table for table in (LENGTHS, ANGLES, TIMES) if word in table), None)
        if table is None:
            raise ConfigError(path, f"units = {shown(word)}: must be {either((*LENGTHS, *ANGLES, *TIMES))}")
        if id(table) in said and common[id(table)] != word:
            raise ConfigError(path, f"units = {shown(word)}: must be one of a kind, not {common[id(table)]} too")
        common[id(table)] = word
        said.add(id(table))
    return common


def _factor(name: str, unit: str, common: dict[int, str], label: str, path: Path) -> float:
    table, power = KINDS[KIND_OF[name]]
    if id(table) not in common:
        return 1.0
    if unit in NO_UNIT:
        return table[common[id(table)]] / TIMES[common[id(TIMES)]] ** power
    above, _, below = unit_of(unit).replace(" ", "").partition("/")
    below = below.replace("^", "").removesuffix(str(power)) if power > 1 else below
    if above not in table or bool(below) != bool(power) or (below and below not in TIMES):
        ending = {0: "", 1: "/s", 2: "/s^2"}[power]
        allowed = either([f"{each}{ending}" for each in table])
        raise ConfigError(path, f"{label}: unit of {name} = {shown(unit)}: must be {allowed}")
    return table[above] / (TIMES[below] ** power if power else 1.0)


def _check(result: MotionColumns, path: Path, line: int, has_times: bool) -> None:
    label = f"line {line}"
    for group, (names, _) in GROUPS.items():
        missing = [name for name in names if name not in result.names]
        if group == "positions" or (group == "times" and has_times) or len(missing) < len(names):
            # Planar robots move in the plane of x and z, and turn by their pitch.
            is_planar = "y" not in result.names and group not in ("tilts", "quaternions")
            spared = (
                (set(names) - {"pitch"} if group == "rotations" else {names[1]})
                if is_planar and len(names) > 1
                else set()
            )
            needed = [name for name in missing if name not in spared]
            if needed:
                unread = [head for head, name in zip(result.heads, result.names, strict=True) if not name and head]
                question = did_you_mean(needed[0], unread)
                plain = plain_names(len(result.heads), has_times)
                called = f", which would have to be called {', '.join(plain)}" if plain and unread else ""
                raise ConfigError(
                    path,
                    f"{label}: no column {needed[0]}: {question}must have {', '.join(names)}, found "
                    f"{_listed(result.heads)}{called}",
                )
    kinds = [group for group in ("quaternions", "rotations", "tilts") if result.has(group)]
    if len(kinds) > 1:
        first, second = (GROUPS[group][0][0] for group in kinds[:2])
        raise ConfigError(path, f"{label}: columns {first} and {second}: must be one orientation, not two")
    if result.has("accelerations") and not result.has("velocities"):
        raise ConfigError(path, f"{label}: column ax without vx: accelerations need velocities beside them")
    if not kinds and (result.has("angular_velocities") or result.has("angular_accelerations")):
        raise ConfigError(path, f"{label}: columns of angular rates: must be beside an orientation, such as qw to qz")


def _listed(heads: tuple[str, ...]) -> str:
    # List the columns that were found, as many as fit into a line.
    words = ", ".join(shown(head) for head in heads[:MAX_LISTED])
    return words + (f" and {len(heads) - MAX_LISTED} more" if len(heads) > MAX_LISTED else "")
