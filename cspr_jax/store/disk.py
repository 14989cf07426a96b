"""Everything that changes a disk, one system call a method: tests put a failing disk in its place."""

import os
from pathlib import Path

READ_ONLY = 0o444
USUAL = 0o644


class Disk:
    """The calls that change a disk."""

    def create(self, path: Path, mode: int = USUAL) -> int:
        """Open an empty file for writing and reading.

        Args:
            path: its name; what is there is emptied.
            mode: its permissions.

        Returns:
            a file descriptor.
        """
        return os.open(path, os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, mode)

    def write(self, file: int, data: bytes, offset: int) -> int:
        """Write some of the data, perhaps not all.

        Args:
            file: descriptor.
            data: what to write.
            offset: where.

        Returns:
            how many bytes were written.
        """
        return os.pwrite(file, data, offset)

    def truncate(self, file: int, size: int) -> None:
        """Set the size of a file.

        Args:
            file: descriptor.
            size: bytes.
        """
        os.ftruncate(file, size)

    def sync(self, file: int) -> None:
        """Flush a file to the disk.

        Args:
            file: descriptor.
        """
        os.fsync(file)

    def replace(self, part: Path, path: Path) -> None:
        """Rename a file, over another if there is one.

        Args:
            part: its name.
            path: its new name.
        """
        os.replace(part, path)

    def sync_folder(self, path: Path) -> None:
        """Flush the names in a folder to the disk.

        Args:
            path: the folder.
        """
        folder = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)

    def unlink(self, path: Path) -> None:
        """Remove a file.

        Args:
            path: its name.
        """
        os.unlink(path)

    def make_folder(self, path: Path) -> None:
        """Make a folder whose parent is there.

        Args:
            path: its name.
        """
        os.mkdir(path)

    def append(self, path: Path, data: bytes) -> None:
        """Add to the end of a file; it is made if absent.

        Args:
            path: its name.
            data: what to add.
        """
        how = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
        file = os.open(path, how, USUAL)
        try:
            os.write(file, data)
        finally:
            os.close(file)


def write_all(disk: Disk, file: int, data: bytes, offset: int = 0) -> None:
    """Write all of the data, in as many calls as it takes.

    Args:
        disk: what to write with.
        file: descriptor.
        data: what to write.
        offset: where.

    Raises:
        OSError: the disk refuses.
    """
    done = 0
    while done < len(data):
        done += disk.write(file, data[done:], offset + done)
