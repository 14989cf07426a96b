"""Checks of sweep files beyond the schema, by the row of their kind of map in `schema.map_kinds`."""

from pathlib import Path

import numpy as np

from cspr_jax.config.keys.limits import LimitTable
from cspr_jax.config.keys.obstacles import ObstacleKeys
from cspr_jax.config.keys.workspace import WorkspaceTable
from cspr_jax.config.missing_cables import ANY_ONE
from cspr_jax.config.reading import Table
from cspr_jax.config.robot import RobotFile
from cspr_jax.config.sweep import Axes, SweepFile
from cspr_jax.config.wording import either
from cspr_jax.errors import ConfigError, shown
from cspr_jax.schema.families import WITHOUT_BETA_HAT
from cspr_jax.schema.map_kinds import MAP_KINDS, MapKind, kinds_with

_TARGETS = ("x", "y", "radius", "azimuth", "z")
_START = ("from_x", "from_y", "from_z")
# Keys that only some kinds of maps have.
_SPECIAL = (
    *(f"axes.{name}" for name in Axes.model_fields if name not in (*_TARGETS, "parameter", "arrangement")),
    *("trajectory.inclination", "trajectory.beta_hat", "trajectory.beat"),
    *("trajectory.max_acceleration", "trajectory.rule", "trajectory.path"),
    *("limits", "limits.uncertainty", "orientations", "orientations.values", "launch", "workspace", "ellipse"),
    "point",
    *ObstacleKeys.model_fields,
)
# A value of a key that counts as a key.
EACH_GONE = f"without.{ANY_ONE}"
# Largest number of kinds that a hint names.
_FEW = 3


def check_map(kind: MapKind, spec: SweepFile, path: Path) -> None:
    """Refuse a sweep whose keys do not fit its map."""
    targets = tuple(name for name in _TARGETS[:-1] if getattr(spec.axes, name) is not None)
    if targets not in (("x", "y"), ("radius", "azimuth")):
        raise ConfigError(path, f"axes: {', '.join(targets) or 'no targets'}: must be x and y, or radius and azimuth")
    if kind.families:
        if "trajectory" not in spec.model_fields_set:
            raise ConfigError(path, f"trajectory is missing: {SweepFile.model_fields['trajectory'].description}")
        families = tuple(name for form in MAP_KINDS[spec.map].forms for name in form.families)
        _check_choice(spec.trajectory.family, "trajectory.family", families, path)
    elif "family" in spec.trajectory.model_fields_set:
        raise ConfigError(path, "trajectory.family: must be absent in this map, whose cells are places")
    for name in _SPECIAL:
        if name not in kind.keys and _missing(spec, name) is None:
            others = any(name in form.keys for form in MAP_KINDS[spec.map].forms)
            where = f'with family = "{spec.trajectory.family}"' if others else f"in this map{_hint(kinds_with(name))}"
            raise ConfigError(path, f"{name}: must be absent {where}")
    if spec.without == ANY_ONE and "workspace" not in kind.takes:
        raise ConfigError(path, f'without = "{ANY_ONE}": must be a list of cables, from 0 on, in this map')
    _check_limits(kind, spec, path)
    if spec.orientations is not None and spec.orientations.definition is not None:
        _check_choice(spec.orientations.definition, "orientations.definition", kind.definitions, path)
    for missing in filter(None, (_missing(spec, name) for name in kind.needs)):
        raise ConfigError(path, missing)
    if kind.one_of and sum(_missing(spec, name) is None for name in kind.one_of) != 1:
        raise ConfigError(path, f"{', '.join(kind.one_of)}: must be one of them in this map")
    _check_start(kind, spec, path)
    if spec.trajectory.beat in WITHOUT_BETA_HAT and spec.trajectory.beta_hat is not None:
        raise ConfigError(path, f'trajectory.beta_hat: must be absent with beat = "{spec.trajectory.beat}"')


