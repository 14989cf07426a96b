"""Links, pipes and second names planted at every name that the program writes: nothing elsewhere is touched."""

import os
import shutil

import pytest
from support.reading import read_here

from cspr_jax.errors import CsprError, RefusedError
from cspr_jax.store.files import publishing
from cspr_jax.store.files.disk import Disk
from cspr_jax.store.files.publishing import publish
from cspr_jax.sweep.inspection import status
from reliability.support import Paper, check_same, content, go, sweep_of

# In a run directory: each may be there before a run, or come while it goes.
NAMES = ("LOCK", "log.jsonl", "run.json", "small.h5", "shards", "quarantine", "shards/00001.h5", "shards/00003.h5")


@pytest.fixture(autouse=True)
def read_in_this_process(monkeypatch):
    """How files are read is what test_isolation.py is about."""
    read_here(monkeypatch)


def plants(outside):
    """Ways to lead a name elsewhere; each takes the name."""
    (outside / "folder").mkdir(parents=True)
    (outside / "file").write_text("mine")
    (outside / "empty").touch()
    return {
        "link to a file": lambda path: path.symlink_to(outside / "file"),
        "link to an empty file": lambda path: path.symlink_to(outside / "empty"),
        "link to nothing": lambda path: path.symlink_to(outside / "new"),
        "link to a folder": lambda path: path.symlink_to(outside / "folder"),
        "link to a device": lambda path: path.symlink_to("/dev/zero"),
        "second name of a file": lambda path: os.link(outside / "file", path),
        "second name of an empty file": lambda path: os.link(outside / "empty", path),
        "pipe": os.mkfifo,
    }


def put(path, plant):
    """In place of what is there."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if os.path.lexists(path):
        path.rename(path.with_name(f"away.{path.name}"))
    plant(path)


def remove(path):
    """What is no file of a run."""
    if os.path.lexists(path) and (path.is_symlink() or path.is_fifo() or os.lstat(path).st_nlink > 1):
        path.unlink() if path.is_symlink() or not path.is_dir() else None


class Planting(Paper):
    """Paper during whose tile something is planted."""

    def tiles(self, indices, stop):
        for computed in super().tiles(indices, stop):
            if len(self.computed) == self.moment:
                put(*self.what)
            yield computed


def planted(tmp_path, moments, step=1):
    """How many were planted; nothing elsewhere has changed, and where they are removed the run goes on."""
    sweep, outside, directory = sweep_of(tmp_path / "s", tiles=4), tmp_path / "outside", tmp_path / "run"
    go(sweep, tmp_path / "whole")
    reference, ways = content(tmp_path / "whole"), plants(outside)

    def look():
        return {str(path): path.read_bytes() if path.is_file() else None for path in outside.rglob("*")}

    before = look()
    cases = [(name, way, moment) for name in NAMES for way in ways for moment in moments][::step]
    for case in cases:
        name, way, moment = case
        paper = Planting(sweep)
        paper.moment, paper.what = moment, (directory / name, ways[way])
        if moment == 0:
            put(*paper.what)
        try:
            go(sweep, directory, paper=paper)
        except CsprError as error:
            assert len(str(error).splitlines()) == 1, case
        assert look() == before, case
        for other in {"LOCK", "log.jsonl", name}:
            remove(directory / other)
        go(sweep, directory)
        assert (directory / "small.h5").read_bytes() == reference["small.h5"], case
        assert look() == before, case
        shutil.rmtree(directory)
    return len(cases)


def test_planted_names(tmp_path):
    """Every fifth, so that each name and each way comes."""
    assert planted(tmp_path, (0, 2), 5) == 26


@pytest.mark.soak
def test_planted_names_all(tmp_path):
    assert planted(tmp_path, (0, 1, 2, 3, 4)) == 320


def test_a_name_that_somebody_guessed(tmp_path, monkeypatch):
    """Where the name of what is not whole is taken, nothing is written to it, and it is not removed."""
    (tmp_path / "mine").write_text("mine")
    part = tmp_path / ".a.png.guess.part"
    monkeypatch.setattr(publishing, "part_of", lambda path: part)
    for target in ("mine", "new"):
        part.symlink_to(tmp_path / target)
        with pytest.raises(CsprError, match=r"a\.png: cannot be written: File exists"):
            publish(Disk(), tmp_path / "a.png", b"picture")
        assert part.is_symlink() and not (tmp_path / "new").exists() and not (tmp_path / "a.png").exists()
        part.unlink()
    assert (tmp_path / "mine").read_text() == "mine"


def test_names_of_what_is_not_whole_cannot_be_known(tmp_path):
    names = {publishing.part_of(tmp_path / "a.png") for _ in range(100)}
    assert len(names) == 100 and not any(str(os.getpid()) == path.name.split(".")[-2] for path in names)


def test_leftovers_of_this_and_earlier_versions(tmp_path):
    """They are removed; links with such names are not ours, and are neither counted nor touched."""
    sweep, directory = sweep_of(tmp_path / "s", tiles=4), tmp_path / "run"
    go(sweep, directory)
    (directory / "small.h5").unlink()
    for name in (".00001.h5.4711.part", publishing.part_of(directory / "00002.h5").name):
        (directory / "shards" / name).write_bytes(b"half")
    (directory / ".small.h5.4711.part").write_bytes(b"half")
    (tmp_path / "mine").write_text("mine")
    (directory / "shards" / ".00003.h5.4711.part").symlink_to(tmp_path / "mine")
    assert status(directory)["unfinished"] == 3
    go(sweep, directory)
    assert [path.name for path in directory.rglob(".*.part")] == [".00003.h5.4711.part"]
    assert (tmp_path / "mine").read_text() == "mine"


@pytest.mark.parametrize("how", ["removed", "replaced", "a link"])
def test_a_lock_that_is_no_longer_ours(tmp_path, how):
    """The run writes no further tile; the next one goes on."""
    sweep, directory = sweep_of(tmp_path / "s", tiles=6), tmp_path / "run"

    def lose(path):
        path.with_name("away.LOCK").rename(tmp_path / "away")
        if how == "replaced":
            path.touch()
        elif how == "a link":
            path.symlink_to(tmp_path / "away")

    paper = Planting(sweep)
    paper.moment, paper.what = 3, (directory / "LOCK", lose)
    with pytest.raises(RefusedError, match="LOCK: was removed or replaced"):
        go(sweep, directory, paper=paper)
    assert len(list((directory / "shards").glob("*.h5"))) == 2
    (directory / "LOCK").unlink(missing_ok=True)
    assert go(sweep, directory).reused == 2
    go(sweep, tmp_path / "whole")
    check_same(directory, content(tmp_path / "whole"))
