"""A line behind the last byte of a file that holds the SHA-256 of all before it.

HDF5 and netCDF take no notice of it. It is checked before HDF5 reads a file: a damaged one can
give wrong values without an error, or keep the library busy for ever.
"""

import errno
import hashlib
import os
from pathlib import Path

from cspr_jax.errors import StoreError, one_line
from cspr_jax.store.disk import Disk, write_all

_MARK = b"\ncspr_jax, sha256 of all before this line: "
LENGTH = len(_MARK) + 64 + 1
_STEP = 1 << 20


# What a process or system lacks at the moment, or may not do: it says nothing about the file.
_PASSING = {errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.EACCES, errno.EPERM, errno.ESTALE, errno.ETIMEDOUT}


class DamagedError(Exception):
    """A file that is not what was written."""


def unreadable(path: Path, error: OSError) -> DamagedError | StoreError:
    """What a file is that cannot be read.

    Args:
        path: the file.
        error: the system's.

    Returns:
        the error to raise: damage, or a refusal that may pass.
    """
    if error.errno in _PASSING:
        return StoreError(one_line(f"{path}: cannot be read: {error.strerror}; mend that and run again"))
    return DamagedError(f"it cannot be read: {error.strerror or error}")


def sealed(data: bytes) -> bytes:
    """Data with their seal.

    Args:
        data: anything.

    Returns:
        the data and the line.
    """
    return data + _line(hashlib.sha256(data).hexdigest())


def unsealed(data: bytes) -> bytes:
    """Data without their seal.

    Args:
        data: as `sealed` gives them.

    Returns:
        the data before the line.

    Raises:
        DamagedError: there is no seal, or it does not fit.
    """
    content, line = data[:-LENGTH], data[-LENGTH:]
    _check(line, hashlib.sha256(content).hexdigest())
    return content


def seal_file(disk: Disk, file: int, size: int) -> None:
    """Seal a file that is open.

    Args:
        disk: what to write with.
        file: descriptor.
        size: of its content, bytes.

    Raises:
        OSError: the disk refuses.
    """
    write_all(disk, file, _line(_hash(file, size)), size)


def check_file(path: Path) -> None:
    """Compare a file with its seal.

    Args:
        path: the file.

    Raises:
        DamagedError: it is no regular file, cannot be read, has no seal, or one that does not fit.
        StoreError: the system refuses to read anything at the moment.
    """
    try:
        file = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
    except OSError as error:
        raise unreadable(path, error) from error
    try:
        size = os.fstat(file).st_size - LENGTH
        line = os.pread(file, LENGTH, max(size, 0))
        # Files of others need not be read whole.
        _check(line, _hash(file, size) if line.startswith(_MARK) else "")
    except OSError as error:
        raise unreadable(path, error) from error
    finally:
        os.close(file)


def _line(digest: str) -> bytes:
    return _MARK + digest.encode() + b"\n"


def _check(line: bytes, digest: str) -> None:
    if not line.startswith(_MARK):
        raise DamagedError("it is not whole, or not of cspr")
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
