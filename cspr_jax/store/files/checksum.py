"""Checksum trailer: a line at the end of a file with the SHA-256 of all bytes before it.

HDF5 and netCDF ignore it. It is checked before HDF5 reads a file, since a damaged file can give wrong values without an
error, or keep the library busy for ever.
"""

import errno
import hashlib
import os
import stat
from pathlib import Path

from cspr_jax.errors import StoreError, printable
from cspr_jax.store.files.disk import Disk, write_all

_PREFIX = b"\ncspr_jax, sha256 of all before this line: "
LENGTH = len(_PREFIX) + 64 + 1
_STEP = 1 << 20
NO_TRAILER = "it is not whole, or not of cspr"


# Errors that mean that there is nothing of this name, or that it is no regular file. All others come from the system or
# the disk, and do not mean that the file is missing or damaged.
_NO_FILE = {errno.ENOENT, errno.ENOTDIR, errno.EISDIR, errno.ELOOP, errno.ENXIO, errno.ENODEV, errno.ENAMETOOLONG}


class DamagedError(Exception):
    """A file that differs from what was written."""


def unreadable(path: Path, error: OSError) -> DamagedError | StoreError:
    """Error for a file that cannot be read."""
    reason = error.strerror or str(error)
    if error.errno in _NO_FILE:
        return DamagedError(f"it cannot be read: {reason}")
    return StoreError(printable(f"{path}: cannot be read: {reason}; mend that, or remove the file, and run again"))


def with_trailer(data: bytes) -> bytes:
    """Data with their checksum trailer."""
    return data + _line(hashlib.sha256(data).hexdigest())


def trailer_of(data: bytes) -> bytes:
    """The checksum trailer at the end of data."""
    return data[-LENGTH:]


def write_trailer(disk: Disk, file: int, length: int) -> None:
    """Write the checksum trailer of a file that is open."""
    write_all(disk, file, _line(_hash(file, length)), length)


def open_regular(path: Path, *, follow: bool = True) -> int:
    """Open a regular file for reading; others are refused, since a pipe would keep its reader waiting."""
    try:
        # Check the kind before opening, which may have effects on a device, and again afterwards.
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


def read_regular(path: Path, maximum: int, *, last: bool = False) -> bytes:
    """Content of a regular file of a run directory; links are refused."""
    file = open_regular(path, follow=False)
    try:
        length = os.fstat(file).st_size
        if length > maximum and not last:
            raise DamagedError("it is not a file of a fitting size")
        return _bytes_of(file, min(length, maximum), max(length - maximum, 0))
    except OSError as error:
        raise unreadable(path, error) from error
    finally:
        os.close(file)


def has_trailer(path: Path, file: int) -> bool:
    """Tell whether an open file ends with a checksum trailer, without reading all of it."""
    try:
        line = os.pread(file, LENGTH, max(os.fstat(file).st_size - LENGTH, 0))
    except OSError as error:
        raise unreadable(path, error) from error
    return line.startswith(_PREFIX)


def check_open(path: Path, file: int) -> bytes:
    """Compare an open file with its checksum trailer, and return the trailer."""
    try:
        length = os.fstat(file).st_size - LENGTH
        line = os.pread(file, LENGTH, max(length, 0))
        _check(line, _hash(file, length))
    except OSError as error:
        raise unreadable(path, error) from error
    return line


def _line(digest: str) -> bytes:
    return _PREFIX + digest.encode() + b"\n"


def _check(line: bytes, digest: str) -> None:
    if not line.startswith(_PREFIX):
        raise DamagedError(NO_TRAILER)
    if line != _line(digest):
        raise DamagedError("its bytes have changed")


def _hash(file: int, length: int) -> str:
    total, offset = hashlib.sha256(), 0
    while offset < length:
        data = os.pread(file, min(_STEP, length - offset), offset)
        if not data:
            break
        total.update(data)
        offset += len(data)
    return total.hexdigest()


def _bytes_of(file: int, length: int, offset: int) -> bytes:
    parts = []
    while length > 0 and (data := os.pread(file, min(_STEP, length), offset)):
        parts.append(data)
        length, offset = length - len(data), offset + len(data)
    return b"".join(parts)
