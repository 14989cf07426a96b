"""Each command has its function, which gives the same; dictionaries do what files do; datasets of xarray."""

import argparse
import importlib
import inspect
import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import h5py
import jax
import numpy as np
import pytest
from outputs.test_outputs import cspr, made, strict_json

import cspr_jax
from cspr_jax import cli
from cspr_jax.api import plans
from cspr_jax.config.catalogue import catalogue_names
from cspr_jax.errors import ConfigError, CsprError, InputError, RefusedError, StoreError
from cspr_jax.platforms.answers import PlatformMotionAnswers
from cspr_jax.published.tables import table_object
from cspr_jax.schema.quantities import AXES, QUANTITIES

PLAN = """schema = 1
robot = "mine.toml"
z0 = 1.5
samples = 30
[[pose]]
rest = true
[[pose]]
position = [0.3, 0.2, 1.6]
[[pose]]
rest = true
"""
ROBOT = 'name = "mine"\nmass = 0.5\nbase_points = [[0.3, 0, 0], [-0.2, 0.3, 0], [-0.1, -0.3, 0]]\n'
SWEEP = """schema = 1
map = "minimum-arcs"
robot = "mine.toml"
[axes]
x = [0.1, 0.3]
y = [0.2]
z = { start = 1.4, stop = 1.6, count = 2 }
z0 = [1.5]
[trajectory]
from = { rest = true }
max_arcs = 8
[run]
tile = [1, 1, 2, 1]
"""
FUNCTIONS = {
    "run": ("run", "compute"),
    "status": ("status",),
    "verify": ("verify",),
    "volume": ("workspace_volume",),
    "plan": ("plan",),
    "replay": ("replay",),
    "plot": ("plot", "open_result"),
    "report": ("report",),
    "table": ("table", "table_names"),
    "bench": ("benchmark",),
    "import": ("import_robot",),
    "robots": ("list_robots",),
    "quantities": ("list_quantities",),
    "examples": ("list_examples", "copy_examples"),
    "new": ("new_file",),
}
# Options that say how to print, or what the process is set to, and what another function does.
PRINTING = {"help", "json", "device", "all_errors", "list", "all"}
NAMES = {"sweep": "given", "plan": "given", "result": "results"}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A working folder with a robot, a plan and a sweep; jax as a caller may have set it, which stays."""
    monkeypatch.chdir(tmp_path)
    for name, text in (("mine.toml", ROBOT), ("plan.toml", PLAN), ("sweep.toml", SWEEP)):
        Path(name).write_text(text)
    with jax.enable_x64(False), jax.numpy_dtype_promotion("strict"), jax.numpy_rank_promotion("raise"):
        yield tmp_path
        assert not jax.config.read("jax_enable_x64")
        assert jax.config.jax_numpy_dtype_promotion == "strict"


def values(path) -> dict[str, np.ndarray]:
    """Every dataset of an HDF5 file."""
    with h5py.File(path) as file:
        return {name: np.asarray(file[name]) for name in file}


def same(found: dict, wanted: dict) -> None:
    assert set(found) == set(wanted)
    for name in wanted:
        np.testing.assert_array_equal(found[name], wanted[name], err_msg=name)


def commands() -> dict[str, argparse.ArgumentParser]:
    (action,) = (a for a in cli._parser()._actions if isinstance(a, argparse._SubParsersAction))
    return action.choices


def test_every_command_has_its_function():
    # What shells complete is no matter of Python.
    assert set(FUNCTIONS) == set(commands()) - {"completion"}
    for name in FUNCTIONS:
        parser = commands()[name]
        functions = [getattr(cspr_jax, function) for function in FUNCTIONS[name]]
        functions += [plans.Plan.save, plans.Plan.save_mjcf, plans.Plan.animate] if name == "plan" else []
        functions += [cspr_jax.Replay.plot] if name == "replay" else []
        functions += [cspr_jax.ImportedRobot.save] if name == "import" else []
        known = {parameter for function in functions for parameter in inspect.signature(function).parameters}
        own = NAMES | {
            "run": {"output": "directory"},
            "plan": {"output": "path", "mjcf": "path", "animate": "path"},
        }.get(name, {})
        own |= {"name": "names", "output": "folder"} if name == "examples" else {}
        own |= {"names": "names"} if name == "robots" else {}
        own |= {"path": {"status": "directory", "volume": "result"}[name]} if name in ("status", "volume") else {}
        own |= {"result": "given", "cell": "cells"} if name == "report" else {}
        own |= {"plan": "plan"} if name in ("plot", "report") else {}
        own |= {"file": "path", "set": "cable_set", "output": "path"} if name == "import" else {}
        options = {action.dest for action in parser._actions} - PRINTING
        assert {own.get(option, option) for option in options} <= known, name


def test_public_names_hide_no_module():
    """A module that is imported becomes an attribute of the package, in place of a function of its name."""
    for name in cspr_jax.__all__:
        with pytest.raises(ModuleNotFoundError):
            importlib.import_module(f"cspr_jax.{name}")
    assert [name for name, _ in sorted(cspr_jax._PUBLIC.items())] == sorted(cspr_jax.__all__)


def test_plans(folder, capsys):
    """From a path, and from a dictionary with arrays in it; rows and files as the command writes them."""
    data = tomllib.loads(PLAN)
    data["pose"][1]["position"] = np.array([0.3, 0.2, 1.6])
    data["samples"], data["robot"] = np.int64(30), Path("mine.toml")
    plan, same_plan = cspr_jax.plan("plan.toml"), cspr_jax.plan(data)
    printed = strict_json(cspr(capsys, "plan", "plan.toml", "--json", "-o", "told.h5", "--rate", 20))
    assert plan.to_dict() == same_plan.to_dict() == printed and plan.feasible
    assert plan.text == PLAN and json.loads(same_plan.text)["samples"] == 30
    assert plan.save("mine.h5", 20.0) == Path("mine.h5")
    same(values("mine.h5"), values("told.h5"))
    rows = plan.rows(20.0)
    assert {name: rows[name].dtype for name in rows} == dict.fromkeys(rows, np.dtype("float64"))
    assert len(plan.rows()["t"]) == 60
    same(rows, {name: values("told.h5")[name] for name in rows})
    cspr(capsys, "plan", "plan.toml", "-o", "told.csv")
    plan.save("mine.csv")
    assert Path("mine.csv").read_bytes() == Path("told.csv").read_bytes()


def test_a_plan_that_is_not_feasible(folder):
    data = tomllib.loads(PLAN) | {"max_arcs": 1}
    data["pose"][1]["position"] = [1.8, 0.2, 0.4]
    plan = cspr_jax.plan(data)
    assert not plan.feasible and plan.to_dict()["segments"][0]["arcs"] is None
    with pytest.raises(ConfigError, match="not proved feasible"):
        plan.save("motion.csv")
    assert not Path("motion.csv").exists()
    assert plan.save("motion.csv", anyway=True).read_text().splitlines()[0].endswith(",feasible")


def test_runs(folder, capsys):
    """The same values from the command, a path, a dictionary, and in memory; what is there is kept."""
    cspr(capsys, "run", "sweep.toml", "-o", "told")
    told = values("told/sweep.h5")
    data = tomllib.loads(SWEEP)
    data["axes"]["x"] = np.array([0.1, 0.3])
    seen = []
    assert cspr_jax.run("sweep.toml", "path") == Path("path/sweep.h5")
    path = cspr_jax.run(data, on_tile=lambda done, total: seen.append((done, total)))
    assert seen == [(0, 4), (2, 4), (4, 4)] and path.parent.parent == Path("results")
    for result in ("path/sweep.h5", path):
        same(values(result), told)
        assert cspr_jax.open_result(result).attributes["identity"] == cspr_jax.status("told")["identity"]
    assert cspr_jax.run(data, on_tile=lambda *_: pytest.fail("computed again")) == path
    computed = cspr_jax.compute(data)
    same({name: computed[name].values for name in computed.variables}, told)
    assert not list(folder.glob("run*"))
    cspr_jax.run("sweep.toml", "path", prune=True)
    assert cspr_jax.status("path")["shards"] == 0


def test_an_interrupted_run_goes_on(folder):
    def interrupt(done, total):
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        cspr_jax.run("sweep.toml", "run", on_tile=interrupt)
    assert cspr_jax.status("run")["shards"] == 1
    seen = []
    cspr_jax.run("sweep.toml", "run", on_tile=lambda done, total: seen.append(done))
    assert seen == [2, 4]


def test_status_and_verify(folder, capsys):
    path = cspr_jax.run("sweep.toml", "run")
    assert cspr_jax.status("run") == strict_json(cspr(capsys, "status", "run", "--json"))
    for place in ("run", str(path)):
        assert cspr_jax.verify(place) == strict_json(cspr(capsys, "verify", place, "--json"))
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    assert len(cspr_jax.verify(path)["faults"]) == 1


def test_tables(capsys):
    with jax.enable_x64(False):
        cells = cspr_jax.table("2.1")
    assert table_object("2.1", cells) == strict_json(cspr(capsys, "table", "2.1", "--json"))
    lines = cspr(capsys, "table", "--list").splitlines()
    assert lines == [f"{name}  {title}" for name, title in cspr_jax.table_names().items()]


def test_lists(capsys, tmp_path):
    assert cspr_jax.list_robots() == strict_json(cspr(capsys, "robots", "--json"))
    assert cspr_jax.list_quantities() == strict_json(cspr(capsys, "quantities", "--json"))
    assert cspr_jax.list_examples() == strict_json(cspr(capsys, "examples", "--json"))
    assert cspr_jax.copy_examples("demo", tmp_path) == [tmp_path / "demo.toml"]
    assert len(cspr_jax.copy_examples(["table_2_1", "poses"], str(tmp_path))) == 2
    with pytest.raises(RefusedError):
        cspr_jax.copy_examples("demo", tmp_path)


@pytest.mark.thorough
def test_the_list_of_robots(capsys, tmp_path):
    """One line a robot, without jax; all about one by its name or file, and what it is where it cannot hang taut."""
    assert cli.main(["robots"]) == 0
    lines = capsys.readouterr().out.splitlines()
    for name in catalogue_names():
        assert len([line for line in lines if line.split()[:1] == [name]]) == 1
    assert not any("not known" in line or len(line.rstrip()) > 80 for line in lines)
    code = "import sys; from cspr_jax import cli; cli.main(['robots']); print({'jax', 'pydantic'} & {*sys.modules})"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.endswith("set()\n")
    path = tmp_path / "low.toml"
    spools = "[[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 9.0]]"
    path.write_text(f'name = "low [b]x"\nplanar = true\nmass = 1.0\ntension_min = 50.0\nbase_points = {spools}\n')
    assert cli.main(["robots", "cogiro", str(path)]) == 0
    text = capsys.readouterr().out
    assert "hangs still with every cable taut" in text and "low [b]x" in text and "CoGiRo" in text
    listed = strict_json(cspr(capsys, "robots", "cogiro", str(path), "--json"))
    assert [robot["name"] for robot in listed] == ["cogiro", "low [b]x"] and listed == cspr_jax.list_robots(
        ["cogiro", path]
    )
    assert cli.main(["robots", "nobody"]) == 2
    assert capsys.readouterr().err.startswith('cspr: robots: robot = "nobody": must be one of')


def test_the_benchmark(small_bench):
    with jax.enable_x64(False):
        found = cspr_jax.benchmark()
    assert found["schema"] == 1 and all(rate > 0 for rate in found["checks_per_second"].values())


def test_pictures(tmp_path, capsys):
    """The same bytes as the command's; no file where none is asked for."""
    path = made(tmp_path / "map.h5")
    cspr(capsys, "plot", path, "--quantity", "margin", "--at", "z=1.0", "--size", "12x9", "-o", tmp_path / "told.png")
    choices = {"quantity": "margin", "at": {"z": 1.0}}
    for given in (str(path), [cspr_jax.open_result(path)]):
        figure = cspr_jax.plot(given, **choices, size=(12, 9), output=tmp_path / "mine.png")
        assert (tmp_path / "mine.png").read_bytes() == (tmp_path / "told.png").read_bytes()
        assert "margin" in figure.get_suptitle() or "pseudotension" in figure.get_suptitle()
    before = set(tmp_path.iterdir())
    figure = cspr_jax.plot(path, size="12x9")
    assert set(tmp_path.iterdir()) == before and tuple(figure.get_size_inches() * 2.54) == pytest.approx((12, 9))
    results = [cspr_jax.open_result(path), cspr_jax.open_result(made(tmp_path / "other.h5"))]
    (panel,) = cspr_jax.plot(results, at={"x": 1.5, "y": 0.5}).axes
    assert [line.get_label() for line in panel.lines] == ["result 1", "result 2"]


