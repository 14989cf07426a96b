"""Volumes of workspaces from Python: of a map, with the error that its grid leaves."""

from pathlib import Path

from cspr_jax.outputs.volumes import WorkspaceVolume, volume_of
from cspr_jax.store.result import Result, open_result

__all__ = ["WorkspaceVolume", "workspace_volume"]


def workspace_volume(result: Result | str | Path) -> WorkspaceVolume:
    """Volume of the workspace that a map has found, or its area where the map is a section.

    Args:
        result: of a sweep of a map with verdicts, in memory or its file.

    Returns:
        the volume; arrays over the axes that are no coordinates of places, () without any.

    Raises:
        InputError: no map, no stored verdicts, or a single place.
        StoreError: no result file.
    """
    return volume_of(result if isinstance(result, Result) else open_result(Path(result)))
