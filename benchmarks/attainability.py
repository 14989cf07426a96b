"""Table 3.3 for one amplitude function, from a cold start: seconds, and motions and instants against testing all."""

import argparse
import time


def main() -> None:
    """Print what each place took."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--amplitude", default="effective-c3", choices=("quintic", "effective", "effective-c3"))
    parser.add_argument("--definition", default="scan", choices=("grid", "scan", "equal-volume"))
    options = parser.parse_args()
    began = time.perf_counter()
    import jax
    import numpy as np

    jax.config.update("jax_enable_x64", True)
    from cspr_jax import orientation_tables as tables
    from cspr_jax.feasibility.pose_samples import SAMPLES
    from cspr_jax.maps.accessible import accessible
    from cspr_jax.maps.attainable import VALUES

    checker, motions = tables.checker_of(options.amplitude), 0
    for name, (x, y) in tables.PLACES.items():
        place = np.array([x * tables.RADIUS, y * tables.RADIUS, tables.DEPTH])
        inside = accessible(checker.shared.robot, place, options.definition, tables.DIVISIONS)
        good = tables.attained(checker, place, inside.angles)
        motions += len(good) * VALUES * tables.MAX_ARCS
        print(
            f"{name:9s} {len(good):6d} accessible, {good.sum():6d} attainable, {100.0 * good.mean():6.2f} %, "
            f"{time.perf_counter() - began:5.1f} s since the start"
        )
    arcs = 0.5 * (tables.MAX_ARCS + 1)
    every = motions * arcs * 2 * (SAMPLES + 1)
    done = checker.done
    instants = done["first look"] + done["checks"]
    print(f"motions: {motions:,} candidates, {done['motions']:,} checked in full ({done['motions'] / motions:.2%})")
    print(f"instants: {every:,.0f} if all were, {instants:,} done ({instants / every:.2%}): {done}")


if __name__ == "__main__":
    main()
