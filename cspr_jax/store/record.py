"""run.json: what a run directory belongs to, written once, with a checksum of its own."""

import json
from pathlib import Path

from cspr_jax.schema.identity import digest
from cspr_jax.store.documents import Record, document, plain_json
from cspr_jax.store.files.checksum import DamagedError, read_regular
from cspr_jax.store.files.disk import READ_ONLY, Disk
from cspr_jax.store.files.publishing import publish

LARGEST_RECORD = 64 << 20


def write_record(disk: Disk, path: Path, record: Record) -> None:
    """Write run.json."""
    content = record.model_dump()
    text = json.dumps({**content, "checksum": digest(content)}, indent=1, allow_nan=False)
    publish(disk, path, (text + "\n").encode(), mode=READ_ONLY)


def read_record(path: Path) -> Record:
    """Read run.json."""
    content = plain_json(read_regular(path, LARGEST_RECORD))
    if not isinstance(content, dict) or content.keys() != Record.model_fields.keys() | {"checksum"}:
        raise DamagedError("it is not a record of cspr")
    checksum = content.pop("checksum")
    if digest(content) != checksum:
        raise DamagedError("its content has changed")
    return document(Record, content, "its content")
