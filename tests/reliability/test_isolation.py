"""Shards that anybody may have made, with a seal that fits: read by another process, set aside, and made again."""

import fcntl
import json
import os
import shutil
import signal
import subprocess
import sys
import sysconfig
import zlib
from importlib.machinery import PathFinder

import h5py
import numpy as np
import pytest
from support.commands import cspr

from cspr_jax.errors import StoreError
from cspr_jax.schema.identity import canonical_json, digest
from cspr_jax.store.files.checksum import LENGTH, with_trailer
from cspr_jax.store.files.netcdf import LAYOUT
from cspr_jax.store.reading import isolated
from cspr_jax.sweep.inspection import verify
from reliability.support import ENVIRONMENT, Paper, check_same, content, go, sweep_of
from reliability.test_damage import without_quarantine
from reliability.test_hostile_results import mutated


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("finished")
    sweep = sweep_of(folder, tiles=6)
    go(sweep, folder / "run")
    return sweep, folder / "run", content(folder / "run")


def spoiled_runs(folder, tiles):
    """Mutations of every shard of a run, sealed anew: how many a look at the directory names, and a run sets aside."""
    sweep, directory = sweep_of(folder, tiles=tiles), folder / "run"
    go(sweep, directory)
    reference = content(directory)
    (directory / "small.h5").unlink()
    computed_by = digest(ENVIRONMENT).encode()
    for index in range(tiles):
        path = directory / "shards" / f"{index:05d}.h5"
        spoiled = mutated(np.random.default_rng([23, index]), path.read_bytes()[:-LENGTH])
        # One letter of the environment's hash makes it a good shard of another environment, which a run refuses.
        if computed_by in spoiled:
            path.write_bytes(with_trailer(spoiled))
    found = verify(directory)
    assert found["shards"] + len(found["faults"]) == tiles and not found["unreadable"]
    paper = Paper(sweep)
    go(sweep, directory, paper=paper)
    assert len(paper.computed) == len(without_quarantine(directory)) == len(found["faults"])
    # A mutation of bytes that nobody reads changes no number.
    assert (directory / "small.h5").read_bytes() == reference["small.h5"]
    return len(found["faults"])


def test_mutated_shards(tmp_path):
    assert spoiled_runs(tmp_path, 40) > 5


@pytest.mark.soak
def test_mutated_shards_all(tmp_path):
    assert spoiled_runs(tmp_path, 3000) > 500


def test_one_without_end_among_others(finished, tmp_path, monkeypatch):
    """The process that reads it is ended, and another one reads the others: all of them, in two processes."""
    sweep, source, reference = finished
    shutil.copytree(source, tmp_path / "run")
    (tmp_path / "run" / "small.h5").unlink()
    hang = """import cspr_jax.store.reading.reader as r
usual = r.decode
def decode(place, layout, index, *rest):
    while index == 2:
        pass
    return usual(place, layout, index, *rest)
r.decode = decode
serve()"""
    starts, start = [], isolated.Reader._start
    with monkeypatch.context() as patch:
        patch.setattr(isolated, "_CODE", isolated._CODE.replace("serve()", hang))
        patch.setattr(isolated.Reader, "_start", lambda self, path: (starts.append(path.name), start(self, path)))
        paper = Paper(sweep)
        go(sweep, tmp_path / "run", paper=paper)
    assert paper.computed == [2] and without_quarantine(tmp_path / "run") == ["00002.h5.0"]
    assert starts == ["00000.h5", "00003.h5"]
    check_same(tmp_path / "run", reference)


@pytest.mark.parametrize(
    "number",
    [signal.SIGTERM, *(pytest.param(one, marks=pytest.mark.thorough) for one in (signal.SIGKILL, signal.SIGINT))],
)
def test_a_reader_that_somebody_ends_is_no_damage(finished, tmp_path, monkeypatch, number):
    """Batch systems end all processes of a job, and the system one that takes too much memory."""
    sweep, source, reference = finished
    shutil.copytree(source, tmp_path / "run")
    (tmp_path / "run" / "small.h5").unlink()
    code = "import cspr_jax.store.reading.reader as r, os, signal\n"
    code += f"r.answer = lambda *a: os.kill(os.getpid(), {int(number)})\n"
    if number != signal.SIGKILL:  # a shell's background job inherits some of them ignored
        code += f"signal.signal({int(number)}, signal.SIG_DFL)\n"
    code += "serve()"
    with monkeypatch.context() as patch:
        patch.setattr(isolated, "_CODE", isolated._CODE.replace("serve()", code))
        with pytest.raises(StoreError, match=r"00000\.h5: the process that read it .*; run it again"):
            go(sweep, tmp_path / "run")
        found = verify(tmp_path / "run")
    assert not found["faults"] and len(found["unreadable"]) == 6
    assert not (tmp_path / "run" / "quarantine").exists()
    go(sweep, tmp_path / "run")
    check_same(tmp_path / "run", reference)


def test_one_process_for_all_and_none_for_a_new_run(finished, tmp_path, monkeypatch):
    sweep, source, _ = finished
    starts, start = [], isolated.Reader._start
    monkeypatch.setattr(isolated.Reader, "_start", lambda self, path: (starts.append(path), start(self, path)))
    go(sweep, tmp_path / "run")
    assert starts == []
    verify(source)
    assert len(starts) == 1


