"""Reading a file that anybody may have made: another process does it, which may fail, hang or take all its memory.

That process starts from nothing (`python -I`, in the root folder, without HDF5's plugins), gets the open file
as its standard input, and has a limit of memory and one of processor time that follow from the file's size.
"""

import contextlib
import dataclasses
import importlib.util
import json
import os
import select
import signal
import subprocess
import sys
from collections.abc import Iterator
from io import RawIOBase
from pathlib import Path
from typing import Any, cast

import numpy as np

from cspr_jax.errors import StoreError, one_line
from cspr_jax.schema.quantities import from_outside
from cspr_jax.store.seal import DamagedError, check_mark, check_open, open_regular

# Hashing that many bytes takes a moment; of larger files it is asked before what they hold.
_QUICK = 512 << 20
# Whoever waits that long waits for ever; the limit of processor time comes long before.
_PATIENCE = 60.0
# The package is not taken from the working folder, nor are the libraries; the path of the parent serves last.
_CODE = """import sys
sys.path.extend(sys.argv[2].split("\\n"))
import h5py, numpy
sys.path.insert(0, sys.argv[3])
import cspr_jax
del sys.path[0]
from cspr_jax.store.reader import serve
serve()
"""
_ENDS = {
    signal.SIGXCPU: "HDF5 finds no end in it",
    signal.SIGKILL: "the process that read it was killed",
}


def fetch(path: Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Attributes, axes and quantities of a sealed file, as far as this program writes them.

    Args:
        path: the file, or a link to one.

    Returns:
        its attributes, and its arrays by name.

    Raises:
        DamagedError: it is no file, is damaged, or holds what no file of this program does.
        StoreError: the system refuses to read anything at the moment.
    """
    with _asked(path, "result") as (answer, pipe):
        arrays = {}
        for name, dtype, shape in answer["arrays"]:
            _header(pipe, patience=None)
            arrays[name] = np.empty(shape, dtype)
            if arrays[name].size:
                _fill(pipe, arrays[name].reshape(-1).data.cast("B"))
    return answer["attributes"], arrays


def content(path: Path) -> dict[str, Any] | None:
    """Content of a result, from `store.consolidation.read_content`.

    Args:
        path: the file, or a link to one.

    Returns:
        its fields; None for a motion.

    Raises:
        DamagedError: it is no file, or damaged.
        StoreError: the system refuses to read anything at the moment.
    """
    with _asked(path, "content") as (answer, pipe):
        return None if "motion" in answer else _header(pipe, patience=None)["content"]


@contextlib.contextmanager
def _asked(path: Path, what: str) -> Iterator[tuple[dict[str, Any], RawIOBase]]:
    file = open_regular(path)
    try:
        check_mark(path, file)
        large = os.fstat(file).st_size > _QUICK
        if not large:
            check_open(path, file)
        with _reading(path, file, what) as pipe:
            answer = _header(pipe, patience=_PATIENCE)
            if large:
                check_open(path, file)
            yield answer, pipe
    finally:
        os.close(file)


@contextlib.contextmanager
def _reading(path: Path, file: int, what: str) -> Iterator[RawIOBase]:
    specs = [spec for name in ("h5py", "numpy") if (spec := importlib.util.find_spec(name)) is not None]
    places = {str(Path(spec.origin).parent.parent) for spec in specs if spec.origin is not None}
    home = str(Path(__file__).parents[2])
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "HDF5_PLUGIN_PRELOAD": "::"}
    rows = json.dumps([dataclasses.asdict(quantity) for quantity in from_outside()])
    command = [sys.executable, "-I", "-c", _CODE, what, "\n".join(sorted(places)), home, rows]
    try:
        child = subprocess.Popen(
            command,
            bufsize=0,
            stdin=file,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            cwd="/",
            env=environment,
        )
    except OSError as error:
        raise StoreError(one_line(f"{path}: no process could be started to read it: {error.strerror}")) from error
    with child:
        try:
            yield cast(RawIOBase, child.stdout)
        except EOFError as error:
            code = child.wait()
            if code >= 0:
                raise StoreError(one_line(f"{path}: the process that read it ended with exit code {code}")) from error
            raise DamagedError(_ENDS.get(signal.Signals(-code), "HDF5 fails on it")) from error
        finally:
            child.kill()


def _header(pipe: RawIOBase, *, patience: float | None) -> dict[str, Any]:
    if patience is not None and not select.select([pipe], [], [], patience)[0]:
        raise DamagedError("HDF5 waits for something")
    size = bytearray(8)
    _fill(pipe, memoryview(size))
    data = bytearray(int.from_bytes(size, "little"))
    _fill(pipe, memoryview(data))
    header = json.loads(data)
    if "refused" in header:
        raise DamagedError(header["refused"])
    return header


def _fill(pipe: RawIOBase, place: memoryview) -> None:
    done = 0
    while done < len(place):
        count = pipe.readinto(place[done:])
        if not count:
            raise EOFError
        done += count
