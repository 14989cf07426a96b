"""Handling of Ctrl-C and SIGTERM, which a thread notices at once, even while the main thread compiles.

An interrupted run finishes and keeps the tile in progress. After SIGTERM it has eight seconds for that, since a batch
system kills it soon after; everything else ends within two seconds.
"""

import contextlib
import os
import signal
import sys
import threading
from collections.abc import Callable, Collection, Iterator
from types import FrameType

from cspr_jax.errors import ExitCode

CODES = {signal.SIGINT: ExitCode.INTERRUPTED, signal.SIGTERM: ExitCode.TERMINATED}
# Time for the main thread to end by itself, if nothing must be finished; it cannot while it compiles.
GRACE_SECONDS = 1.2
# Time for a tile in progress after SIGTERM.
TILE_SECONDS = 8.0
FINISHING = "finishing {work} in progress; Ctrl-C again ends at once"
STOPPING = "stopping; Ctrl-C again ends at once"
TERMINATING = f"SIGTERM: waiting up to {TILE_SECONDS:.0f} s for {{work}} in progress"
# Clears the line of a progress display, and shows the cursor that it hid.
_TIDY = b"\r\x1b[2K\x1b[?25h"


class Stop:
    """Request that a run stops.

    Fields:
        code: exit code of the signal; None: nobody has requested to stop.
        busy: whether work is in progress that must be finished.
        at_once: function that is called before the process ends at a second signal.
        note: likewise, for an entry in a log.
        tell: function that is called with a line for the user after the first signal.
        work: what must be finished, in words.
        results: what is kept, in words.
    """

    def __init__(self) -> None:
        """Begin without a request."""
        self.code: ExitCode | None = None
        self.busy = False
        self.at_once: Callable[[], None] = lambda: None
        self.note: Callable[[], None] = lambda: None
        self.tell: Callable[[str], None] = lambda line: None
        self.work, self.results = "the tile", "finished tiles"

    def __bool__(self) -> bool:
        return self.code is not None

    def ask(self, number: int, frame: FrameType | None = None) -> None:
        """Request to stop; a second request ends the process, which leaves published files intact."""
        del frame
        if self.code is None:
            self.code = CODES[signal.Signals(number)]
            finishing = TERMINATING if self.code is ExitCode.TERMINATED else FINISHING
            self.tell(finishing.format(work=self.work) if self.busy else STOPPING)
            return
        self.end(CODES[signal.Signals(number)])

    def end(self, code: ExitCode) -> None:
        """End the process now."""
        self.code = code
        self.note()
        self.at_once()
        signal_name = "SIGTERM: " if code is ExitCode.TERMINATED else ""
        line = f"cspr: {signal_name}stopped at once; {self.results} are kept, run it again to go on\n"
        _end(code, line.encode())


@contextlib.contextmanager
def stop_signals(tell: Callable[[str], None] = lambda line: None) -> Iterator[Stop]:
    """Turn SIGINT and SIGTERM into a flag while the block runs; in the main thread only."""
    stop, over = Stop(), threading.Event()
    stop.tell = tell
    if threading.current_thread() is not threading.main_thread():
        yield stop
        return

    def end_unless_over() -> None:
        if over.wait(GRACE_SECONDS) or stop.code is None:
            return
        if stop.busy and (stop.code is not ExitCode.TERMINATED or over.wait(TILE_SECONDS - GRACE_SECONDS)):
            return
        stop.end(stop.code)

    def on_signal(number: int) -> None:
        stop.ask(number)
        threading.Thread(target=end_unless_over, daemon=True).start()

    before = {number: signal.signal(number, lambda number, frame: None) for number in CODES}
    try:
        with _watched(CODES, on_signal):
            yield stop
    finally:
        over.set()
        for number, handler in before.items():
            signal.signal(number, handler)


class Prompt:
    """Response to Ctrl-C and SIGTERM while nothing has to be finished.

    Fields:
        told: whether the user has been told that the signal was noticed.
        code: exit code of the signal.
    """

    def __init__(self) -> None:
        """Begin without a signal."""
        self.told, self.code, self._lock = False, ExitCode.INTERRUPTED, threading.Lock()

    def tell(self) -> None:
        """Tell the user once that the signal was noticed."""
        with self._lock:
            before, self.told = self.told, True
        if not before:
            with contextlib.suppress(OSError, ValueError):  # standard error may be closed
                signal_name = "SIGTERM: stopped" if self.code is ExitCode.TERMINATED else "interrupted"
                sys.stderr.write(f"cspr: {signal_name}; nothing half-written is left\n")
                sys.stderr.flush()


@contextlib.contextmanager
def prompt_end(last: Callable[[], None] | None = None) -> Iterator[Prompt]:
    """Tell at once that Ctrl-C or SIGTERM was noticed, and end the process if KeyboardInterrupt does not do so soon.

    Files get their names only when they are complete, so that no incomplete files are left.
    """
    prompt, pressed, over = Prompt(), threading.Event(), threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield prompt
        return

    def end_unless_over() -> None:
        if not over.wait(GRACE_SECONDS):
            _end(prompt.code)

    def on_signal(number: int) -> None:
        prompt.code = CODES[signal.Signals(number)]
        if pressed.is_set():
            _end(prompt.code)
        pressed.set()
        prompt.tell()
        threading.Thread(target=end_unless_over, daemon=True).start()

    before = signal.getsignal(signal.SIGTERM)
    if before is signal.SIG_DFL:  # otherwise keep the handler that somebody has set
        signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        with _watched(CODES, on_signal):
            yield prompt
    finally:
        signal.signal(signal.SIGTERM, before)
        if last is not None and pressed.is_set():
            # Skip Python's shutdown, which would wait for threads that compile, or remove objects that they use.
            with contextlib.suppress(OSError, ValueError):
                sys.stdout.flush()
            last()
            _end(prompt.code)
        over.set()


@contextlib.contextmanager
def _watched(numbers: Collection[int], handle: Callable[[int], None]) -> Iterator[None]:
    # Python runs handlers only when the main thread returns from compiled code, which may be after a minute. But it
    # writes the number of a signal to this pipe at once, where another thread reads it.
    reading, writing = os.pipe()
    os.set_blocking(writing, False)

    def watch() -> None:
        while number := os.read(reading, 1):
            if number[0] in numbers:
                handle(number[0])

    thread = threading.Thread(target=watch, daemon=True)
    thread.start()
    before = signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        os.close(writing)
        thread.join()
        os.close(reading)


def _end(code: ExitCode, line: bytes = b"") -> None:
    with contextlib.suppress(OSError):
        os.write(2, (_TIDY if os.isatty(2) else b"") + line)
    os._exit(code)
