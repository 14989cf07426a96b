"""Margins and feasible frequencies of millions of ellipses by formulas, from arrays to arrays, beside NumPy."""

import argparse
import time

import numpy as np

import cspr_jax
from cspr_jax.bench import ellipses


def main() -> None:
    """Print ellipses a second, of wall and of CPU time, and how many are feasible."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=4_000_000)
    case = ellipses.work(parser.parse_args().count)
    count, shape = len(case.frequency), [np.asarray(leaf) for leaf in case.ellipse]
    robot = cspr_jax.load_robot("prototype")
    ways = {
        "margins": lambda: cspr_jax.ellipse_margins(robot, *shape, case.frequency),
        "margins, NumPy": lambda: ellipses.numpy_margins(case),
        "frequencies": lambda: cspr_jax.ellipse_frequencies(robot, *shape),
        "frequencies, NumPy": lambda: ellipses.numpy_intervals(case),
    }
    for name, way in ways.items():
        for round_name in ("cold", "warm"):
            start, worked = time.perf_counter(), time.process_time()
            found = way()
            seconds, worked = time.perf_counter() - start, time.process_time() - worked
            print(
                f"{name}, {round_name}: {count / seconds / 1e6:.1f} million a second, {count / worked / 1e6:.1f} of CPU"
            )
        if name == "margins":
            print(f"{(found > 0.0).mean():.2%} feasible")


if __name__ == "__main__":
    main()
