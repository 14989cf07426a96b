"""Reading of files of unknown origin by another process, which may fail, hang or use all of its memory.

That process is isolated (`python -I`, in the root folder, without HDF5's plugins and locks), receives one open file
after the other, and has limits of memory and processor time for each, which depend on the file's size.
"""

import contextlib
import dataclasses
import importlib.util
import io
import json
import os
import select
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from io import RawIOBase
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self, cast

import numpy as np

from cspr_jax.errors import ConfigError, StoreError, printable
from cspr_jax.schema.map_kinds import MAP_KINDS
from cspr_jax.schema.quantities import from_outside
from cspr_jax.store.consolidation import Content
from cspr_jax.store.documents import Header
from cspr_jax.store.files.checksum import NO_TRAILER, DamagedError, check_open, has_trailer, open_regular
from cspr_jax.store.shards import LARGEST_SHARD, Layout, Shard, decode

# Hashing this number of bytes takes a moment; larger files are inspected before they are hashed.
_QUICK = 512 << 20
# Time, s, after which a reader is assumed never to answer; it reaches its limit of processor time long before.
_PATIENCE = 60.0
# Neither package nor libraries are taken from the working folder; the path of the parent comes last.
_CODE = """import sys
sys.path.extend(sys.argv[1].split("\\n"))
import h5py, numpy
sys.path.insert(0, sys.argv[2])
import cspr_jax
del sys.path[0]
from cspr_jax.store.reading.reader import serve
serve()
"""
# Libraries that the process imports; each may be in a folder of its own, as where PYTHONPATH lists several.
_LIBRARIES = ("h5py", "numpy", "pydantic", "pydantic_core", "annotated_types", "typing_extensions", "typing_inspection")
# Signals by which a file can end the process that reads it. Other signals come from people, batch systems or a lack of
# memory, and do not mean that the file is damaged.
_ENDS = {
    signal.SIGXCPU: "HDF5 finds no end in it",
    **dict.fromkeys((signal.SIGSEGV, signal.SIGBUS, signal.SIGABRT, signal.SIGFPE, signal.SIGILL), "HDF5 fails on it"),
}


class _Opened(NamedTuple):
    path: Path
    file: int
    trailer: bytes | None  # None: there is none, or it has not been compared yet, since the file is large
    has_trailer: bool


