"""Files that nobody should give to the program: each gives one line and an exit code, never a traceback."""

import json
import os
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support.commands import cspr
from support.reading import read_here

from cspr_jax.build.problems import build_amplitude
from cspr_jax.build.robots import build_limits, build_robot
from cspr_jax.config.plan import PlanFile
from cspr_jax.config.reading import checked, read_toml
from cspr_jax.config.robot import resolve_robot
from cspr_jax.errors import CsprError
from cspr_jax.store.files.checksum import with_trailer
from cspr_jax.sweep.definition import read_sweep
from reliability.support import SWEEP, content, go, sweep_of

ROOT = Path(__file__).parents[2]
PLAN = (ROOT / "sweeps" / "table_2_1.toml").read_text()
FILES = {
    "sweep": SWEEP.format(x="{ start = -0.5, stop = 0.5, count = 4 }", trajectory="", run="", store='["arcs"]'),
    "plan": PLAN[: PLAN.index("position = [-0.6")] + "position = [0.3, 0.1, 1.5]\n",
}


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("finished")
    sweep = sweep_of(folder, tiles=4)
    go(sweep, folder / "run")
    return sweep, folder / "run"


@pytest.fixture(autouse=True)
def no_pictures(monkeypatch):
    """Figures are laid out, not written: that takes longer than all the rest."""
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda self, *args, **kwargs: None)


def refused(*arguments, code=4):
    found, _, err = cspr(*arguments)
    assert (found, len(err.splitlines())) == (code, 1), err
    assert err.startswith("cspr: ") and str(arguments[1]) in err


