"""Cost of safety: the store's share of a sweep's wall time, and going on with a finished run.

Usage: python benchmarks/store_cost.py [SWEEP.toml]
"""

import sys
import tempfile
import time
from pathlib import Path

from cspr_jax.sweep.definition import read_sweep
from cspr_jax.sweep.engine import Run
from cspr_jax.sweep.executors import ThisProcess
from cspr_jax.sweep.tile import TileMap


class Timed(ThisProcess):
    """Adds up the time in which tiles are computed."""

    seconds = 0.0

    def tiles(self, indices, stop):
        tiles = super().tiles(indices, stop)
        while True:
            start = time.perf_counter()
            computed = next(tiles, None)
            self.seconds += time.perf_counter() - start
            if computed is None:
                return
            yield computed


def main() -> None:
    path = Path(sys.argv[1] if len(sys.argv) > 1 else "sweeps/minimum_arcs.toml")
    sweep = read_sweep(path)
    with tempfile.TemporaryDirectory(dir=".") as folder:
        executor, directory = Timed(TileMap(sweep)), Path(folder) / "run"
        start = time.perf_counter()
        outcome = Run(sweep, directory).go(executor)
        whole = time.perf_counter() - start
        size = sum(p.stat().st_size for p in directory.rglob("*") if p.is_file())
        start = time.perf_counter()
        Run(sweep, directory).finished()
        again = time.perf_counter() - start
        outcome.result.unlink()
        start = time.perf_counter()
        Run(sweep, directory).go(executor)
        resume = time.perf_counter() - start
    stored = sum(8 if name not in ("arcs", "verdict", "tried_arcs") else 2 for name in sweep.store) * sweep.grid.n_cells
    print(f"{sweep.grid.n_cells} cells in {whole:.2f} s, {executor.seconds:.2f} s of it computing")
    print(f"the store took {whole - executor.seconds:.2f} s, {100 * (1 - executor.seconds / whole):.1f} % of the whole")
    print(f"{size / 1e6:.1f} MB on disk, {stored / 1e6:.1f} MB of data")
    print(f"a finished run is recognised in {again:.3f} s; all shards checked and copied again in {resume:.2f} s")


if __name__ == "__main__":
    main()