def test_a_map_for_xarray(tmp_path):
    """As xarray itself reads the file, but for what is never told apart."""
    xarray = pytest.importorskip("xarray")
    path = made(tmp_path / "map.h5")
    found = cspr_jax.open_result(path).to_xarray()
    with xarray.open_dataset(path, engine="h5netcdf", decode_timedelta=False) as wanted:
        xarray.testing.assert_equal(found, wanted)
        for name in found.variables:
            assert found[name].attrs.keys() == wanted[name].attrs.keys(), name
            assert found[name].attrs["units"] == (AXES | QUANTITIES)[name].units
    assert found.arcs.dims == ("x", "y", "z", "z0") and found.attrs["robot"] == "prototype"
    assert found.arcs.sel(x=1.5, y=0.5, z=0.5, z0=1.7) == 40


def test_a_motion_for_xarray(folder):
    """The same from the plan and from its file."""
    xarray = pytest.importorskip("xarray")
    plan = cspr_jax.plan("plan.toml")
    found = plan.to_xarray(20.0)
    xarray.testing.assert_equal(found, cspr_jax.open_result(plan.save("motion.h5", 20.0)).to_xarray())
    assert found.attrs.keys() == cspr_jax.open_result("motion.h5").to_xarray().attrs.keys()
    assert found.position.dims == ("t", "axis") and found.tension.dims == ("t", "cable")
    assert found.segment_margin.dims == ("segment",) and found.tension.attrs["units"] == "N"
    assert "flag_masks" in found.segment_verdict.attrs and "component" not in found.dims
    assert found.position.sel(axis="z").values[0] == pytest.approx(1.5)


