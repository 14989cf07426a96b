"""What people see while they wait, and what Ctrl-C does meanwhile, whatever the main thread is stuck in."""

import dataclasses
import io
import os
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import jax
import pytest

from cspr_jax.api.files.pictures import plot
from cspr_jax.cli import main
from cspr_jax.errors import StoreError
from cspr_jax.published import tables
from cspr_jax.runtime import progress as progress_lines
from cspr_jax.runtime import stages
from cspr_jax.runtime.progress import RateEstimate, progress, waiting
from reliability.support import go, sweep_of

# In a call that no signal ends, as compiling is: the main thread waits for a lock that it holds itself.
STUCK = """
import contextlib, ctypes, signal, sys, threading
from cspr_jax import cli
from cspr_jax.api import sweeps
def stuck(*_):
    system, lock = ctypes.CDLL(None), ctypes.create_string_buffer(256)
    system.pthread_mutex_init(lock, None)
    system.pthread_mutex_lock(lock)
    threading.Timer(0.3, print, ("stuck",), {"flush": True}).start()  # by then the main thread is in the call
    system.pthread_mutex_lock(lock)
class Tiles:
    environment = staticmethod(lambda: {"paper": 1})
    tiles = staticmethod(stuck)
cli.COMMANDS = tuple(row._replace(run=stuck) if row.name == "robots" else row for row in cli.COMMANDS)
sweeps._executor = lambda *_: contextlib.nullcontext(Tiles)
sys.argv[0] = "cspr"
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job inherits it ignored
sys.exit(cli.main())
"""


@pytest.fixture
def started():
    processes = []

    def start(*words):
        command = [sys.executable, "-c", STUCK, *map(str, words)]
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
        processes.append(subprocess.Popen(command, cwd=Path(__file__).parents[2], **pipes))
        assert processes[-1].stdout.readline() == "stuck\n"
        return processes[-1]

    yield start
    for process in processes:
        process.kill()
        process.communicate()


@pytest.mark.parametrize(
    ("number", "word", "code"),
    [
        pytest.param(signal.SIGINT, "interrupted", 130, marks=pytest.mark.thorough),
        (signal.SIGTERM, "SIGTERM: stopped", 143),
    ],
)
def test_signals_where_nothing_must_be_finished(started, number, word, code):
    process = started("robots")
    process.send_signal(number)
    assert process.stderr.readline() == f"cspr: {word}; nothing half-written is left\n"
    assert process.wait(timeout=5) == code and process.stderr.read() == ""


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, 130), pytest.param(signal.SIGTERM, 143, marks=pytest.mark.thorough)]
)
def test_a_run_says_at_once_that_it_finishes_its_tile(started, tmp_path, number, code):
    process = started("run", sweep_of(tmp_path, tiles=4).file, "-o", tmp_path / "run")
    process.send_signal(number)
    line = {
        signal.SIGINT: "finishing the tile in progress; Ctrl-C again ends at once",
        signal.SIGTERM: "SIGTERM: waiting up to 8 s for the tile in progress",
    }[number]
    assert process.stderr.readline() == f"cspr: {line}\n"
    process.send_signal(number)
    assert process.wait(timeout=5) == code
    stopped = "SIGTERM: stopped at once" if number == signal.SIGTERM else "stopped at once"
    assert process.stderr.read().startswith(f"cspr: {stopped}; finished tiles are kept")


@pytest.mark.thorough
def test_a_tile_that_takes_long_does_not_hold_up_sigterm(started, tmp_path):
    """A batch system kills half a minute after it; the tile in progress is given up before."""
    process = started("run", sweep_of(tmp_path, tiles=4).file, "-o", tmp_path / "run")
    process.send_signal(signal.SIGTERM)
    assert process.wait(timeout=12) == 143
    first, last = process.stderr.read().splitlines()
    assert first == "cspr: SIGTERM: waiting up to 8 s for the tile in progress"
    assert last == "cspr: SIGTERM: stopped at once; finished tiles are kept, run it again to go on"


class Terminal(io.StringIO):
    def isatty(self):
        return True


def at_terminal(monkeypatch):
    """Standard error is a terminal, from within a test on: pytest puts its own there before."""
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "150")
    monkeypatch.setattr(sys, "stderr", Terminal())
    return sys.stderr


def told_at_a_terminal(monkeypatch, capsys):
    """What a terminal sees while a table is computed; a pipe sees nothing, and the table is the same."""
    terminal = at_terminal(monkeypatch)
    assert main(["table", "1.1"]) == 0
    shown = capsys.readouterr().out
    assert "H_1" in shown and "\x1b" not in shown
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    assert main(["table", "1.1"]) == 0 and capsys.readouterr().out == shown and sys.stderr.getvalue() == ""
    return terminal.getvalue()