def flipped_results(finished, tmp_path, count):
    _, directory = finished
    data, rng, path = (directory / "small.h5").read_bytes(), np.random.default_rng(11), tmp_path / "x.h5"
    told = 0
    for i in range(count):
        spoiled = bytearray(data)
        for bit in rng.integers(0, 8 * (2048 if i % 2 else len(data)), 1 + i % 3):
            spoiled[bit // 8] ^= 1 << (bit % 8)
        path.write_bytes(spoiled[: rng.integers(0, len(data))] if i % 5 == 0 else spoiled)
        for command in ("plot", "verify"):
            code, _, err = cspr(command, path)
            assert code in (0, 4) and len(err.splitlines()) == (code == 4), err
            told += code == 4
    return told


def test_flipped_and_cut_results(finished, tmp_path):
    assert flipped_results(finished, tmp_path, 60) > 60


@pytest.mark.soak
def test_flipped_and_cut_results_all(finished, tmp_path):
    assert flipped_results(finished, tmp_path, 5000) > 5000


def foreign(folder):
    """HDF5 files that look a little like results."""
    small = folder / "source.h5"
    with h5py.File(small, "w") as file:
        file["a"] = np.zeros(3)

    def grid(file, settings='{"dimensions": ["x", "y"]}', shape=(2, 3), scales=(2, 3), **attributes):
        file.attrs.update({"map": "minimum-arcs", "robot": "r", "settings": settings} | attributes)
        data = file.create_dataset("arcs", shape, "i2")
        for i, n in enumerate(scales):
            file["xy"[i]] = np.arange(n, dtype=float)
            file["xy"[i]].make_scale()
            data.dims[i].attach_scale(file["xy"[i]])

    def virtual(file):
        layout = h5py.VirtualLayout((3,), "f8")
        layout[:] = h5py.VirtualSource(str(small), "a", (3,))
        file.create_virtual_dataset("arcs", layout)

    def motion(file, shape=(4, 3)):
        file.attrs["robot"] = "r"
        file["t"] = np.arange(4.0)
        file["t"].make_scale()
        for name in ("position", "tension"):
            file.create_dataset(name, shape, "f8").dims[0].attach_scale(file["t"])

    return {
        "empty": lambda file: None,
        "groups": lambda file: file.create_group("arcs/x/y"),
        "plain data": lambda file: file.update({"arcs": 1}) if hasattr(file, "update") else file.__setitem__("arcs", 1),
        "no scales": lambda file: (file.attrs.update({"map": "m", "robot": "r"}), file.__setitem__("arcs", [1.0])),
        "virtual": virtual,
        "external": lambda file: file.create_dataset("arcs", (4,), "f8", external=[("/etc/hostname", 0, 32)]),
        "a terabyte": lambda file: file.create_dataset("arcs", (10**12,), "f8", chunks=(1000,)),
        "wrong shapes": lambda file: grid(file, shape=(5, 7)),
        "settings are no JSON": lambda file: grid(file, settings="{"),
        "settings are a list": lambda file: grid(file, settings="[1]"),
        "deep settings": lambda file: grid(file, settings="[" * 30000),
        "numbers for names": lambda file: grid(file, robot=3),
        "text for numbers": lambda file: (grid(file), file.__delitem__("arcs"), file.__setitem__("arcs", ["a"])),
        "soft link": lambda file: file.__setitem__("arcs", h5py.SoftLink("/nowhere")),
        "link to another file": lambda file: file.__setitem__("arcs", h5py.ExternalLink(str(small), "a")),
        "short motion": motion,
        "bent motion": lambda file: motion(file, (4, 2)),
    }


def test_foreign_hdf5(finished, tmp_path, monkeypatch):
    read_here(monkeypatch)
    for name, fill in foreign(tmp_path).items():
        path = tmp_path / "foreign.h5"
        with h5py.File(path, "w") as file:
            fill(file)
        refused("plot", path)  # it was not written by this program
        path.write_bytes(with_trailer(path.read_bytes()))  # and if it had been
        refused("plot", path)
        refused("verify", path)
        directory = tmp_path / "run"
        shutil.copytree(finished[1], directory)
        shutil.copy(path, directory / "small.h5")
        go(finished[0], directory)
        assert (directory / "small.h5").read_bytes() == content(finished[1])["small.h5"], name
        shutil.rmtree(directory)


def test_pipes_devices_and_links_to_them(tmp_path):
    """One line at once; a link to a file is followed."""
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to("pipe")
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "nowhere").symlink_to("none")
    for path in (tmp_path / "pipe", tmp_path / "link", tmp_path / "loop", tmp_path / "nowhere", Path("/dev/zero")):
        refused("plot", path, "-o", tmp_path / "a.png")
        refused("verify", path)
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "run.json").symlink_to("../pipe")
    for command in ("plot", "verify", "status"):
        refused(command, tmp_path / "run")


def test_a_link_to_a_result_is_followed(finished, tmp_path):
    (tmp_path / "link.h5").symlink_to(finished[1] / "small.h5")
    assert cspr("plot", tmp_path / "link.h5")[0] == 0 == cspr("verify", tmp_path / "link.h5")[0]


def test_files_that_are_no_hdf5(tmp_path):
    for name, data in {
        "empty": b"",
        "text": b"hello",
        "signature": b"\x89HDF\r\n\x1a\n" * 9,
        "zeros": bytes(9999),
    }.items():
        path = tmp_path / f"{name}.h5"
        path.write_bytes(data)
        refused("plot", path)
        refused("verify", path)
    for path in (tmp_path / "none.h5", tmp_path):
        refused("plot", path)
        refused("verify", path)
    assert cspr("table", tmp_path / "text.h5")[0] == 2


BOMBS = {
    "deep list": "robot = " + "[" * 50_000,
    "deep table": "robot = " + "{a=" * 20_000 + "1" + "}" * 20_000,
    "dotted": ".".join(["a"] * 500_000) + " = 1",
    "quoted": " . ".join(['"a"'] * 50_000) + " = 1",
    "spaced": "a" + " " * 500_000 + "." + "a." * 200_000 + "b = 1",
    "headers": "\n".join(f"[{'.'.join(f'a{i}' for i in range(k))}]" for k in range(1, 300)),
    "long key": "a" * 900_000 + " = 1",
    "long number": "z0 = " + "1" * 5000,
    "long float": "z0 = 1." + "0" * 900_000 + "e-99999",
    "long text": 'robot = "' + "x" * 900_000 + '"',
    "many tables": "[[pose]]\n" * 90_000,
    "too long": "#" * (1 << 21),
}


