"""The pages on families and maps of one's own work as written, from an empty folder, with the command line."""

import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from cspr_jax.schema.plugins import ExtensibleRows
from tests.maps.test_grid_map import SWEEP as DISTANCES
from tests.plans.test_sequence import PLAN
from tests.plans.test_sequence import SWEEP as DURATIONS

DOCS = Path(__file__).parents[2] / "docs"


def installed(folder, page):
    """What pip writes for the pyproject.toml of a page."""
    (text,) = re.findall(r"```toml\n(.*?)```", (DOCS / page).read_text("utf-8"), re.DOTALL)
    project = tomllib.loads(text)["project"]
    place = folder / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    place.mkdir()
    (place / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n")
    groups = project["entry-points"].items()
    lines = [f"[{group}]\n" + "".join(f"{key} = {value}\n" for key, value in rows.items()) for group, rows in groups]
    (place / "entry_points.txt").write_text("\n".join(lines))


def command(folder, *words):
    """Exit code and outputs of a process of its own, which finds the folder as it finds installed packages."""
    process = subprocess.run(
        [sys.executable, "-m", "cspr_jax", *map(str, words)],
        env=os.environ | {"PYTHONPATH": f"{folder}{os.pathsep}{DOCS.parent}"},
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=300,
    )
    return process.returncode, process.stdout, process.stderr


def test_a_family_and_its_map_from_an_empty_folder(tmp_path):
    shutil.copytree(DOCS / "examples" / "straight_lines", tmp_path / "straight_lines")
    installed(tmp_path, "add_family.md")
    (tmp_path / "plan.toml").write_text(PLAN.format(last="[-0.05, -0.1, 1.6]", more=""))
    code, out, err = command(tmp_path, "plan", "plan.toml", "--json")
    assert err == "" and code == 1 and {row["verdict"] for row in json.loads(out)["segments"]} == {"undecided"}
    (tmp_path / "durations.toml").write_text(DURATIONS)
    code, out, err = command(tmp_path, "run", "durations.toml", "-o", "run")
    assert (code, err) == (0, "") and (tmp_path / "run" / "durations.h5").is_file()


@pytest.mark.thorough
def test_a_map_from_an_empty_folder(tmp_path):
    shutil.copy(DOCS / "examples" / "spool_distances.py", tmp_path)
    installed(tmp_path, "add_map.md")
    (tmp_path / "distances.toml").write_text(DISTANCES)
    code, _, err = command(tmp_path, "run", "distances.toml", "-o", "run", "--workers", 2)
    assert (code, err) == (0, "")
    assert command(tmp_path, "plot", "run", "-o", "picture.png")[::2] == (0, "")


@pytest.mark.quick("def (", "None")
@pytest.mark.parametrize(
    "content", ["import absent", "def (", "1 / 0", "KIND = 1", "raise OSError('two\\nlines')", None]
)
def test_a_broken_package_is_one_line(tmp_path, content):
    installed(tmp_path, "add_map.md")
    if content is not None:
        (tmp_path / "spool_distances.py").write_text(content)
    (tmp_path / "distances.toml").write_text(DISTANCES)
    code, out, err = command(tmp_path, "run", "distances.toml", "-o", "run")
    assert (code, out) == (2, "") and len(err.splitlines()) == 1 and "spool-distances = spool_distances: cannot" in err
    assert not (tmp_path / "run").exists()


def test_entry_points_are_read_once_and_late(monkeypatch):
    asked = []
    monkeypatch.setattr("importlib.metadata.entry_points", lambda group: asked.append(group) or [])
    rows = ExtensibleRows({"own": 1}, "some.group", lambda row: None)
    assert "own" in rows and rows["own"] == 1 and list(rows) == ["own"] and not asked
    assert "other" not in rows and "another" not in rows and asked == ["some.group"]
    with pytest.raises(KeyError):
        rows["other"]