def test_a_motion_of_a_platform_for_xarray():
    from cspr_jax.schema import labelled

    arrays = {"t": np.arange(4.0), "quaternion": np.ones((4, 4)), "omega": np.ones((4, 3)), "tension": np.ones((4, 6))}
    found = labelled.motion(arrays, {})
    assert (found.quaternion.dims, found.omega.dims) == (("t", "component"), ("t", "axis"))
    assert found.component.values.tolist() == list("wxyz") and found.cable.values.tolist() == [1, 2, 3, 4, 5, 6]


def test_answers_for_xarray(prototype):
    x, z = np.array([-0.4, 0.1, 0.5]), [1.4, 1.6]
    targets = [[i, 0.2, k] for i in x for k in z]
    answers = cspr_jax.minimum_arcs(prototype, targets, z0=1.7, max_arcs=8)
    flat, found = answers.to_xarray(), answers.to_xarray({"x": x, "z": z})
    assert flat.arcs.dims == ("target",) and found.arcs.dims == ("x", "z")
    np.testing.assert_array_equal(found.margin.values.ravel(), answers.margin)
    assert found.arcs.sel(x=0.1, z=1.6) == answers.arcs[3]
    assert found.duration.attrs["units"] == "s" and found.x.attrs["units"] == "m"
    assert "flag_meanings" in found.verdict.attrs
    for wrong in ({"x": x}, {"x": x, "z": [1.4, 1.6, 1.8]}, {"x": np.zeros((3, 2))}, {}):
        with pytest.raises(InputError, match=r"^dims = .* 6 points"):
            answers.to_xarray(wrong)