@pytest.mark.parametrize("name", BOMBS)
@pytest.mark.parametrize("command", ["run", "plan"])
def test_bombs(tmp_path, name, command):
    path = tmp_path / "bomb.toml"
    path.write_text(BOMBS[name])
    refused(command, path, code=2)


SIZES = {
    "axis": ("count = 4", "count = 10_000_000_000"),
    "product": ("y = [0.1, 0.2, 0.3]", "y = { start = 0, stop = 1, count = 10_000_000 }\nfrom_x = [0.1]"),
    "cells": ("count = 4 }", "count = 10_000_000 }\nfrom_z = {start = 0, stop = 1, count = 10_000_000}"),
    "tiles": ("count = 4", "count = 10_000_000"),
    "tile": ("[1, 3, 1, 1]", "[1000000, 3, 1, 1]"),
}


@pytest.mark.parametrize("name", SIZES)
def test_absurd_sizes(tmp_path, name):
    old, new = SIZES[name]
    assert old in FILES["sweep"]
    path = tmp_path / "large.toml"
    path.write_text(FILES["sweep"].replace(old, new))
    refused("run", path, code=2)


TOKENS = (
    *(
        "=",
        "[",
        "]",
        "{",
        "}",
        "[[",
        '"',
        "'",
        '"""',
        ",",
        ".",
        "#",
        "\n",
        "\\",
        "\0",
        "\x7f",
        "é",
        "\U0001f600",
        "-",
        "_",
    ),
    *("nan", "inf", "-inf", "1e400", "-0.0", "1e-320", "9" * 30, "0x10", "true", "false", "1979-05-27", "07:32:00"),
    *("[]", "{}", "[[]]", '""', "null", "schema", "robot", "axes", "[axes]", "x", "z0", "pose", "[[pose]]", "position"),
    *("rest", "run", "tile", "store", "arcs", "limits", "tension_min", "from", "amplitude", "polynomial", "epsilon"),
    *('"best"', '"effective"', '"fastest"', "choose", "max_arcs", "count", "start", "stop", "../x.toml", "base_points"),
    *("{ name = 'r', mass = 1, base_points = [[0,0,0],[1,0,0],[0,1,0]] }", "[0, 0, 0]", "1000000", "0", "-1", "0.5"),
)
EDITS = st.lists(
    st.tuples(st.integers(0, 10**4), st.integers(0, 12), st.sampled_from(TOKENS) | st.text(max_size=4)),
    min_size=1,
    max_size=5,
)


def read_anything(kind, path):
    """As far as a file is looked at before anything is computed."""
    if kind == "sweep":
        return read_sweep(path)
    keys = checked(PlanFile, read_toml(path), path)
    robot_file = resolve_robot(keys.robot, path, path.parent)
    return (
        build_robot(robot_file, keys, path),
        build_limits(robot_file, keys, path),
        build_amplitude(keys, path, epsilon=0.2),
    )


def fuzz(folder, examples):
    path, outcomes = folder / "fuzz.toml", {"read": 0, "refused": 0}

    @settings(max_examples=examples, suppress_health_check=list(HealthCheck), database=None)
    @given(st.sampled_from(sorted(FILES)), EDITS)
    def check(kind, edits):
        text = FILES[kind]
        for place, cut, token in edits:
            place %= len(text) + 1
            text = text[:place] + token + text[place + cut :]
        path.write_bytes(text.encode("utf-8", "surrogatepass"))
        try:
            read_anything(kind, path)
            outcomes["read"] += 1
        except CsprError as error:
            outcomes["refused"] += 1
            assert len(str(error).splitlines()) == 1 and str(path) in str(error)
            assert error.exit_code == 2

    check()
    return outcomes


