"""Display of progress: finished cells of a sweep, or the stage of the work; continuous in a terminal, else by lines."""

import contextlib
import datetime
import sys
import threading
import time
from collections.abc import Callable, Iterator

from cspr_jax.errors import printable
from cspr_jax.runtime import stages

# Time between lines, s, where standard error is no terminal.
LINE_SECONDS = 60.0


class RateEstimate:
    """Rate of a sweep, and the remaining time.

    Args:
        clock: function that returns the time in s.

    Fields:
        rate: cells a second; None before the first tile.
        ends: expected time of the clock at the end; None before the first tile.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """Nothing is known yet."""
        self._clock, self._begin, self._first = clock, (0, clock()), (0, 0.0)
        self._tiles = -1
        self.rate: float | None = None
        self.ends: float | None = None

    def advance(self, done: int, total: int) -> None:
        """Record a finished tile; the first call gives the number of cells that an earlier run has done."""
        seconds = self._clock()
        self._tiles += 1
        if self._tiles == 0:
            self._begin = (done, seconds)
            return
        if self._tiles == 1:
            self._first = (done, seconds)
        # The first tile includes the time of compiling: leave it out as soon as there are others.
        cells, since = self._begin if self._tiles == 1 else self._first
        self.rate = (done - cells) / max(seconds - since, 1e-9)
        self.ends = seconds + (total - done) / self.rate if self.rate > 0.0 else None

    def left(self) -> str:
        """Remaining time, in words."""
        if self.ends is None:
            return ""
        return f"{datetime.timedelta(seconds=round(max(self.ends - self._clock(), 0.0)))} left"


@contextlib.contextmanager
def progress() -> Iterator[Callable[[int, int], None]]:
    """Show the progress of a sweep: by a bar in a terminal, elsewhere by a line a minute on standard error."""
    if not sys.stderr.isatty():
        with _lines() as on_tile:
            yield on_tile
        return
    from rich.progress import BarColumn, TaskProgressColumn, TextColumn

    class Words(TextColumn):
        """Words for the stage until the first tile is done; then for the rate and the remaining time."""

        def render(self, task):
            """The current text; see `rich.progress.TextColumn`."""
            self.text_format = (
                task.description if estimate.rate is None else f"{estimate.rate:,.0f} cells/s  {estimate.left()}"
            )
            return super().render(task)

    estimate = RateEstimate()
    with _bar(BarColumn(), TaskProgressColumn(), Words("", markup=False)) as bar:
        task = bar.add_task("starting", total=None)

        def on_tile(done: int, total: int) -> None:
            estimate.advance(done, total)
            bar.update(task, completed=done, total=total)

        with stages.heard(lambda text: bar.update(task, description=printable(text) or "computing")):
            yield on_tile


@contextlib.contextmanager
def _lines() -> Iterator[Callable[[int, int], None]]:
    estimate, cells = RateEstimate(), [(0, 0)]

    def on_tile(done: int, total: int) -> None:
        estimate.advance(done, total)
        cells.append((done, total))

    def line() -> str:
        done, total = cells[-1]
        rate = "" if estimate.rate is None else f", {estimate.rate:,.3g} cells/s, {estimate.left()}"
        fraction = f"{100.0 * done / total:.0f} %, {done:,} of {total:,} cells" if total else "before the first tile"
        return f"{fraction}{rate}"

    with _every_minute(line):
        yield on_tile


@contextlib.contextmanager
def _every_minute(line: Callable[[], str]) -> Iterator[None]:
    over = threading.Event()

    def write_lines() -> None:
        while not over.wait(LINE_SECONDS):
            _write(line())

    thread = threading.Thread(target=write_lines, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def _write(line: str) -> None:
    with contextlib.suppress(OSError, ValueError):  # standard error may be closed
        sys.stderr.write(f"cspr: {printable(line)}\n")
        sys.stderr.flush()


@contextlib.contextmanager
def waiting() -> Iterator[None]:
    """Show the stage of the work while the block runs: continuously in a terminal, elsewhere by a line a minute.

    Announced amounts of work are written at once. The block must not print anything.
    """
    if not sys.stderr.isatty():
        latest = ["starting"]

        def keep(text: str) -> None:
            latest[0] = text or "computing"

        with _every_minute(lambda: latest[0]), stages.heard(keep, _write):
            yield
        return
    from rich.progress import SpinnerColumn, TextColumn, TimeElapsedColumn

    with _bar(SpinnerColumn("line"), TextColumn("{task.description}", markup=False), TimeElapsedColumn()) as bar:
        task = bar.add_task("starting", total=None)

        def show(text: str) -> None:
            bar.update(task, description=printable(text) or "computing")

        with stages.heard(show, lambda text: bar.console.out(f"cspr: {printable(text)}", highlight=False)):
            yield


def _bar(*columns):
    from rich.console import Console
    from rich.progress import Progress

    # Standard output may go elsewhere: do not redirect it to the terminal of standard error.
    return Progress(*columns, console=Console(stderr=True), transient=True, redirect_stdout=False)
