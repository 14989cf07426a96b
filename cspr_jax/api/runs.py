"""Runs and files looked at from Python: how far they are, and whether they are whole."""

from pathlib import Path
from typing import Any

from cspr_jax.sweep import inspection


def status(directory: str | Path) -> dict[str, Any]:
    """How far a run has come, without touching it.

    Args:
        directory: of the run.

    Returns:
        what `cspr status --json` prints: "identity", "tiles", "shards", "result" and more.

    Raises:
        StoreError: no run directory.
    """
    return inspection.status(Path(directory))


def verify(path: str | Path) -> dict[str, Any]:
    """Read again everything of a run, or of a result or motion file, and check it.

    Args:
        path: a run directory, or a file.

    Returns:
        what `cspr verify --json` prints: counts, and "faults", one line each; none where all is whole.

    Raises:
        StoreError: neither a run directory nor a file.
    """
    return inspection.verify(Path(path))
