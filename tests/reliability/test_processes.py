"""Real processes: killed, stopped, started twice, short of memory or of disk, in places they may not write."""

import errno
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from reliability.support import check_prefix, check_same, content, go, sweep_of

PAPER = Path(__file__).with_name("paper_cspr.py")


@pytest.fixture(scope="module")
def job(tmp_path_factory):
    folder = tmp_path_factory.mktemp("job")
    sweep = sweep_of(folder, tiles=12)
    go(sweep, folder / "reference")
    return sweep, content(folder / "reference")


def start(sweep, directory, *options, seconds=0.02, **keywords):
    command = [sys.executable, str(PAPER), str(seconds), "run", str(sweep.file), "-o", str(directory), *options]
    return subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True, **keywords
    )


def finish(process, timeout=60):
    """Exit code, and standard error."""
    _, err = process.communicate(timeout=timeout)
    return process.returncode, err


def complete(sweep, directory, reference):
    """The next run goes on; it may be this process."""
    go(sweep, directory)
    check_same(directory, reference)
    shutil.rmtree(directory)


def wait_for(path, process, seconds=20):
    end = time.monotonic() + seconds
    while not path.exists():
        assert time.monotonic() < end and process.poll() is None
        time.sleep(0.005)


def kills(job, tmp_path, count):
    sweep, reference = job
    rng, directory, killed = np.random.default_rng(3), tmp_path / "run", 0
    while killed < count:
        process = start(sweep, directory)
        time.sleep(rng.uniform(0.2, 1.0))
        os.killpg(process.pid, signal.SIGKILL)
        if finish(process)[0] == -signal.SIGKILL:
            killed += 1
            check_prefix(directory, reference)
        else:
            check_same(directory, reference)
            shutil.rmtree(directory)
    assert finish(start(sweep, directory, seconds=0)) == (0, "")
    check_same(directory, reference)


def test_kills(job, tmp_path):
    kills(job, tmp_path, 1)


@pytest.mark.soak
def test_kills_all(job, tmp_path):
    kills(job, tmp_path, 200)


def stops(job, tmp_path, count):
    """Ctrl-C, SIGTERM, and Ctrl-C twice: the tile in progress is kept, and the code says what happened."""
    sweep, reference = job
    rng = np.random.default_rng(4)
    for i in range(count):
        directory = tmp_path / str(i)
        number = (signal.SIGINT, signal.SIGTERM, signal.SIGINT)[i % 3]
        process = start(sweep, directory, seconds=30 if i % 3 == 2 else 0.15)
        wait_for(directory / "log.jsonl", process)
        time.sleep(rng.uniform(0.0, 0.4))
        process.send_signal(number)
        if i % 3 == 2:
            time.sleep(0.1)
            process.send_signal(number)
        code, err = finish(process, timeout=10)
        assert code == {signal.SIGINT: 130, signal.SIGTERM: 143}[number]
        first, last = err.splitlines()
        is_terminated = number == signal.SIGTERM
        assert first.endswith("the tile in progress" if is_terminated else "; Ctrl-C again ends at once")
        assert last.startswith("cspr: stopped by SIGTERM: " if is_terminated else "cspr: stopped")
        assert "run it again" in last
        check_prefix(directory, reference)
        complete(sweep, directory, reference)


def test_stop_signals(job, tmp_path):
    stops(job, tmp_path, 3)


@pytest.mark.soak
def test_stop_signals_all(job, tmp_path):
    stops(job, tmp_path, 100)


def second_writers(job, tmp_path, count):
    """While one writes, another is refused, whatever HDF5 does about locks; a dead one holds nothing."""
    sweep, reference = job
    for i in range(count):
        directory = tmp_path / str(i)
        environment = os.environ | ({"HDF5_USE_FILE_LOCKING": "FALSE"} if i % 2 else {})
        holder = start(sweep, directory, seconds=0.3, env=environment)
        wait_for(directory / "log.jsonl", holder)
        code, err = finish(start(sweep, directory, env=environment), timeout=10)
        assert (code, len(err.splitlines())) == (3, 1)
        assert f"is being written by process {holder.pid} on " in err
        os.kill(holder.pid, signal.SIGKILL)
        finish(holder)
        complete(sweep, directory, reference)


