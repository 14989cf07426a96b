"""Going on after a change of sweep, program, machine or clock; equal runs give equal bytes."""

import os
import shutil
import subprocess
import sys
import time
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
import xarray

from cspr_jax.cli import main
from cspr_jax.errors import ConfigError, ExitCode, RefusedError, StoreError
from cspr_jax.schema.identity import digest
from cspr_jax.sweep.definition import read_sweep
from cspr_jax.sweep.inspection import verify
from reliability.support import ENVIRONMENT, Paper, check_same, content, go, sweep_of
from reliability.test_processes import PAPER


@pytest.fixture
def half(tmp_path):
    """A sweep of which four tiles of twelve are finished."""
    sweep = sweep_of(tmp_path, tiles=12)
    with pytest.raises(Exception, match="4 of 12 tiles are kept"):
        go(sweep, tmp_path / "run", paper=Paper(sweep, stop_after=4))
    return sweep, tmp_path / "run"


def tree(directory):
    return {path: path.read_bytes() for path in directory.rglob("*") if path.is_file()}


def test_going_on_computes_the_rest_only(half, tmp_path):
    sweep, directory = half
    paper = Paper(sweep)
    outcome = go(sweep, directory, paper=paper)
    assert (outcome.computed, outcome.reused, len(paper.computed)) == (8, 4, 8)
    again = Paper(sweep)
    assert go(sweep, directory, paper=again).computed == 0 and again.computed == []
    go(sweep, tmp_path / "whole")
    check_same(directory, content(tmp_path / "whole"))


CHANGES = {
    "trajectory.max_arcs": ("[run]", "max_arcs = 7\n[run]"),
    "trajectory.amplitude": ("[run]", "amplitude = {polynomial = [0, 0, 0, 10, -15, 6]}\n[run]"),
    "trajectory.gravity": ("[run]", "gravity = 9.7\n[run]"),
    "trajectory.from.rest": ("rest = true", "position = [0.1, 0.1, 1.2]"),
    "axes.y": ("0.3]", "0.31]"),
    "limits.floor": ("[run]", "[limits]\nfloor = 5.0\n[run]"),
    "run.dtype": ("[run]", '[run]\ndtype = "float32"'),
    "run.tile": ("[1, 3, 1, 1]", "[1, 3, 2, 1]"),
    "run.store": ('"margin", ', ""),
    "robot.name": ('"prototype"', '"transition-prototype"'),
}


@pytest.mark.parametrize("key", CHANGES)
def test_a_changed_sweep_is_refused(half, key):
    sweep, directory = half
    old, new = CHANGES[key]
    assert old in sweep.text
    sweep.file.write_text(sweep.text.replace(old, new))
    changed, before = read_sweep(sweep.file), tree(directory)
    with pytest.raises(RefusedError) as refusal:
        go(changed, directory)
    assert refusal.value.exit_code == ExitCode.REFUSED
    assert any(f" {key} = " in line or f" {key}." in line for line in str(refusal.value).splitlines())
    assert tree(directory) == before
    assert changed.identity != sweep.identity


@pytest.mark.parametrize("key", [*ENVIRONMENT, "xla_flags"])
def test_a_changed_environment_is_refused_or_accepted(half, key):
    sweep, directory = half
    known, before = ENVIRONMENT | {key: "new"}, tree(directory)
    with pytest.raises(RefusedError, match=rf'{key} = "new" here.*--accept-environment-change') as refusal:
        go(sweep, directory, paper=Paper(sweep, known))
    assert len(str(refusal.value).splitlines()) == 1
    assert tree(directory) == before
    paper = Paper(sweep, known)
    outcome = go(sweep, directory, paper=paper, accept_environment_change=True)
    assert len(paper.computed) == 8
    with h5py.File(outcome.result) as file:
        assert file.attrs["mixed"] == 1
        assert set(file.attrs["environments"].split()) == {digest(ENVIRONMENT), digest(known)}
    # A complete result is a complete result, wherever it is looked at.
    assert go(sweep, directory, paper=Paper(sweep, ENVIRONMENT)).computed == 0


def test_a_worker_of_another_environment_is_refused(half):
    sweep, directory = half

    class Mixed(Paper):
        def tiles(self, indices, stop):
            for computed in super().tiles(indices, stop):
                computed.environment["jax"] = "0.1"
                yield computed

    with pytest.raises(RefusedError, match="a worker differs"):
        go(sweep, directory, paper=Mixed(sweep))
    assert len(list((directory / "shards").iterdir())) == 4


def test_too_little_room(tmp_path, monkeypatch):
    """A grid that does not fit is refused before anything is made; what is there already counts."""
    sweep = sweep_of(tmp_path, tiles=4)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=1_000_000, total=10**12))
    with pytest.raises(ConfigError, match="must fit on the disk") as refusal:
        go(sweep, tmp_path / "run")
    assert refusal.value.exit_code == ExitCode.BAD_INPUT and not (tmp_path / "run").exists()


