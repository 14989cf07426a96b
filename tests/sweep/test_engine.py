"""Sweeps from file to HDF5: what is stored, where, under which name, and what a failure leaves behind."""

import dataclasses
import itertools
import json
from pathlib import Path

import h5py
import jax
import numpy as np
import pytest
import xarray
from oracles import point_mass
from support.commands import cspr

import cspr_jax
from cspr_jax.errors import SelfCheckError
from cspr_jax.families.swings.arcs_map import MinimumArcsMap
from cspr_jax.schema.map_kinds import MAP_KINDS
from cspr_jax.schema.quantities import QUANTITIES as EVERY
from cspr_jax.store import consolidation
from cspr_jax.sweep.definition import read_sweep

ROOT = Path(__file__).parents[2]
START = [0.7, 0.7, 3.0]
AXES = """z0 = [1.5, 1.7]
y = [-1.1, 0.0, 0.5, 1.0]
x = { start = -1.0, stop = 1.0, count = 5 }
z = { start = 0.5, stop = 2.5, count = 3 }
"""
FROM = "from = { position = [0.7, 0.7, 3.0] }"
TILT = [[0.3, 0.05, -0.02], [-0.2, 0.25, 0.06], [-0.1, -0.3, 0.01]]
KIND = MAP_KINDS["minimum-arcs"]
QUANTITIES = {name: EVERY[name] for name in KIND.quantities if not KIND.keys_of(name)}
FLOATS = [name for name, quantity in QUANTITIES.items() if quantity.kind == "float"]
COUNTS = [name for name in QUANTITIES if name not in FLOATS]


# What a run of one tile leaves.
FINISHED = ["LOCK", "log.jsonl", "run.json", "shards/00000.h5", "tiny.h5"]


def sweep_file(folder: Path, axes: str = AXES, start: str = FROM, run: str = "", robot: str = '"prototype"') -> Path:
    """A sweep that stores everything, named tiny.toml."""
    text = f'schema = 1\nmap = "minimum-arcs"\nrobot = {robot}\n[axes]\n{axes}[trajectory]\n{start}\n'
    path = folder / "tiny.toml"
    path.write_text(f"{text}[run]\nstore = {json.dumps(list(QUANTITIES))}\n{run}\n")
    return path


def computed(folder: Path, **parts: str) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Axes and data of a sweep that runs without a word on standard error."""
    code, out, err = cspr("run", sweep_file(folder, **parts), "-o", folder / "run")
    assert (code, err) == (0, "")
    result = cspr_jax.open_result(out.splitlines()[-1])
    assert list(result.data) == sorted(QUANTITIES)
    return result.axes, result.data


def tree(folder: Path) -> dict[str, bytes]:
    """Every file below a folder and its content."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture(scope="module")
def tiny(tmp_path_factory):
    """The tiny sweep, run once, from a process in which jax still has 32 bits."""
    folder = tmp_path_factory.mktemp("tiny")
    jax.config.update("jax_enable_x64", False)
    try:
        axes, data = computed(folder)
    finally:
        jax.config.update("jax_enable_x64", True)
    return folder, axes, data


