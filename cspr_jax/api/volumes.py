"""Volumes of workspaces from Python: of a map, with the error that its grid leaves."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cspr_jax.api.argument_checks import checked
from cspr_jax.outputs.volumes import WorkspaceVolume, volume_of
from cspr_jax.store.result import Result, open_result

if TYPE_CHECKING:
    import xarray

__all__ = ["WorkspaceVolume", "workspace_volume"]


@checked
def workspace_volume(result: "Result | xarray.Dataset | str | Path") -> WorkspaceVolume:
    """Volume of the workspace that a map has found, or its area where the map is a section.

    Args:
        result: of a sweep of a map with verdicts: its file, what `open_result` or `compute` gave.

    Returns:
        the volume; arrays over the axes that are no coordinates of places, () without any.

    Raises:
        InputError: no map, no stored verdicts, or a single place.
        StoreError: no result file.
    """
    if isinstance(result, Result):
        return volume_of(result)
    if isinstance(result, str | Path):
        return volume_of(open_result(Path(result)))
    data = {str(name): np.asarray(values) for name, values in result.data_vars.items()}
    dims = result["verdict"].dims if "verdict" in data else ()
    axes = {str(name): np.asarray(result[name]) for name in dims}
    return volume_of(Result(axes, data, {}, {}, dict(result.attrs), {}))
