"""Heads of the columns of a table: their names and units, in the forms in which people and programs write them.

A unit follows the name in brackets or parentheses, `x [mm]`, or after a slash, an underscore, a dot, a space or "in",
`x/mm`, `t_ms` and `x in mm`.
"""

import re
from typing import NamedTuple

import numpy as np

from cspr_jax.schema.quantities import columns_of

LENGTHS = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "um": 1e-6, "km": 1000.0}
TIMES = {"s": 1.0, "ms": 0.001, "us": 1e-6, "ns": 1e-9, "min": 60.0}
ANGLES = {"rad": 1.0, "deg": np.pi / 180.0, "°": np.pi / 180.0, "mrad": 0.001}
# Kinds of columns: their units, and the power of a unit of time that divides these.
KINDS = {
    "time": (TIMES, 0),
    "length": (LENGTHS, 0),
    "angle": (ANGLES, 0),
    "number": ({"1": 1.0}, 0),
    "speed": (LENGTHS, 1),
    "acceleration": (LENGTHS, 2),
    "turning": (ANGLES, 1),
    "turning change": (ANGLES, 2),
}
# Groups of columns; `MotionTable` has a field for each, except the two that become quaternions.
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
KIND_OF = {name: kind for names, kind in GROUPS.values() for name in names}
# The names of this program's own tables.
WRITTEN = {
    "position": "positions",
    "quaternion": "quaternions",
    "velocity": "velocities",
    "acceleration": "accelerations",
    "omega": "angular_velocities",
    "omega_dot": "angular_accelerations",
}
_SYNONYMS = {"time": "t"} | {
    head: name
    for written, group in WRITTEN.items()
    for head, name in zip(columns_of(written, len(GROUPS[group][0])), GROUPS[group][0], strict=True)
}
_UNIT_WORDS = {
    word: unit
    for unit, words in {
        "s": "sec secs second seconds sek sekunden",
        "ms": "msec msecs millisecond milliseconds millisekunden",
        "us": "µs μs usec usecs microsecond microseconds",
        "ns": "nsec nsecs nanosecond nanoseconds",
        "min": "minute minutes",
        "m": "meter meters metre metres",
        "cm": "centimeter centimeters centimetre centimetres",
        "mm": "millimeter millimeters millimetre millimetres",
        "um": "µm μm micrometer micrometers micrometre micrometres",
        "rad": "radian radians",
        "deg": "degree degrees",
    }.items()
    for word in words.split()
}
NO_UNIT = ("", "-", "1")
_HEAD = re.compile(r"^([^\[\]()]*?)\s*(?:\[([^\[\]]*)\]|\((.*)\))?$", re.DOTALL)
_BEHIND = re.compile(r"^(.+?)(?:\s*/\s*|\s+in\s+|\s+|[_.])([a-zµμ°]+)$")
LONGEST_HEAD = 200  # letters
# Words in the names that other programs use; a group is read only if all of its columns are found, or x and z alone.
_TIME_WORDS = {"timestamp", "stamp", "time", "zeit", "temps", "tiempo", "tempo", "elapsed"}
_POSITION_WORDS = {"p", "pos", "position", "translation", "coordinate", "coord", "koordinate", "location"}
_QUATERNION_WORDS = {"q", "quat", "quaternion", "orientation"}
_JOINED = re.compile(r"(?:t|p|pos)([xyz])|([xyz])(?:pos|position)")
_JOINED_QUATERNION = re.compile(r"(?:q|quat)([wxyz])")


class Head(NamedTuple):
    """Name of a column, one of `NAMES` or empty, and its unit as written, or empty."""

    name: str
    unit: str


def unit_of(word: str) -> str:
    """A unit as `KINDS` spells it."""
    word = word.strip().strip("[]()").strip().lower().replace("²", "^2").replace("**", "^")
    above, _, below = word.partition("/")
    if not below:
        parts = re.fullmatch(r"(\S+?)(?:\s+|[*·.])([a-zµμ]+)\s*\^?[-−⁻]([12¹²])", word)
        if parts is not None:
            above, below = parts[1], parts[2] + ("^2" if parts[3] in "2²" else "")
    above, below = above.strip(), below.strip().strip("()")
    head, caret, power = below.partition("^")
    below = _UNIT_WORDS.get(head, head) + caret + power
    return _UNIT_WORDS.get(above, above) + (f"/{below}" if below else "")


