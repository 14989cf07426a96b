"""Sealed result files that nobody wrote: each gives one line and an exit code, in little time and memory."""

import faulthandler
import json
import os
import subprocess
import sys
import zlib
from concurrent.futures import ThreadPoolExecutor

import h5py
import numpy as np
import pytest
from outputs.test_outputs import settings_of
from support.commands import cspr
from support.reading import read_here

import cspr_jax
from cspr_jax.errors import StoreError
from cspr_jax.outputs.plots.draw import _map_figure
from cspr_jax.outputs.plots.motions.motion import motion_figure
from cspr_jax.schema.identity import identity
from cspr_jax.store.consolidation import content_of
from cspr_jax.store.files.checksum import LENGTH, DamagedError, with_trailer, write_trailer
from cspr_jax.store.files.disk import Disk
from cspr_jax.store.files.netcdf import LAYOUT, make_datasets, set_attributes
from cspr_jax.store.reading import isolated

AXES = {"x": [0.1, 0.2, 0.3, 0.4], "y": [0.1, 0.2, 0.3], "z": [1.0, 1.5], "z0": [1.7]}
SHAPE = tuple(len(points) for points in AXES.values())
STORE = ["arcs", "margin"]


def good_settings():
    return settings_of(json.loads(json.dumps(AXES))) | {"run": {"tile": list(SHAPE), "store": STORE}}


def a_map(file, settings=None, **attributes):
    """A good result, but for what is given."""
    known = {"map": "minimum-arcs", "robot": "prototype", "z_axis": "down", "base_points": np.eye(3) * 0.3}
    if settings is None or isinstance(settings, dict):
        settings = settings or good_settings()
        known["identity"] = identity(settings)
    set_attributes(file, known | {"settings": json.dumps(settings) if isinstance(settings, dict) else settings})
    set_attributes(file, attributes)
    make_datasets(file, {n: np.array(p) for n, p in AXES.items()}, STORE, dtype="float64", tile=SHAPE)
    file["arcs"][...], file["margin"][...] = 3, 0.5


def a_motion(file, count=5, **attributes):
    set_attributes(file, {"robot": "prototype", "z_axis": "down", "z0": 1.7, "mass": 0.2} | attributes)
    file["t"] = np.linspace(0.0, 1.0, count)
    for name, width in (("position", 3), ("velocity", 3), ("tension", 3)):
        file[name] = np.ones((count, width))


def forged(path, fill, layout=LAYOUT):
    """A file with its seal."""
    with h5py.File(path, "w", libver=layout) as file:
        fill(file)
    seal(path)
    return path


def seal(path):
    with open(path, "r+b") as file:
        write_trailer(Disk(), file.fileno(), os.fstat(file.fileno()).st_size)


def changed(*keys, to):
    """A good map whose settings hold something else at one place."""

    def fill(file):
        settings = good_settings()
        inner = settings
        for key in keys[:-1]:
            inner = inner[key]
        inner[keys[-1]] = to
        a_map(file, settings)

    return fill


def instead(name, make):
    """A good map with another object under the name of one of its datasets."""

    def fill(file):
        a_map(file)
        del file[name]
        make(file)

    return fill


def also(make, good=a_map):
    """A good file, and something more done to it."""
    return lambda file: (good(file), make(file))


def attribute(name, value, **how):
    def fill(file):
        a_map(file)
        file.attrs.create(name, value, **how)

    return fill


def bomb(file):
    """Seven gigabytes of zeros, packed; the chunks are one chunk, many times."""
    size = 1 << 20
    data = file.create_dataset("arcs", (3500 * size,), "i2", chunks=(size,), compression="gzip", shuffle=True)
    packed = zlib.compress(bytes(2 * size))
    for i in range(3500):
        data.id.write_direct_chunk((i * size,), packed)


def gigabytes(file):
    file.create_dataset("arcs", SHAPE, "i2", maxshape=(None,) * 4, chunks=(64, 64, 64, 4096), compression="gzip")


def doubled(file):
    """A filter of which one use is enough for anybody, three times."""
    creation = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    creation.set_chunk(SHAPE)
    for _ in range(3):
        creation.set_filter(h5py.h5z.FILTER_DEFLATE, 0, (9,))
    h5py.h5d.create(file.id, b"arcs", h5py.h5t.STD_I16LE, h5py.h5s.create_simple(SHAPE), creation)


