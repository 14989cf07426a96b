"""Answers whose fields are columns. Tables of quantities are imported only where units and names are needed."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import xarray


class Columns:
    """Answers whose fields are columns: arrays with a value for each of n cases."""

    def __init_subclass__(cls, **keywords: Any) -> None:
        """Replace the repr of dataclasses, which would print every number of every column."""
        super().__init_subclass__(**keywords)
        cls.__repr__ = Columns.__repr__  # type: ignore[method-assign]

    def __repr__(self) -> str:
        arrays = self.arrays()
        count = len(next(iter(arrays.values()), ()))
        lines = [f"{type(self).__name__} of {count} cases"]
        with np.printoptions(precision=5, threshold=8, edgeitems=2, linewidth=100):
            lines += [f"  {name}: {' '.join(str(values).split())}" for name, values in arrays.items()]
        return "\n".join(lines)

    def arrays(self) -> dict[str, np.ndarray]:
        """The fields that are arrays."""
        return {name: values for name, values in vars(self).items() if isinstance(values, np.ndarray)}

    def to_xarray(self, dims: Mapping[str, Any] | None = None) -> "xarray.Dataset":
        """The answers for xarray, with units and long names."""
        from cspr_jax.schema import labelled

        return labelled.over(self.arrays(), dims)

    def best(self, axis: str, dims: Mapping[str, Any]) -> dict[str, np.ndarray]:
        """The answers at the best point of one dimension, if they cover all combinations of coordinates."""
        from cspr_jax.schema import labelled
        from cspr_jax.schema.best import best_of, check_axis

        arrays = self.arrays()
        axes, shape = labelled.axes_of(dims, len(next(iter(arrays.values()))))
        check_axis(axis, tuple(axes))
        full = {name: values.reshape(*shape, *values.shape[1:]) for name, values in arrays.items()}
        return best_of(full, axis, axes[axis], list(axes).index(axis)).data
