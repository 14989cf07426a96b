"""Sweep and plan files that come with the program, and what the command line says of itself."""

import json
import re
import sys
from pathlib import Path

import pytest

from cspr_jax import __version__
from cspr_jax.cli import main
from cspr_jax.config.reading import read_toml
from cspr_jax.config.robot import catalogue_names
from cspr_jax.outputs import example_files


def test_they_are_listed_with_what_they_are_for(capsys):
    assert main(["examples"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == len(example_files.examples()) > 15
    assert all(len(purpose) > 30 and purpose[-1] == "." for purpose in example_files.examples().values())
    assert main(["examples", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == example_files.examples()


def test_copies_work_elsewhere_and_overwrite_nothing(tmp_path, capsys):
    place = tmp_path / "new" / "folder"
    assert main(["examples", "demo", "table_2_1", "-o", str(place)]) == 0
    assert capsys.readouterr().out.splitlines() == [str(place / "demo.toml"), str(place / "table_2_1.toml")]
    assert (place / "demo.toml").read_bytes() == (example_files.folder() / "demo.toml").read_bytes()
    (place / "demo.toml").write_text("mine")
    assert main(["examples", "--all", "-o", str(place)]) == 3
    assert "demo.toml: is there already" in capsys.readouterr().err
    assert (place / "demo.toml").read_text() == "mine" and len(list(place.iterdir())) == 2
    assert main(["examples", "dmo", "-o", str(place)]) == 2
    assert "did you mean demo?" in capsys.readouterr().err
    # No path leads out of the folder that they are copied from.
    robots = [read_toml(path)["robot"] for path in example_files.folder().glob("*.toml")]
    assert {robot for robot in robots if not isinstance(robot, dict)} <= set(catalogue_names())


def test_version_and_platforms(capsys, monkeypatch):
    with pytest.raises(SystemExit) as ended:
        main(["--version"])
    assert ended.value.code == 0 and capsys.readouterr().out == f"cspr {__version__}\n"
    monkeypatch.setattr(sys, "platform", "win32")
    assert main(["robots"]) == 2
    assert capsys.readouterr().err.startswith("cspr: Linux and macOS are supported")


def test_versions_agree():
    """The package, its metadata, the citation and the newest dated section of the changelog name one version."""
    root = Path(__file__).parents[2]
    files = {name: (root / name).read_text("utf-8") for name in ("pyproject.toml", "CITATION.cff", "CHANGELOG.md")}
    assert f'version = "{__version__}"' in files["pyproject.toml"]
    version, date = re.search(r"^version: (.*)\ndate-released: \"(.*)\"$", files["CITATION.cff"], re.M).groups()
    dated = re.findall(r"^## (\d\S*) - (\d{4}-\d\d-\d\d)$", files["CHANGELOG.md"], re.M)
    assert (version, date) == dated[0] and version == __version__


def test_the_hosted_workflow_runs_what_ci_runs():
    """Its parts are all targets of .ci/run, and the tests in all of their shards."""
    root = Path(__file__).parents[2]
    script, workflow = (root / name for name in (".ci/run", ".github/workflows/ci.yml"))
    targets = re.findall(r"^make (.*)$", script.read_text("utf-8"), re.M)
    targets = [word for line in targets for word in line.split() if word.isalpha()]
    parts = re.findall(r"^ {10}- (.*)$", workflow.read_text("utf-8"), re.M)
    shards = [part.split("=")[1] for part in parts if "SHARD" in part]
    assert shards == [f"{k}/{len(shards)}" for k in range(1, len(shards) + 1)]
    words = {word for part in parts for word in part.split() if "=" not in word}
    assert words == set(targets) and len(targets) == len(words)
    makefile = (root / "Makefile").read_text("utf-8")
    assert all(f"\n{target}: " in makefile or f"\n{target}:\n" in makefile for target in targets)
