"""A working folder full of somebody's files: none of them is executed."""

import os
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

from cspr_jax.runtime import processes, xla

OTHERS = ("cspr_jax", "jax", "jaxlib", "numpy", "h5py", "scipy", "pydantic", "rich", "sitecustomize", "usercustomize")
SWEEP = """schema = 1
map = "transition-envelopes"
robot = "transition-prototype"
[axes]
x = {x}
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
    return folder, marks


def run_there(hostile, tmp_path, x, environment):
    """The command with its workers, and what multiprocessing starts beside them; a tile, so a worker, for each x."""
    folder, marks = hostile
    (folder / "small.toml").write_text(SWEEP.format(x=x))
    script = Path(sysconfig.get_path("scripts")) / "cspr"
    command = [str(script), "run", "small.toml", "-o", str(tmp_path / "run"), "--workers", "2"]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=300)
    assert not marks.exists(), marks.read_text()
    assert (done.returncode, done.stderr) == (0, "") and (tmp_path / "run" / "small.h5").exists()
    assert processes.SAFE_PATH not in os.environ


@pytest.mark.soak
def test_a_folder_full_of_modules(hostile, tmp_path, monkeypatch):
    """The trial of a flag, the command, and a worker."""
    folder, marks = hostile
    with monkeypatch.context() as patch:
        patch.chdir(folder)
        assert not xla._is_accepted(tmp_path, "--xla_no_such_flag=1") and not marks.exists()
    run_there(hostile, tmp_path, [2.0], os.environ)


@pytest.mark.soak
def test_a_folder_full_of_modules_all(hostile, tmp_path):
    """Where no code is kept yet, the command itself tries a flag."""
    run_there(hostile, tmp_path, [2.0, 2.1], os.environ | {"CSPR_CACHE_DIR": str(tmp_path / "kept")})
    assert list(tmp_path.glob("kept/*"))