def kind_of_unit(unit: str) -> str | None:
    """Kind of a plain unit."""
    unit = unit_of(unit)
    return next((kind for kind in ("time", "length", "angle") if unit in KINDS[kind][0]), None)


def is_unit(word: str) -> bool:
    """Tell whether a word is a unit that a column can have, units of rates included."""
    above, slash, below = unit_of(word).partition("/")
    return kind_of_unit(above) is not None and (not slash or below.rstrip("2").rstrip("^") in TIMES)


def resolved(heads: list[str]) -> list[Head]:
    """Names and units of heads: exact names first, then names of other programs for groups without exact ones."""
    parts = [parted(head) for head in heads]
    names = [_exact(stem) for stem, _ in parts]
    for group, letters in (
        ("times", [_time(stem) for stem, _ in parts]),
        ("positions", [_lettered(stem, _POSITION_WORDS, _JOINED, "xyz", "") for stem, _ in parts]),
        ("quaternions", [_lettered(stem, _QUATERNION_WORDS, _JOINED_QUATERNION, "wxyz", "q") for stem, _ in parts]),
    ):
        columns = GROUPS[group][0]
        matches = [word if not name else "" for word, name in zip(letters, names, strict=True)]
        is_whole = sorted(filter(None, matches)) in (sorted(columns), ["x", "z"])
        if is_whole and not any(name in columns for name in names):
            names = [name or word for word, name in zip(matches, names, strict=True)]
    return [Head(name, unit) for name, (_, unit) in zip(names, parts, strict=True)]


def mentioned(text: str) -> list[str]:
    """Names of columns among the words of a comment."""
    words = (word.strip("._") for word in re.findall(r"[^\W\d][\w.]*", text.lower()))
    names = (_exact(word) or _time(word) or _lettered(word, set(), _JOINED, "xyz", "") for word in words)
    return [name for name in names if name]


def units_within(text: str) -> list[str]:
    """Units among the words of a comment, except default ones, and "min" and "us", which are words too."""
    words = re.findall(r"(?<![\w/])(?:[^\W\d_]+|°)(?![\w/])", text.lower())
    units = [unit_of(word) for word in words if word not in ("min", "us")]
    return [unit for unit in units if kind_of_unit(unit) and unit not in ("s", "m", "rad")]


def parted(head: str) -> tuple[str, str]:
    """Stem of a head, in small letters, and its unit as written, or empty."""
    plain = head.strip().strip("\"'").strip()
    parts = _HEAD.match(plain) if len(plain) <= LONGEST_HEAD else None
    if parts is None:
        return plain.lower(), ""
    stem, unit = parts[1].strip().lower(), (parts[2] or parts[3] or "").strip()
    stem = stem.rstrip("/").rstrip()
    behind = _BEHIND.match(stem)
    if behind is not None and not unit and not _exact(stem) and is_unit(behind[2]):
        return behind[1], behind[2]
    return stem, unit


def _exact(stem: str) -> str:
    name = _SYNONYMS.get(stem, stem)
    return name if name in KIND_OF else ""


def _words(stem: str) -> list[str]:
    return re.findall(r"[^\W\d_]+", stem)


def _time(stem: str) -> str:
    return "t" if _TIME_WORDS.intersection(_words(stem)) else ""


def _lettered(stem: str, group_words: set[str], joined: re.Pattern, letters: str, prefix: str) -> str:
    # The letter of an axis in a name such as tx, pos_x, pose.position.x, p_RS_R_x or X-Position.
    words = _words(stem)
    match = joined.fullmatch(words[0]) if len(words) == 1 else None
    if match is not None:
        return prefix + next(filter(None, match.groups()))
    for k in (-1, 0) if len(words) > 1 and group_words.intersection(words) else ():
        if words[k] in set(letters):
            return prefix + words[k]
    return ""
