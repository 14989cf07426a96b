"""Result files: content that another process has read, checked against the schema of the program that wrote it."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cspr_jax.config.keys.limits import LARGEST_LENGTH, MAX_CABLES
from cspr_jax.config.reading import checked
from cspr_jax.config.robot import RobotFile
from cspr_jax.config.sweep import SweepFile, sweep_spec
from cspr_jax.errors import ConfigError, InputError, StoreError, printable, shown
from cspr_jax.schema import labelled
from cspr_jax.schema.best import best_of, check_axis
from cspr_jax.schema.map_kinds import MAP_KINDS, quantity_of
from cspr_jax.schema.quantities import (
    ACROSS,
    EVERY,
    OTHER_DIMS,
    PARTS,
    QUANTITIES,
    SEGMENTS,
    TRAJECTORY,
    is_axis,
    is_of_robot,
)
from cspr_jax.store.documents import plain_json
from cspr_jax.store.files.checksum import DamagedError
from cspr_jax.store.reading.isolated import Reader
from cspr_jax.store.reading.joined import joined_map
from cspr_jax.store.reading.motion_table import read_table

if TYPE_CHECKING:
    import xarray

# Largest magnitude of the finite numbers of a result, and largest mass, kg.
LARGEST_NUMBER, LARGEST_MASS = 1e30, 1e9
# Largest number of tables, lists and keys of settings, which have some ten tables and lists and some fifty keys.
_LARGEST_PARTS = 10_000
_BLOCK = 1 << 20


class BestPoints(NamedTuple):
    """Axis that was removed from a map by choosing its best point for every cell.

    Fields:
        points: (n,) points of the axis.
        indices: (...) index of the best point on the axis, in the shape of the quantities.
    """

    points: np.ndarray
    indices: np.ndarray


@dataclasses.dataclass(frozen=True)
class Result:
    """A result file in memory.

    Fields:
        axes: coordinates by name, in the order of the dimensions.
        data: quantities by name, with the dimensions of `axes` for a map, as stored for a motion.
        units: units of axes and quantities.
        labels: long names of axes and quantities.
        attributes: those attributes of the file that this program writes.
        settings: settings of the sweep; empty for a motion.
        choices: axes of the sweep that `best` has removed, by name.
    """

    axes: dict[str, np.ndarray]
    data: dict[str, np.ndarray]
    units: dict[str, str]
    labels: dict[str, str]
    attributes: dict[str, Any]
    settings: dict[str, Any]
    choices: dict[str, BestPoints] = dataclasses.field(default_factory=dict)

    @property
    def is_map(self) -> bool:
        """Tell whether the result is a map, not a motion over time."""
        return "map" in self.attributes

    def best(self, *axes: str) -> "Result":
        """The map with the best point of each of some axes chosen for every cell: the answer to "at any z0?"."""
        if not self.is_map:
            raise InputError("--best", " ".join(axes), "absent for a motion")
        full = self
        for axis in axes:
            full = full._without(axis)
        return full

    def _without(self, axis: str) -> "Result":
        check_axis(axis, tuple(self.axes))
        dimension, points = list(self.axes).index(axis), self.axes[axis]
        data, indices = best_of(self.data, axis, points, dimension, MAP_KINDS[self.attributes["map"]].pictured)
        others = {name: points for name, points in self.axes.items() if name != axis}
        earlier = {
            name: BestPoints(
                choice.points,
                np.take_along_axis(choice.indices, np.expand_dims(indices, dimension), dimension).squeeze(dimension),
            )
            for name, choice in self.choices.items()
        }
        choices = earlier | {axis: BestPoints(points, indices)}
        units, labels = _described(self.settings, [*others, *choices, *data])
        return dataclasses.replace(self, axes=others, data=data, units=units, labels=labels, choices=choices)

    def coordinates(self, index: tuple[int, ...]) -> dict[str, float]:
        """Coordinates of a cell of a map."""
        point = {axis: float(points[i]) for (axis, points), i in zip(self.axes.items(), index, strict=True)}
        return point | {axis: float(choice.points[choice.indices[index]]) for axis, choice in self.choices.items()}

    def to_xarray(self) -> "xarray.Dataset":
        """The result for xarray: named dimensions, units and long names, and the attributes of the file."""
        if self.is_map:
            variables = {name: (tuple(self.axes), data) for name, data in self.data.items()}
            best = {"best_over": " ".join(self.choices)} if self.choices else {}
            return labelled.dataset(variables, self.axes, self.attributes | best, self.settings)
        return labelled.motion(self.axes | self.data, self.attributes)


def open_result(path: Path) -> Result:
    """Read a result of `cspr run`, a map that xarray has joined from several, or a motion of `cspr plan -o`.

    A motion in a .csv file has neither robot nor plan nor segments, and the name of its file as its name.

    An HDF5 file may come from anybody: another process reads it, within limits of memory and time, and its content is
    checked like a sweep file.
    """
    try:
        is_table = Path(path).suffix.lower() == ".csv"
        attributes, arrays, dimensions = (*read_table(Path(path)), None) if is_table else _content(Path(path))
        settings = _settings(attributes, path) if "map" in attributes else {}
        if dimensions is not None:
            attributes, settings, arrays = joined_map(attributes, settings, arrays, dimensions)
        arrays = dict(sorted(arrays.items()))
        _check_robot(attributes, path)
        if settings:
            axes, data = _map(settings, arrays)
        else:
            axes, data = _motion(attributes, arrays, keeps_robot=not is_table)
    except DamagedError as error:
        raise StoreError(printable(f"{path}: cannot be read as a result: {error}")) from error
    except ConfigError as error:
        raise StoreError(str(error)) from error
    names = [*axes, *data]
    units, labels = _described(settings, names)
    return Result(axes, data, units, labels, attributes, settings)


def motion_result(attributes: dict[str, Any], arrays: dict[str, np.ndarray]) -> Result:
    """A computed motion in the form in which it would be read from a motion file."""
    try:
        axes, data = _motion(attributes, dict(sorted(arrays.items())), keeps_robot=True)
    except DamagedError as error:
        raise StoreError(f"the motion cannot be drawn: {error}") from error
    return Result(axes, data, *_described({}, [*axes, *data]), attributes, {})


def _content(path: Path) -> tuple[dict[str, Any], dict[str, np.ndarray], dict[str, list[str]] | None]:
    with Reader() as reader:
        return reader.result(path)


def _described(settings: Mapping[str, Any], names: list[str]) -> tuple[dict[str, str], dict[str, str]]:
    # Units and long names, from the rows of the kind of map, and of parameters from the robot.
    quantities = [quantity_of(settings.get("map"), name, settings) for name in names]
    return {row.name: row.units for row in quantities}, {row.name: row.long_name for row in quantities}


def _json(attributes: dict[str, Any], name: str) -> dict[str, Any]:
    text = attributes.get(name)
    if text is None:
        raise DamagedError(f"it has no {name}")
    # Check sizes before anything is built from the text.
    if max(text.count("[") + text.count("{"), text.count(":")) > _LARGEST_PARTS:
        raise DamagedError(f"its {name} have more parts than cspr writes")
    try:
        table = plain_json(text)
    except DamagedError as error:
        raise DamagedError(f"its {name} cannot be read: {error}") from error
    if not isinstance(table, dict):
        raise DamagedError(f"its {name} = {shown(table)}: must be a table")
    return table


def _settings(attributes: dict[str, Any], path: Path) -> dict[str, Any]:
    # Settings are the content of a sweep file, with its robot and the order of the axes.
    settings = _json(attributes, "settings")
    checked(SweepFile, sweep_spec(settings), path, at="settings")
    robot = checked(RobotFile, settings["robot"], path, at="settings.robot")
    order = settings.get("dimensions")
    if not isinstance(order, list) or not order or not all(map(is_axis, order)):
        raise DamagedError(f"settings.dimensions = {shown(order)}: must be a list of axes")
    for name, setting in (("map", settings["map"]), ("robot", robot.name), ("z_axis", robot.z_axis)):
        if attributes.get(name) != setting:
            raise DamagedError(f"its {name} = {shown(attributes.get(name))} and its settings do not fit")
    return settings


def _check_robot(attributes: dict[str, Any], path: Path) -> None:
    # Check attributes of the robot that pictures show, of which motions of earlier versions have only the name.
    name, z_axis, points = attributes.get("robot"), attributes.get("z_axis", "down"), attributes.get("base_points")
    if not isinstance(name, str) or not 0 < len(name) <= 200:
        raise DamagedError(f"robot = {shown(name)}: must be a name of at most 200 characters")
    if z_axis not in ("down", "up"):
        raise DamagedError(f'z_axis = {shown(z_axis)}: must be "down" or "up"')
    attributes["robot"] = printable(name)
    if points is not None:
        attributes["base_points"] = np.asarray(points, float)
        _check_numbers("base_points", attributes["base_points"], LARGEST_LENGTH)
    if "robot_settings" in attributes:
        checked(RobotFile, _json(attributes, "robot_settings"), path, at="robot_settings")


def _map(
    settings: dict[str, Any], arrays: dict[str, np.ndarray]
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    order = settings["dimensions"]
    axes = {name: arrays[name] for name in order if name in arrays}
    data = {name: array for name, array in arrays.items() if name in QUANTITIES}
    if len(axes) < len(order) or not data:
        raise DamagedError("it is not a result of cspr: it has no quantities with named axes")
    for name, points in axes.items():
        if points.dtype != np.float64 or points.ndim != 1 or not points.size:
            raise DamagedError(f"axis {name} is not a list of numbers")
        _check_numbers(name, points, LARGEST_NUMBER if is_of_robot(name) else LARGEST_LENGTH)
    shape = tuple(points.size for points in axes.values())
    for name, array in data.items():
        if array.shape != shape or array.dtype.name not in QUANTITIES[name].readable:
            raise DamagedError(f"{name} has not the shape of its axes, or another type")
        _check_numbers(name, array, LARGEST_NUMBER, finite=False)
        data[name] = _as_now(name, array)
    return axes, data


# Quantities of a motion that may be infinite.
_OPEN = (
    *("tension", "tension_residual", "tension_each", "tension_couple", "path_acceleration", "landing"),
    *("segment_cause_time", "segment_needed", "segment_allowed", "path_speed", "segment_lower_bound"),
)


def _motion(
    attributes: dict[str, Any], arrays: dict[str, np.ndarray], *, keeps_robot: bool
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    time, tension = arrays.get("t"), arrays.get("tension")
    if time is None or tension is None or "position" not in arrays or time.ndim != 1 or tension.ndim != 2:
        raise DamagedError("it is not a result of cspr: it has no quantities with named axes")
    if not len(time) or time.dtype != np.float64 or not 2 <= tension.shape[1] <= MAX_CABLES:
        raise DamagedError("it is not a motion of two cables or more")
    # Motions along straight lines have no P0.
    bounds = ({"mass": LARGEST_MASS} if keeps_robot else {}) | ({"z0": LARGEST_LENGTH} if "z0" in attributes else {})
    for name, maximum in bounds.items():
        if not 1.0 / maximum <= attributes.get(name, 0.0) <= maximum:
            raise DamagedError(f"{name} = {shown(attributes.get(name))}: must be a number > 0")
    widths = {
        "quaternion": 4,
        "tension_each": 6,
        "tension_couple": 4,
        "length": tension.shape[1],
        "rate": tension.shape[1],
        "tension": tension.shape[1],
    }
    segments = {name: array for name, array in arrays.items() if name in SEGMENTS}
    for name, array in arrays.items():
        shape: tuple[int, ...] = (len(time), widths.get(name, 3))
        if name in TRAJECTORY and name not in ACROSS:
            shape = (len(time),)
        elif name in OTHER_DIMS:
            first, *rest = OTHER_DIMS[name]
            shape = (arrays[first].size if first in arrays else -1, *(len(PARTS[part]) for part in rest))
        elif name in segments:
            shape = (segments["segment"].size if "segment" in segments else -1,)
        kinds = EVERY[name].readable
        if array.shape != shape or array.dtype.name not in (kinds[:1] if kinds[0] == "float64" else kinds):
            raise DamagedError(f"{name} has another shape or type than in a motion")
        # The best candidate of a motion that is not feasible may pass a singularity, where tensions are infinite.
        _check_numbers(name, array, LARGEST_NUMBER, finite=name not in _OPEN)
    if (np.diff(time) < 0.0).any():
        raise DamagedError("its time runs backwards")
    return {"t": time}, {name: _as_now(name, array) for name, array in arrays.items() if name != "t"}


def _as_now(name: str, array: np.ndarray) -> np.ndarray:
    # Convert to the type of this version, which changes no number.
    kind = EVERY[name].kind
    return array if kind == "float" else array.astype(kind, copy=False)


def _check_numbers(name: str, array: np.ndarray, maximum: float, *, finite: bool = True) -> None:
    flat = array.reshape(-1)
    for start in range(0, flat.size, _BLOCK):
        block = flat[start : start + _BLOCK]
        if block.dtype.kind == "f":
            is_finite = np.isfinite(block)
            if finite and not is_finite.all():
                raise DamagedError(f"{name} holds numbers that are not finite")
            block = np.abs(block[is_finite])
        if block.size and (block.max() > maximum or block.min() < 0):
            raise DamagedError(f"{name} holds numbers that no result has")
