"""Files and folders that are complete or absent.

A file gets its name only when it is complete and on the disk: it is written under another name in the same folder,
flushed, renamed, and the folder flushed. A crash leaves the old state or the new one.
"""

import contextlib
import errno
import os
import secrets
from collections.abc import Callable, Iterator
from pathlib import Path

from cspr_jax.errors import StoreError, printable
from cspr_jax.store.files.disk import USUAL, Disk, write_all

LONGEST_NAME = 255  # bytes, on all kinds of disks
# Endings of unfinished files: of this version, and of earlier ones, which named their process.
PART = r"\.(?:[0-9a-f]{12}|\d+)\.part"


def part_of(path: Path) -> Path:
    """Name, which cannot be guessed, under which a file is written until it is complete."""
    return path.with_name(f".{path.name}.{secrets.token_hex(6)}.part")


def check_writable(path: Path | None) -> None:
    """Refuse a path at which no file can be written, before long work begins."""
    if path is None:
        return
    is_long = len(os.fsencode(part_of(path).name)) > LONGEST_NAME
    reasons: tuple[tuple[int, Callable[[], bool]], ...] = (
        (errno.ENAMETOOLONG, lambda: is_long),
        (errno.EISDIR, path.is_dir),
        (errno.ENOENT, lambda: not path.parent.exists()),
        (errno.ENOTDIR, lambda: not path.parent.is_dir()),
        (errno.EACCES, lambda: not os.access(path.parent, os.W_OK | os.X_OK)),
    )
    number = next((number for number, is_so in reasons if is_so()), None)
    if number is not None:
        raise refusal(path, OSError(number, os.strerror(number)))


@contextlib.contextmanager
def new_file(disk: Disk, path: Path, *, mode: int = USUAL) -> Iterator[int]:
    """A file that gets its name if the block ends without an error, and is removed otherwise."""
    part = part_of(path)
    try:
        file = disk.create(part, mode)  # if this fails, a file of that name is not ours and must not be removed
        try:
            try:
                yield file
                disk.sync(file)
            finally:
                os.close(file)
            disk.replace(part, path)
        except BaseException:
            with contextlib.suppress(OSError):  # report the first failure
                disk.unlink(part)
            raise
        disk.sync_folder(path.parent)
    except OSError as error:
        raise refusal(path, error) from error


def publish(disk: Disk, path: Path, data: bytes, *, mode: int = USUAL) -> None:
    """Write a small file completely or not at all."""
    with new_file(disk, path, mode=mode) as file:
        write_all(disk, file, data)


def make_folders(disk: Disk, path: Path) -> None:
    """Make a folder and its parents, and flush each name to the disk before the next."""
    missing = []
    folder = path
    while not folder.is_dir():
        missing.append(folder)
        if folder.parent == folder:
            break
        folder = folder.parent
    try:
        for folder in reversed(missing):
            with contextlib.suppress(FileExistsError):  # somebody made it meanwhile
                disk.make_folder(folder)
            disk.sync_folder(folder.parent)
        if not path.is_dir():
            raise NotADirectoryError(20, "Not a directory")
    except OSError as error:
        raise StoreError(printable(f"{path}: cannot be made: {error.strerror or error}")) from error


def refusal(path: Path, error: OSError) -> StoreError:
    """Error for a file that cannot be written."""
    return StoreError(
        printable(f"{path}: cannot be written: {error.strerror or error}; make room or choose another -o")
    )
