"""Robot files and the catalogue."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, PrivateAttr, model_validator

from cspr_jax.config import catalogue
from cspr_jax.config.catalogue import catalogue_names as catalogue_names
from cspr_jax.config.formats.table import ENDINGS, Imported, format_of, parted, read
from cspr_jax.config.keys.limits import (
    LARGEST_LENGTH,
    MAX_CABLES,
    LimitKeys,
    MatrixRow,
    NotNegativePerCable,
    PerCable,
    PerCableDirection,
    Point,
    Positive,
)
from cspr_jax.config.keys.parameter import ParameterTable, ParameterTables
from cspr_jax.config.keys.winch import WinchTable
from cspr_jax.config.parameters import check_bounds, check_names, check_parameters, moved, of_numbers
from cspr_jax.config.reading import checked, other_case, read_toml, refuse_other_kinds
from cspr_jax.config.wording import table_error
from cspr_jax.errors import ConfigError, InputError, demand, shown
from cspr_jax.errors.suggestions import did_you_mean
from cspr_jax.robots.model.parallel_pairs import COUNT, ParallelPairs, parallel_pairs
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.schema.limits import LIMITS

SMALLEST_COUNTS = "least numbers of cables are " + ", ".join(
    f"{row.dof} ({row.description})" for row in PATTERNS.values()
)
BODIES = " or ".join(f'"{row.name}"' for row in PATTERNS.values() if row.is_body)
POINTS = " or ".join(f'"{row.name}"' for row in PATTERNS.values() if not row.is_body)
# Two spools count as level if their heights differ by less than this fraction of their distance; the same as in
# `robots.model.point_mass`.
LEVEL = 1e-9


class RobotFile(LimitKeys):
    """A robot of one effector: a point mass on cables, or a platform; other kinds of effectors need `pattern`."""

    name: str = Field(description="name of the robot, at most 200 characters", min_length=1, max_length=200)
    base_points: Annotated[list[Point], Field(max_length=MAX_CABLES)] = Field(
        description="points where the cables leave their spools, or enter their pulleys, [x, y, z] in cable order, m; "
        "as many as degrees of freedom, or more; with y = 0 if planar"
    )
    platform_points: Annotated[list[Point], Field(max_length=MAX_CABLES)] | None = Field(
        None, description="platform: points where the cables are attached, one per cable, platform axes, m"
    )
    inertia: Annotated[list[MatrixRow], Field(min_length=3, max_length=3)] | None = Field(
        None,
        description="platform: inertia tensor about the mass centre, platform axes, kg m^2, components up to 1e18",
    )
    centre_of_mass: Point | None = Field(
        None, description="platform: mass centre in platform axes, m (default [0, 0, 0])"
    )
    planar: bool = Field(False, description="true: a point mass, with everything in the plane y = 0")
    pattern: Literal["1T", "2T", "3T", "1R2T", "2R3T", "3R3T", "3R"] | None = Field(
        None,
        description="motions of the effector, R rotations and T translations (default by the other keys: "
        '"2T" if planar, "3T" of a point mass, "3R3T" of a platform): "1T" along a vertical guide; "1R2T" of a '
        'platform in the plane y = 0; "2R3T" of a rod, platform_points on one line; "3R" of a platform that turns '
        "about a fixed joint, the origin of its axes",
    )
    translation_only: bool | None = Field(
        None,
        description="rigid platform on six cables in three parallel pairs, each pair on one winch: true if it only "
        "translates; plans and sweeps then take the equivalent point mass on three cables",
    )
    mass: Positive = Field(description="mass of the effector, kg, at most 1e9")
    gravity: Positive | None = Field(None, description="gravity, m/s^2 (default 9.81)")
    z_axis: Literal["down", "up"] = Field("down", description='direction of the z axis, "down" or "up"')
    _file: Path | None = PrivateAttr(None)  # file that it was read from; None for a table of another file
    # The platform on six cables to which this point mass on three is equivalent, if it is.
    _platform: "RobotFile | None" = PrivateAttr(None)
    _full: "RobotFile | None" = PrivateAttr(None)  # the robot with all its cables, if this one lacks some
    _remaining: tuple[int, ...] = PrivateAttr(())  # its cables that this robot still has
    cable_diameter: Annotated[float, Field(ge=0, le=LARGEST_LENGTH)] | None = Field(
        None, description="diameter of the cables, for distances between bodies, m (default 0)"
    )
    pulley_radius: NotNegativePerCable | None = Field(
        None,
        description="radius of swivelling pulleys, one number, or one per cable, m; absent: cables leave from points",
    )
    pulley_axes: PerCableDirection | None = Field(
        None,
        description="axes about which pulleys swivel, in the direction in which the cables enter them: one vector "
        "[x, y, z], or one per cable (default: straight up)",
    )
    axial_stiffness: PerCable | None = Field(
        None,
        description="axial stiffness EA of the cables, the tension that would double a length, one number, or one per "
        "cable, N; absent: cables do not stretch",
    )
    axial_damping: Annotated[float, Field(ge=0, le=1e12)] | None = Field(
        None,
        description="damping of elastic cables, their tension over the rate of their strain, N s; only models and "
        "simulations for MuJoCo have it (default 0)",
    )
    winch: WinchTable | None = Field(None, description="winches of the cables")
    parameter: ParameterTables | None = Field(
        None, description="[[parameter]]: named numbers that move others, for designs, maps over robots, and --set"
    )
    _notes: tuple[str, ...] = PrivateAttr(())  # about items of a file of another program
    source: str = Field("", description='where the numbers come from; "placeholder..." marks invented ones')

    @property
    def notes(self) -> tuple[str, ...]:
        """Items of a file of another program that were left out, one line each."""
        return self._notes

    @property
    def file(self) -> Path | None:
        """The file that the robot was read from; None for a table in another file."""
        return self._file

    @property
    def is_platform(self) -> bool:
        """Tell whether the robot is a rigid platform."""
        return self.platform_points is not None

    @property
    def own_pattern(self) -> str:
        """Pattern of the effector's motions that follows from the keys."""
        return self.pattern or ("3R3T" if self.is_platform else "2T" if self.planar else "3T")

    @property
    def is_planar(self) -> bool:
        """Tell whether everything lies in the plane y = 0."""
        return PATTERNS[self.own_pattern].is_planar

    @property
    def dof(self) -> int:
        """Degrees of freedom of the effector."""
        return PATTERNS[self.own_pattern].dof

    @property
    def kind(self) -> str:
        """Kind of robot, for people."""
        if self._platform is not None:
            return "a platform that only translates"
        names = {"2T": "a planar robot", "3R3T": "a platform"}
        return names.get(self.own_pattern, PATTERNS[self.own_pattern].description)

    @model_validator(mode="after")
    def _kind(self) -> "RobotFile":
        if (self.platform_points is None) != (self.inertia is None):
            missing, other = ("inertia", "platform_points") if self.inertia is None else ("platform_points", "inertia")
            raise table_error(missing, None, f"a rigid platform has it beside {other}, a point mass has neither")
        if self.centre_of_mass is not None and not self.is_platform:
            raise table_error("centre_of_mass", self.centre_of_mass, "absent without platform_points and inertia")
        pattern, count = self.own_pattern, len(self.base_points)
        row = PATTERNS[pattern]
        if row.is_body != self.is_platform:
            raise table_error(
                "pattern", shown(pattern), f"{BODIES if self.is_platform else POINTS}, or absent: as the other keys say"
            )
        if self.planar and not row.is_planar:
            if self.is_platform:
                allowed = "false, or absent, for a rigid platform (platform_points, inertia)"
                raise table_error("planar", True, f'{allowed}; a planar one has pattern = "1R2T"')
            raise table_error("pattern", shown(pattern), '"2T", or absent: as the other keys say')
        if count < row.dof:
            allowed = f"at least {row.dof} ({row.description}), as the other keys say; {SMALLEST_COUNTS}"
            raise table_error("base_points", f"{count} points", allowed)
        if self.platform_points is not None and len(self.platform_points) != count:
            allowed = f"{count}, as many as base_points"
            raise table_error("platform_points", f"{len(self.platform_points)} points", allowed)
        if pattern == "2T" and count == row.dof:
            _check_level(self.base_points)
        return self

    @model_validator(mode="after")
    def _translates(self) -> "RobotFile":
        if self.translation_only and len(self.base_points) <= COUNT:  # of more cables some must be gone
            try:
                self.parallel_pairs()
            except InputError as error:
                raise table_error("translation_only", True, f"absent: {error.problem}") from error
        return self

    def parallel_pairs(self) -> ParallelPairs:
        """Pairs of parallel cables of a platform; see `robots.model.parallel_pairs`."""
        if self.platform_points is None:
            raise InputError("platform_points", None, "given", problem="it has no platform_points")
        if self.own_pattern != "3R3T":
            raise InputError("pattern", None, "3R3T", problem=f"it is {self.kind}")
        if self.pulley_radius is not None:
            raise InputError("pulley_radius", None, "absent", problem="its cables leave from pulleys")
        points = np.asarray(self.platform_points) - np.asarray(self.centre_of_mass or [0.0, 0.0, 0.0])
        pairs = parallel_pairs(self.base_points, points)
        if self.winch is not None and (name := self.winch.first_difference(pairs.cables.tolist())):
            problem = "cables of a pair are on one winch, but their numbers differ"
            raise InputError(f"winch.{name}", None, "equal for both", problem=problem)
        return pairs

    def limit(self, name: str) -> Any:
        """A limit of the robot, or of its winches; None: there is none."""
        return getattr(self, name, None if self.winch is None else self.winch.limits.get(name))

    @property
    def as_written(self) -> "RobotFile":
        """The robot of the file: the platform, if this is its equivalent point mass."""
        return self._platform or self

    @property
    def pairs(self) -> ParallelPairs | None:
        """Pairs that the cables of an equivalent stand for; its limits are still those of the six cables."""
        return None if self._platform is None else self._platform.parallel_pairs()

    @property
    def settings(self) -> dict[str, Any]:
        """Plain values on which motions depend: keys of the file, and translation_only of an equivalent."""
        of_file = self.full.model_dump(mode="json", exclude_none=True)
        return of_file if self._platform is None else of_file | {"translation_only": True}

    def as_remaining(self, full: "RobotFile", remaining: list[int]) -> "RobotFile":
        """This robot as what is left of another one that has lost cables."""
        robot_file = self.model_copy()
        robot_file._file, robot_file._notes = full._file, full._notes
        robot_file._full, robot_file._remaining = full, tuple(remaining)
        return robot_file

    def of_own_cables(self, limits: Mapping[str, Any]) -> dict[str, Any]:
        """Limits of the cables that are left, of limits that are given for all cables of the file."""
        if self._full is None:
            return dict(limits)
        count, of_cables = len(self._full.base_points), dict(limits)
        for row in LIMITS:
            value = limits.get(row.name)
            if isinstance(value, list) and row.per_cable:
                if len(value) != count:
                    raise InputError(row.name, value, f"{row.allowed}, or {count}: one a cable")
                of_cables[row.name] = [value[i] for i in self._remaining]
        return of_cables

    @property
    def full(self) -> "RobotFile":
        """The robot of the file, with all its cables."""
        return self._full or self.as_written

    @property
    def missing_cables(self) -> tuple[int, ...]:
        """Cables of the file that the robot has lost, from 0 on."""
        return () if self._full is None else tuple(sorted(set(range(len(self._full.base_points))) - {*self._remaining}))

    def equivalent(self) -> "RobotFile":
        """The point mass on three cables to which this platform on six cables in parallel pairs is equivalent."""
        pairs = self.parallel_pairs()
        others = ("inertia", "centre_of_mass", "pattern", "translation_only")
        changes: dict[str, Any] = dict.fromkeys(("platform_points", *others))
        if self.axial_stiffness is not None:  # parallel cables of one length: their stiffnesses add up
            each = np.broadcast_to(np.asarray(self.axial_stiffness, float), (len(self.base_points),))
            changes["axial_stiffness"] = each[pairs.cables].sum(1).tolist()
        if self.winch is not None:
            changes["winch"] = self.winch.of_cables(pairs.cables[:, 0].tolist())
        robot_file = self.model_copy(update={"base_points": pairs.exit_points.tolist(), **changes})
        robot_file._platform = self.model_copy(update={"translation_only": True})
        return robot_file

    @model_validator(mode="after")
    def _one_a_cable(self) -> "RobotFile":
        for row in LIMITS:
            value, count = getattr(self, row.name, None), len(self.base_points)
            if isinstance(value, list) and len(value) != count:
                raise table_error(row.name, value, f"{row.allowed}, or {count}: one a cable")
        radii, axes = self.pulley_radius, self.pulley_axes
        if isinstance(radii, list) and len(radii) != count:
            raise table_error("pulley_radius", radii, f"a number >= 0, or {count}: one a cable")
        if axes is not None and radii is None:
            raise table_error("pulley_axes", axes, "absent without pulley_radius")
        if axes is not None and isinstance(axes[0], list) and len(axes) != count:
            raise table_error("pulley_axes", f"{len(axes)} vectors", f"one vector, or {count}: one a cable")
        stiffness = self.axial_stiffness
        if isinstance(stiffness, list) and len(stiffness) != count:
            raise table_error("axial_stiffness", stiffness, f"a number > 0, or {count}: one a cable")
        if self.axial_damping is not None and stiffness is None:
            raise table_error("axial_damping", self.axial_damping, "absent without axial_stiffness")
        if self.winch is not None:
            self.winch.check_count(count)
            if self.winch.has_layers and not self.cable_diameter:
                raise table_error("cable_diameter", self.cable_diameter, "a number > 0 beside winch.layer_turns, m")
        return self

    @model_validator(mode="after")
    def _have_robots(self) -> "RobotFile":
        if self.parameter:
            spec = self.model_dump(exclude_none=True, exclude={"parameter"})
            check_parameters(self.parameter, spec)
            check_bounds(self.parameter, spec, RobotFile, "robot")
        return self

    def with_parameters(self, values: Mapping[str, float]) -> "RobotFile":
        """The robot at other values of its parameters; its numbers have moved, and these values are those of its file.

        Raises:
            InputError: no parameter has this name, a value is beyond its bounds, or there is no such robot.
        """
        spec = self.model_dump(exclude_none=True, exclude={"parameter"})
        there = moved(self.parameter or [], spec, values)
        if there is None:
            return self
        try:
            robot_file = of_numbers(RobotFile, there[0], "robot").model_copy(update={"parameter": there[1]})
        except ConfigError as error:
            raise InputError("parameters", dict(values), "values that give a robot", problem=str(error)) from error
        robot_file._file, robot_file._notes = self._file, self._notes
        return robot_file

    def placed(self, key: str, file: object) -> tuple[object, str]:
        """File and dotted name by which errors refer to a key of the robot."""
        return (file, f"robot.{key}") if self._file is None else (self._file, key)

    def typed(self, error: InputError) -> str:
        """Text of an error about this robot, with numbers as in the file instead of in the kernels' axes."""
        value = getattr(self, error.key, None)
        if error.problem or value is None:
            return f"robot.{error}"
        return f"robot.{error.key} = {shown(value)}: {demand(error.allowed)}"


