"""Arrays by name of their quantities, as datasets of xarray with units and long names."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from cspr_jax.errors import ConfigError, InputError
from cspr_jax.schema.map_kinds import quantity_of
from cspr_jax.schema.meanings import value_attributes
from cspr_jax.schema.quantities import ACROSS, OTHER_DIMS, PARTS, SEGMENTS, flag_attributes

if TYPE_CHECKING:
    import xarray

# Points of the axis of answers that have a value at each end of a segment.
ENDS = ("start", "target")
CONTROL_POINTS = ("start", "middle", "end")


def need_xarray() -> None:
    """Raise an error if xarray is missing, before a dataset is computed."""
    try:
        import xarray  # noqa: F401
    except ImportError as error:
        raise ConfigError("xarray", "is not installed: pip install 'cspr_jax[xarray]'") from error


def dataset(
    variables: Mapping[str, tuple[tuple[str, ...], np.ndarray]],
    axes: Mapping[str, Any],
    attributes: Mapping[str, Any] | None = None,
    settings: Mapping[str, Any] | None = None,
) -> "xarray.Dataset":
    """A dataset whose variables and axes carry the attributes of the table of quantities."""
    need_xarray()
    import xarray

    return xarray.Dataset(
        {name: (dims, values, _described(name, settings)) for name, (dims, values) in variables.items()},
        {name: (name, np.asarray(points), _described(name, settings)) for name, points in axes.items()},
        attributes,
    )


def motion(arrays: Mapping[str, np.ndarray], attributes: Mapping[str, Any]) -> "xarray.Dataset":
    """A motion as a dataset: rows over time, and quantities of its segments."""
    cables = range(1, arrays["tension"].shape[1] + 1)
    axes: dict[str, Any] = {"t": arrays["t"], **PARTS, "cable": np.array(cables)}
    used = {ACROSS.get(name) for name in arrays} | {part for name in arrays for part in OTHER_DIMS.get(name, ())}
    for part in PARTS.keys() - used:
        del axes[part]
    axes |= {
        name: arrays[name]
        for name in ("segment", "flight_t", "throw", "failure", "criterion_failure", "path_node")
        if name in arrays
    }
    dims_of = dict.fromkeys(SEGMENTS, ("segment",)) | OTHER_DIMS
    variables = {
        name: (dims_of[name] if name in dims_of else ("t", ACROSS[name]) if name in ACROSS else ("t",), values)
        for name, values in arrays.items()
        if name not in axes
    }
    return dataset(variables, axes, attributes)


def over(arrays: Mapping[str, np.ndarray], dims: Mapping[str, Any] | None) -> "xarray.Dataset":
    """Answers over the product of some dimensions."""
    count = len(next(iter(arrays.values())))
    axes, shape = axes_of({"target": range(count)} if dims is None else dims, count)
    numbers = {name: values for name, values in arrays.items() if values.dtype != object}
    both = {"end": ENDS} if any(values.ndim == 2 for values in numbers.values()) else {}
    controls = {"control_point": CONTROL_POINTS, "axis": PARTS["axis"]}
    third = controls if any(values.ndim == 3 for values in numbers.values()) else {}
    further_dims: dict[int, dict[str, Any]] = {1: {}, 2: both, 3: third}
    variables = {
        name: ((*axes, *further_dims[values.ndim]), values.reshape(*shape, *values.shape[1:]))
        for name, values in numbers.items()
    }
    data = dataset(variables, axes | both | third)
    if "beta_hat" in data and both:
        data["beta_hat"].attrs = {
            "units": "1",
            "long_name": "beta-hat",
        }  # the table of quantities describes only the value at the target
    return data


def axes_of(dims: Mapping[str, Any], count: int) -> tuple[dict[str, np.ndarray], tuple[int, ...]]:
    """Return the dimensions whose product the answers cover."""
    axes = {name: np.asarray(points) for name, points in dims.items()}
    shape = tuple(points.size for points in axes.values())
    if any(points.ndim != 1 for points in axes.values()) or math.prod(shape) != count:
        shapes = {name: list(points.shape) for name, points in axes.items()}
        raise InputError("dims", shapes, f"lists of coordinates whose product has {count} points")
    return axes, shape


def _described(name: str, settings: Mapping[str, Any] | None = None) -> dict[str, Any]:
    try:
        quantity = quantity_of((settings or {}).get("map"), name, settings)
    except KeyError:
        return {}
    attributes = {"units": quantity.units, "long_name": quantity.long_name, "description": quantity.description}
    return attributes | (flag_attributes() if name.endswith("verdict") else value_attributes(quantity, settings))