def check_points(axes: dict[str, np.ndarray], kind: MapKind, robot: RobotFile, path: Path) -> None:
    """Refuse coordinates out of their range, and out of the plane of a planar robot that the map moves."""
    for name, inside, allowed in (
        ("z0", lambda p: p > 0.0, "a number > 0"),
        ("radius", lambda p: p >= 0.0, "a number >= 0"),
        ("inclination", lambda p: np.abs(p) < 1.0, "a number in ]-1, 1["),
        ("tau", lambda p: (p >= 0.0) & (p <= 1.0), "a number in [0, 1]"),
        ("circle_radius", lambda p: p >= 0.0, "a number >= 0"),
        ("scale", lambda p: p >= 0.0, "a number >= 0"),
        ("frequency", lambda p: p > 0.0, "a number > 0"),
        ("cable", lambda p: (p >= 1.0) & (p == np.round(p)), "a whole number from 1 on"),
    ):
        points = axes.get(name, np.empty(0))
        wrong = points[~inside(points)]
        if len(wrong):
            raise ConfigError(path, f"axes.{name} = {shown(float(wrong[0]))}: must be {allowed}")
    # Maps that move no planar robots refuse the robot, whatever the axes are.
    if robot.is_planar and (not kind.patterns or robot.own_pattern in kind.patterns):
        if "y" not in axes or axes["y"].any():
            raise ConfigError(path, "axes.y: must be [0] for a planar robot")
        if axes.get("from_y", np.zeros(1)).any():
            raise ConfigError(path, "axes.from_y: must be [0] for a planar robot")


def is_given(spec: SweepFile, name: str) -> bool:
    """Tell whether a sweep has a key."""
    if name == EACH_GONE:
        return spec.without == ANY_ONE
    return _missing(spec, name) is None


def is_asked(spec: SweepFile, robot: RobotFile, name: str) -> bool:
    """Tell whether a sweep or its robot gives a key, so that quantities that depend on it have values."""
    table, _, last = name.rpartition(".")
    if name == EACH_GONE:
        return is_given(spec, name)
    if table == "workspace.conditions":
        return last in (spec.workspace or WorkspaceTable()).conditions
    if table == "robot":
        return getattr(robot, last) is not None
    if table == "limits" and getattr(robot, last, None) is not None:
        return True
    return is_given(spec, name) and getattr(getattr(spec, table) if table else spec, last) is not False


def check_store(kind: MapKind, spec: SweepFile, robot: RobotFile, path: Path) -> None:
    """Refuse to store quantities that the map does not have, or whose keys the sweep does not give."""
    for name in spec.run.store or ():
        if name not in kind.quantities:
            raise ConfigError(path, f"run.store: {name}: must be one of {', '.join(kind.quantities)} in this map")
        needed = kind.keys_of(name)
        if needed and not any(is_asked(spec, robot, key) for key in needed):
            raise ConfigError(path, f"run.store: {name}: must be absent without {either(map(_as_written, needed))}")


def _as_written(name: str) -> str:
    table, _, last = name.rpartition(".")
    if name == EACH_GONE:
        return f'without = "{ANY_ONE}"'
    return f'"{last}" among workspace.conditions' if table == "workspace.conditions" else name


def _missing(spec: SweepFile, name: str) -> str | None:
    # Words for a dotted key that is missing; None if it is given.
    table: Table = spec
    for part in name.split("."):
        inner = getattr(table, part)
        if inner is None or part not in table.model_fields_set:
            return f"{name} is missing: {type(table).model_fields[part].description}"
        table = inner
    return None


def _hint(kinds: list[str]) -> str:
    return f"; it is for map = {either(kinds)}" if 0 < len(kinds) <= _FEW else ""


def _check_choice(value: str, name: str, allowed: tuple[str, ...], path: Path) -> None:
    if value not in allowed:
        raise ConfigError(path, f'{name} = "{value}": must be {either(allowed)} in this map')


def _check_limits(kind: MapKind, spec: SweepFile, path: Path) -> None:
    takes = (*kind.limits, *["tension_margin"] * ("tension_min" in kind.limits), "uncertainty")
    for name in LimitTable.model_fields if kind.limits else ():
        if name not in takes and getattr(spec.limits, name) is not None:
            allowed = ", ".join(kind.limits)
            raise ConfigError(
                path, f"limits.{name}: must be absent in this map, which takes {allowed} alone; plans take all"
            )


def _check_start(kind: MapKind, spec: SweepFile, path: Path) -> None:
    start = spec.trajectory.start
    if kind.start == "rest" and start is not None and not start.rest:
        raise ConfigError(path, "trajectory.from: must be { rest = true }, or absent, in this map")
    if kind.start != "pose" and start is not None and start.is_pose:
        poses = either(other.name for other in MAP_KINDS.values() if other.start == "pose")
        raise ConfigError(path, f"trajectory.from: must be without orientation and beta_hat but for map = {poses}")
    start_axes = [name for name in _START if getattr(spec.axes, name) is not None]
    if kind.start == "point" and start is None and len(start_axes) < len(_START):
        raise ConfigError(
            path,
            "trajectory.from is missing: { position = [x, y, z] }, { rest = true }, or axes from_x, from_y, from_z",
        )
    if start is not None and start.rest and start_axes:
        raise ConfigError(path, f"axes.{start_axes[0]}: must be absent where trajectory.from.rest = true")
