"""Robots of cdpyr: JSON or YAML, metres, kilogrammes, newtons, z up; in a plane x and y, with y up; on a line x.

Chains say which frame anchor is joined to which platform anchor; both are numbered from 0. Inertia is about the origin
of the platform. A pulley swivels about the z axis of its anchor, along which the cable enters.
"""

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from cspr_jax.config.formats import model
from cspr_jax.config.formats.model import Body, Cable
from cspr_jax.config.reading import look_alike_before, read_text, refuse_long_numbers
from cspr_jax.config.wording import either
from cspr_jax.errors import ConfigError, shown
from cspr_jax.errors.suggestions import look_alike

# Patterns by their numbers of rotations and translations.
PATTERNS = {(0, 1): "1T", (0, 2): "2T", (0, 3): "3T", (1, 2): "1R2T", (2, 3): "2R3T", (3, 3): "3R3T"}
AXES = {"1T": model.OF_X, "2T": model.OF_XY, "1R2T": model.OF_XY}
MAX_CABLES = 1000
LARGEST = 1_000_000  # largest number of values of a file


def read_json(path: Path) -> Body:
    """A robot of a JSON file."""
    return _read(path, _json, "JSON")


def read_yaml(path: Path) -> Body:
    """A robot of a YAML file."""
    return _read(path, _yaml, "YAML")


def _json(text: str) -> Any:
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        raise ValueError(f"{error}{look_alike_before(text, error.pos)}") from error


def _yaml(text: str) -> Any:
    import yaml

    from cspr_jax.config.formats.yaml_text import load  # imported only where YAML is read, since it takes time

    try:
        data = load(text)
    # YAML's constructors of numbers and dates raise arbitrary errors, such as for "!!int ''" and "!!timestamp x".
    except (yaml.YAMLError, LookupError, AttributeError, ArithmeticError, TypeError) as error:
        raise ValueError(" ".join(str(error).split())[:200]) from error
    if not _value_count(data, {}) <= LARGEST:
        raise ValueError(f"its references (*name) stand for more than {LARGEST} values, or for themselves")
    return data


def _value_count(data: Any, counts: dict[int, float]) -> float:
    # Number of values once references are written out; infinite where a value contains itself.
    if not isinstance(data, dict | list):
        return 1.0
    if id(data) not in counts:
        counts[id(data)] = math.inf
        values = data.values() if isinstance(data, dict) else data
        counts[id(data)] = 1.0 + sum(_value_count(value, counts) for value in values)
    return counts[id(data)]


def _read(path: Path, parse: Callable[[str], Any], kind: str) -> Body:
    text = read_text(path)
    try:
        data = parse(text)
    except RecursionError as error:
        raise ConfigError(path, f"is not {kind} that is read here: nested too deeply") from error
    except ValueError as error:
        refuse_long_numbers(text, path)
        raise ConfigError(path, f"is not {kind}: {error}") from error
    data = data["robot"] if isinstance(data, dict) and set(data) == {"robot"} else data
    return _body(_Table(data, "the file", path), path)


class _Table:
    """Part of the file whose values are read by their keys."""

    def __init__(self, data: Any, label: str, file: Path) -> None:
        if not isinstance(data, dict):
            raise ConfigError(file, f"{label} = {shown(data)}: must be a table")
        self.data, self.file, self.prefix = data, file, "" if label == "the file" else f"{label}."

    def has(self, key: str) -> bool:
        return self.data.get(key) is not None

    def table(self, key: str) -> "_Table":
        return _Table(self._required(key), self.prefix + key, self.file)

    def tables(self, key: str) -> list["_Table"]:
        tables = self._required(key)
        if not isinstance(tables, list) or not 1 <= len(tables) <= MAX_CABLES:
            raise ConfigError(self.file, f"{self.prefix}{key}: must be a list of 1 to {MAX_CABLES} tables")
        return [_Table(one, f"{self.prefix}{key}[{k}]", self.file) for k, one in enumerate(tables)]

    def numbers(self, key: str, *shape: int, missing: Any = None) -> np.ndarray | None:
        """Finite numbers of a shape; None where one is infinite; `missing` where the key is absent."""
        if not self.has(key):
            return None if missing is None else np.asarray(missing, float)
        try:
            values = np.array(self.data[key], float)
        except (ValueError, TypeError, OverflowError):
            values = np.full(1, np.nan)
        if values.shape == shape and np.isposinf(np.abs(values)).any():
            return None
        if values.shape != shape or not (np.abs(values) <= model.LARGEST_NUMBER).all():
            words = f"{' x '.join(map(str, shape))} finite numbers" if shape else "a finite number"
            words += f" up to {model.LARGEST_NUMBER:g}" * bool(values.shape == shape and np.isfinite(values).all())
            value = shown(self.data[key])
            raise ConfigError(self.file, f"{self.prefix}{key} = {value}: must be {words}{look_alike(value)}")
        return values

    def index(self, key: str, count: int, missing: int | None = None) -> int:
        number = self.data.get(key, missing)
        if isinstance(number, bool) or not isinstance(number, int) or not 0 <= number < count:
            words = f"must be a number from 0 to {count - 1}{look_alike(shown(number))}"
            raise ConfigError(self.file, f"{self.prefix}{key} = {shown(number)}: {words}")
        return number

    def _required(self, key: str) -> Any:
        if not self.has(key):
            raise ConfigError(self.file, f"{self.prefix}{key} is missing: a robot of cdpyr has it")
        return self.data[key]