def _check_level(points: list[Point]) -> None:
    (x1, _, z1), (x2, _, z2) = points
    if abs(z2 - z1) > LEVEL * abs(x2 - x1):
        heights = f"spools at heights z = {z1:g} and {z2:g}"
        raise table_error("base_points", heights, "level in a planar robot: give both spools the same z")


def resolve_robot(
    reference: Any,
    file: object,
    directory: Path,
    parameters: Mapping[str, float] | None = None,
    of_file: Sequence[ParameterTable] | None = None,
) -> RobotFile:
    """The robot that a plan or sweep with parameters of its own names, at its values of the robot's parameters."""
    robot_file = _named_robot(reference, file, directory)
    try:
        check_names(of_file or [], robot_file.parameter or [], parameters or {})
        return robot_file.with_parameters(parameters or {})
    except InputError as error:
        raise ConfigError(file, str(error)) from error


def _named_robot(reference: Any, file: object, directory: Path) -> RobotFile:
    if isinstance(reference, dict):
        return checked(RobotFile, reference, file, at="robot")
    if not isinstance(reference, str):
        raise ConfigError(file, f"robot = {shown(reference)}: must be a catalogue name, a path, or a [robot] table")
    name, cable_set = parted(reference)
    if format_of(name) is not None:
        path = directory / name
        if not path.is_file():
            raise _missing(reference, file, path)
        return read_foreign(path, cable_set)[0]
    if reference.endswith(".toml") or "/" in reference:
        path = directory / reference
        if not path.is_file():
            raise _missing(reference, file, path)
        return read_robot(path)
    if reference in catalogue_names():
        return read_robot(catalogue.CATALOGUE / f"{reference}.toml")
    hint = did_you_mean(reference, catalogue_names())
    names = ", ".join(catalogue_names())
    raise ConfigError(
        file,
        f"robot = {shown(reference)}: {hint}must be one of {names}, or a path to a .toml file, or one of another "
        f"program ({', '.join(ENDINGS)})",
    )


def _missing(reference: str, file: object, path: Path) -> ConfigError:
    words = f"no such file{other_case(path)}: must be a catalogue name, or a path"
    return ConfigError(file, f"robot = {shown(reference)}: {words}")


def read_foreign(path: Path, cable_set: str | None = None) -> tuple[RobotFile, Imported]:
    """Read a robot file of another program; see `config.formats`."""
    imported = read(path, cable_set)
    robot_file = checked(RobotFile, imported.spec, path)
    robot_file._file, robot_file._notes = path, imported.warnings
    return robot_file, imported


def read_robot(path: Path) -> RobotFile:
    """A robot file."""
    data = read_toml(path)
    refuse_other_kinds(data, "robot", path)
    robot_file = checked(RobotFile, data, path)
    robot_file._file = path
    return robot_file