def repeated(path):
    """Items of any length, four gigabytes of them, which are all one."""
    with h5py.File(path, "w", libver=LAYOUT) as file:
        a_map(file)
        del file["arcs"]
        data = file.create_dataset("arcs", (1000,), h5py.vlen_dtype("u1"))
        data[0] = np.zeros(4 << 20, "u1")
        place = data.id.get_offset()
    with open(path, "r+b") as file:
        one = os.pread(file.fileno(), 16, place)
        os.pwrite(file.fileno(), one * 1000, place)


def virtual(fifo):
    """Of a pipe, and of no known length: HDF5 opens the pipe to learn it."""

    def make(file):
        layout = h5py.VirtualLayout((3,), "i2", maxshape=(None,))
        source = h5py.VirtualSource(str(fifo), "a", (3,), maxshape=(None,))
        layout[0 : h5py.h5s.UNLIMITED] = source[0 : h5py.h5s.UNLIMITED]
        file.create_virtual_dataset("arcs", layout)

    return make


def put(name, value, **how):
    return instead(name, lambda file: file.create_dataset(name, data=value, **how))


def files(fifo):
    """What is in each file."""
    nested = np.dtype([("a", np.dtype([("b", "f8", (3, 3))]), 5)])
    other = str(fifo.with_name("other.h5"))
    return {
        "a link to a pipe": instead("arcs", lambda f: f.__setitem__("arcs", h5py.ExternalLink(str(fifo), "a"))),
        "an axis that is a pipe": instead("z", lambda f: f.__setitem__("z", h5py.ExternalLink(str(fifo), "a"))),
        "a pipe in a virtual dataset": instead("arcs", virtual(fifo)),
        "a link to another file": instead("arcs", lambda f: f.__setitem__("arcs", h5py.ExternalLink(other, "a"))),
        "a link inside": instead("arcs", lambda f: f.__setitem__("arcs", h5py.SoftLink("/margin"))),
        "a link to itself": instead("arcs", lambda f: f.__setitem__("arcs", h5py.SoftLink("/arcs"))),
        "data elsewhere": instead(
            "arcs", lambda f: f.create_dataset("arcs", SHAPE, "i2", external=[(str(fifo), 0, 99)])
        ),
        "items of any length": None,  # its bytes are changed
        "texts of any length": put("arcs", np.full(SHAPE, "x" * 9999, object), dtype=h5py.string_dtype()),
        "a compound": put("arcs", np.zeros(SHAPE, nested)),
        "an enumeration": put("arcs", np.zeros(SHAPE, "i2"), dtype=h5py.enum_dtype({"a": 0}, "i2")),
        "a reference": instead("arcs", lambda f: f.create_dataset("arcs", SHAPE, h5py.ref_dtype)),
        "a group": instead("arcs", lambda f: f.create_group("arcs/arcs/arcs")),
        "a named type": instead("arcs", lambda f: f.__setitem__("arcs", np.dtype("i2"))),
        "a scalar": put("arcs", np.int16(3)),
        "nothing": put("arcs", h5py.Empty("i2")),
        "a petabyte": instead("arcs", lambda f: f.create_dataset("arcs", (10**15,), "i2", chunks=(1 << 20,))),
        "a chunk of gigabytes": instead("arcs", gigabytes),
        "many small chunks": instead("arcs", lambda f: f.create_dataset("arcs", (10**7,), "i2", chunks=(1,))),
        "packed zeros": instead("arcs", bomb),
        "packed thrice": instead("arcs", doubled),
        "packed otherwise": put("arcs", np.zeros(SHAPE, "i2"), compression="lzf"),
        "many objects": also(lambda f: [f.__setitem__(f"l{i}", f["arcs"]) for i in range(5000)]),
        "many groups": also(lambda f: [f.create_group(f"g{i}") for i in range(2000)]),
        "a filler": attribute("filler", np.zeros(40 << 20, "u1")),
        "a filler of a dataset": also(lambda f: f["arcs"].attrs.create("filler", np.zeros(40 << 20, "u1"))),
        "many attributes": also(lambda f: [f.attrs.create(f"a{i}", np.zeros(30_000, "u1")) for i in range(500)]),
        "many of a dataset": also(lambda f: [f["z"].attrs.create(f"a{i}", 1) for i in range(2000)]),
        "a text in a list": attribute("settings", ["{}"]),
        "a text that is none": attribute("settings", h5py.Empty(h5py.string_dtype())),
        "bytes that are no text": attribute("title", b"\xff", dtype=h5py.string_dtype()),
        "a long text of a fixed length": attribute("title", np.bytes_(b"r" * (1 << 17))),
        "many texts": attribute("robot", ["a" * 99] * 999),
        "a long name": lambda f: a_map(f, robot="r" * (1 << 20)),
        "a name that is a list": attribute("robot", [1, 2]),
        "long settings": lambda f: a_map(f, '{"a": "' + "x" * (9 << 20) + '"}'),
        "a settings bomb": lambda f: a_map(f, "[" + "[]," * (2 << 20) + "[]]"),
        "keys without end": lambda f: a_map(f, "{" + ",".join(f'"a{i}":1' for i in range(300_000)) + "}"),
        "deep settings": lambda f: a_map(f, "[" * 9_000 + "]" * 9_000),
        "settings that are null": lambda f: a_map(f, "null"),
        "settings that are no JSON": lambda f: a_map(f, "{"),
        "a large integer": lambda f: a_map(f, '{"schema": ' + "9" * 9000 + "}"),
        "no trajectory": changed("trajectory", to=None),
        "a list for the trajectory": changed("trajectory", to=[1]),
        "a list for the start": changed("trajectory", "from", to=[1]),
        "a list for the robot's name": changed("robot", "name", to=["a"]),
        "a list for the robot": changed("robot", to=[]),
        "the name of a robot": changed("robot", to="prototype"),
        "another robot": changed("robot", "name", to="other"),
        "spools of text": changed("robot", "base_points", to="abc"),
        "spools without end": changed("robot", "base_points", to=[[0.0, 0.0, 0.0]] * 2000),
        "spools far away": attribute("base_points", np.full((3, 3), 1e300)),
        "spools that are no numbers": attribute("base_points", np.full((3, 3), np.nan)),
        "spools in a row": attribute("base_points", np.zeros(9)),
        "many spools": attribute("base_points", np.zeros((5000, 3))),
        "an axis of texts": changed("axes", "x", to=["a"] * 500_000),
        "dimensions that are numbers": changed("dimensions", to=[1, 2]),
        "a dimension that is null": changed("dimensions", to=None),
        "a dimension twice": changed("dimensions", to=["x", "x", "z", "z0"]),
        "a z axis that points sideways": changed("robot", "z_axis", to="sideways"),
        "another map": lambda f: a_map(f, map="poses"),
        "a place that is not a number": also(lambda f: f["x"].__setitem__(0, np.nan)),
        "a place far away": also(lambda f: f["x"].__setitem__(0, 1e300)),
        "numbers too large": also(lambda f: f["margin"].__setitem__(0, 1e300)),
        "fewer than no arcs": also(lambda f: f["arcs"].__setitem__(0, -1)),
        "a motion to a pipe": also(
            lambda f: (f.__delitem__("tension"), f.__setitem__("tension", h5py.ExternalLink(str(fifo), "a"))), a_motion
        ),
        "a motion of no mass": lambda f: a_motion(f, mass=1e-300),
        "a motion without end": lambda f: a_motion(f, z0=np.inf),
        "a motion back in time": also(lambda f: f["t"].__setitem__(0, 2.0), a_motion),
        "a motion of a long name": lambda f: a_motion(f, robot="r" * 300),
        "a motion with a robot that is none": lambda f: a_motion(f, robot_settings='{"name": ["a"]}'),
        "an empty motion": lambda f: a_motion(f, 0),
    }


