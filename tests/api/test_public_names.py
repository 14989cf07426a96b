"""The public names: each command has its function, and a mistake is one line."""

import argparse
import ast
import importlib
import inspect
import re
import sys
import tomllib
from pathlib import Path
from typing import get_args

import pytest
from outputs.test_outputs import made
from support.folder import PLAN, SWEEP, folder

import cspr_jax
from cspr_jax import cli
from cspr_jax.api import calibration, designs, plans, sizing
from cspr_jax.api.files.logs import LogComparison
from cspr_jax.build.robots import PlatformName, PointMassName
from cspr_jax.errors import ConfigError, CsprError, StoreError
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.point_mass import PointMassRobot

__all__ = ["folder"]  # a fixture

FUNCTIONS = {
    "run": ("run", "compute_sweep"),
    "merge": ("merge",),
    "status": ("status",),
    "verify": ("verify", "verify_certificate"),
    "volume": ("workspace_volume",),
    "design": ("design",),
    "plan": ("plan",),
    "check": ("check",),
    "calibrate": ("calibrate",),
    "replay": ("replay",),
    "simulate": ("simulate",),
    "stops": ("stops",),
    "size": ("size", "check"),
    "locate": ("forward",),
    "log": ("compare_log",),
    "anchors": ("anchors",),
    "plot": ("plot", "open_result"),
    "report": ("report",),
    "table": ("table", "list_tables"),
    "bench": ("benchmark",),
    "import": ("import_robot",),
    "robots": ("list_robots",),
    "quantities": ("list_quantities",),
    "examples": ("list_examples", "copy_examples"),
    "new": ("new_file",),
}
# Options that say how to print, or what the process is set to, and what another function does.
PRINTING = {"help", "json", "device", "all_errors", "list", "all", "readings"}
NAMES = {"sweep": "given", "plan": "given", "result": "results", "measurements": "lengths"}


def commands() -> dict[str, argparse.ArgumentParser]:
    (action,) = (a for a in cli._parser()._actions if isinstance(a, argparse._SubParsersAction))
    return action.choices


def test_every_command_has_its_function():
    # What shells complete is no matter of Python.
    assert set(FUNCTIONS) == set(commands()) - {"completion"}
    for name in FUNCTIONS:
        parser = commands()[name]
        functions = [getattr(cspr_jax, function) for function in FUNCTIONS[name]]
        files = [plans.Plan.save, plans.Plan.save_mjcf, plans.Plan.animate]
        functions += files if name in ("plan", "check") else []
        functions += [cspr_jax.retime] if name in ("plan", "check") else []
        functions += [cspr_jax.Replay.plot] if name == "replay" else []
        functions += [cspr_jax.Simulation.plot] if name == "simulate" else []
        functions += [cspr_jax.Stops.plot] if name == "stops" else []
        functions += [sizing.Sizes.plot] if name == "size" else []
        functions += [designs.Design.plot] if name == "design" else []
        functions += [cspr_jax.ImportedRobot.save] if name == "import" else []
        functions += [calibration.Calibration.save] if name == "calibrate" else []
        functions += [LogComparison.page] if name == "log" else []
        known = {parameter for function in functions for parameter in inspect.signature(function).parameters}
        own = NAMES | {
            "run": {"output": "directory"},
            "merge": {"output": "directory"},
            "plan": dict.fromkeys(("output", "mjcf", "animate", "setpoints", "certificate"), "path"),
            "check": {
                **dict.fromkeys(("output", "mjcf", "animate", "setpoints", "certificate"), "path"),
                **{"motion": "times", "slower": "slower"},
            },
        }.get(name, {})
        own |= {"name": "names", "output": "folder"} if name == "examples" else {}
        own |= {"names": "names"} if name == "robots" else {}
        own |= {"robot": "reference"} if name == "anchors" else {}
        own |= {"sources": "given"} if name == "size" else {}
        own |= {"design": "source", "output": "directory", "picture": "output"} if name == "design" else {}
        known |= {"elastic"} if name == "replay" else set()  # a function of its own
        own |= {"path": {"status": "directory", "volume": "result"}[name]} if name in ("status", "volume") else {}
        own |= {"result": "given", "cell": "cells"} if name == "report" else {}
        own |= {"plan": "plan"} if name in ("plot", "report", "log") else {}
        own |= {"file": "path", "set": "cable_set", "output": "path"} if name == "import" else {}
        own |= {"output": "path"} if name == "calibrate" else {}
        own |= {"file": "lengths", "all": "all_solutions", "slack": "equilibrium"} if name == "locate" else {}
        # `load_robot` takes parameters of the robot that is checked, `plan` those of what is played, driven or stopped.
        own |= {"parameters": "robot"} if name == "check" else {}
        known |= {"parameters"} if name in ("replay", "simulate", "stops") else set()
        known |= {"slower"} if name == "check" else set()  # a method of what is checked
        known |= {"output"} if name == "locate" else set()  # a table of the answers
        known |= {"retime"} if name in ("plan", "check") else set()  # a function of what is planned or checked
        options = {action.dest for action in parser._actions} - PRINTING
        assert {own.get(option, option) for option in options} <= known, name


def test_public_names_hide_no_module():
    """A module that is imported becomes an attribute of the package, in place of a function of its name."""
    for name in cspr_jax.__all__:
        with pytest.raises(ModuleNotFoundError):
            importlib.import_module(f"cspr_jax.{name}")


def test_type_checkers_see_what_is_loaded():
    """The stub says of each name the module of the table; `__all__` is the table; both know the older names."""
    stub = Path(cspr_jax.__file__).with_suffix(".pyi")
    modules, aliases = {}, {}
    for node in ast.parse(stub.read_text("utf-8")).body:
        if isinstance(node, ast.ImportFrom):
            modules |= {name.asname: node.module.removeprefix("cspr_jax.") for name in node.names}
        elif isinstance(node, ast.Assign):
            aliases[node.targets[0].id] = node.value.id
    assert modules == cspr_jax._MODULES and aliases == cspr_jax._ALIASES
    assert cspr_jax.__all__ == sorted(cspr_jax._MODULES)
    assert stub.with_name("py.typed").is_file()


def test_type_checkers_know_the_kinds_of_catalogue_robots():
    for name in get_args(PointMassName):
        assert isinstance(cspr_jax.load_robot(name), PointMassRobot), name
    for name in get_args(PlatformName):
        assert isinstance(cspr_jax.load_robot(name), PlatformRobot), name
    assert {*get_args(PointMassName), *get_args(PlatformName)} == {row["name"] for row in cspr_jax.list_robots()}


def test_older_names_work():
    assert cspr_jax.compute is cspr_jax.compute_sweep and cspr_jax.table_names is cspr_jax.list_tables
    with pytest.raises(AttributeError, match="no attribute 'computed'"):
        _ = cspr_jax.computed


def test_without_xarray(tmp_path, monkeypatch):
    result = cspr_jax.open_result(made(tmp_path / "map.h5"))
    monkeypatch.setitem(sys.modules, "xarray", None)
    for call in (result.to_xarray, lambda: cspr_jax.compute_sweep(tmp_path / "none.toml")):
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
        (lambda plan, sweep: cspr_jax.compute_sweep(plan), ConfigError, "sweep: is a plan file"),
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
