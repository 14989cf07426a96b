"""Flipped bits, cut files, files that are not what their name says: each is found, kept aside, and made again."""

import errno
import json
import os
import shutil

import numpy as np
import pytest
from support.commands import cspr
from support.reading import read_here

import cspr_jax
from cspr_jax.cli import main
from cspr_jax.errors import CsprError, RefusedError, StoreError
from cspr_jax.sweep.inspection import verify
from reliability.support import Paper, check_same, content, go, sweep_of


@pytest.fixture(autouse=True)
def read_in_this_process(monkeypatch):
    """How files are read is what test_isolation.py is about."""
    read_here(monkeypatch)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("finished")
    sweep = sweep_of(folder, tiles=4)
    go(sweep, folder / "run")
    return sweep, folder / "run", content(folder / "run")


def without_quarantine(directory):
    """What was set aside, moved out of the way."""
    aside = directory / "quarantine"
    found = sorted(path.name for path in aside.iterdir()) if aside.is_dir() else []
    if aside.is_dir():
        shutil.rmtree(aside)
    return found


def flip(path, rng, first=0, last=None):
    data = bytearray(path.read_bytes())
    bit = int(rng.integers(8 * first, 8 * (last or len(data))))
    data[bit // 8] ^= 1 << (bit % 8)
    path.chmod(0o644)
    path.write_bytes(data)


def flips(finished, tmp_path, count):
    """Flip one bit of a shard, of the result, or of run.json; then run again. How many were noticed, of each kind."""
    sweep, source, reference = finished
    rng, noticed = np.random.default_rng(7), {"shard": 0, "result": 0, "run.json": 0}
    directory = tmp_path / "run"
    for i in range(count):
        shutil.rmtree(directory, ignore_errors=True)
        shutil.copytree(source, directory)
        kind = ("shard", "result", "shard", "result", "run.json")[i % 5]
        if kind == "shard":
            shard = directory / "shards" / f"0000{i % 4}.h5"
            flip(shard, rng, *((0, 1024) if i % 2 else ()))
            os.unlink(directory / "small.h5")
        elif kind == "result":
            flip(directory / "small.h5", rng, *((0, 4096) if i % 4 == 1 else ()))
        else:
            flip(directory / "run.json", rng)
            os.unlink(directory / "small.h5")
        paper = Paper(sweep)
        go(sweep, directory, paper=paper)
        noticed[kind] += len(without_quarantine(directory))
        assert len(paper.computed) == (kind == "shard")
        check_same(directory, reference)
    return noticed


def check_flips(noticed, count):
    assert noticed == {"shard": 2 * count // 5, "result": 2 * count // 5, "run.json": count // 5}


def test_flipped_bits(finished, tmp_path):
    check_flips(flips(finished, tmp_path, 30), 30)


@pytest.mark.soak
def test_flipped_bits_all(finished, tmp_path):
    check_flips(flips(finished, tmp_path, 1000), 1000)


def cut(path, rng):
    path.write_bytes(path.read_bytes()[: int(rng.integers(0, path.stat().st_size))])


def replacements(finished, tmp_path):
    """Ways to put something else under the name of shard 2."""
    _, source, _ = finished
    other = sweep_of(tmp_path / "other", tiles=4, trajectory="max_arcs = 12")
    go(other, tmp_path / "other" / "run")

    def folder(path):
        path.unlink()
        path.mkdir()
        (path / "inner").write_text("x")

    def link(path):
        shutil.move(path, path.parent.parent.parent / "elsewhere.h5")
        path.symlink_to(path.parent.parent.parent / "elsewhere.h5")

    return {
        "empty": lambda path: path.write_bytes(b""),
        "neighbour": lambda path: shutil.copy(source / "shards" / "00001.h5", path),
        "other sweep": lambda path: shutil.copy(tmp_path / "other" / "run" / "shards" / "00002.h5", path),
        "result": lambda path: shutil.copy(source / "small.h5", path),
        "text": lambda path: path.write_text("hello\n" * 200),
        "folder": folder,
        "link": link,
        "broken link": lambda path: (path.unlink(), path.symlink_to("nowhere")),
        "stray": lambda path: shutil.copy(path, path.with_name("00099.h5")),
    }


def replaced(finished, tmp_path, cuts):
    """Something else under the name of a shard, or a part of it: set aside, and made again."""
    sweep, source, reference = finished
    ways, directory = replacements(finished, tmp_path), tmp_path / "run"
    rng = np.random.default_rng(9)
    ways |= {f"cut {i}": lambda path: cut(path, rng) for i in range(cuts)}
    for name, way in ways.items():
        shutil.copytree(source, directory)
        way(directory / "shards" / "00002.h5")
        (directory / "small.h5").unlink()
        paper = Paper(sweep)
        go(sweep, directory, paper=paper)
        assert len(without_quarantine(directory)) == 1, name
        assert paper.computed == ([] if name == "stray" else [2]), name
        check_same(directory, reference)
        shutil.rmtree(directory)


def test_replaced_shards(finished, tmp_path):
    replaced(finished, tmp_path, 6)


@pytest.mark.soak
def test_replaced_shards_all(finished, tmp_path):
    replaced(finished, tmp_path, 300)


def cut_results(finished, tmp_path, count):
    sweep, source, reference = finished
    rng = np.random.default_rng(10)
    shutil.copytree(source, tmp_path / "run")
    for _ in range(count):
        cut(tmp_path / "run" / "small.h5", rng)
        assert verify(tmp_path / "run")["faults"]
        go(sweep, tmp_path / "run")
        assert without_quarantine(tmp_path / "run") == ["small.h5.0"]
        check_same(tmp_path / "run", reference)


def test_cut_results(finished, tmp_path):
    cut_results(finished, tmp_path, 8)


@pytest.mark.soak
def test_cut_results_all(finished, tmp_path):
    cut_results(finished, tmp_path, 300)


def test_shards_of_another_sweep_are_not_touched_when_the_record_is_damaged(finished, tmp_path):
    """A damaged run.json does not hand somebody's shards to another sweep."""
    _, source, _ = finished
    shutil.copytree(source, tmp_path / "run")
    (tmp_path / "run" / "small.h5").unlink()
    flip(tmp_path / "run" / "run.json", np.random.default_rng(1))
    other = sweep_of(tmp_path / "other", tiles=4, trajectory="max_arcs = 12")
    before = content(tmp_path / "run")
    with pytest.raises(RefusedError, match="another sweep"):
        go(other, tmp_path / "run")
    assert content(tmp_path / "run") == before


def test_somebodys_file_under_the_name_of_the_result(finished, tmp_path):
    sweep, _, _ = finished
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "small.h5").write_text("mine")
    with pytest.raises(CsprError, match="choose another -o"):
        go(sweep, tmp_path / "run")
    assert content(tmp_path / "run") == {"small.h5": b"mine"}


@pytest.mark.parametrize("name", ["run.json", "shards/00001.h5", "shards/photo.png", "shards"])
def test_somebodys_files_under_the_names_of_a_run(finished, tmp_path, name):
    """Where no run of ours ever was, nothing is moved: not even to quarantine."""
    sweep, _, _ = finished
    path = tmp_path / "run" / name
    path.parent.mkdir(parents=True)
    path.write_text("mine")
    before = content(tmp_path / "run")
    with pytest.raises(RefusedError, match="somebody's file"):
        go(sweep, tmp_path / "run")
    assert content(tmp_path / "run") == before


def test_other_names_among_the_shards_are_left_alone(finished, tmp_path):
    sweep, source, reference = finished
    shutil.copytree(source, tmp_path / "run")
    (tmp_path / "run" / "small.h5").unlink()
    (tmp_path / "run" / "shards" / "notes.txt").write_text("mine")
    paper = Paper(sweep)
    go(sweep, tmp_path / "run", paper=paper)
    assert paper.computed == [] and (tmp_path / "run" / "shards" / "notes.txt").read_text() == "mine"
    (tmp_path / "run" / "shards" / "notes.txt").unlink()
    check_same(tmp_path / "run", reference)


@pytest.mark.parametrize("code", [errno.EMFILE, errno.EIO, errno.ENOLCK])
@pytest.mark.parametrize("call", ["open", "pread"])
def test_a_refusal_to_read_is_no_damage(finished, tmp_path, monkeypatch, call, code):
    """Too many open files, a disk that fails, say: nothing is set aside, and the next run goes on."""
    sweep, source, reference = finished
    shutil.copytree(source, tmp_path / "run")
    (tmp_path / "run" / "small.h5").unlink()
    before = content(tmp_path / "run")
    usual, shard, words = getattr(os, call), tmp_path / "run" / "shards" / "00002.h5", os.strerror(code)

    def refuse(place, *arguments):
        there = os.fstat(place) if isinstance(place, int) else os.lstat(place) if os.path.lexists(place) else None
        if there is not None and os.path.samestat(there, os.lstat(shard)):
            raise OSError(code, words)
        return usual(place, *arguments)

    with monkeypatch.context() as patch:
        patch.setattr(os, call, refuse)
        with pytest.raises(StoreError, match=rf"00002\.h5: cannot be read: {words}"):
            go(sweep, tmp_path / "run")
        found = verify(tmp_path / "run")
        assert (found["shards"], found["faults"], len(found["unreadable"])) == (3, [], 1)
        assert words in cspr("verify", tmp_path / "run")[2] and cspr("verify", tmp_path / "run")[0] == 4
    assert content(tmp_path / "run").keys() >= before.keys() and not (tmp_path / "run" / "quarantine").exists()
    go(sweep, tmp_path / "run")
    check_same(tmp_path / "run", reference)


def test_status_tells_the_pace(finished, tmp_path, capsys):
    """Without the first tile of the last process, which holds the time of compiling, and without broken entries."""
    _, source, _ = finished
    shutil.copytree(source, tmp_path / "run")
    (tmp_path / "run" / "shards" / "00003.h5").unlink()
    next((tmp_path / "run").glob("*.h5")).unlink()
    minute = "2026-01-01T00:{:02d}:00+0000"
    events = [("tile", 9, 3), ("started", 20, None), ("tile", 25, 0), ("tile", 26, 1), ("tile", 28, 2)]
    lines = [{"time": minute.format(at), "event": event, "index": index} for event, at, index in events]
    lines += [
        {"time": "yesterday", "event": "tile", "index": 1},
        {"time": minute.format(1), "event": "tile", "index": "x"},
    ]
    text = "\n".join([*map(json.dumps, lines[:4]), "no entry", *map(json.dumps, lines[4:])])
    (tmp_path / "run" / "log.jsonl").write_text(text + "\n")
    state = cspr_jax.status(tmp_path / "run")
    assert (state["cells"], state["cells_done"]) == (12, 9)
    assert state["cells_per_second"] == pytest.approx(6 / 180) and state["seconds_left"] == pytest.approx(90)
    assert main(["status", str(tmp_path / "run")]) == 0
    out = capsys.readouterr().out
    assert "75 % done: 9 of 12 cells, 3 of 4 tiles\n  0.0333 cells/s; at this rate 0:01:30 left\n" in out
    assert "shards" not in out and "set aside" not in out


def test_verify_and_status_tell_without_touching(finished, tmp_path, capsys):
    _, source, _ = finished
    shutil.copytree(source, tmp_path / "run")
    directory = str(tmp_path / "run")
    assert main(["verify", directory]) == 0
    assert "tiles 4, shards 4, missing 0, cells 12" in capsys.readouterr().out
    flip(tmp_path / "run" / "shards" / "00003.h5", np.random.default_rng(2))
    (tmp_path / "run" / "shards" / "00000.h5").unlink()
    (tmp_path / "run" / "shards" / ".00000.h5.12.part").write_bytes(b"x")
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / "run").rglob("*")}
    assert main(["verify", directory, "--json"]) == 4
    out, err = capsys.readouterr()
    found = json.loads(out)
    assert (found["shards"], found["missing"], len(found["faults"])) == (2, 1, 1)
    assert len(err.splitlines()) == 1 and "00003.h5: its bytes have changed" in err
    assert main(["status", directory, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["tiles"], found["shards"], found["unfinished"]) == (4, 3, 1)
    assert found["last"]["event"] == "finished"
    assert main(["status", directory]) == 0
    assert (
        "100 % done: 12 of 12 cells, 3 of 4 tiles\n  half-written files, which the next run removes: 1\n"
        in capsys.readouterr().out
    )
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / "run").rglob("*")} == before
    for command in ("status", "verify"):
        assert main([command, str(tmp_path)]) == 4
        assert len(capsys.readouterr().err.splitlines()) == 1
