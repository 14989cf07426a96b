"""One process reads the files of many tests, as one reads those of a command; where reading is tested, each its own."""

import contextlib
from collections.abc import Iterator

import pytest

from cspr_jax.schema.quantities import from_outside
from cspr_jax.store.reading.isolated import Reader

APART = ("reliability", "store", "sweep")
_PARTS = ("_child", "_channel", "_pipe", "_idle")
_spare: list[tuple] = []  # what the process knows of quantities, and the parts of the reader that it belongs to


def _taken(reader: Reader) -> Reader:
    for name, part in zip(_PARTS, _spare.pop()[1], strict=True):
        setattr(reader, name, part)
    return reader


def _enter(self: Reader) -> Reader:
    return _taken(self) if _spare and _spare[0][0] == from_outside() else self


def _exit(self: Reader, *_: object) -> None:
    if self._child is not None and self._idle and not _spare and self._child.poll() is None:
        _spare.append((from_outside(), [getattr(self, name) for name in _PARTS]))
        self._child = self._channel = self._pipe = None
    else:
        self._end()


@contextlib.contextmanager
def shared(folder: str) -> Iterator[None]:
    """Within it, tests of a folder share a process."""
    with pytest.MonkeyPatch.context() as patch:
        if folder not in APART:
            patch.setattr(Reader, "__enter__", _enter)
            patch.setattr(Reader, "__exit__", _exit)
        yield
    if _spare:
        _taken(Reader())._end()
