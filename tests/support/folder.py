"""A working folder with a robot, a plan and a sweep, and what HDF5 files in it hold."""

from pathlib import Path

import h5py
import jax
import numpy as np
import pytest

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
