"""Growth of rate and memory with the number of cases, and with a second core; every line is a process of its own."""

import argparse
import json
import os
import resource
import subprocess
import sys

SIZES = {"six-cable look": (10**3, 10**4, 10**5, 10**6, 10**7), "three-cable map": (10**3, 10**4, 10**5, 10**6)}


def main() -> None:
    """Print a table, or one line of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--largest", type=int, default=10**7)
    parser.add_argument("--one", nargs=3, metavar=("WORK", "COUNT", "CORES"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        one(options.one[0], *map(int, options.one[1:]))
        return
    print("work             cores       cases  seconds  checks a second  memory, MB")
    for work, sizes in SIZES.items():
        for cores in sorted({1, len(os.sched_getaffinity(0))}):
            for count in (size for size in sizes if size <= options.largest):
                command = [sys.executable, __file__, "--one", work, str(count), str(cores)]
                found = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
                print(
                    f"{work:15s}  {cores:5d}  {count:10,d}  {found['seconds']:7.3f}  {found['rate'] / 1e6:13.1f} M"
                    f"  {found['memory']:10.0f}",
                    flush=True,
                )


def one(work: str, count: int, cores: int) -> None:
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:cores])
    from cspr_jax.runtime import xla

    xla.prepare()
    import jax

    jax.config.update("jax_enable_x64", True)
    seconds, checks = (six_cables if work.startswith("six") else three_cables)(count)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    print(json.dumps({"seconds": seconds, "rate": checks / seconds, "memory": memory}))


def six_cables(count: int) -> tuple[float, int]:
    """The bench's kernel over all trajectories, whatever their numbers."""
    import jax

    from cspr_jax.bench import six_cables as bench
    from cspr_jax.bench.timing import best
    from cspr_jax.numerics.batches import in_threads

    given = bench.work(count)

    def look(batch):
        return jax.block_until_ready(bench.tensions(given.robot, batch, single_precision=True))

    batches = bench.batches(given)
    return best(lambda: in_threads(look, batches), repeats=2), count * bench.SAMPLES


def three_cables(count: int) -> tuple[float, int]:
    """Numbers of arcs, certified; what a brute-force search would check is counted."""
    import numpy as np

    from cspr_jax.bench import three_cables as bench
    from cspr_jax.bench.timing import best
    from cspr_jax.families.swings.arcs import minimum_arcs

    given = bench.work()
    ends = np.random.default_rng(0).uniform([-1.5, -1.5, 0.3], [1.5, 1.5, 3.2], (count, 3))
    starts = np.broadcast_to(bench.START, ends.shape).copy()
    z0 = np.full(count, bench.Z0)
    return best(lambda: minimum_arcs(given.problem, starts, ends, z0), repeats=2), bench.checks(count)


if __name__ == "__main__":
    main()
