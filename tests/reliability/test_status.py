"""What `status` says of a run: whether somebody computes, how it ended, and how long it will still take."""

import fcntl
import os
import signal
import threading
import time

import pytest

from cspr_jax.errors import StoppedError
from cspr_jax.runtime.progress import RateEstimate
from cspr_jax.store.files.disk import Disk
from cspr_jax.store.folder import RunFolder
from cspr_jax.sweep import inspection
from cspr_jax.sweep.engine import Hooks, Run
from reliability.support import Crash, FaultyDisk, Paper, sweep_of


def test_status_says_whether_somebody_runs(tmp_path):
    """Running, stopped by a signal, killed, finished: by the lock, and by the end of the log."""
    sweep, directory = sweep_of(tmp_path), tmp_path / "run"
    states = []

    class Watched(Paper):
        def tiles(self, indices, stop):
            states.append(inspection.status(directory)["state_text"])
            for computed in super().tiles(indices, stop):
                yield computed
                states.append(inspection.status(directory))

    for number, words in ((signal.SIGTERM, "stopped by SIGTERM at"), (signal.SIGINT, "stopped by Ctrl-C at")):
        hooks = Hooks()
        hooks.on_tile = lambda done, total, ask=hooks.stop.ask, number=number: ask(number) if done % 2 else None
        with pytest.raises(StoppedError):
            Run(sweep, directory, hooks=hooks).go(Watched(sweep))
        state = inspection.status(directory)
        assert state["state"] == "stopped" and state["state_text"].startswith(words)
    with pytest.raises(Crash):
        Run(sweep, directory, disk=FaultyDisk(25, "before")).go(Watched(sweep))
    state = inspection.status(directory)
    assert state["state"] == "killed" and state["state_text"].endswith("run again to resume")
    assert state["seconds_left"] is not None
    assert Run(sweep, directory).go(Watched(sweep)).result and inspection.status(directory)["state"] == "finished"
    assert states[0].startswith("running, before the first tile, started 0:00:0")
    assert states[1]["state"] == "running" and states[1]["state_text"].startswith("running, last tile 0:00:0")


def test_status_and_the_log_have_one_estimate(tmp_path, monkeypatch):
    """That of the process: the first tile, which compiles, counts until there is another."""
    sweep, directory, clock = sweep_of(tmp_path), tmp_path / "run", [1e9]
    monkeypatch.setattr(time, "time", lambda: clock[0])
    pace, rates = RateEstimate(lambda: clock[0]), []

    class Slow(Paper):
        def tiles(self, indices, stop):
            for number, computed in enumerate(super().tiles(indices, stop)):
                clock[0] += 100.0 if number == 0 else 7.0
                yield computed
                state = inspection.status(directory)
                rates.append((state["cells_per_second"], state["seconds_left"], pace.rate, pace.ends - clock[0]))

    Run(sweep, directory, hooks=Hooks(on_tile=pace.advance)).go(Slow(sweep))
    assert len(rates) == 12 and rates[0][0] == pytest.approx(0.03)
    for rate, left, expected_rate, expected_left in rates:
        assert rate == pytest.approx(expected_rate) and (left or 0.0) == pytest.approx(expected_left)


def test_asking_for_the_state_disturbs_no_run(tmp_path):
    folder = RunFolder(tmp_path, "map", Disk())
    assert folder.is_held() is False and not list(tmp_path.iterdir())
    with folder.locked():
        assert folder.is_held() is True
    assert folder.is_held() is False
    file = os.open(folder.lock, os.O_RDONLY)
    fcntl.flock(file, fcntl.LOCK_SH)
    threading.Timer(0.03, os.close, (file,)).start()
    with folder.locked():
        pass
