"""Reading result files."""

import dataclasses
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from cspr_jax.errors import StoreError


@dataclasses.dataclass(frozen=True)
class Result:
    """A result file in memory.

    Fields:
        axes: coordinates by name, in the order of the dimensions.
        data: quantities by name, each with the dimensions of `axes` (of a map), or as stored (of a motion).
        units: of axes and quantities.
        labels: long names of axes and quantities.
        attributes: of the file.
    """

    axes: dict[str, np.ndarray]
    data: dict[str, np.ndarray]
    units: dict[str, str]
    labels: dict[str, str]
    attributes: dict[str, Any]

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
        with h5py.File(path, "r") as file:
            everything = {name: item for name, item in file.items() if isinstance(item, h5py.Dataset)}
            scales = {name for name, item in everything.items() if item.is_scale}
            order = _dimensions(everything, scales)
            found = {name: np.asarray(item) for name, item in everything.items()}
            units = {name: str(item.attrs.get("units", "")) for name, item in everything.items()}
            labels = {name: str(item.attrs.get("long_name", name)) for name, item in everything.items()}
            attributes = dict(file.attrs)
    except (OSError, KeyError, ValueError, RuntimeError, IndexError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise StoreError(f"{path}: cannot be read as a result: {reason}") from error
    data = {name: array for name, array in found.items() if name not in scales}
    known = "map" in attributes or ({"position", "tension"} <= data.keys() and "t" in order)
    if not data or not order or "robot" not in attributes or not known:
        raise StoreError(f"{path}: is not a result of cspr: it has no quantities with named axes")
    return Result({name: found[name] for name in order}, data, units, labels, attributes)


def _dimensions(everything: dict[str, h5py.Dataset], scales: set[str]) -> list[str]:
    order: list[str] = []
    for name, item in everything.items():
        if name not in scales:
            names = [Path(dim[0].name).name for dim in item.dims]
            order += [n for n in names if n not in order]
    return order
