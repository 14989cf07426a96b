"""Ownership of a run directory: which sweep and environment may continue in it."""

import contextlib
import os
from pathlib import Path
from typing import Any

from cspr_jax.errors import RefusedError, printable
from cspr_jax.schema.identity import differences, digest
from cspr_jax.store.consolidation import Content
from cspr_jax.store.documents import Record, read_record, write_record
from cspr_jax.store.files.checksum import DamagedError
from cspr_jax.store.folder import RunFolder
from cspr_jax.store.reading.isolated import Reader
from cspr_jax.sweep.definition import Sweep


def refuse_other_sweep(sweep: Sweep, folder: RunFolder, reader: Reader) -> None:
    """Refuse a directory that belongs to another sweep."""
    record = _record(folder.record)
    if record is not None:
        if record.identity != sweep.identity:
            raise RefusedError(*differing(sweep, folder, record.settings))
        return
    # Without a valid record, take the identity of the sweep from shards and results.
    for path in sorted(folder.path.glob("*.h5")):
        content = content_at(path, reader)
        if isinstance(content, Content) and content.identity != sweep.identity:
            raise RefusedError(*differing(sweep, folder, content.settings))
    if {identity for identity, _ in _owners(folder, reader)} - {sweep.identity}:
        raise RefusedError(printable(f"{folder.path}: holds shards of another sweep: choose another -o"))


def refuse_strangers(folder: RunFolder, reader: Reader) -> None:
    """Refuse a directory in which files of other origin have names of a run's files.

    A run makes its lock before anything else: where there is a lock, an incomplete file is a damaged one of a run.
    """
    if folder.lock.exists() or _record(folder.record) is not None or _owners(folder, reader):
        return
    inside = sorted(folder.shards.iterdir()) if folder.shards.is_dir() else [folder.shards]
    if strangers := [path for path in (folder.record, *inside) if os.path.lexists(path)]:
        raise RefusedError(printable(f"{strangers[0]}: is somebody's file, not of a run of cspr: choose another -o"))


def differing(sweep: Sweep, folder: RunFolder, settings: dict[str, Any]) -> list[str]:
    """Differences between a sweep and the one that a directory belongs to."""
    lines = differences(sweep.settings, settings) or ["the format of the run differs"]
    return [printable(f"{folder.path}: {line}: must be equal, or another -o") for line in lines]


def refuse_other_environment(folder: RunFolder, environment: dict[str, Any], accept: bool, reader: Reader) -> None:
    """Refuse to continue with another program, library or machine than the run began with."""
    record = _record(folder.record)
    if accept or (record is not None and record.environment == environment):
        return
    advice = "--accept-environment-change mixes them, another -o starts anew"
    if record is None:
        if {theirs for _, theirs in _owners(folder, reader)} - {digest(environment)}:
            raise RefusedError(printable(f"{folder.path}: its shards were computed in another environment: {advice}"))
        return
    lines = differences(environment, record.environment)
    raise RefusedError(*(printable(f"{folder.path}: {line}: {advice}") for line in lines))


def refuse_worker(expected: dict[str, Any], actual: dict[str, Any]) -> None:
    """Refuse a tile of a worker whose environment differs from that of the run."""
    if actual == expected:
        return
    advice = "--accept-environment-change takes it"
    lines = differences(actual, expected)
    raise RefusedError(*(printable(f"a worker differs from the run: {line}: {advice}") for line in lines))


def damage(path: Path) -> str | None:
    """Damage of a run.json, in words; None if there is none."""
    if not (path.exists() or path.is_symlink()):
        return None
    try:
        read_record(path)
    except DamagedError as error:
        return str(error)
    return None


def own_record(sweep: Sweep, folder: RunFolder, environment: dict[str, Any], command: tuple[str, ...]) -> Record:
    """Record of a directory that belongs to the sweep, written if it is missing."""
    present = _record(folder.record)
    if present is not None:
        return present
    source = {"file": sweep.file.name, "text": sweep.text, "command": list(command)}
    record = Record(identity=sweep.identity, settings=sweep.settings, environment=environment, source=source)
    write_record(folder.disk, folder.record, record)
    return record


def _record(path: Path) -> Record | None:
    # Record of a directory; None where it is missing or damaged.
    try:
        return read_record(path)
    except DamagedError:
        return None


def content_at(path: Path, reader: Reader) -> Content | str:
    """Content of a result in a run directory, or its damage in words."""
    try:
        return reader.content(path) or "it is a motion"
    except DamagedError as error:
        return str(error)


def _owners(folder: RunFolder, reader: Reader) -> set[tuple[str, str]]:
    # Identities of sweeps with hashes of environments, from all shards that are not damaged.
    owners = set()
    for path in folder.shard_names():
        with contextlib.suppress(DamagedError):
            header = reader.header(path)
            owners.add((header.identity, header.environment))
    return owners
