"""Several processes and a dask scheduler give the bytes of one process; a lost worker's tile is computed again.

Quick tests take a kind of map without kernels, whose worker dies by itself at a known tile; soak tests take the real
kernels, and kill at any time.
"""

import contextlib
import os
import pickle
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import psutil
import pytest
from distributed import LocalCluster
from support import toy
from support.commands import cspr

import cspr_jax
from cspr_jax.errors import ResourceError
from cspr_jax.schema.map_kinds import registered
from cspr_jax.sweep import distributed as workers_of_dask
from cspr_jax.sweep.definition import read_sweep
from cspr_jax.sweep.distributed import Scheduler
from cspr_jax.sweep.signals import Stop
from reliability.support import check_prefix, check_same, content

ROOT = Path(__file__).parents[2]
SWEEP = """schema = 1
map = "minimum-arcs"
robot = "prototype"
[axes]
x = { start = -1.2, stop = 1.2, count = 8 }
y = [-0.9, 0.1, 0.8]
z = [0.8, 1.9]
z0 = [1.7]
[trajectory]
from = { position = [0.7, 0.7, 3.0] }
[run]
tile = [1, 3, 2, 1]
"""
KILLS = 200
# Another process: here batches are smaller, and XLA's flags are others than in what `cspr` starts.
WHOLE = "import sys, cspr_jax; cspr_jax.run(sys.argv[1], sys.argv[2])"


@pytest.fixture
def toys(tmp_path):
    """A sweep file of six tiles, and what one process makes of it."""
    path = tmp_path / "toys" / "toys.toml"
    path.parent.mkdir()
    path.write_text(toy.SWEEP)
    with registered(toy.KIND, *toy.QUANTITIES):
        assert cspr("run", path, "-o", tmp_path / "one")[::2] == (0, "")
        yield path, content(tmp_path / "one")


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """A sweep file of eight tiles."""
    path = tmp_path_factory.mktemp("job") / "eight.toml"
    path.write_text(SWEEP)
    return path


@pytest.fixture(scope="module")
def job(file):
    """That file, and what one process makes of it."""
    subprocess.run([sys.executable, "-c", WHOLE, file, file.parent / "run"], check=True, capture_output=True, cwd=ROOT)
    return file, content(file.parent / "run")


def has_only_progress(err):
    """On a slow machine a run says now and then how far it is."""
    return all(re.match(r"cspr: +\d+ %, ", line) for line in err.splitlines())


def test_worker_processes(toys, tmp_path):
    """One dies at the last tile; what is missing then is computed by new ones."""
    path, reference = toys
    (path.parent / "die").write_text("0.5")
    code, _, err = cspr("run", path, "-o", tmp_path / "run", "--workers", 2)
    assert code == 0 and has_only_progress(err) and not (path.parent / "die").exists()
    check_same(tmp_path / "run", reference)


def kill_one_when(directory, shards, victims):
    """Kill one of the victims as soon as so many shards are there."""

    def work():
        end = time.monotonic() + 60
        while time.monotonic() < end and len(list((directory / "shards").glob("0*.h5"))) < shards:
            time.sleep(0.005)
        for process in victims()[:1]:
            with contextlib.suppress(psutil.NoSuchProcess):
                process.kill()

    thread = threading.Thread(target=work)
    thread.start()
    return thread


def spawned():
    """Worker processes that a run started below this process."""
    found = psutil.Process().children(recursive=True)
    return [p for p in found if "spawn_main" in " ".join(p.cmdline()) and p.memory_info().rss > 1 << 27]


def one_killed_of_two(job, tmp_path, victims):
    path, reference = job
    thread = kill_one_when(tmp_path / "run", 2, victims)
    code, _, err = cspr("run", path, "-o", tmp_path / "run", "--workers", 2)
    thread.join()
    assert code == 0 and has_only_progress(err)
    check_same(tmp_path / "run", reference)


@pytest.mark.soak
def test_worker_processes_all(job, tmp_path):
    one_killed_of_two(job, tmp_path, spawned)


@pytest.mark.soak
def test_a_worker_dies_while_another_cannot_end(job, tmp_path):
    """As one does that waits for a lock the dead one held; here it is stopped."""

    def victims():
        found = spawned()
        if len(found) > 1:
            found[1].suspend()
        return found

    one_killed_of_two(job, tmp_path, victims)


def a_cluster(workers):
    return LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None, silence_logs=50)


def test_a_dask_scheduler(toys, tmp_path):
    """One worker dies; what it was at is computed by another."""
    path, reference = toys
    (path.parent / "die").write_text("0.2")
    with a_cluster(2) as cluster:
        code, _, err = cspr("run", path, "-o", tmp_path / "run", "--scheduler", cluster.scheduler_address)
    assert code == 0 and has_only_progress(err) and not (path.parent / "die").exists()
    check_same(tmp_path / "run", reference)


# A scheduler and its worker in one process: nobody ends them in good order.
CLUSTER = """from distributed import LocalCluster
cluster = LocalCluster(1, processes=False, threads_per_worker=1, dashboard_address=None, protocol="tcp")
print(cluster.scheduler_address, flush=True)
input()"""