def test_a_terminal_is_told_the_stages_and_a_pipe_is_not(monkeypatch, capsys):
    """With numbers that take no time. jax compiles something all the same, too soon for anybody to see."""
    heard = []

    def compute():
        def a_name_that_is_read(x):
            return x + 1.0

        stages.stage("H_1")
        with stages.heard(heard.append):
            jax.jit(a_name_that_is_read)(1.0)
        return {("H_1", "A1", ""): 1.0}

    monkeypatch.setitem(tables.TABLES, "1.1", dataclasses.replace(tables.TABLES["1.1"], compute=compute))
    assert "table 1.1: H_1" in told_at_a_terminal(monkeypatch, capsys)
    assert "table 1.1: H_1: compiling a name that is read" in heard
    terminal = at_terminal(monkeypatch)
    with waiting(), stages.within("table 3.3"):
        stages.stage("arcs 5 of 20 [m]")
        threading.Thread(target=stages.compiling, args=("first look",)).start()
        stages.amount("450 parts [m]")
    assert "table 3.3: arcs 5 of 20 [m]" in terminal.getvalue()
    assert "cspr: 450 parts [m]\n" in terminal.getvalue()


@pytest.mark.soak
def test_a_terminal_is_told_the_stages_all(monkeypatch, capsys):
    assert "table 1.1: H_1" in told_at_a_terminal(monkeypatch, capsys)


def test_a_run_shows_what_it_does_until_the_first_tile(monkeypatch):
    terminal = at_terminal(monkeypatch)
    with progress() as on_tile:
        stages.stage("arcs 1 to 30")
        on_tile(0, 10)
    assert "arcs 1 to 30" in terminal.getvalue()
    with progress() as on_tile:
        on_tile(0, 10)
        on_tile(5, 10)
    assert " left" in terminal.getvalue()


def test_a_log_gets_the_amount_of_work_at_once(monkeypatch):
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    with waiting():
        stages.amount("450 parts")
        assert sys.stderr.getvalue() == "cspr: 450 parts\n"
    stages.amount("nobody listens")


def test_a_log_gets_a_line_now_and_then(monkeypatch):
    """Where standard error is no terminal; before the first tile there is no rate."""
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    monkeypatch.setattr(progress_lines, "LINE_SECONDS", 0.02)

    def next_line():
        count = sys.stderr.getvalue().count("\n")
        while sys.stderr.getvalue().count("\n") < count + 2:
            time.sleep(0.005)
        return sys.stderr.getvalue().splitlines()[-1]

    with progress() as on_tile:
        assert next_line() == "cspr: before the first tile"
        on_tile(0, 2000)
        assert next_line() == "cspr: 0 %, 0 of 2,000 cells"
        on_tile(1500, 2000)
        assert re.fullmatch(r"cspr: 75 %, 1,500 of 2,000 cells, \S+ cells/s, 0:00:\d\d left", next_line())
    written = sys.stderr.getvalue()
    time.sleep(0.06)
    assert sys.stderr.getvalue() == written


def test_the_pace_of_a_sweep():
    """Cells that an earlier run has left count for nothing, nor does compiling once there are two tiles."""
    now = [100.0]
    pace = RateEstimate(lambda: now[0])
    pace.advance(500, 1000)
    assert pace.rate is None and pace.left() == ""
    now[0] = 110.0
    pace.advance(600, 1000)
    assert (pace.rate, pace.left()) == (10.0, "0:00:40 left")
    now[0] = 112.0
    pace.advance(700, 1000)
    assert (pace.rate, pace.left()) == (50.0, "0:00:06 left")
    now[0] = 115.0
    assert pace.left() == "0:00:03 left"


@pytest.mark.thorough
def test_a_picture_is_there_whole_or_not_at_all(tmp_path, monkeypatch):
    sweep = sweep_of(tmp_path, tiles=4)
    result, picture = go(sweep, tmp_path / "run").result, tmp_path / "map.png"

    def interrupted(self, target, **keywords):
        target.write(b"half")
        raise KeyboardInterrupt

    monkeypatch.setattr("matplotlib.figure.Figure.savefig", interrupted)
    with pytest.raises(KeyboardInterrupt):
        plot([result], output=picture)
    assert not picture.exists()
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda self, target, **keywords: target.write(b"whole"))
    plot([result], output=picture)
    assert picture.read_bytes() == b"whole" and not [name for name in os.listdir(tmp_path) if name.endswith(".part")]
    with pytest.raises(StoreError, match="cannot be written"):
        plot([result], output=tmp_path / "nowhere" / "map.png")
