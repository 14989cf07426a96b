"""Every moment at which a run can die, and every call that a disk can refuse: one after the other."""

import itertools
import shutil

import pytest
from support.reading import read_here

from cspr_jax.errors import ExitCode, StoreError
from reliability.support import FAULTS, STORE, Crash, FaultyDisk, Paper, check_prefix, check_same, content, go, sweep_of

CRASHES = ("before", "half", "after", "power")


@pytest.fixture(autouse=True)
def read_in_this_process(monkeypatch):
    """How files are read is what test_isolation.py is about."""
    read_here(monkeypatch)


@pytest.fixture(scope="module")
def long_job(tmp_path_factory):
    """A sweep, what its directory holds in the end, and how many calls that takes."""
    return make_job(tmp_path_factory.mktemp("long"), 6, STORE)


@pytest.fixture(scope="module")
def short_job(tmp_path_factory):
    return make_job(tmp_path_factory.mktemp("short"), 2, ["arcs", "margin"])


def make_job(folder, tiles, store):
    sweep, disk = sweep_of(folder, tiles=tiles, store=store), FaultyDisk()
    go(sweep, folder / "reference", disk=disk)
    return sweep, content(folder / "reference"), disk.count


def crash(sweep, directory, k, mode):
    """Run until call k; whether it came that far. Finished tiles must be there, whole."""
    disk, paper = FaultyDisk(k, mode), Paper(sweep)
    try:
        go(sweep, directory, disk=disk, paper=paper)
    except Crash:
        # A tile that the run went on from is acknowledged: all computed but the last.
        for index in paper.computed[:-1]:
            assert (directory / "shards" / f"{index:05d}.h5").exists()
        return True
    return False


def every_crash(job, tmp_path, modes_at):
    """Oracle A: what was acknowledged is there. Oracle B: a prefix of a run; in the end, the same bytes."""
    sweep, reference, calls = job
    assert calls > 30
    count = 0
    for k in range(1, calls + 1):
        for mode in modes_at(k):
            directory = tmp_path / "run"
            assert crash(sweep, directory, k, mode)
            check_prefix(directory, reference)
            go(sweep, directory)
            check_same(directory, reference)
            shutil.rmtree(directory)
            count += 1
    assert not crash(sweep, tmp_path / "run", calls + 1, "after")
    return count


def test_every_crash_point(short_job, tmp_path):
    """Neighbouring calls die in different ways: of a file's calls, each way comes once or more."""
    assert every_crash(short_job, tmp_path, lambda k: [CRASHES[k % 4]]) > 35


@pytest.mark.soak
def test_every_crash_point_in_every_way_all_of_a_short_run(short_job, tmp_path):
    assert every_crash(short_job, tmp_path, lambda k: CRASHES) > 140


@pytest.mark.soak
def test_every_crash_point_in_every_way_all(long_job, tmp_path):
    assert every_crash(long_job, tmp_path, lambda k: CRASHES) > 350


def crash_twice(job, tmp_path, calls_between, step):
    """Crash at every so many-th call, and again while the next run goes on, at every so many-th call of that."""
    sweep, reference, calls = job
    pairs = 0
    for k in range(1, calls + 1, calls_between):
        for j in itertools.count(1 + k % step, step):
            directory = tmp_path / "run"
            assert crash(sweep, directory, k, CRASHES[(k + j // step) % 4])
            again = crash(sweep, directory, j, CRASHES[j % 4])
            check_prefix(directory, reference)
            go(sweep, directory)
            check_same(directory, reference)
            shutil.rmtree(directory)
            if not again:
                break
            pairs += 1
    return pairs


@pytest.mark.thorough
def test_crashes_while_going_on(short_job, tmp_path):
    assert crash_twice(short_job, tmp_path, 7, 19) > 5


@pytest.mark.soak
def test_crashes_while_going_on_all(short_job, tmp_path):
    assert crash_twice(short_job, tmp_path, 1, 1) > 1000


def refusals(job, tmp_path, faults_at):
    """One line, exit code 4, nothing unfinished left; then the same bytes."""
    sweep, reference, calls = job
    for k in range(1, calls + 1):
        for fault, lasting in faults_at(k):
            directory = tmp_path / "run"
            with pytest.raises(StoreError) as failure:
                go(sweep, directory, disk=FaultyDisk(k, fault, lasting=lasting))
            assert failure.value.exit_code == ExitCode.INPUT_OUTPUT
            assert len(str(failure.value).splitlines()) == 1
            if not lasting:  # a disk that refuses everything refuses to remove, too
                assert not list(directory.rglob(".*.part")) if directory.exists() else True
            check_prefix(directory, reference)
            go(sweep, directory)
            check_same(directory, reference)
            shutil.rmtree(directory)


@pytest.mark.thorough
def test_a_disk_that_refuses(short_job, tmp_path):
    """Every call, for one reason after the other; every third for good."""
    refusals(short_job, tmp_path, lambda k: [([*FAULTS][k % 5], k % 3 == 0)])


@pytest.mark.soak
@pytest.mark.parametrize("fault", FAULTS)
def test_a_disk_that_refuses_all(short_job, tmp_path, fault):
    """Every call, for every reason, once or from then on."""
    refusals(short_job, tmp_path, lambda k: [(fault, False), (fault, True)])


def test_short_writes_change_nothing(short_job, tmp_path):
    sweep, reference, _ = short_job
    disk = FaultyDisk()
    go(sweep, tmp_path / "whole", disk=disk)
    writes = [k for k, call in enumerate(disk.log, start=1) if call[0] == "write"]
    assert len(writes) > 4
    for k in writes:
        go(sweep, tmp_path / str(k), disk=FaultyDisk(k, "short"))
        check_same(tmp_path / str(k), reference)


def test_the_order_of_calls(short_job, tmp_path):
    """Each published file: written, flushed, named, its folder flushed. What a kill cannot show."""
    sweep, _, _ = short_job
    disk = FaultyDisk()
    go(sweep, tmp_path / "run", disk=disk)
    names = [call[0] for call in disk.log]
    renames = [i for i, name in enumerate(names) if name == "replace"]
    assert len(renames) == 2 + 2  # run.json, two shards, the result
    for i in renames:
        part, path = disk.log[i][1:]
        created = max(j for j in range(i) if disk.log[j] == ("create", part, disk.log[j][-1]))
        writes = [j for j in range(created, i) if names[j] in ("write", "truncate")]
        flushed = [j for j in range(created, i) if names[j] == "sync"]
        assert writes and flushed and max(writes) < max(flushed) < i
        assert ("sync_folder", path.parent) == disk.log[i + 1]
    for i, call in enumerate(disk.log):
        if call[0] == "make_folder":
            assert disk.log[i + 1] == ("sync_folder", call[1].parent)
