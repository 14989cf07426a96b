"""Maps of searches go on where the machine went off, and end with the bytes of one run."""

import pytest

from cspr_jax.sweep.definition import read_sweep
from cspr_jax.sweep.engine import Run
from cspr_jax.sweep.executors import ThisProcess
from cspr_jax.sweep.tile import TileMap
from reliability.support import Crash, FaultyDisk

LEAST_TIME = """schema = 1
map = "least-time"
robot = "boralugoda-rectangle"
[axes]
x = [5.0, 20.0, 60.0]
y = [5.0, 20.0]
z = [3.0]
[trajectory]
family = "s-curve"
max_acceleration = 10.0
from = { position = [1.0, 20.0, 7.0] }
[run]
tile = [1, 2, 1]
"""
SWING_RANGE = """schema = 1
map = "swing-range"
robot = "prototype"
[axes]
x = [-2.0, 0.5, 6.0]
y = [1.0]
z = [3.0]
[trajectory]
family = "ellipse"
from = { position = [0.0, 0.0, 2.0] }
[launch]
release_x = [-1.5, 1.5]
release_y = [-1.5, 1.5]
release_z = [1.2, 2.4]
[limits]
floor = 3.0
[run]
tile = [1, 1, 1]
"""


@pytest.mark.thorough
@pytest.mark.parametrize("text", [LEAST_TIME, SWING_RANGE], ids=["least-time", "swing-range"])
def test_a_map_of_searches_goes_on(tmp_path, text):
    """With the machine off while the first tile, the second and the result are written."""
    (tmp_path / "map.toml").write_text(text)
    sweep = read_sweep(tmp_path / "map.toml")
    executor = ThisProcess(TileMap(sweep))
    counting = FaultyDisk()
    whole = Run(sweep, tmp_path / "whole", disk=counting).go(executor).result.read_bytes()
    for part in (0.3, 0.5, 0.9):
        directory = tmp_path / str(part)
        with pytest.raises(Crash):
            Run(sweep, directory, disk=FaultyDisk(int(part * counting.count), "power")).go(executor)
        assert Run(sweep, directory).go(executor).result.read_bytes() == whole