def test_a_scheduler_that_is_not_there_is_told_at_once(toys, tmp_path, monkeypatch):
    """dask itself would try again for as long as a slow scheduler may take."""
    import distributed

    seconds = []

    def refused(address, timeout):
        seconds.append(timeout)
        raise TimeoutError

    monkeypatch.setattr(distributed, "Client", refused)
    with socket.socket() as place:  # nobody listens there
        place.bind(("127.0.0.1", 0))
        for address in ("tcp://127.0.0.1:{}", "127.0.0.1:{}", "tls://localhost:{}"):
            address = address.format(place.getsockname()[1])
            with pytest.raises(ResourceError, match=f"--scheduler {address}: no scheduler answers"):
                cspr_jax.run(toys[0], tmp_path / "run", scheduler=address)
    assert seconds == [1.0] * 3


@pytest.mark.parametrize("status", ["connecting", "closed"])
def test_a_connection_that_stays_lost_is_given_up(monkeypatch, status):
    clock, client = [0.0], SimpleNamespace(status="running")
    monkeypatch.setattr(workers_of_dask.time, "monotonic", lambda: clock[0])
    lost = workers_of_dask._Lost(client)
    for at, state, is_lost in ((0, "running", False), (5, status, status == "closed"), (7, status, status == "closed")):
        clock[0], client.status = at, state
        assert lost.is_so() is is_lost
    clock[0] = 9
    assert lost.is_so()
    client.status = "running"
    assert not lost.is_so()


def test_a_scheduler_dies(toys, tmp_path):
    """One line on standard error, without dask's own, exit 4; the finished tiles stay, and another run goes on."""
    path, reference = toys
    directory, pipes = tmp_path / "run", {"stdout": subprocess.PIPE, "text": True}
    (path.parent / "pause").write_text("0.3")
    settings = {"cwd": ROOT / "tests", "env": os.environ | {"CSPR_CACHE_DIR": ""}}
    with subprocess.Popen([sys.executable, "-c", CLUSTER], stdin=subprocess.PIPE, **pipes, **settings) as cluster:
        words = ["run", str(path), "-o", str(directory), "--scheduler", cluster.stdout.readline().strip()]
        process = subprocess.Popen(
            [sys.executable, "-m", "support.toy", *words], stderr=subprocess.PIPE, **pipes, **settings
        )
        end = time.monotonic() + 60
        while not (directory / "shards" / "00001.h5").exists():
            assert time.monotonic() < end and process.poll() is None, process.stderr.read()
            time.sleep(0.005)
        cluster.kill()
        out, err = process.communicate(timeout=60)
    assert (process.returncode, out, err.count("\n")) == (4, "", 1) and "the scheduler is gone" in err
    check_prefix(directory, reference)
    (path.parent / "pause").unlink()
    assert cspr("run", path, "-o", directory)[::2] == (0, "")
    check_same(directory, reference)


@pytest.mark.soak
def test_a_dask_scheduler_all(job, tmp_path):
    path, reference = job
    with a_cluster(2) as cluster:
        victims = [psutil.Process(worker.pid) for worker in cluster.workers.values()]
        thread = kill_one_when(tmp_path / "run", 2, lambda: victims)
        code, _, err = cspr("run", path, "-o", tmp_path / "run", "--scheduler", cluster.scheduler_address)
        thread.join()
    assert code == 0 and has_only_progress(err)
    check_same(tmp_path / "run", reference)


