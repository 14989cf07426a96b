"""Exact verdicts of a million Bezier segments on random triangles of spools, from arrays to arrays."""

import time

import numpy as np

import cspr_jax

COUNT = 1_000_000


def main() -> None:
    """Print seconds, segments a minute and how many are feasible."""
    rng = np.random.default_rng(0)
    spools = rng.normal(size=(3, 3)) * np.array([0.5, 0.5, 0.1])
    robot = cspr_jax.point_mass(spools, mass=1.0)
    points = rng.normal(size=(3, COUNT, 3)) * 0.3 + np.array([0.0, 0.0, 1.1])
    times = np.exp(rng.uniform(-0.5, 1.4, COUNT))
    for name in ("cold", "warm"):
        start = time.perf_counter()
        found = cspr_jax.bezier_verdicts(robot, *points, durations=times)
        seconds = time.perf_counter() - start
        rate = COUNT / seconds * 60.0 / 1e6
        print(f"{name}: {seconds:.2f} s, {rate:.0f} million a minute, {found.feasible.mean():.2%} feasible")


if __name__ == "__main__":
    main()
