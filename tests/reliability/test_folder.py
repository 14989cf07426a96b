"""A working folder full of somebody's files: none of them is executed."""

import os
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

from cspr_jax.runtime import xla
from cspr_jax.sweep import executors

OTHERS = ("cspr_jax", "jax", "jaxlib", "numpy", "h5py", "scipy", "pydantic", "rich", "sitecustomize", "usercustomize")
SWEEP = """schema = 1
map = "transition-envelopes"
robot = "transition-prototype"
[axes]
x = [2.0, 2.1]
y = [0.0]
z = [2.0]
inclination = [0.0]
tau = [0.5, 1.0]
[trajectory]
family = "transition"
amplitude = "A1"
[run]
tile = [1, 1, 1, 1, 2]
"""


@pytest.fixture
def hostile(tmp_path):
    """The folder, and the file to which each of its modules adds a line when it is executed."""
    folder, marks = tmp_path / "folder", tmp_path / "marks"
    folder.mkdir()
    for name in (*sys.stdlib_module_names, *OTHERS):
        (folder / f"{name}.py").write_text(f"open({str(marks)!r}, 'a').write({name!r} + '\\n')\n")
    (folder / "small.toml").write_text(SWEEP)
    return folder, marks


def test_a_folder_full_of_modules(hostile, tmp_path, monkeypatch):
    """The trial of a flag, the command, its workers, and what multiprocessing starts beside them."""
    folder, marks = hostile
    monkeypatch.chdir(folder)
    assert not xla._is_known(tmp_path, "--xla_no_such_flag=1") and not marks.exists()
    script = Path(sysconfig.get_path("scripts")) / "cspr"
    here = os.environ | {"CSPR_CACHE_DIR": str(tmp_path / "kept")}
    command = [str(script), "run", "small.toml", "-o", str(tmp_path / "run"), "--workers", "2"]
    done = subprocess.run(command, env=here, capture_output=True, text=True, timeout=300)
    assert not marks.exists(), marks.read_text()
    assert (done.returncode, done.stderr) == (0, "") and list(tmp_path.glob("kept/*"))
    assert executors.SAFE_PATH not in os.environ