def cells_of(axes: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Coordinates of all cells, in the order of the file."""
    product = zip(*itertools.product(*axes.values()), strict=True)
    return {name: np.array(column) for name, column in zip(axes, product, strict=True)}


def assert_answers(data: dict[str, np.ndarray], answers: object) -> None:
    """Stored numbers are those of Python's answers, in the order of the file."""
    for name, stored in data.items():
        wanted = getattr(answers, name)
        np.testing.assert_allclose(
            stored.ravel(), wanted, rtol=1e-12 if name in FLOATS else 0.0, atol=0.0, err_msg=name
        )


def test_dimensions_are_in_the_order_of_the_file(tiny):
    folder, axes, data = tiny
    assert list(axes) == ["z0", "y", "x", "z"]
    np.testing.assert_array_equal(axes["y"], [-1.1, 0.0, 0.5, 1.0])
    np.testing.assert_array_equal(axes["x"], [-1.0, -0.5, 0.0, 0.5, 1.0])
    with h5py.File(folder / "run" / "tiny.h5") as file:
        for name in QUANTITIES:
            assert file[name].shape == (2, 4, 5, 3)
            assert [dim[0].name for dim in file[name].dims] == ["/z0", "/y", "/x", "/z"]
            assert file[name].fletcher32 and file[name].compression == "gzip"
    assert len(np.unique(data["arcs"])) > 4
    assert sorted(tree(folder)) == [*(f"run/{name}" for name in FINISHED), "tiny.toml"]


def test_cells_are_what_python_answers(tiny, prototype):
    _, axes, data = tiny
    cells = cells_of(axes)
    targets = np.stack([cells[name] for name in "xyz"], axis=1)
    assert_answers(data, cspr_jax.minimum_arcs(prototype, targets, start=np.array(START), z0=cells["z0"]))
    base, arcs, margin = np.asarray(prototype.base_points), data["arcs"].ravel(), data["margin"].ravel()
    for i in np.random.default_rng(1).choice(len(arcs), 6, replace=False):
        here = (base, START, targets[i], cells["z0"][i], 9.81)
        assert point_mass.smallest_arcs(*here, 30, samples=4001) == arcs[i]
        tried = data["tried_arcs"].ravel()[i]
        assert point_mass.margin(*here, tried) == pytest.approx(margin[i], rel=1e-5, abs=5e-6)


@pytest.mark.parametrize("tile", ["[1, 3, 5, 2]", "[2, 4, 2, 3]"])
def test_tiles_change_nothing(tiny, tmp_path, tile):
    _, data = computed(tmp_path, run=f"tile = {tile}")
    for name, stored in data.items():
        np.testing.assert_array_equal(stored, tiny[2][name])


def test_start_points_on_axes(tmp_path, prototype):
    axes = "x = [0.3, -0.6]\nfrom_z = [1.0, 2.0, 3.0]\ny = [0.4]\nfrom_x = [0.7, -0.2]\nz = [1.5]\nz0 = [1.7]\n"
    found, data = computed(tmp_path, axes=axes)
    assert list(found) == ["x", "from_z", "y", "from_x", "z", "z0"]
    cells = cells_of(found)
    start = np.stack([cells["from_x"], np.full(12, 0.7), cells["from_z"]], axis=1)
    targets = np.stack([cells[name] for name in "xyz"], axis=1)
    assert_answers(data, cspr_jax.minimum_arcs(prototype, targets, start=start, z0=1.7))
    (tmp_path / "all").mkdir()
    _, same = computed(tmp_path / "all", axes=f"from_y = [0.7]\n{axes}", start="")
    for name in QUANTITIES:
        np.testing.assert_array_equal(same[name][0], data[name])


def test_start_at_rest(tmp_path, prototype):
    axes = "z0 = [1.2, 1.9]\nx = [0.5, -0.9]\ny = [0.1]\nz = [1.0, 1.9]\n"
    found, data = computed(tmp_path, axes=axes, start="from = { rest = true }")
    cells = cells_of(found)
    targets = np.stack([cells[name] for name in "xyz"], axis=1)
    assert_answers(data, cspr_jax.minimum_arcs(prototype, targets, z0=cells["z0"]))


def test_an_upward_z_axis_mirrors_a_downward_one(tmp_path):
    """The same spools and targets, described with z up, have the same answers."""
    found = {}
    for word, sign in (("down", 1), ("up", -1)):
        points = [[x, y, sign * z] for x, y, z in TILT]
        robot = f'{{ name = "r", base_points = {points}, mass = 1.0, z_axis = "{word}" }}'
        axes = f"x = [0.5, -0.9]\ny = [0.2, 0.7]\nz = {[sign * 1.0, sign * 2.0]}\nz0 = [1.3]\n"
        (tmp_path / word).mkdir()
        start = f"from = {{ position = [0.3, -0.4, {sign * 1.6}] }}"
        limits = f"[limits]\nfloor = {sign * 1.9}"
        found[word] = computed(tmp_path / word, axes=axes, start=start, robot=robot, run=limits)[1]
    assert set(np.unique(found["down"]["verdict"] & cspr_jax.Verdict.BELOW_FLOOR)) == {0, cspr_jax.Verdict.BELOW_FLOOR}
    for name, stored in found["down"].items():
        np.testing.assert_allclose(found["up"][name], stored, rtol=1e-9 if name in FLOATS else 0.0, err_msg=name)


def test_float32_has_the_same_arcs_and_verdicts(tiny, tmp_path):
    _, data = computed(tmp_path, run='dtype = "float32"')
    for name in COUNTS:
        np.testing.assert_array_equal(data[name], tiny[2][name])
    for name in FLOATS:
        assert (data[name].dtype, tiny[2][name].dtype) == (np.float32, np.float64)
        np.testing.assert_allclose(data[name], tiny[2][name], rtol=2e-7)


def test_a_second_run_computes_nothing_and_another_sweep_is_refused(tiny, tmp_path, monkeypatch):
    sweep_file(tmp_path)
    folder = tmp_path / "run"
    folder.mkdir()
    for path in (tiny[0] / "run").glob("*.*"):
        (folder / path.name).write_bytes(path.read_bytes())
    before = tree(folder)
    monkeypatch.setattr(MinimumArcsMap, "__call__", None)
    code, out, err = cspr("run", tmp_path / "tiny.toml", "-o", folder)
    assert (code, err, out.splitlines()[-1]) == (0, "", str(folder / "tiny.h5"))
    assert "finished" in out.splitlines()[0]
    sweep_file(tmp_path, axes=AXES.replace("1.1", "1.2"), start=f"{FROM}\nmax_arcs = 20", run="tile = [1, 1, 1, 1]")
    code, out, err = cspr("run", tmp_path / "tiny.toml", "-o", folder)
    assert (code, out) == (3, "")
    lines = err.splitlines()
    assert [line.split(" = ")[0].split()[-1] for line in lines] == ["axes.y", "run.tile", "trajectory.max_arcs"]
    assert all(line.startswith("cspr: ") for line in lines) and "20 here, 30 there" in lines[2]
    assert tree(folder) == before


def test_the_default_directory_is_named_after_sweep_and_identity(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = sweep_file(tmp_path)
    identity = read_sweep(path).identity
    code, out, _ = cspr("run", "tiny.toml")
    assert (code, out.splitlines()[-1]) == (0, f"results/tiny-{identity[:12]}/tiny.h5")
    attributes = cspr_jax.open_result(out.splitlines()[-1]).attributes
    assert attributes["identity"] == identity and len(identity) == 64
    path.write_text("# a comment\n" + path.read_text().replace("[0.7, 0.7, 3.0]", "[0.7, 0.70, 3]"))
    assert read_sweep(path).identity == identity
    changed = [sweep_file(tmp_path, axes=AXES.replace("1.7", "1.8")), sweep_file(tmp_path, run='dtype = "float32"')]
    assert all(read_sweep(path).identity != identity for path in changed)


def test_xarray_sees_names_units_and_flags(tiny):
    with xarray.open_dataset(tiny[0] / "run" / "tiny.h5", engine="h5netcdf") as data:
        assert data["arcs"].dims == ("z0", "y", "x", "z")
        assert set(data.coords) == {"z0", "y", "x", "z"} and set(data.data_vars) == set(QUANTITIES)
        assert data["x"].attrs["units"] == "m" and data["x"].attrs["long_name"] == "x of the target"
        assert data["duration"].attrs["units"] == "s" and data["arcs"].attrs["units"] == "1"
        assert all(data[name].attrs["long_name"] for name in (*QUANTITIES, *data.coords))
        assert data.attrs["z_axis"] == "down" and data.attrs["robot"] == "prototype" and data.attrs["schema"] == 2
        flags = data["verdict"].attrs
        names = dict(zip(flags["flag_masks"].tolist(), flags["flag_meanings"].split(), strict=True))
        assert names == {flag.value: flag.name.lower() for flag in cspr_jax.Verdict if flag}
        here = data.sel(z0=1.7, y=-1.1, x=-1.0, z=0.5)
        assert float(here["duration"]) == tiny[2]["duration"][1, 0, 0, 0]


@pytest.mark.quick("failure0-4")
@pytest.mark.parametrize(
    ("failure", "code"), [(MemoryError(), 4), (SelfCheckError("tile 1"), 5), (ValueError("a mistake of ours"), 70)]
)
def test_a_failure_keeps_what_is_finished(tiny, tmp_path, monkeypatch, failure, code):
    path, calls, whole = sweep_file(tmp_path, run="tile = [1, 4, 5, 3]"), [], MinimumArcsMap.__call__

    def fails_at_the_second_tile(self, cells):
        calls.append(len(cells["x"]))
        if len(calls) == 2:
            raise failure
        return whole(self, cells)

    with monkeypatch.context() as patch:
        patch.setattr(MinimumArcsMap, "__call__", fails_at_the_second_tile)
        found, out, err = cspr("run", path, "-o", tmp_path / "run")
        assert (found, out, calls) == (code, "", [60, 60])
        assert err.splitlines()[-1].startswith("cspr") and (code == 70 or len(err.splitlines()) == 1)
        kept = ["LOCK", "log.jsonl", "run.json", "shards/00000.h5"]
        assert sorted(tree(tmp_path / "run")) == kept
        found, out, err = cspr("run", path, "-o", tmp_path / "run")
        assert (found, err, calls) == (0, "", [60, 60, 60])
    again = cspr_jax.open_result(tmp_path / "run" / "tiny.h5")
    np.testing.assert_array_equal(again.data["arcs"], tiny[2]["arcs"])
    assert sorted(tree(tmp_path / "run")) == sorted([*kept, "shards/00001.h5", "tiny.h5"])


@pytest.mark.parametrize(
    ("name", "value"), [("margin", -1.0), ("margin", np.nan), ("verdict", 1), ("duration", 0.0), ("margin_bound", 2.0)]
)
def test_numbers_that_contradict_each_other_are_refused(tmp_path, monkeypatch, name, value):
    """A processor that miscalculates: nothing of the tile is kept, and the exit code says so."""
    whole = MinimumArcsMap.__call__

    def broken(self, cells):
        answers = {key: array.copy() for key, array in whole(self, cells).items()}
        answers[name][np.flatnonzero(answers["arcs"] > 0)[3]] = value
        return answers

    monkeypatch.setattr(MinimumArcsMap, "__call__", broken)
    code, out, err = cspr("run", sweep_file(tmp_path), "-o", tmp_path / "run")
    assert (code, out, len(err.splitlines())) == (5, "", 1) and "1 of 120 cells" in err
    assert sorted(tree(tmp_path / "run")) == ["LOCK", "log.jsonl", "run.json"]


@pytest.mark.parametrize("output", ["taken", "taken/below"])
def test_an_output_that_cannot_be_written(tmp_path, output):
    path = sweep_file(tmp_path)
    (tmp_path / "taken").write_text("mine")
    before = tree(tmp_path)
    code, out, err = cspr("run", path, "-o", tmp_path / output)
    assert (code, out) == (4, "")
    assert len(err.splitlines()) == 1 and err.startswith(f"cspr: {tmp_path / output}: ")
    assert tree(tmp_path) == before


def test_the_reference_data_set_is_what_the_program_computes():
    path = ROOT / "results" / "reference" / "minimum_arcs.h5"
    assert path.stat().st_size < 2_000_000
    result = cspr_jax.open_result(path)
    with h5py.File(path) as file:
        for name, stored in result.data.items():
            np.testing.assert_array_equal(file[name][...], stored)
    sweep = read_sweep(ROOT / "sweeps" / "reference" / "minimum_arcs.toml")
    assert result.attributes["identity"] == sweep.identity
    assert list(result.axes) == list(sweep.grid.axes)
    for name, points in sweep.grid.axes.items():
        np.testing.assert_array_equal(result.axes[name], points)
    places = np.random.default_rng(2).choice(sweep.grid.n_cells, 60, replace=False)
    index = np.unravel_index(places, sweep.grid.shape)
    cells = {name: points[i] for (name, points), i in zip(sweep.grid.axes.items(), index, strict=True)}
    answers = MinimumArcsMap(sweep.robot, sweep.spec, sweep.file)(cells)
    assert set(sweep.store) == set(result.data) and len(np.unique(answers["arcs"])) > 5
    for name, stored in result.data.items():
        rtol = 1e-6 if name in FLOATS else 0.0
        np.testing.assert_allclose(stored[index], answers[name], rtol=rtol, atol=rtol, err_msg=name)


@pytest.mark.thorough
def test_runs_of_versions_with_narrower_verdicts_go_on(tiny, tmp_path, monkeypatch):
    """Earlier versions stored flags as uint16: their shards and results are read, finished, and give the same."""
    narrow = dataclasses.replace(EVERY["verdict"], kind="uint16")
    with monkeypatch.context() as before:
        before.setitem(EVERY, "verdict", narrow)
        code, out, _ = cspr("run", sweep_file(tmp_path, run="tile = [1, 4, 5, 3]"), "-o", tmp_path / "run")
    path = Path(out.splitlines()[-1])
    old, shards = path.read_bytes(), sorted((tmp_path / "run" / "shards").iterdir())
    with h5py.File(path) as file:
        assert file["verdict"].dtype == np.uint16
    data = cspr_jax.open_result(path).data
    assert data["verdict"].dtype == np.uint32 and cspr("verify", tmp_path / "run")[0] == 0
    kept = shards[0].read_bytes()
    path.unlink(), shards[1].unlink()
    code, out, _ = cspr("run", tmp_path / "tiny.toml", "-o", tmp_path / "run")
    assert code == 0 and shards[0].read_bytes() == kept and not list(tmp_path.glob("run/quarantine/*"))
    assert path.read_bytes() != old and cspr("verify", path)[0] == 0
    again = cspr_jax.open_result(path)
    with h5py.File(path) as file:
        assert file["verdict"].dtype == file["verdict"].attrs["flag_masks"].dtype == np.uint32
    for name, stored in again.data.items():
        np.testing.assert_array_equal(stored, data[name])
        np.testing.assert_array_equal(stored, tiny[2][name])


def test_hints_come_with_what_is_computed_and_with_nothing_refused(tmp_path):
    robot = '{ name = "mm", mass = 1.0, base_points = [[0, 0, 0], [1000, 0, 0], [0, 1000, 0]] }'
    code, out, err = cspr("run", sweep_file(tmp_path, robot=robot), "-o", tmp_path / "run")
    assert (code, out.splitlines()[-1]) == (0, str(tmp_path / "run" / "tiny.h5"))
    assert err.startswith("cspr: hint: robot.base_points: spools 1414.21 m apart") and len(err.splitlines()) == 1
    above = AXES.replace("start = 0.5, stop = 2.5", "start = -2.5, stop = -0.5")
    code, out, err = cspr("run", sweep_file(tmp_path, axes=above, robot=robot))
    assert (code, out, len(err.splitlines())) == (2, "", 1) and 'does it lack z_axis = "up"?' in err


def test_all_errors_of_a_sweep(tmp_path):
    path = sweep_file(tmp_path, axes=AXES.replace("count = 5", "count = 0"), start=f"{FROM}\nmax_arc = 3")
    for arguments, count in (((), 1), (("--all-errors",), 2)):
        code, out, err = cspr("run", path, *arguments)
        assert (code, out, len(err.splitlines())) == (2, "", count)
    assert "unknown key trajectory.max_arc = 3: did you mean max_arcs?" in err and "axes.x.count = 0: must be" in err


def test_what_part_is_proved():
    """Of all shards, if every one says it: those of earlier versions, and of maps that prove nothing, do not."""
    assert consolidation._proved([1, 0, 2], 12) == {"proved": 0.75}
    assert consolidation._proved([1, None, 2], 12) == {}
