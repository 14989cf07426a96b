"""Announcements of stages of the work, for users who wait; listeners show them, and this module prints nothing."""

import contextlib
import threading
from collections.abc import Callable, Iterator

Listener = Callable[[str], None]


class _Board:
    # The work in progress: nested parts, outermost first, and the function that each thread compiles.

    def __init__(self) -> None:
        self.listener: Listener | None = None
        self.amount_listener: Listener | None = None
        self.around: list[str] = []
        self.now = ""
        self.compiling: dict[int, str] = {}

    def tell(self) -> None:
        listener = self.listener
        if listener is None:
            return
        parts = [*self.around, self.now]
        # Usually users wait longest for the function whose compilation began last.
        parts += [f"compiling {name}" for name in list(self.compiling.values())[-1:]]
        listener(": ".join(part for part in parts if part))


_board = _Board()


def stage(text: str) -> None:
    """Announce the stage that begins now."""
    _board.now = text
    _board.tell()


def amount(text: str) -> None:
    """Announce the amount of work that begins now, if it may take minutes."""
    if _board.amount_listener is not None:
        _board.amount_listener(text)


@contextlib.contextmanager
def within(text: str) -> Iterator[None]:
    """Announce work whose parts are the stages of the block."""
    _board.around.append(text)
    stage("")
    try:
        yield
    finally:
        _board.around.pop()
        _board.now = ""


def compiling(name: str | None) -> None:
    """Announce the function that this thread compiles."""
    _board.compiling.pop(threading.get_ident(), None)
    if name is not None:
        _board.compiling[threading.get_ident()] = name
    _board.tell()


@contextlib.contextmanager
def heard(listener: Listener, amounts: Listener | None = None) -> Iterator[None]:
    """Listen to the stages while the block runs."""
    before = _board.listener, _board.amount_listener
    _board.listener, _board.amount_listener = listener, amounts
    try:
        yield
    finally:
        _board.listener, _board.amount_listener = before