def test_fuzzed_files(tmp_path):
    outcomes = fuzz(tmp_path, 120)
    assert outcomes["refused"] > 60 and outcomes["read"] > 0


@pytest.mark.soak
def test_fuzzed_files_all(tmp_path):
    assert fuzz(tmp_path, 100_000)["refused"] > 50_000


def test_records_that_nobody_wrote(finished, tmp_path):
    """run.json of any content: it is set aside, or the directory refused."""
    sweep, source = finished
    good = json.loads((source / "run.json").read_text())
    for text in ("", "[]", "1", "{}", "[" * 90_000, '{"identity": 1}', json.dumps(good | {"checksum": 1}), "\0" * 99):
        shutil.copytree(source, tmp_path / "run")
        (tmp_path / "run" / "run.json").chmod(0o644)
        (tmp_path / "run" / "run.json").write_text(text)
        refused("status", tmp_path / "run")
        refused("verify", tmp_path / "run")
        assert go(sweep, tmp_path / "run").computed == 0
        shutil.rmtree(tmp_path / "run")


def test_other_people_s_files_in_a_run_directory(tmp_path):
    """A file named LOCK, a link of that name, odd .part files and shards that are not the run's: none is lost."""
    sweep = sweep_of(tmp_path / "s", tiles=4)
    for name in ("file", "link"):
        directory = tmp_path / name
        directory.mkdir()
        (tmp_path / "precious").write_text("mine")
        if name == "file":
            (directory / "LOCK").write_text("mine")
        else:
            (directory / "LOCK").symlink_to(tmp_path / "precious")
        with pytest.raises(CsprError):
            go(sweep, directory)
        assert (directory / "LOCK").read_text() == "mine" == (tmp_path / "precious").read_text()
    directory = tmp_path / "run"
    directory.mkdir()
    (directory / ".download.part").write_text("mine")
    (directory / ".folder.part").mkdir()
    go(sweep, directory)
    (directory / "shards" / "mine.h5").write_text("mine")
    go(sweep, directory, prune=True)
    assert [path.name for path in (directory / "shards").iterdir()] == ["mine.h5"]
    assert (directory / ".download.part").read_text() == "mine" and (directory / ".folder.part").is_dir()


def test_a_log_that_is_a_pipe(tmp_path):
    sweep = sweep_of(tmp_path / "s", tiles=4)
    (tmp_path / "run").mkdir()
    os.mkfifo(tmp_path / "run" / "log.jsonl")
    with pytest.raises(CsprError, match=r"log\.jsonl"):
        go(sweep, tmp_path / "run")


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("schema = 1", "schema = 0x" + "f" * 5000),
        ("count = 4", "count = 0x" + "f" * 5000),
        ("[1, 3, 1, 1]", "[1, 3, 1, 0x" + "f" * 400 + "]"),
        ("schema = 1", '"!".' * 200_000 + "a = 1"),
        ("schema = 1", "'!' . " * 100_000 + "a = 1"),
    ],
)
def test_more_bombs(tmp_path, old, new):
    path = tmp_path / "bomb.toml"
    path.write_text(FILES["sweep"].replace(old, new))
    refused("run", path, code=2)


def test_odd_names(tmp_path):
    text = FILES["sweep"]
    long = tmp_path / f"{'n' * 230}.toml"
    long.write_text(text)
    refused("run", long, code=2)
    (tmp_path / "loop").symlink_to("loop")
    path = tmp_path / "s.toml"
    path.write_text(text)
    code, _, err = cspr("run", path, "-o", tmp_path / "loop")
    assert (code, len(err.splitlines())) == (4, 1)
    (tmp_path / "two\nlines").write_text("x")
    code, _, err = cspr("run", path, "-o", tmp_path / "two\nlines")
    assert (code, len(err.splitlines())) == (4, 1)
