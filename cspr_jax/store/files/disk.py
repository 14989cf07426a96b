"""All calls that change a disk, one system call for each method, so that tests can replace them by failing ones."""

import errno
import os
import stat
from pathlib import Path

READ_ONLY = 0o444
USUAL = 0o644


class Disk:
    """Calls that change a disk."""

    def create(self, path: Path, mode: int = USUAL) -> int:
        """Make a file, and open it for writing and reading."""
        return os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, mode)

    def write(self, file: int, data: bytes, offset: int) -> int:
        """Write some of the data, perhaps not all."""
        return os.pwrite(file, data, offset)

    def truncate(self, file: int, length: int) -> None:
        """Set the size of a file."""
        os.ftruncate(file, length)

    def sync(self, file: int) -> None:
        """Flush a file to the disk."""
        os.fsync(file)

    def replace(self, part: Path, path: Path) -> None:
        """Rename a file, replacing another if there is one."""
        os.replace(part, path)

    def sync_folder(self, path: Path) -> None:
        """Flush the names in a folder to the disk."""
        folder = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)

    def unlink(self, path: Path) -> None:
        """Remove a file."""
        os.unlink(path)

    def make_folder(self, path: Path) -> None:
        """Make a folder in an existing one."""
        os.mkdir(path)

    def append(self, path: Path, data: bytes) -> None:
        """Append to a regular file, which is made if it is absent."""
        file = open_plain(path, os.O_WRONLY | os.O_APPEND)
        try:
            os.write(file, data)
        finally:
            os.close(file)


def open_plain(path: Path, how: int) -> int:
    """Open for writing, or make, a regular file that has no other name."""
    check_plain(path)  # before opening, which may have effects on a device; checked again afterwards
    file = os.open(path, how | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_NOCTTY, USUAL)
    try:
        _check_plain(os.fstat(file))
    except OSError:
        os.close(file)
        raise
    return file


def check_plain(path: Path) -> None:
    """Refuse a file that `open_plain` would refuse, without opening it; a name without a file is accepted."""
    if os.path.lexists(path):
        _check_plain(os.lstat(path))


def _check_plain(status: os.stat_result) -> None:
    if not stat.S_ISREG(status.st_mode):
        raise OSError(errno.EINVAL, "it must be a file, not a link, a folder or a pipe")
    if status.st_nlink > 1:
        raise OSError(errno.EMLINK, f"it must be a file with one name, and it has {status.st_nlink} (hard links)")


def write_all(disk: Disk, file: int, data: bytes, offset: int = 0) -> None:
    """Write all of the data, in as many calls as it takes."""
    done = 0
    while done < len(data):
        done += disk.write(file, data[done:], offset + done)
