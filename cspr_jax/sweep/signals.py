"""Ctrl-C and SIGTERM: a flag that is looked at between tiles, so that the tile in progress is kept."""

import contextlib
import os
import signal
import threading
from collections.abc import Callable, Iterator
from types import FrameType

from cspr_jax.errors import ExitCode

CODES = {signal.SIGINT: ExitCode.INTERRUPTED, signal.SIGTERM: ExitCode.TERMINATED}


class Stop:
    """Whether a run was asked to stop.

    Fields:
        code: exit code of the signal, or None.
        at_once: called before the process ends at a second signal.
    """

    def __init__(self) -> None:
        """Nobody asked yet."""
        self.code: ExitCode | None = None
        self.at_once: Callable[[], None] = lambda: None

    def __bool__(self) -> bool:
        return self.code is not None

    def ask(self, number: int, frame: FrameType | None = None) -> None:
        """Ask to stop; asked again, end the process: whatever was published stays whole.

        Args:
            number: of the signal.
            frame: not used.
        """
        del frame
        code = CODES[signal.Signals(number)]
        if self.code is None:
            self.code = code
            return
        self.at_once()
        os.write(2, b"cspr: stopped at once; finished tiles are kept, run it again to go on\n")
        os._exit(code)


@contextlib.contextmanager
def stop_signals() -> Iterator[Stop]:
    """Turn SIGINT and SIGTERM into a flag while the block runs; in the main thread only.

    Yields:
        the flag.
    """
    stop = Stop()
    if threading.current_thread() is not threading.main_thread():
        yield stop
        return
    before = {number: signal.signal(number, stop.ask) for number in CODES}
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