def test_answers_between_poses_for_xarray():
    """beta-hat has a value at either end."""
    fields = {name: np.arange(6.0) for name in inspect.signature(PlatformMotionAnswers).parameters}
    answers = PlatformMotionAnswers(**fields | {"beta_hat": np.arange(12.0).reshape(6, 2)})
    found = answers.to_xarray({"tilt": [0.0, 0.1, 0.2], "torsion": [0.0, 0.5]})
    assert found.beta_hat.dims == ("tilt", "torsion", "end") and found.end.values.tolist() == ["start", "target"]
    assert found.beta_hat.sel(tilt=0.2, torsion=0.0, end="target") == 9.0
    assert "target" not in found.beta_hat.attrs["long_name"] and found.det_margin.dims == ("tilt", "torsion")


def test_without_xarray(tmp_path, monkeypatch):
    result = cspr_jax.open_result(made(tmp_path / "map.h5"))
    monkeypatch.setitem(sys.modules, "xarray", None)
    for call in (result.to_xarray, lambda: cspr_jax.compute(tmp_path / "none.toml")):
        with pytest.raises(ConfigError, match=re.escape("pip install 'cspr_jax[xarray]'")) as raised:
            call()
        assert len(str(raised.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("call", "kind", "words"),
    [
        (lambda plan, sweep: cspr_jax.plan(plan | {"z0": -1.0}), ConfigError, "plan: z0 = -1.0: must be"),
        (lambda plan, sweep: cspr_jax.plan(plan | {"robot": "no.toml"}), ConfigError, 'plan: robot = "no.toml": no su'),
        (lambda plan, sweep: cspr_jax.plan(plan | {1: 2}), ConfigError, "plan: unknown key 1 = 2"),
        (lambda plan, sweep: cspr_jax.plan(plan | {"robot": object()}), ConfigError, "plan: robot = <object"),
        (lambda plan, sweep: cspr_jax.plan(sweep), ConfigError, "plan: is a sweep file"),
        (lambda plan, sweep: cspr_jax.plan("no.toml"), ConfigError, "no.toml: cannot be read"),
        (lambda plan, sweep: cspr_jax.plan(plan).save("motion.txt"), ConfigError, "motion.txt: must end in .csv or"),
        (lambda plan, sweep: cspr_jax.plan(plan).rows(-1.0), ConfigError, "--rate: -1.0: must be a number > 0, in Hz"),
        (lambda plan, sweep: cspr_jax.plan(plan).rows(1e12), ConfigError, "--rate: 1e+12 Hz: must give at most"),
        (lambda plan, sweep: cspr_jax.run(sweep | {"map": "arcs"}, "a"), ConfigError, 'sweep: map = "arcs": '),
        (lambda plan, sweep: cspr_jax.compute(plan), ConfigError, "sweep: is a plan file"),
        (lambda plan, sweep: cspr_jax.run(sweep, "a", workers=0), ConfigError, "--workers: 0: must be an integer from"),
        (
            lambda plan, sweep: cspr_jax.run(sweep, workers=2, scheduler="b"),
            ConfigError,
            "--workers: 2: cannot be combined with --scheduler",
        ),
        (lambda plan, sweep: cspr_jax.status("a"), StoreError, "a: is not a run directory"),
        (lambda plan, sweep: cspr_jax.verify("a"), StoreError, "a: is not a run directory"),
        (lambda plan, sweep: cspr_jax.table("9.9"), ConfigError, 'table: "9.9": must be one of 1.1'),
        (lambda plan, sweep: cspr_jax.table("2.1", fine=True), ConfigError, "--fine: must be absent with table 2.1"),
        (lambda plan, sweep: cspr_jax.table("3.3", definition="x"), ConfigError, '--definition: "x": must be one of g'),
        (lambda plan, sweep: cspr_jax.plot("no.h5"), StoreError, "no.h5: "),
        (lambda plan, sweep: cspr_jax.plot([]), ConfigError, "results: []: must be one result"),
        (lambda plan, sweep: cspr_jax.plot("map.h5", at={"w": 1.0}), ConfigError, 'map.h5: --at = "w": must be one of'),
        (lambda plan, sweep: cspr_jax.plot("map.h5", size=(1, 9)), ConfigError, '--size: "1x9": must be WIDTHxHEIGHT'),
        (lambda plan, sweep: cspr_jax.plot("map.h5", output="a.bmp2"), ConfigError, "a.bmp2: Format"),
        (lambda plan, sweep: cspr_jax.copy_examples("demos", "a"), ConfigError, 'examples: "demos": did you mean demo'),
        (lambda plan, sweep: cspr_jax.list_quantities() and cspr_jax.open_result("no.h5"), StoreError, "no.h5: "),
    ],
)
def test_mistakes(folder, call, kind, words):
    """One line, with what is wrong; nothing is written."""
    made(Path("map.h5"))
    before = set(folder.rglob("*"))
    with pytest.raises(CsprError) as raised:
        call(tomllib.loads(PLAN), tomllib.loads(SWEEP))
    assert type(raised.value) is kind and str(raised.value).startswith(words), raised.value
    assert len(str(raised.value).splitlines()) == 1 and set(folder.rglob("*")) == before


def test_another_sweep_in_the_directory(folder):
    cspr_jax.run("sweep.toml", "run")
    data = tomllib.loads(SWEEP)
    data["axes"]["y"] = [0.1]
    with pytest.raises(RefusedError, match=r"axes\.y"):
        cspr_jax.run(data, "run")


def test_hints_and_quarantines_are_warnings(folder):
    """What the command line says on stderr."""
    Path("mine.toml").write_text(ROBOT.replace("0.3, 0, 0", "3000, 0, 0").replace("-0.2, 0.3", "-2000, 3000"))
    data = tomllib.loads(SWEEP)
    with pytest.warns(UserWarning, match="hint: .*millimetres"):
        cspr_jax.run(data, "run")
