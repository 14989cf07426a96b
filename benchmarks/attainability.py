"""Table 3.3 for one amplitude function, from a cold start: seconds, and motions and samples against testing all."""

import argparse
import time


def main() -> None:
    """Print the counts of four places, and what they took."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--amplitude", default="effective-c3", choices=("quintic", "effective", "effective-c3"))
    parser.add_argument("--definition", default="scan", choices=("grid", "scan", "equal-volume"))
    options = parser.parse_args()
    began = time.perf_counter()
    import jax
    import numpy as np

    jax.config.update("jax_enable_x64", True)
    from cspr_jax.families.platforms.orientations.accessible import accessible
    from cspr_jax.families.platforms.orientations.attainable import VALUES
    from cspr_jax.families.platforms.six_cable_proof.pose_blocks import STEPS
    from cspr_jax.families.platforms.six_cable_proof.pose_proof import PARTS
    from cspr_jax.families.platforms.six_cable_proof.tension_proof import WITH_MARGINS
    from cspr_jax.numerics.bounds.chebyshev import DEGREE
    from cspr_jax.published import chapter_3 as tables

    checker = tables.checker_of(options.amplitude)
    places = [np.array([x * tables.RADIUS, y * tables.RADIUS, tables.DEPTH]) for x, y in tables.POSITIONS.values()]
    robot = checker.problem.robot
    sets = [(place, accessible(robot, place, options.definition, tables.DIVISIONS).angles) for place in places]
    print(f"accessible: {time.perf_counter() - began:.1f} s since the start")
    found = tables.attained(checker, sets)
    for name, good in zip(tables.POSITIONS, found, strict=True):
        print(f"{name:9s} {len(good):6d} accessible, {good.sum():6d} attainable, {100.0 * good.mean():6.2f} %")
    print(f"attainable: {time.perf_counter() - began:.1f} s since the start")
    motions = sum(map(len, found)) * VALUES * tables.MAX_ARCS
    arcs = 0.5 * (tables.MAX_ARCS + 1)
    every = motions * arcs * (PARTS * (STEPS + 1) + WITH_MARGINS[0] * (DEGREE + 1))
    done = checker.done
    samples = done["screen"] + done["checks"]
    print(f"motions: {motions:,} candidates, {done['motions']:,} checked in full ({done['motions'] / motions:.2%})")
    print(f"samples: {every:,.0f} if all were, {samples:,} done ({samples / every:.2%}): {done}")


if __name__ == "__main__":
    main()
