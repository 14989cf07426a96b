"""A kind of map without kernels: plain NumPy, so that its bytes are the same in every process.

Files beside the sweep file ask for more: "pause" holds the seconds that a tile takes; "die" holds an x, and the worker
process that computes it takes the file away and is gone, once.

As a program, `python -m support.toy`, it is the command line of somebody who has registered that kind.
"""

import multiprocessing
import os
import signal
import sys
import time
from pathlib import Path

import numpy as np

from cspr_jax.maps.grid_map import GridMap
from cspr_jax.schema.map_kinds import MapKind, registered
from cspr_jax.schema.quantities import Quantity

SWEEP = """schema = 1
map = "toy"
robot = "prototype"
[axes]
x = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5]
y = [-0.9, 0.1, 0.8]
z = [0.8, 1.9]
[trajectory]
[run]
tile = [1, 3, 2]
"""
TILES = 6


class ToyMap(GridMap):
    """Distance of each target from the origin."""

    def __init__(self, robot_file, keys, file):
        self._folder = Path(file).parent

    def refuse_hopeless(self, grid):
        pass

    def contradictions(self, answers):
        return {"a negative distance": answers["toy_distance"] < 0.0}

    def __call__(self, cells):
        if (self._folder / "pause").exists():
            time.sleep(float((self._folder / "pause").read_text()))
        die = self._folder / "die"
        if multiprocessing.parent_process() is not None and die.exists() and float(die.read_text()) in cells["x"]:
            die.unlink()
            os.kill(os.getpid(), signal.SIGKILL)
        return {"toy_distance": np.sqrt(cells["x"] ** 2 + cells["y"] ** 2 + cells["z"] ** 2)}


QUANTITIES = (Quantity("toy_distance", "m", "distance from the origin", "Distance of the target from the origin."),)
KIND = MapKind(
    name="toy",
    title="Distances from the origin",
    description="distance of each target from the origin",
    implementation="support.toy:ToyMap",
    quantities=("toy_distance",),
    stored=("toy_distance",),
    pictured=("toy_distance",),
    motionless=("toy_distance",),
    families=("hypocycloid-standard",),
    cells=8,
)


if __name__ == "__main__":
    from cspr_jax.cli import main

    with registered(KIND, *QUANTITIES):
        sys.exit(main())
