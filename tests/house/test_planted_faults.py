"""The tests see faults: those of `planted_faults.toml` are planted, one at a time, in a copy of the package.

Each is a text that stands in one place of the package, what takes its place, and a test that must then fail: faults of
the kind that a refactoring makes. Whoever changes such a text, or the name of the test, changes it there too.
"""

import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FAULTS = tomllib.loads(Path(__file__).with_name("planted_faults.toml").read_text("utf-8"))["fault"]
QUICK, THOROUGH = "not soak and not thorough", "not soak"


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    """The package and its tests, elsewhere."""
    folder, skipped = tmp_path_factory.mktemp("copy"), shutil.ignore_patterns("__pycache__")
    for name in ("cspr_jax", "docs", "tests", "sweeps", "results"):
        shutil.copytree(ROOT / name, folder / name, ignore=skipped)
    shutil.copy(ROOT / "pyproject.toml", folder)
    return folder


def places(package: Path, old: str) -> list[Path]:
    """Files in which a text stands, one for each time."""
    texts = {path: path.read_text("utf-8") for path in sorted(package.rglob("*.py"))}
    return [path for path, text in texts.items() for _ in range(text.count(old))]


def outcome(folder: Path, marks: str, *names: str) -> int:
    """Exit status of tests of a copy, which comes first on the path: 0 all pass, 1 some fail."""
    command = [sys.executable, "-m", "pytest", "-m", marks, "-x", "-q", "-p", "no:cacheprovider"]
    here = os.environ | {"PYTHONPATH": str(folder)}
    here.pop("XLA_FLAGS", None)
    done = subprocess.run([*command, *(f"tests/{name}" for name in names)], cwd=folder, env=here, capture_output=True)
    return done.returncode


@pytest.mark.prose
def test_every_text_stands_in_one_place():
    counts = {fault["name"]: len(places(ROOT / "cspr_jax", fault["old"])) for fault in FAULTS}
    gone = {name: count for name, count in counts.items() if count != 1}
    assert not gone, f"change the texts in planted_faults.toml as they were changed in the package: {gone}"
    assert len(counts) == len(FAULTS)


@pytest.mark.soak
@pytest.mark.parametrize("fault", [pytest.param(fault, id=fault["name"]) for fault in FAULTS])
def test_a_planted_fault_is_seen(copy, fault):
    (path,) = places(copy / "cspr_jax", fault["old"])
    text = path.read_text("utf-8")
    path.write_text(text.replace(fault["old"], fault["new"]), "utf-8")
    try:
        assert outcome(copy, THOROUGH if fault.get("thorough") else QUICK, fault["test"]) == 1
    finally:
        path.write_text(text, "utf-8")


@pytest.mark.soak
def test_without_a_fault_they_pass(copy):
    for marks, is_thorough in ((QUICK, False), (THOROUGH, True)):
        names = {fault["test"] for fault in FAULTS if fault.get("thorough", False) == is_thorough}
        assert outcome(copy, marks, *sorted(names)) == 0
