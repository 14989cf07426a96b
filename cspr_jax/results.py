"""Reading result files."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from cspr_jax.errors import StoreError
from cspr_jax.store.netcdf import UNREADABLE, plain, reason, refuse_foreign
from cspr_jax.store.seal import DamagedError, check_file

# A result is read into memory as a whole: bytes of its data.
LARGEST_DATA = 8e9
# Shapes of what a motion holds for each cable, at one instant.
CABLES = [(n,) for n in range(2, 7)]


@dataclasses.dataclass(frozen=True)
class Result:
    """A result file in memory.

    Fields:
        axes: coordinates by name, in the order of the dimensions.
        data: quantities by name, each with the dimensions of `axes` (of a map), or as stored (of a motion).
        units: of axes and quantities.
        labels: long names of axes and quantities.
        attributes: of the file.
        settings: of the sweep; empty for a motion.
    """

    axes: dict[str, np.ndarray]
    data: dict[str, np.ndarray]
    units: dict[str, str]
    labels: dict[str, str]
    attributes: dict[str, Any]
    settings: dict[str, Any]

    @property
    def is_map(self) -> bool:
        """Whether it is a map, not a motion over time."""
        return "map" in self.attributes


def open_result(path: Path) -> Result:
    """Read a result of `cspr run` or a motion of `cspr plan -o`.

    Args:
        path: the file.

    Returns:
        the result.

    Raises:
        StoreError: no such file, not HDF5, damaged, or not written by this program.
    """
    try:
        check_file(path)
        with h5py.File(path, "r") as file:
            refuse_foreign(path, file, LARGEST_DATA)
            everything = {name: item for name, item in file.items() if isinstance(item, h5py.Dataset)}
            scales = {name for name, item in everything.items() if item.is_scale}
            found = {name: np.asarray(item) for name, item in everything.items()}
            units = {name: str(plain(item.attrs.get("units", ""))) for name, item in everything.items()}
            names = {name: str(plain(item.attrs.get("long_name", name))) for name, item in everything.items()}
            attributes = {name: plain(value) for name, value in file.attrs.items()}
            settings = json.loads(attributes.get("settings", "{}"))
    except (DamagedError, *UNREADABLE, MemoryError) as error:
        raise StoreError(f"{path}: cannot be read as a result: {reason(error)}") from error
    data = {name: array for name, array in found.items() if name not in scales}
    # HDF5's own record of dimensions is not asked: damaged, it keeps the library busy for ever.
    order = settings.get("dimensions") if isinstance(settings, dict) and "map" in attributes else ["t"]
    axes = {str(name): found[name] for name in order if name in scales} if isinstance(order, list) else {}
    if not _is_ours(axes, data, attributes):
        raise StoreError(f"{path}: is not a result of cspr: it has no quantities with named axes")
    return Result(axes, data, units, names, attributes, settings)


def _is_ours(axes: dict[str, np.ndarray], data: dict[str, np.ndarray], attributes: dict[str, Any]) -> bool:
    # A map over a grid, or a motion over time, with numbers of the right shapes.
    if not data or not axes or not isinstance(attributes.get("robot"), str):
        return False
    if "map" in attributes:
        shape = tuple(points.size for points in axes.values())
        numbers = [*axes.values(), *data.values()]
        return all(array.dtype.kind in "fiu" for array in numbers) and all(a.shape == shape for a in data.values())
    if "t" not in axes or not isinstance(attributes.get("z0"), float):
        return False
    count, position, tension = axes["t"].size, data.get("position"), data.get("tension")
    if position is None or tension is None or {position.dtype.kind, tension.dtype.kind} != {"f"}:
        return False
    return position.shape == (count, 3) and tension.shape[:1] == (count,) and tension.shape[1:] in CABLES
