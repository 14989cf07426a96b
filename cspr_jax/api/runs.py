"""Runs and files looked at from Python: how far they are, and whether they are whole."""

from pathlib import Path
from typing import Any

from cspr_jax.api.argument_checks import checked
from cspr_jax.runtime.xla import keep_compiled_code as _keep_compiled_code
from cspr_jax.store.result import open_result as _open_result
from cspr_jax.sweep import inspection

keep_compiled_code = checked(_keep_compiled_code, "keep_compiled_code", __name__)
open_result = checked(_open_result, "open_result", __name__)


@checked
def status(directory: str | Path) -> dict[str, Any]:
    """How far a run has come, without touching it.

    Returns:
        what `cspr status --json` prints: "identity", "tiles", "shards", "result" and more.

    Raises:
        StoreError: no run directory.
    """
    return inspection.status(Path(directory))


@checked
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