class Reader:
    """A process that reads files; it starts with the first file, and again after a file on which it failed.

    Fields:
        trusted: trailers of shards that the current process has written, or that were read without an error before; it
            reads these itself.
    """

    def __init__(self) -> None:
        """Nothing is started yet."""
        self.trusted: set[bytes] = set()
        self._child: subprocess.Popen[bytes] | None = None
        self._channel: socket.socket | None = None
        self._pipe: RawIOBase | None = None
        self._idle = False

    def __enter__(self) -> Self:
        """Nothing is started yet."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the process."""
        self._end()

    def result(self, path: Path) -> tuple[dict[str, Any], dict[str, np.ndarray], dict[str, list[str]] | None]:
        """Read the attributes, axes and quantities of a file, as far as this program writes such."""
        with (
            self._opened(path, follow=True, needs_no_trailer=True) as opened,
            self._answered(opened, {"what": "result", "has_trailer": opened.has_trailer}) as (answer, pipe),
        ):
            arrays = {}
            for name, dtype, shape in answer["arrays"]:
                self._header(pipe, patience=None)
                arrays[name] = _array(pipe, dtype, shape)
            return answer["attributes"], arrays, answer["dimensions"]

    def content(self, path: Path, *, follow: bool = False) -> Content | None:
        """Content of a result, from `store.consolidation.content_of`."""
        with self._opened(path, follow=follow) as opened, self._answered(opened, {"what": "content"}) as (answer, pipe):
            return None if "motion" in answer else Content(**self._header(pipe, patience=None)["content"])

    def shard(self, path: Path, layout: Layout, index: int, shape: tuple[int, ...]) -> Shard:
        """Read a shard and check it completely."""
        words = {"what": "shard", "layout": dataclasses.asdict(layout), "index": index, "shape": shape}
        with self._opened(path, maximum=LARGEST_SHARD) as opened:
            if opened.trailer in self.trusted:
                with os.fdopen(os.dup(opened.file), "rb") as data:
                    return decode(io.BytesIO(data.read()), layout, index, shape)
            with self._answered(opened, words) as (answer, pipe):
                values = {name: _array(pipe, dtype, shape) for name, dtype in answer["arrays"]}
            if opened.trailer is not None:
                self.trusted.add(opened.trailer)
            return Shard(**answer["shard"], values=values)

    def header(self, path: Path) -> Header:
        """Header of a shard of any run."""
        with (
            self._opened(path, maximum=LARGEST_SHARD) as opened,
            self._answered(opened, {"what": "header"}) as (answer, _),
        ):
            return Header(**answer["header"])

    @contextlib.contextmanager
    def _opened(
        self, path: Path, *, follow: bool = False, maximum: int | None = None, needs_no_trailer: bool = False
    ) -> Iterator["_Opened"]:
        file = open_regular(path, follow=follow)
        try:
            length = os.fstat(file).st_size
            if maximum is not None and length > maximum:
                raise DamagedError("it is not a file of a fitting size")
            is_marked = has_trailer(path, file)
            if not (is_marked or needs_no_trailer):
                raise DamagedError(NO_TRAILER)
            yield _Opened(path, file, check_open(path, file) if is_marked and length <= _QUICK else None, is_marked)
        finally:
            os.close(file)

    @contextlib.contextmanager
    def _answered(self, opened: "_Opened", words: dict[str, Any]) -> Iterator[tuple[dict[str, Any], RawIOBase]]:
        path, file, trailer, is_marked = opened
        try:
            pipe = self._sent(path, file, words)
            answer = self._header(pipe, patience=_PATIENCE)
            if trailer is None and is_marked:
                check_open(path, file)
            yield answer, pipe
        except EOFError as error:
            raise self._ended(path) from error
        except DamagedError:
            if trailer is not None:
                check_open(path, file)  # if the disk fails now, that does not mean that the file is damaged
            raise
        self._idle = True

    def _sent(self, path: Path, file: int, words: dict[str, Any]) -> RawIOBase:
        # Replace a process that has died, or has not finished its last file.
        if self._child is None or self._child.poll() is not None or not self._idle:
            self._end()
            self._start(path)
        channel, pipe = cast(socket.socket, self._channel), cast(RawIOBase, self._pipe)
        data = json.dumps(words).encode()
        data = len(data).to_bytes(8, "little") + data
        self._idle = False
        try:
            channel.sendall(data[socket.send_fds(channel, [data], [file]) :])
        except OSError as error:
            raise EOFError from error
        return pipe

    def _start(self, path: Path) -> None:
        home = str(Path(__file__).parents[3])
        settings = {"OPENBLAS_NUM_THREADS": "1", "HDF5_PLUGIN_PRELOAD": "::", "HDF5_USE_FILE_LOCKING": "FALSE"}
        with contextlib.suppress(ConfigError):  # reported when its map is looked up
            MAP_KINDS.complete()
        quantities = json.dumps([dataclasses.asdict(quantity) for quantity in from_outside()])
        command = [sys.executable, "-I", "-c", _CODE, "\n".join(_library_folders()), home, quantities]
        current, there = socket.socketpair()
        with there:
            try:
                # The process has its own session, so that a Ctrl-C reaches only this process.
                self._child = subprocess.Popen(
                    command,
                    stdin=there.fileno(),
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL,
                    cwd="/",
                    env=os.environ | settings,
                    start_new_session=True,
                )
            except OSError as error:
                current.close()
                line = f"{path}: no process could be started to read it: {error.strerror}"
                raise StoreError(printable(line)) from error
        self._channel, self._pipe = current, current.makefile("rb", buffering=0)
        try:
            self._header(self._pipe, patience=None)
        except EOFError as error:
            line = f"{path}: the process that reads it did not start: exit code {self._child.wait()}"
            raise StoreError(printable(line)) from error

    def _ended(self, path: Path) -> StoreError | DamagedError:
        code = cast(subprocess.Popen[bytes], self._child).wait()
        if -code in _ENDS:
            return DamagedError(_ENDS[signal.Signals(-code)])
        end = f"was killed: signal {-code}" if code < 0 else f"ended with exit code {code}"
        return StoreError(printable(f"{path}: the process that read it {end}; run it again"))

    def _end(self) -> None:
        for end in (self._pipe, self._channel):
            if end is not None:
                end.close()
        if self._child is not None:
            self._child.kill()
            self._child.wait()
        self._child = self._channel = self._pipe = None

    def _header(self, pipe: RawIOBase, *, patience: float | None) -> dict[str, Any]:
        if patience is not None and not select.select([pipe], [], [], patience)[0]:
            raise DamagedError("HDF5 waits for something")
        length = bytearray(8)
        _fill(pipe, memoryview(length))
        data = bytearray(int.from_bytes(length, "little"))
        _fill(pipe, memoryview(data))
        header = json.loads(data)
        self._idle = "refused" in header or "failed" in header
        if "failed" in header:
            raise StoreError(printable(header["failed"]))
        if "refused" in header:
            raise DamagedError(header["refused"])
        return header


def _library_folders() -> list[str]:
    specs = [spec for name in _LIBRARIES if (spec := importlib.util.find_spec(name)) is not None]
    depths = [(spec.origin, 1 if spec.submodule_search_locations else 0) for spec in specs]
    return sorted({str(Path(origin).parents[depth]) for origin, depth in depths if origin is not None})


def _array(pipe: RawIOBase, dtype: str, shape: list[int] | tuple[int, ...]) -> np.ndarray:
    array = np.empty(shape, dtype)
    if array.size:
        _fill(pipe, array.reshape(-1).data.cast("B"))
    return array


def _fill(pipe: RawIOBase, buffer: memoryview) -> None:
    done = 0
    while done < len(buffer):
        try:
            count = pipe.readinto(buffer[done:])
        except ConnectionError as error:
            raise EOFError from error
        if not count:
            raise EOFError
        done += count