def test_a_folder_that_vanishes(tmp_path):
    sweep = sweep_of(tmp_path, tiles=4)

    class Vanishing(Paper):
        def tiles(self, indices, stop):
            for computed in super().tiles(indices, stop):
                if len(self.computed) == 2:
                    shutil.rmtree(tmp_path / "run")
                yield computed

    with pytest.raises(StoreError, match="cannot be written: No such file"):
        go(sweep, tmp_path / "run", paper=Vanishing(sweep))
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("now", [0.0, 2.0**31 + 5.0, 4e9])
def test_clocks_decide_nothing(half, tmp_path, monkeypatch, now):
    sweep, directory = half
    for path in (directory / "shards").iterdir():
        os.utime(path, (now, now))
    monkeypatch.setattr(time, "time", lambda: now)
    monkeypatch.setattr(time, "localtime", lambda: time.gmtime(now))
    paper = Paper(sweep)
    go(sweep, directory, paper=paper)
    assert len(paper.computed) == 8
    go(sweep, tmp_path / "whole")
    check_same(directory, content(tmp_path / "whole"))


def test_equal_runs_give_equal_bytes(tmp_path):
    """Backwards, elsewhere, in another language and time zone, with other hash seeds, on one processor."""
    sweep = sweep_of(tmp_path / "a", tiles=4)
    go(sweep, tmp_path / "reference")
    reference = content(tmp_path / "reference")
    go(sweep, tmp_path / "backwards", paper=Paper(sweep, backwards=True))
    check_same(tmp_path / "backwards", reference)
    (tmp_path / "b").mkdir()
    settings = (
        {"PYTHONHASHSEED": "0", "LC_ALL": "C", "TZ": "Pacific/Kiritimati"},
        {"PYTHONHASHSEED": "1", "LC_ALL": "tr_TR.UTF-8", "TZ": "America/St_Johns", "PAPER_CORES": "1"},
        {"PYTHONHASHSEED": "random"},
    )
    for i, extra in enumerate(settings):
        directory, sweep_path = tmp_path / f"run{i}", shutil.copy(sweep.file, tmp_path / "b" / "small.toml")
        command = [sys.executable, str(PAPER), "0", "run", str(sweep_path), "-o", str(directory)]
        subprocess.run(
            command,
            check=True,
            capture_output=True,
            cwd=tmp_path / "ab"[i % 2],
            env=os.environ | extra,
        )
        check_same(directory, reference)


def test_pruned_shards(half, tmp_path, capsys):
    sweep, directory = half
    go(sweep, directory, prune=True)
    assert list((directory / "shards").iterdir()) == []
    assert go(sweep, directory).computed == 0
    assert verify(directory)["faults"] == []
    (directory / "small.h5").write_bytes(b"no result")
    assert main(["verify", str(directory)]) == 4
    assert "small.h5" in capsys.readouterr().err
    assert go(sweep, directory).computed == 12
    go(sweep, directory, prune=True)  # of a finished run
    assert list((directory / "shards").iterdir()) == []


def test_the_result_is_labelled_for_others(tmp_path):
    """xarray, plain h5py, and h5dump where there is one: dimensions, units, flags, provenance."""
    sweep = sweep_of(tmp_path, tiles=4)
    path = go(sweep, tmp_path / "run").result
    with xarray.open_dataset(path, engine="h5netcdf") as data:
        assert set(data.data_vars) == set(sweep.store)
        for name in sweep.store:
            assert data[name].dims == ("x", "y", "z", "z0")
            assert data[name].attrs["long_name"] and "units" in data[name].attrs
        np.testing.assert_array_equal(data["y"], [0.1, 0.2, 0.3])
        assert data["z"].attrs["units"] == "m" and data["duration"].attrs["units"] == "s"
        assert data["verdict"].attrs["flag_meanings"].startswith("slack_cable")
        for name in ("identity", "settings", "environment", "environment_settings", "software", "content_sha256"):
            assert isinstance(data.attrs[name], str), name
        assert str(tmp_path) not in str(data.attrs)
    with h5py.File(path) as file:
        for name, item in file.items():
            assert [dim[0].name for dim in item.dims] == ["/x", "/y", "/z", "/z0"] if name in sweep.store else True
        of_hdf5 = {"CLASS", "NAME"}  # its dimension scales must have these of a fixed length
        attributes = [*file.attrs.items(), *(pair for item in file.values() for pair in item.attrs.items())]
        texts = {name: value for name, value in attributes if isinstance(value, str | bytes) and name not in of_hdf5}
        assert {"settings", "units", "flag_meanings"} <= texts.keys()
        assert all(type(value) is str for value in texts.values())
    if shutil.which("h5dump"):
        done = subprocess.run(["h5dump", "-H", str(path)], capture_output=True, text=True, check=True)
        assert "DATASET" in done.stdout
    for shard in (tmp_path / "run" / "shards").iterdir():
        with h5py.File(shard) as file:
            assert set(file) == set(sweep.store)


def test_provenance_is_in_the_record(tmp_path):
    from cspr_jax.store.documents import read_record

    sweep = sweep_of(tmp_path, tiles=4)
    go(sweep, tmp_path / "run")
    record = read_record(tmp_path / "run" / "run.json")
    assert record.identity == sweep.identity and record.settings == sweep.settings
    assert record.environment == ENVIRONMENT
    assert record.source["text"] == sweep.text and record.source["file"] == "small.toml"
    assert (tmp_path / "run" / "run.json").stat().st_mode & 0o222 == 0