class Hostile(dict):
    """Files, by what is wrong with them; each is made when it is asked for."""

    def __init__(self, folder):
        super().__init__()
        os.mkfifo(folder / "fifo")
        forged(folder / "other.h5", lambda file: file.__setitem__("a", np.zeros(SHAPE, "i2")))
        self.folder, self.fills = folder, files(folder / "fifo")

    def __missing__(self, name):
        self[name] = path = self.folder / f"{len(self)}.h5"
        if self.fills[name] is None:
            repeated(path)
            seal(path)
        else:
            forged(path, self.fills[name])
        return path


@pytest.fixture(scope="module")
def hostile(tmp_path_factory):
    return Hostile(tmp_path_factory.mktemp("hostile"))


def test_good_ones_are_drawn(tmp_path, monkeypatch):
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda self, *args, **kwargs: None)
    for name, fill in (("map", a_map), ("motion", a_motion)):
        for layout in (LAYOUT, ("earliest", "v108")):
            path = forged(tmp_path / f"{name}.h5", fill, layout)
            assert cspr("plot", path) == (0, f"{path.with_suffix('.png')}\n", "")
    assert cspr("verify", path) == (0, f"{path}: rows 5\n", "")


@pytest.mark.parametrize("step", [5, pytest.param(1, marks=pytest.mark.soak)])
def test_hostile_files_are_refused(hostile, monkeypatch, step):
    """Every fifth one, and all in the soak."""
    read_here(monkeypatch)
    assert len(hostile.fills) >= 60
    faulthandler.dump_traceback_later(300.0, exit=True)  # HDF5 would wait for ever, and Python with it
    for name in list(hostile.fills)[::step]:
        path = hostile[name]
        with pytest.raises(StoreError) as raised:
            cspr_jax.open_result(path)
        line = str(raised.value)
        assert len(line.splitlines()) == 1 and len(line) < 500 and line.startswith(f"{path}: "), name
        if "motion" not in name:
            with pytest.raises(DamagedError):
                content_of(path)
    faulthandler.cancel_dump_traceback_later()