@pytest.mark.thorough
def test_two_writers(job, tmp_path):
    second_writers(job, tmp_path, 2)


@pytest.mark.soak
def test_two_writers_all(job, tmp_path):
    second_writers(job, tmp_path, 50)


def memory_limits(job, tmp_path, levels):
    """Too little memory is an error or a success, never a missing tile; afterwards the run goes on."""
    sweep, reference = job
    codes = []
    for i, megabytes in enumerate(levels):
        directory, most = tmp_path / str(i), int(megabytes) << 20
        process = start(sweep, directory, seconds=0, env=os.environ | {"PAPER_MEMORY": str(most)})
        code, _ = finish(process)
        codes.append(code)
        if code == 0:
            check_same(directory, reference)
        check_prefix(directory, reference)
        complete(sweep, directory, reference)
    return codes


def test_little_memory(job, tmp_path):
    codes = memory_limits(job, tmp_path, (120, 3000))
    assert codes[0] != 0 and codes[-1] == 0


@pytest.mark.soak
def test_little_memory_all(job, tmp_path):
    codes = memory_limits(job, tmp_path, np.linspace(100, 1500, 30))
    assert codes[0] != 0 and codes[-1] == 0


def full_disks(job, tmp_path, tiles):
    """A real disk of four megabytes that another program fills at some tile, and then leaves."""
    sweep, reference = job
    codes = []
    for i in tiles:
        disk, copy = tmp_path / str(i), tmp_path / f"copy{i}"
        disk.mkdir()
        run = f"{sys.executable} {PAPER} 0.05 run {sweep.file} -o {disk}/run"
        script = f"""mount -t tmpfs -o size=4m none {disk} || exit 77
            {run} 2> {tmp_path}/err &
            until [ -e {disk}/run/shards/{i % 12:05d}.h5 ]; do sleep 0.01; done
            head -c 9000000 /dev/zero > {disk}/filler
            wait $!; first=$?
            rm {disk}/filler; ls -AR {disk}/run > {tmp_path}/left
            {run} || exit 78
            cp -r {disk}/run {copy}; exit $first"""
        done = subprocess.run(["unshare", "-m", "sh", "-c", script], capture_output=True, text=True)
        if not copy.exists() and done.returncode in (1, 77):
            pytest.skip("no private mounts here: " + done.stderr.strip())
        codes.append(done.returncode)
        assert done.returncode in (0, 4), done.stderr
        if done.returncode:
            assert len((tmp_path / "err").read_text().splitlines()) == 1
            assert ".part" not in (tmp_path / "left").read_text()
        check_same(copy, reference)
    assert 4 in codes
    return codes


@pytest.mark.thorough
@pytest.mark.skipif(shutil.which("unshare") is None, reason="needs unshare")
def test_a_full_disk(job, tmp_path):
    full_disks(job, tmp_path, [2])


@pytest.mark.soak
@pytest.mark.skipif(shutil.which("unshare") is None, reason="needs unshare")
def test_a_full_disk_all(job, tmp_path):
    full_disks(job, tmp_path, range(20))


def test_a_folder_that_may_not_be_written(job, tmp_path):
    sweep, _ = job
    closed = tmp_path / "closed"
    closed.mkdir(mode=0o555)
    for folder in tmp_path.parents[:2]:
        folder.chmod(0o755)  # the other user has to come here
    code, err = finish(start(sweep, closed / "run", seconds=0, env=os.environ | {"PAPER_USER": "65534"}))
    assert (code, len(err.splitlines())) == (4, 1), err
    assert str(closed / "run") in err and os.strerror(errno.EACCES) in err
    assert list(closed.iterdir()) == []