def _body(robot: _Table, path: Path) -> Body:
    platforms = robot.tables("platforms")
    if len(platforms) != 1:
        raise ConfigError(path, f"platforms: {len(platforms)} platforms: must be one")
    platform = platforms[0]
    pattern = _pattern(platform)
    body = Body(path, _name(robot, path), pattern, _cables(robot, platform), f"cdpyr robot {path.name}")
    body.axes = AXES.get(pattern, model.SAME)
    centre = platform.numbers("center_of_gravity", 3, missing=[0.0, 0.0, 0.0])
    body.centre = [0.0, 0.0, 0.0] if centre is None else centre.tolist()
    if platform.has("inertia"):
        inertia = platform.table("inertia")
        linear, angular = inertia.numbers("linear", 3, 3), inertia.numbers("angular", 3, 3)
        body.mass = None if linear is None else float(linear[0, 0])
        if angular is not None and angular.any():
            body.inertia = model.about_centre(angular, body.mass or 0.0, body.centre)
    _thickness(robot, body)
    return body


def _name(robot: _Table, path: Path) -> str:
    name = robot.data.get("name")
    return name if isinstance(name, str) and name else path.stem


def _pattern(platform: _Table) -> str:
    pattern = platform.data.get("motion_pattern")
    if isinstance(pattern, dict):
        counts = pattern.get("rotation") or 0, pattern.get("translation") or 0
        pattern = PATTERNS.get(counts, pattern) if all(isinstance(count, int) for count in counts) else pattern
    if not isinstance(pattern, str) or pattern not in PATTERNS.values():
        key = f"{platform.prefix}motion_pattern"
        allowed = f"{either(PATTERNS.values())}{look_alike(shown(pattern))}"
        raise ConfigError(platform.file, f"{key} = {shown(pattern)}: must be {allowed}")
    return pattern


def _cables(robot: _Table, platform: _Table) -> list[Cable]:
    starts, ends = robot.table("frame").tables("anchors"), platform.tables("anchors")
    cables = []
    for chain in robot.tables("kinematic_chains"):
        chain.index("platform", 1, 0)
        start, end = starts[chain.index("frame_anchor", len(starts))], ends[chain.index("platform_anchor", len(ends))]
        points = [anchor.numbers("position", 3, missing=[0.0, 0.0, 0.0]) for anchor in (start, end)]
        for anchor, point in zip((start, end), points, strict=True):
            if point is None:
                raise ConfigError(robot.file, f"{anchor.prefix}position: must be 3 finite numbers")
        cable = Cable(*(point.tolist() for point in points if point is not None))
        if start.has("pulley"):
            pulley = start.table("pulley")
            radius = pulley.numbers("radius")
            cable.radius = 0.0 if radius is None else float(radius)
            cable.axis = (_rotation(start) @ _rotation(pulley))[:, 2].tolist()
        cables.append(cable)
    return cables


def _rotation(anchor: _Table) -> np.ndarray:
    matrix = anchor.numbers("dcm", 3, 3)
    return np.eye(3) if matrix is None else matrix


def _thickness(robot: _Table, body: Body) -> None:
    if not robot.has("cables"):
        return
    values = [cable.numbers("diameter") for cable in robot.tables("cables")]
    diameters = [float(value) for value in values if value is not None]
    body.cable_diameter = max(diameters, default=None)
    if len(set(diameters)) > 1:
        body.warnings.append(f"cables of several diameters: the largest, {max(diameters):g} m, stands for all")
