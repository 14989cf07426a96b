"""run.json: what a run directory belongs to, written once, with a checksum of its own."""

import dataclasses
import json
from pathlib import Path
from typing import Any

from cspr_jax.schema.identity import digest
from cspr_jax.store.disk import READ_ONLY, Disk
from cspr_jax.store.netcdf import file_size
from cspr_jax.store.publishing import publish
from cspr_jax.store.seal import DamagedError, unreadable

LARGEST_RECORD = 64 << 20
_KEYS = {"identity", "settings", "environment", "source"}


@dataclasses.dataclass(frozen=True)
class Record:
    """Content of run.json.

    Fields:
        identity: of the sweep.
        settings: resolved, what the identity is the hash of.
        environment: what computes.
        source: name and text of the sweep file, and the command; no decision uses them.
    """

    identity: str
    settings: dict[str, Any]
    environment: dict[str, Any]
    source: dict[str, Any]


def write_record(disk: Disk, path: Path, record: Record) -> None:
    """Write run.json.

    Args:
        disk: what to write with.
        path: its name.
        record: its content.

    Raises:
        StoreError: the disk or the folder refuses.
    """
    content = dataclasses.asdict(record)
    text = json.dumps({**content, "checksum": digest(content)}, indent=1, allow_nan=False)
    publish(disk, path, (text + "\n").encode(), mode=READ_ONLY)


def read_record(path: Path) -> Record:
    """Read run.json.

    Args:
        path: its name.

    Returns:
        its content.

    Raises:
        DamagedError: it is not what was written, or was not written by this program.
        StoreError: the system refuses to read anything at the moment.
    """
    if not 0 <= file_size(path) <= LARGEST_RECORD:
        raise DamagedError("it is not a file of a fitting size")
    try:
        content = json.loads(path.read_bytes())
    except OSError as error:
        raise unreadable(path, error) from error
    except (ValueError, RecursionError) as error:
        raise DamagedError(f"it cannot be read: {error}") from error
    if not isinstance(content, dict) or content.keys() != _KEYS | {"checksum"}:
        raise DamagedError("it is not a record of cspr")
    checksum = content.pop("checksum")
    if digest(content) != checksum:
        raise DamagedError("its content has changed")
    return Record(**content)