# Those that took gigabytes, or minutes, or for ever.
WORST = (
    *("a link to a pipe", "a pipe in a virtual dataset", "items of any length", "packed zeros", "a settings bomb"),
    *("keys without end", "an axis of texts"),
)
MEASURED = """
import resource, sys
from pathlib import Path
from cspr_jax.cli import main
for command, path in zip(sys.argv[1::2], sys.argv[2::2]):
    print(main([command, path]), flush=True)
if sys.platform == "linux":  # its own peak, not what it had from its parent before it was this program
    own = next(line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM"))
    print("peak", max(int(own.split()[1]), resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss))
"""


def worst(hostile, tmp_path, commands_of):
    """As commands, each file read by a process of its own; nothing of the working folder is run."""
    for name in ("h5py", "numpy", "cspr_jax", "json"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit(99)")
    large = forged(tmp_path / "large.h5", a_map)  # six gigabytes of nothing in front of a seal that does not fit
    line = large.read_bytes()[-LENGTH:]
    with open(large, "r+b") as file:
        file.truncate(6 << 30)
        os.pwrite(file.fileno(), line, 6 << 30)
    (tmp_path / "link.h5").symlink_to(hostile["a link to a pipe"].with_name("fifo"))
    quick = [(command, path) for path in (large, tmp_path / "link.h5", "/dev/zero") for command in ("plot", "verify")]
    asked = [(command, hostile[name]) for i, name in enumerate(WORST) for command in commands_of(i)] + quick
    command = [sys.executable, "-I", "-c", MEASURED, *(str(word) for words in asked for word in words)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300, check=True)
    assert [line for line in done.stdout.splitlines() if line.isdigit()] == ["4"] * len(asked)
    errors = done.stderr.splitlines()
    assert len(errors) == len(asked) and all(line.startswith("cspr: ") for line in errors)
    # Not hashed, which takes long.
    told = [line for line in errors if str(large) in line]
    assert (
        "GB of it are none of its quantities" in told[0] and "its settings is not of cspr" in told[1] and len(told) == 2
    )
    peaks = [int(line.split()[1]) for line in done.stdout.splitlines() if line.startswith("peak")]
    assert all(peak < 500_000 for peak in peaks)


@pytest.mark.thorough
def test_the_worst_take_little_time_and_memory(hostile, tmp_path):
    """Each is drawn or verified; test_hostile_files_are_refused does both with each, but not as a command."""
    worst(hostile, tmp_path, lambda i: [("plot", "verify")[i % 2]])


@pytest.mark.soak
def test_the_worst_take_little_time_and_memory_all(hostile, tmp_path):
    worst(hostile, tmp_path, lambda i: ("plot", "verify"))


def mutated(rng, data):
    """A few bytes other than they were; where a file's structure lies more often than elsewhere."""
    spoiled = bytearray(data)
    for _ in range(rng.integers(1, 4)):
        place = int(rng.integers(0, len(data) if rng.random() < 0.5 else min(len(data), 4096)))
        spoiled[place] = int(rng.choice([0, 255, int(rng.integers(256)), spoiled[place] ^ (1 << int(rng.integers(8)))]))
    return bytes(spoiled)


def mutate(folder, count):
    """How many of so many mutations, sealed, were refused; half of them without HDF5's checksums."""
    good = []
    for layout in (LAYOUT, ("earliest", "v108")):
        for fill in (a_map, a_motion):
            with h5py.File(folder / "good.h5", "w", libver=layout) as file:
                fill(file)
            good.append((folder / "good.h5").read_bytes())

    def one(i):
        path = folder / f"{i}.h5"
        path.write_bytes(with_trailer(mutated(np.random.default_rng([17, i]), good[i % 4])))
        try:
            result = cspr_jax.open_result(path)
        except StoreError as error:
            assert len(str(error).splitlines()) == 1 and str(path) in str(error)
            return True
        finally:
            path.unlink()
        figure = motion_figure(result) if not result.is_map else _map_figure(result, None, {}, None)
        assert figure.axes
        return False

    with ThreadPoolExecutor(2) as threads:
        return sum(threads.map(one, range(count)))


def test_mutations(tmp_path):
    assert mutate(tmp_path, 8) > 2


@pytest.mark.soak
def test_mutations_all(tmp_path):
    assert mutate(tmp_path, 10_000) > 3000


def test_a_process_that_fails_says_so(tmp_path, monkeypatch):
    """That reads a file: killed, without end, without an interpreter; before it has begun, the file had no part."""
    path = forged(tmp_path / "map.h5", a_map)
    usual, instead = isolated._CODE, "import cspr_jax.store.reading.reader as r, os\nr.answer = lambda *a: {}\nserve()"
    for end, words, at_first in (
        ("os.kill(os.getpid(), 11)", "cannot be read as a result: HDF5 fails on it", "did not start: exit code -11"),
        ("os.kill(os.getpid(), 9)", "was killed: signal 9", "did not start: exit code -9"),
        ("os._exit(7)", "exit code 7", "did not start: exit code 7"),
    ):
        for code, line in ((usual.replace("serve()", instead.format(end)), words), (f"import os; {end}", at_first)):
            with monkeypatch.context() as patch:
                patch.setattr(isolated, "_CODE", code)
                with pytest.raises(StoreError, match=line):
                    cspr_jax.open_result(path)
    monkeypatch.setattr(sys, "executable", str(tmp_path / "none"))
    with pytest.raises(StoreError, match="no process could be started"):
        cspr_jax.open_result(path)


@pytest.mark.parametrize(
    ("code", "words"),
    [
        pytest.param("while True: pass", "finds no end", marks=pytest.mark.thorough),
        ("bytearray(1 << 32)", "more memory"),
    ],
)
def test_the_limits_hold(tmp_path, monkeypatch, code, words):
    """Of time and of memory, were the checks of what a file holds to miss something."""
    path = forged(tmp_path / "map.h5", a_map)
    body = f"import cspr_jax.store.files.guard as g\ndef datasets(*a, **k):\n    {code}\ng.datasets = datasets\n"
    monkeypatch.setattr(isolated, "_CODE", isolated._CODE.replace("serve()", body + "serve()"))
    with pytest.raises(StoreError, match=words):
        cspr_jax.open_result(path)


def test_motions_of_versions_with_narrower_verdicts(tmp_path):
    """Earlier versions stored flags as uint16; other types than these two are refused."""

    def with_segments(dtype):
        def fill(file):
            a_motion(file)
            file["segment"] = np.array([1, 2], np.int16)
            file["segment_verdict"] = np.array([0, 32768], dtype)

        return fill

    for dtype in (np.uint16, np.uint32):
        found = cspr_jax.open_result(forged(tmp_path / "m.h5", with_segments(dtype))).data["segment_verdict"]
        assert found.dtype == np.uint32 and found.tolist() == [0, 32768]
    with pytest.raises(StoreError, match="segment_verdict"):
        cspr_jax.open_result(forged(tmp_path / "m.h5", with_segments(np.int64)))
