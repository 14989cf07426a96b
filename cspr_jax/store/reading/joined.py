"""Maps that xarray or dask has joined and written as netCDF, restored to this program's dimensions, types and order."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from cspr_jax.schema.quantities import QUANTITIES
from cspr_jax.store.files.checksum import DamagedError

# Attributes that the join has kept from one of the maps, and that are wrong for the joined one.
_OF_ONE = ("identity", "content_sha256", "proved", "cells_near_zero", "mixed", "environment", "environments")


def joined_map(
    attributes: dict[str, Any],
    settings: dict[str, Any],
    arrays: Mapping[str, np.ndarray],
    dimensions: Mapping[str, list[str]],
) -> tuple[dict[str, Any], dict[str, Any], dict[str, np.ndarray]]:
    """Attributes, settings and arrays of a joined map, in the form of a map that was computed in one run."""
    order = settings["dimensions"]
    for name, names in dimensions.items():
        if sorted(names) != (sorted(order) if name in QUANTITIES else [name]):
            raise DamagedError(f"{name} has the dimensions {', '.join(names) or 'none'}: must be {', '.join(order)}")
    axes = {name: arrays[name] for name in order if name in arrays}
    indices = {name: np.argsort(points, kind="stable") for name, points in axes.items()}
    for name, points in axes.items():
        repeated = points[indices[name]][1:][np.diff(points[indices[name]]) == 0.0]
        if repeated.size:
            raise DamagedError(f"{name} = {repeated[0]:.9g} is there twice: must be once, as xarray's merge leaves it")
    result = {name: points[indices[name]] for name, points in axes.items()}
    for name in arrays.keys() & QUANTITIES.keys():
        values = arrays[name].transpose([dimensions[name].index(axis) for axis in order])
        result[name] = _typed(name, values[np.ix_(*indices.values())])
    settings = settings | {"axes": settings["axes"] | {name: result[name].tolist() for name in settings["axes"]}}
    return {name: value for name, value in attributes.items() if name not in _OF_ONE}, settings, result


def _typed(name: str, values: np.ndarray) -> np.ndarray:
    # xarray's merge fills cells with NaN, which turns integers into floats.
    kind = QUANTITIES[name].kind
    if kind == "float" or values.dtype.kind != "f":
        return values
    if np.isnan(values).any():
        count = int(np.isnan(values).sum())
        raise DamagedError(f"{count} cells have no {name}: the joined maps must fill their grid")
    limits = np.iinfo(kind)
    if not ((values >= limits.min) & (values <= limits.max) & (values == np.round(values))).all():
        raise DamagedError(f"{name} holds numbers that no result has")
    return values.astype(kind)
