"""Table of formats of other programs. A new format is a file in this folder and a row of this table."""

import dataclasses
import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from cspr_jax.config.formats.model import Body, robot_spec
from cspr_jax.errors import ConfigError, shown


@dataclasses.dataclass(frozen=True)
class Format:
    """Format of robot files of another program.

    Fields:
        name: name of the program.
        endings: how names of its files end.
        description: for people.
        reader: "module:function", called with the path and, if `has_sets`, with the name of a set of cables or None.
        has_sets: whether a file may hold several sets of cables.
    """

    name: str
    endings: tuple[str, ...]
    description: str
    reader: str
    has_sets: bool = False

    def load(self) -> Callable[..., Body]:
        """The function that reads a file, imported now."""
        module, _, name = self.reader.partition(":")
        return getattr(importlib.import_module(module), name)


_PACKAGE = "cspr_jax.config.formats."
FORMATS = (
    Format(
        "CASPR", (".xml",), "NAME_bodies.xml and NAME_cables.xml, side by side", _PACKAGE + "caspr:read", has_sets=True
    ),
    Format("cdpyr", (".json",), "a robot as JSON", _PACKAGE + "cdpyr:read_json"),
    Format("cdpyr", (".yaml", ".yml"), "a robot as YAML", _PACKAGE + "cdpyr:read_yaml"),
    Format("WireX", (".wcrfx",), "a robot of version 0.31 or 0.32", _PACKAGE + "wirex:read"),
)
ENDINGS = tuple(ending for row in FORMATS for ending in row.endings)


@dataclasses.dataclass(frozen=True)
class Imported:
    """Robot that was read from a file of another program.

    Fields:
        spec: content of the robot file that it becomes.
        cable_names: names of the cables in the file of the other program.
        warnings: items that were left out, one line each.
    """

    spec: dict[str, Any]
    cable_names: tuple[str, ...]
    warnings: tuple[str, ...]


def format_of(name: str) -> Format | None:
    """The format of a file, by the ending of its name."""
    return next((row for row in FORMATS if name.lower().endswith(row.endings)), None)


def parted(reference: str) -> tuple[str, str | None]:
    """File and set of cables that a reference such as "robot_cables.xml#set" names."""
    name, separator, cable_set = reference.partition("#")
    return (name, cable_set) if separator and format_of(name) else (reference, None)


def read(path: Path, cable_set: str | None = None) -> Imported:
    """A robot of another program."""
    row = format_of(path.name)
    if row is None:
        raise KeyError(path.name)
    if row.has_sets:
        body = row.load()(path, cable_set)
    elif cable_set is None:
        body = row.load()(path)
    else:
        owners = " and ".join(dict.fromkeys(other.name for other in FORMATS if other.has_sets))
        raise ConfigError(path, f"--set = {shown(cable_set)}: must be absent: only models of {owners} have cable sets")
    spec = robot_spec(body)
    return Imported(spec, tuple(cable.name for cable in body.cables), tuple(body.warnings))
