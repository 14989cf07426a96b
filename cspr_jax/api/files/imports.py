"""Robots of other programs from Python: reading them, and writing them as robot files."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from cspr_jax.api.arguments.checks import checked
from cspr_jax.build.robots import build_robot
from cspr_jax.config.formats.table import ENDINGS, Imported, format_of
from cspr_jax.config.formats.writing import robot_text
from cspr_jax.config.hints import robot_hints
from cspr_jax.config.keys.trajectory import TrajectoryKeys
from cspr_jax.config.reading import other_case
from cspr_jax.config.robot import RobotFile, read_foreign
from cspr_jax.errors import ConfigError
from cspr_jax.errors.suggestions import with_suggestions
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.point_mass import PointMassRobot
from cspr_jax.store.files.disk import Disk
from cspr_jax.store.files.publishing import publish


@with_suggestions
@dataclasses.dataclass(frozen=True)
class ImportedRobot:
    """Robot that was read from a file of another program.

    Fields:
        robot: the robot, in the form for all functions.
        keys: keys of its robot file, as plain values.
        warnings: items that were omitted, and probable mistakes, one line each.
    """

    robot: PointMassRobot | PlatformRobot
    keys: dict[str, Any]
    warnings: tuple[str, ...]
    _imported: Imported

    def to_toml(self) -> str:
        """The robot as the text of a robot file.

        Returns:
            TOML.
        """
        return robot_text(self.keys, self._imported.cable_names)

    @checked()
    def save(self, path: str | Path) -> Path:
        """Write the robot file.

        Args:
            path: file to write, .toml; an existing file is replaced.

        Returns:
            the path.

        Raises:
            ConfigError: the path does not end in .toml.
            StoreError: the file cannot be written.
        """
        target = Path(path)
        if target.suffix != ".toml":
            raise ConfigError("-o", f"{target}: must end in .toml")
        publish(Disk(), target, self.to_toml().encode("utf-8"))
        return target


@checked()
def import_robot(path: str | Path, cable_set: str | None = None) -> ImportedRobot:
    """Read a robot of CASPR (NAME_cables.xml beside NAME_bodies.xml), cdpyr (.json, .yaml) or WireX (.wcrfx).

    Args:
        path: the file, for CASPR either of the two, at most 1 MB.
        cable_set: name of a set of cables of CASPR; None: the file's default.

    Returns:
        the robot, z up.

    Raises:
        ConfigError: there is no such file or set, a file has a mistake, or no robot file can express it (several
            links).
    """
    file = Path(path)
    if format_of(file.name) is None:
        raise ConfigError(file, f"must end in {', '.join(ENDINGS)}")
    if not file.is_file():
        raise ConfigError(file, f"no such file{other_case(file)}")
    robot_file, imported = read_foreign(file, cable_set)
    return ImportedRobot(_built(robot_file, file), imported.spec, tuple(robot_hints(robot_file)), imported)


def _built(robot_file: RobotFile, file: Path) -> PointMassRobot | PlatformRobot:
    return build_robot(robot_file, TrajectoryKeys(), file)
