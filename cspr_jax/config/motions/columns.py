"""Columns of a table of a motion: their names, units and directives, and what follows for its samples.

A unit stands in brackets or parentheses behind a name, `x [mm]`, or in a line `# units: mm, deg, ms`. Further
lines of this kind are `# interpolation: quintic`, `# ends: periodic` and `# z: up`.
"""

import dataclasses
import re
from pathlib import Path

import numpy as np

from cspr_jax.config.motions.table import POINTS, Z_AXES
from cspr_jax.config.suggestions import did_you_mean, nearest
from cspr_jax.config.wording import either
from cspr_jax.errors import ConfigError, shown
from cspr_jax.schema.quantities import TRAJECTORY, columns_of

LENGTHS = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "km": 1000.0}
TIMES = {"s": 1.0, "ms": 0.001, "us": 1e-6, "min": 60.0}
ANGLES = {"rad": 1.0, "deg": np.pi / 180.0, "°": np.pi / 180.0, "mrad": 0.001}
# Kinds of columns: their units of length or angle, and by which power of time these are divided.
_KINDS = {
    "time": (TIMES, 0),
    "length": (LENGTHS, 0),
    "angle": (ANGLES, 0),
    "number": ({"1": 1.0}, 0),
    "speed": (LENGTHS, 1),
    "acceleration": (LENGTHS, 2),
    "turning": (ANGLES, 1),
    "turning change": (ANGLES, 2),
}
# Groups of columns; `MotionTable` has a field for each, but for the two that become quaternions.
GROUPS = {
    "times": (("t",), "time"),
    "positions": (("x", "y", "z"), "length"),
    "quaternions": (("qw", "qx", "qy", "qz"), "number"),
    "rotations": (("roll", "pitch", "yaw"), "angle"),
    "tilts": (("tilt_phi", "tilt_theta", "tilt_sigma"), "angle"),
    "velocities": (("vx", "vy", "vz"), "speed"),
    "accelerations": (("ax", "ay", "az"), "acceleration"),
    "angular_velocities": (("wx", "wy", "wz"), "turning"),
    "angular_accelerations": (("wdx", "wdy", "wdz"), "turning change"),
}
NAMES = tuple(name for names, _ in GROUPS.values() for name in names)
_KIND_OF = {name: kind for names, kind in GROUPS.values() for name in names}
# The names of this program's own tables.
_WRITTEN = {
    "position": "positions",
    "quaternion": "quaternions",
    "velocity": "velocities",
    "acceleration": "accelerations",
    "omega": "angular_velocities",
    "omega_dot": "angular_accelerations",
}
_SYNONYMS = {"time": "t"} | {
    head: name
    for written, group in _WRITTEN.items()
    for head, name in zip(columns_of(written, len(GROUPS[group][0])), GROUPS[group][0], strict=True)
}
# Columns that this program writes beside the motion.
_BESIDE = re.compile(rf"(?:{'|'.join(sorted(TRAJECTORY.keys() - _WRITTEN.keys() - {'t'}))})(?:_\w+)?|feasible")
_HEAD = re.compile(r"^(.*?)\s*(?:\[(.*)\]|\((.*)\))?$", re.DOTALL)
# Without a header, columns stand in the order of these.
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


@dataclasses.dataclass(frozen=True)
class MotionColumns:
    """Columns of a table.

    Fields:
        names: of all columns, those of `NAMES`; empty: not read.
        heads: of all columns, as the file has them.
        factors: (columns,) from the units of the file to SI.
        is_written: whether this program wrote the table, in which legs meet in two rows of one time.
        notes: lines for the user.
    """

    names: tuple[str, ...]
    heads: tuple[str, ...]
    factors: np.ndarray
    is_written: bool
    notes: tuple[str, ...] = ()

    def has(self, group: str) -> bool:
        """Tell whether the table has columns of a group of `GROUPS`.

        Returns:
            True if it has one.
        """
        return any(name in self.names for name in GROUPS[group][0])

    def values(self, group: str, rows: np.ndarray) -> np.ndarray | None:
        """Values of a group of columns.

        Args:
            rows: (n, columns) in the units of the file.

        Returns:
            (n, size of the group) in SI; zeros for y of planar robots; None: the table has none.
        """
        if not self.has(group):
            return None
        values = np.zeros((len(rows), len(GROUPS[group][0])))
        for i, name in enumerate(GROUPS[group][0]):
            if name in self.names:
                k = self.names.index(name)
                values[:, i] = rows[:, k] * self.factors[k]
        return values


def directives(comments: list[tuple[int, str]], path: Path) -> dict[str, str]:
    """Directives among the comments of a file.

    Args:
        comments: line numbers and texts, without the mark.
        path: named in errors.

    Returns:
        values by the names of `DIRECTIVES`.

    Raises:
        ConfigError: a value that a directive cannot have.
    """
    values: dict[str, str] = {}
    for line, text in comments:
        name, mark, value = (part.strip().lower() for part in text.partition(":"))
        name = "z" if name == "z_axis" else name
        if not mark or name not in DIRECTIVES:
            continue
        if name != "units" and value not in _VALUES[name]:
            allowed = either(_VALUES[name])
            question = did_you_mean(value, _VALUES[name])
            raise ConfigError(path, f"line {line}: {name} = {shown(value)}: {question}must be {allowed}")
        values[name] = value
    return values