@pytest.mark.soak
def test_ctrl_c_while_no_worker_is_there(file, tmp_path):
    """Before the first worker comes, and after the last one has gone."""
    command = [sys.executable, "-m", "cspr_jax", "run", str(file), "-o", str(tmp_path / "run"), "--scheduler"]
    with a_cluster(0) as cluster:
        process = subprocess.Popen(
            [*command, cluster.scheduler_address], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        try:
            assert "has no workers yet" in process.stderr.readline()
            process.send_signal(signal.SIGINT)
            _, err = process.communicate(timeout=20)
        finally:
            process.kill()
        assert process.returncode == 130 and err.splitlines()[0] == "cspr: stopping; Ctrl-C again ends at once"
        assert not (tmp_path / "run").exists()

        asked = Stop()

        def ask_when_gone(line):
            assert "has lost its workers" in line
            asked.ask(signal.SIGTERM)

        cluster.scale(1)
        scheduler = Scheduler(read_sweep(file), cluster.scheduler_address, warn=ask_when_gone)
        tiles = scheduler.tiles(range(8), asked)
        next(tiles)
        cluster.scale(0)
        assert len(list(tiles)) < 7
        scheduler.close()


@pytest.mark.parametrize(
    ("options", "code", "words"),
    [
        (("--workers", "0"), 2, "must be an integer from 1"),
        (("--workers", "2", "--scheduler", "tcp://127.0.0.1:1"), 2, "cannot be combined with --scheduler"),
        (("--scheduler", "not an address"), 2, "must be an address"),
        (("--scheduler", "tls://127.0.0.1:1"), 2, "must fit dask's TLS settings"),
    ],
)
def test_wrong_workers(file, tmp_path, options, code, words):
    found, out, err = cspr("run", file, "-o", tmp_path / "run", *options)
    assert (found, out, len(err.splitlines())) == (code, "", 1) and words in err
    assert not (tmp_path / "run").exists()


def test_a_kill_of_the_command(toys, tmp_path):
    """Its whole process group killed in the middle; the next run goes on from what it has left."""
    path, reference = toys
    directory = tmp_path / "run"
    (path.parent / "pause").write_text("0.2")
    # Without a folder for compiled code the command leaves XLA's flags alone, which are part of the environment.
    process = subprocess.Popen(
        [sys.executable, "-m", "support.toy", "run", str(path), "-o", str(directory)],
        **{"start_new_session": True, "stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE},
        cwd=ROOT / "tests",
        env=os.environ | {"CSPR_CACHE_DIR": ""},
    )
    end = time.monotonic() + 60
    while not (directory / "shards" / "00001.h5").exists():
        assert time.monotonic() < end and process.poll() is None, process.stderr.read()
        time.sleep(0.005)
    os.killpg(process.pid, signal.SIGKILL)
    process.communicate()
    check_prefix(directory, reference)
    kept = {path: path.stat().st_mtime_ns for path in (directory / "shards").glob("0*.h5")}
    assert 2 <= len(kept) < toy.TILES and not list(directory.glob("*.h5"))
    (path.parent / "pause").unlink()
    assert cspr("run", path, "-o", directory)[::2] == (0, "")
    check_same(directory, reference)
    assert {path: path.stat().st_mtime_ns for path in kept} == kept  # they were not made again


@pytest.mark.soak
def test_kills_of_the_real_command_all(file, tmp_path):
    """The real command line, its whole process group killed while it compiles, computes or writes."""
    rng, directory, killed = np.random.default_rng(5), tmp_path / "run", 0
    words = [sys.executable, "-m", "cspr_jax", "run", str(file), "-o"]
    subprocess.run([*words, str(tmp_path / "whole")], check=True, capture_output=True, cwd=ROOT)
    command, reference = [*words, str(directory)], content(tmp_path / "whole")
    while killed < KILLS:
        process = subprocess.Popen(
            command, start_new_session=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=ROOT
        )
        try:
            process.communicate(timeout=rng.uniform(0.5, 8.0))
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
            killed += 1
            check_prefix(directory, reference)
            continue
        assert process.returncode == 0
        check_same(directory, reference)
        shutil.rmtree(directory)
    subprocess.run(command, check=True, capture_output=True, cwd=ROOT)
    check_same(directory, reference)


def test_the_sweep_travels_whole(file):
    """Workers get the sweep by pickle; errors come back with their exit codes."""
    from cspr_jax.errors import ConfigError, InputError, ResourceError, SelfCheckError

    sweep = pickle.loads(pickle.dumps(read_sweep(file)))
    assert sweep.identity == read_sweep(file).identity
    for error in (ConfigError("f", "m"), InputError("k", 1, "2"), ResourceError("r"), SelfCheckError("s")):
        again = pickle.loads(pickle.dumps(error))
        assert (type(again), str(again), again.exit_code) == (type(error), str(error), error.exit_code)


LONG = """schema = 1
map = "minimum-arcs"
robot = "prototype"
[axes]
x = { start = -1.5, stop = 1.5, count = 128 }
y = { start = -1.5, stop = 1.5, count = 128 }
z = { start = 0.3, stop = 3.2, count = 64 }
z0 = [1.5, 1.6, 1.7, 1.8]
[trajectory]
from = { position = [0.7, 0.7, 3.0] }
[run]
tile = [1, 128, 64, 1]
"""


@pytest.mark.soak
def test_a_long_sweep_that_is_killed_all_the_time(tmp_path):
    """Four million cells; every 5 to 60 s all processes of the run are killed, for half an hour and until it ends."""
    path = tmp_path / "long.toml"
    path.write_text(LONG)
    words = [sys.executable, "-m", "cspr_jax", "run", str(path), "-o"]
    subprocess.run([*words, str(tmp_path / "whole")], check=True, capture_output=True, cwd=ROOT)
    command, reference = [*words, str(tmp_path / "run")], content(tmp_path / "whole")
    rng, begin, kills, ends = np.random.default_rng(18), time.monotonic(), 0, 0
    while time.monotonic() < begin + 1800 or (tmp_path / "run").exists():
        process = subprocess.Popen(
            [*command, *(["--workers", "2"] if kills % 4 == 3 else [])],
            **{"start_new_session": True, "stderr": subprocess.PIPE, "stdout": subprocess.PIPE},
            cwd=ROOT,
        )
        try:
            _, err = process.communicate(timeout=rng.uniform(5.0, 60.0))
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
            kills += 1
            continue
        assert (process.returncode, err) == (0, b"")
        check_same(tmp_path / "run", reference)
        shutil.rmtree(tmp_path / "run")
        ends += 1
    sys.stderr.write(f"{kills} kills, {ends} runs to the end\n")
    assert kills > 20 and ends >= 1
