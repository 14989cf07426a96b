"""One million straight lines of a point mass on four cables: from a cold start to least durations and bounds."""

import argparse
import time


def main() -> None:
    """Print seconds and lines a second."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=1_000_000)
    count = parser.parse_args().count
    began = time.perf_counter()
    import numpy as np

    import cspr_jax

    robot, rng = cspr_jax.load_robot("boralugoda-rectangle"), np.random.default_rng(0)
    starts, ends = (rng.uniform([0.1, 0.1, 0.1], [44.9, 29.9, 29.5], (count, 3)) for _ in range(2))
    answers = cspr_jax.least_time(robot, ends, start=starts, max_acceleration=10.0)
    seconds = time.perf_counter() - began
    ratio = answers.duration_ratio
    print(
        f"{count} lines in {seconds:.1f} s, {count / seconds:.0f} a second; "
        f"{(answers.verdict == 0).mean():.4%} feasible"
    )
    print(
        f"duration over the least of any motion: median {np.median(ratio):.4f}, {ratio.min():.4f} to {ratio.max():.4f}"
    )


if __name__ == "__main__":
    main()
