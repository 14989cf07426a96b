"""A file that HDF5 writes through."""

import io
import os

from cspr_jax.store.files.disk import Disk, write_all


class DiskFile(io.RawIOBase):
    """A new file that HDF5 writes through, and that never raises an error within HDF5.

    HDF5 can crash the interpreter if a write fails and it then has to close the file. So the first failure is kept, all
    later writes are dropped, and `raise_failure` reports it.

    Args:
        file: descriptor of an empty file.
    """

    def __init__(self, disk: Disk, file: int) -> None:
        """Start at the beginning."""
        self._disk, self._file, self._at, self._length = disk, file, 0, 0
        self._failure: BaseException | None = None

    @property
    def length(self) -> int:
        """Number of bytes of the file."""
        return self._length

    def raise_failure(self) -> None:
        """Raise the first failure, if there was one."""
        if self._failure is not None:
            raise self._failure

    def seek(self, offset: int, whence: int = os.SEEK_SET, /) -> int:
        """Go to an offset."""
        self._at = offset + {os.SEEK_SET: 0, os.SEEK_CUR: self._at, os.SEEK_END: self._length}[whence]
        return self._at

    def tell(self) -> int:
        """Position at which reading and writing goes on."""
        return self._at

    def readinto(self, buffer, /) -> int:
        """Read what has been written, or keep the failure."""
        view = memoryview(buffer).cast("B")
        try:
            data = os.pread(self._file, len(view), self._at)
        except OSError as failure:
            self._failure, data = self._failure or failure, b""
        view[: len(data)] = data
        self._at += len(data)
        return len(data)

    def write(self, data, /) -> int:
        """Write all of the data, or keep the failure."""
        view = memoryview(data).cast("B")
        if self._failure is None:
            try:
                write_all(self._disk, self._file, bytes(view), self._at)
            except BaseException as failure:  # noqa: BLE001 - whatever it is, it must not pass through HDF5
                self._failure = failure
        self._at += len(view)
        self._length = max(self._length, self._at)
        return len(view)

    def truncate(self, length: int | None = None, /) -> int:
        """Set the size, or keep the failure."""
        self._length = self._at if length is None else length
        if self._failure is None:
            try:
                self._disk.truncate(self._file, self._length)
            except BaseException as failure:  # noqa: BLE001 - as above
                self._failure = failure
        return self._length

    def readable(self) -> bool:
        """It can be read."""
        return True

    def writable(self) -> bool:
        """It can be written."""
        return True

    def seekable(self) -> bool:
        """It has offsets."""
        return True