def headers(sweep):
    """Headers of shard 1 that this program does not write."""
    good = {"environment": digest(ENVIRONMENT), "identity": sweep.identity, "near_zero": 0, "tile": 1}
    good["undecided"] = None
    wrong = (None, True, -1, 1.5, "1", "\ud800", 10**30, 1e400, [], {}, [[[]]])
    for key in good:
        yield f"no {key}", json.dumps({name: value for name, value in good.items() if name != key})
        for value in wrong:
            if good[key] is not value:
                yield f"{key} = {value!r}", json.dumps(good | {key: value})
    yield from (("deep", "[" * 90_000), ("null", "null"), ("list", "[]"), ("empty", ""), ("number", "1"))
    yield "not a number", json.dumps(good | {"near_zero": float("nan")})
    yield "large", json.dumps(good | {"near_zero": 4})
    yield "padded", canonical_json(good) + " " * (1 << 20) + "x"
    for value in (3, np.zeros(3), np.bytes_(canonical_json(good)), ["a", "b"], h5py.Empty("f8")):
        yield f"of type {type(value).__name__}", value


@pytest.mark.parametrize("step", [12, pytest.param(1, marks=pytest.mark.soak)])
def test_headers_of_any_type(finished, tmp_path, step):
    """With a seal and a content that fit: set aside, and the run goes on; without the record, too."""
    sweep, source, reference = finished
    directory = tmp_path / "run"
    shutil.copytree(source, directory)
    path = directory / "shards" / "00001.h5"
    good, cases = path.read_bytes(), list(headers(sweep))
    assert len(cases) > 50
    for i, (name, header) in enumerate(cases[::step]):
        forged = tmp_path / "forged.h5"
        forged.write_bytes(good[:-LENGTH])
        with h5py.File(forged, "r+", libver=LAYOUT) as file:
            file.attrs["header"] = header
        path.write_bytes(with_trailer(forged.read_bytes()))
        faults = verify(directory)["faults"]
        harmless = name == "no undecided"
        assert len(faults) == (not harmless) and all(len(line.splitlines()) == 1 for line in faults), name
        if i % 3 == 0:
            (directory / "small.h5").unlink()
            (directory / "run.json").unlink()
            paper = Paper(sweep)
            go(sweep, directory, paper=paper)
            assert paper.computed == [] if harmless else [1], name
            without_quarantine(directory)
            check_same(directory, reference | ({"shards/00001.h5": path.read_bytes()} if harmless else {}))


def bomb(file):
    """Gigabytes of zeros in one chunk under the name of a quantity."""
    del file["arcs"]
    data = file.create_dataset("arcs", (1 << 31,), "i2", chunks=(1 << 24,), compression="gzip")
    data.id.write_direct_chunk((0,), zlib.compress(bytes(1 << 25), 1))


@pytest.mark.parametrize(
    "change",
    [
        bomb,
        lambda file: (file.__delitem__("arcs"), file.__setitem__("arcs", h5py.SoftLink("/margin"))),
        lambda file: (file.__delitem__("arcs"), file.__setitem__("arcs", h5py.ExternalLink("/dev/zero", "a"))),
        lambda file: file.attrs.__setitem__("content_sha256", 3),
        lambda file: file.attrs.__delitem__("content_sha256"),
    ],
)
def test_hostile_shards(finished, tmp_path, change):
    sweep, source, reference = finished
    directory = tmp_path / "run"
    shutil.copytree(source, directory)
    path = directory / "shards" / "00001.h5"
    path.write_bytes(path.read_bytes()[:-LENGTH])
    with h5py.File(path, "r+", libver=LAYOUT) as file:
        change(file)
    path.write_bytes(with_trailer(path.read_bytes()))
    assert len(verify(directory)["faults"]) == 1
    (directory / "small.h5").unlink()
    go(sweep, directory)
    assert without_quarantine(directory) == ["00001.h5.0"]
    check_same(directory, reference)


def test_a_result_that_hdf5_cannot_lock_is_whole(finished):
    """Network disks refuse locks, and another program may hold one; whoever only reads needs none."""
    path = finished[1] / "small.h5"
    with open(path, "rb") as other:
        fcntl.flock(other, fcntl.LOCK_EX)
        assert cspr("verify", path)[0] == 0 == cspr("verify", finished[1])[0]
        assert go(*finished[:2]).computed == 0


def test_a_disk_without_locks_is_named(finished, tmp_path, monkeypatch):
    def refuse(file, how):
        raise OSError(37, os.strerror(37))

    monkeypatch.setattr(fcntl, "flock", refuse)
    with pytest.raises(StoreError, match=r"No locks available: .*choose -o on another disk") as raised:
        go(finished[0], tmp_path / "run")
    assert len(str(raised.value).splitlines()) == 1 and "HDF5_USE_FILE_LOCKING" in str(raised.value)


def test_each_library_of_the_process_may_lie_in_a_folder_of_its_own():
    """A variable or a loader of modules may name folders one by one: it is told the folders of all that it imports."""
    code = (
        "import sys, cspr_jax.store.reading.reader; print(*[getattr(m, '__file__', '') for m in sys.modules.values()])"
    )
    words = [sys.executable, "-c", code]
    files = subprocess.run(words, capture_output=True, text=True, check=True).stdout.split()
    sites = {sysconfig.get_path("purelib"), sysconfig.get_path("platlib")}
    needed = {
        file[len(site) + 1 :].partition("/")[0].partition(".")[0]
        for file in files
        for site in sites
        if file.startswith(site + "/")
    }
    at_start = {name for name in needed if name.startswith("_")}  # of installers
    assert needed - at_start - {"cspr_jax"} == set(isolated._LIBRARIES)
    places = isolated._library_folders()
    assert set(places) <= set(sys.path)
    assert all(PathFinder.find_spec(name, places) is not None for name in isolated._LIBRARIES)