def columns(
    heads: list[str] | None, count: int, units: str, path: Path, line: int, *, has_times: bool = True
) -> MotionColumns:
    """Columns of a table.

    Args:
        heads: names in its header line; None: it has none.
        count: of values in a row.
        units: that its directive names, such as "mm, deg, ms".
        path: named in errors.
        line: of the header, or of the first row.
        has_times: whether the table is that of a motion, and not of a path.

    Returns:
        the columns.

    Raises:
        ConfigError: missing columns, one that stands twice, units that are unknown, or a number of columns that says
            nothing without a header.
    """
    common = _common(units, path)
    if heads is None:
        plain = PLAIN if has_times else PLAIN_PATH
        if count not in plain:
            counts, words = ", ".join(map(str, plain)), "t, x, y, z, ..." if has_times else "x, y, z, ..."
            raise ConfigError(
                path, f"line {line}: {count} columns without a header: must be {counts}, or name them: {words}"
            )
        heads = list(plain[count])
    names, factors, notes = list[str](), list[float](), list[str]()
    for column, head in enumerate(heads):
        name, unit = _parted(head)
        known = name in _KIND_OF
        if known and name in names:
            raise ConfigError(path, f"line {line}, column {column + 1}: {shown(head)} stands twice: must stand once")
        names.append(name if known else "")
        factors.append(_factor(name, unit, common, f"line {line}, column {column + 1}", path) if known else 1.0)
        if not known and head and not _BESIDE.fullmatch(head):
            near = nearest(name, [other for other in NAMES if other not in names])
            question = f"did you mean {near}? " if near else ""
            notes.append(f"column {shown(head)} is not read: {question}known: {', '.join(NAMES)}")
    is_written = "position_x" in heads and "velocity_x" in heads
    result = MotionColumns(tuple(names), tuple(heads), np.array(factors), is_written, tuple(notes))
    _check(result, path, line, has_times)
    return result


def _parted(head: str) -> tuple[str, str]:
    parts = _HEAD.match(head.strip().strip("\"'").strip())
    if parts is None:
        return head, ""
    name = parts[1].strip().lower()
    unit = (parts[2] or parts[3] or "").strip().lower()
    for ending in (*TIMES, *LENGTHS, *ANGLES):
        stem = name.removesuffix(f"_{ending}")
        if stem != name and not unit and _SYNONYMS.get(stem, stem) in _KIND_OF:
            name, unit = stem, ending
    return _SYNONYMS.get(name, name), unit


def _common(units: str, path: Path) -> dict[int, str]:
    # Units of the directive, by the table that each is of.
    common = {id(TIMES): "s", id(LENGTHS): "m", id(ANGLES): "rad"}
    said: set[int] = set()
    for word in filter(None, re.split(r"[,;\s]+", units)):
        table = next((table for table in (LENGTHS, ANGLES, TIMES) if word in table), None)
        if table is None:
            raise ConfigError(path, f"units = {shown(word)}: must be {either((*LENGTHS, *ANGLES, *TIMES))}")
        if id(table) in said and common[id(table)] != word:
            raise ConfigError(path, f"units = {shown(word)}: must be one of a kind, not {common[id(table)]} too")
        common[id(table)] = word
        said.add(id(table))
    return common


def _factor(name: str, unit: str, common: dict[int, str], place: str, path: Path) -> float:
    table, power = _KINDS[_KIND_OF[name]]
    if id(table) not in common:
        return 1.0
    if not unit:
        return table[common[id(table)]] / TIMES[common[id(TIMES)]] ** power
    above, _, below = unit.replace("²", "^2").replace(" ", "").partition("/")
    below = below.replace("^", "").removesuffix(str(power)) if power > 1 else below
    if above not in table or bool(below) != bool(power) or (below and below not in TIMES):
        ending = {0: "", 1: "/s", 2: "/s^2"}[power]
        allowed = either([f"{each}{ending}" for each in table])
        raise ConfigError(path, f"{place}: unit of {name} = {shown(unit)}: must be {allowed}")
    return table[above] / (TIMES[below] ** power if power else 1.0)


def _check(result: MotionColumns, path: Path, line: int, has_times: bool) -> None:
    place = f"line {line}"
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
                raise ConfigError(
                    path,
                    f"{place}: no column {needed[0]}: {question}must have {', '.join(names)}, found "
                    f"{shown(', '.join(result.heads))}",
                )
    kinds = [group for group in ("quaternions", "rotations", "tilts") if result.has(group)]
    if len(kinds) > 1:
        first, second = (GROUPS[group][0][0] for group in kinds[:2])
        raise ConfigError(path, f"{place}: columns {first} and {second}: must be one orientation, not two")
    if result.has("accelerations") and not result.has("velocities"):
        raise ConfigError(path, f"{place}: column ax without vx: accelerations need velocities beside them")
    if not kinds and (result.has("angular_velocities") or result.has("angular_accelerations")):
        raise ConfigError(path, f"{place}: columns of angular rates: must be beside an orientation, such as qw to qz")
