"""A line behind the last byte of a file that holds the SHA-256 of all before it.

HDF5 and netCDF take no notice of it. It is checked before HDF5 reads a file: a damaged one can
give wrong values without an error, or keep the library busy for ever.
"""

import errno
import hashlib
import os
import stat
from pathlib import Path

from cspr_jax.errors import StoreError, printable
from cspr_jax.store.files.disk import Disk, write_all

_MARK = b"\ncspr_jax, sha256 of all before this line: "
LENGTH = len(_MARK) + 64 + 1
_STEP = 1 << 20
UNSEALED = "it is not whole, or not of cspr"


# These errors mean that nothing is there, or that it is no file. Every other refusal comes from the system or the disk,
# and says nothing about the file.
_NO_FILE = {errno.ENOENT, errno.ENOTDIR, errno.EISDIR, errno.ELOOP, errno.ENXIO, errno.ENODEV, errno.ENAMETOOLONG}


class DamagedError(Exception):
    """A file that is not what was written."""


def unreadable(path: Path, error: OSError) -> DamagedError | StoreError:
    """Error for a file that cannot be read."""
    reason = error.strerror or str(error)
    if error.errno in _NO_FILE:
        return DamagedError(f"it cannot be read: {reason}")
    return StoreError(printable(f"{path}: cannot be read: {reason}; mend that, or remove the file, and run again"))


def sealed(data: bytes) -> bytes:
    """Data with their seal."""
    return data + _line(hashlib.sha256(data).hexdigest())


def seal_of(data: bytes) -> bytes:
    """The seal at the end of data."""
    return data[-LENGTH:]


def seal_file(disk: Disk, file: int, size: int) -> None:
    """Seal a file that is open."""
    write_all(disk, file, _line(_hash(file, size)), size)


def open_regular(path: Path, *, follow: bool = True) -> int:
    """Open a file for reading, and only a file: a pipe would keep its reader waiting."""
    try:
        # Opening a device can do something to it, so it is looked at before, and again against a change between.
        if not stat.S_ISREG(os.stat(path, follow_symlinks=follow).st_mode):
            raise DamagedError("it is not a file")
        how = os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK | os.O_NOCTTY | (0 if follow else os.O_NOFOLLOW)
        file = os.open(path, how)
    except ValueError as error:  # a name with a null byte
        raise DamagedError(f"it cannot be read: {error}") from error
    except OSError as error:
        raise unreadable(path, error) from error
    if not stat.S_ISREG(os.fstat(file).st_mode):
        os.close(file)
        raise DamagedError("it is not a file")
    return file


def read_regular(path: Path, most: int, *, last: bool = False) -> bytes:
    """Content of a file of a run directory, which is no link."""
    file = open_regular(path, follow=False)
    try:
        size = os.fstat(file).st_size
        if size > most and not last:
            raise DamagedError("it is not a file of a fitting size")
        return _bytes_of(file, min(size, most), max(size - most, 0))
    except OSError as error:
        raise unreadable(path, error) from error
    finally:
        os.close(file)


def has_mark(path: Path, file: int) -> bool:
    """Tell whether an open file ends with a seal; files of others need not be read whole."""
    try:
        line = os.pread(file, LENGTH, max(os.fstat(file).st_size - LENGTH, 0))
    except OSError as error:
        raise unreadable(path, error) from error
    return line.startswith(_MARK)


def check_open(path: Path, file: int) -> bytes:
    """Compare an open file with its seal."""
    try:
        size = os.fstat(file).st_size - LENGTH
        line = os.pread(file, LENGTH, max(size, 0))
        _check(line, _hash(file, size))
    except OSError as error:
        raise unreadable(path, error) from error
    return line


def _line(digest: str) -> bytes:
    return _MARK + digest.encode() + b"\n"


def _check(line: bytes, digest: str) -> None:
    if not line.startswith(_MARK):
        raise DamagedError(UNSEALED)
    if line != _line(digest):
        raise DamagedError("its bytes have changed")


def _hash(file: int, size: int) -> str:
    total, place = hashlib.sha256(), 0
    while place < size:
        data = os.pread(file, min(_STEP, size - place), place)
        if not data:
            break
        total.update(data)
        place += len(data)
    return total.hexdigest()


def _bytes_of(file: int, size: int, place: int) -> bytes:
    parts = []
    while size > 0 and (data := os.pread(file, min(_STEP, size), place)):
        parts.append(data)
        size, place = size - len(data), place + len(data)
    return b"".join(parts)
