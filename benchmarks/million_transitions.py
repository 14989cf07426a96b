"""One million transitions: from a cold start to numbers of oscillations, proofs, margins and verdicts."""

import argparse
import time

COUNT = 1_000_000
MAX_ARCS = 30  # 15 oscillations


def main() -> None:
    """Print seconds and targets a second."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=COUNT)
    parser.add_argument("--inclination", type=float, default=0.0)
    options = parser.parse_args()
    began = time.perf_counter()
    import jax
    import numpy as np

    jax.config.update("jax_enable_x64", True)
    from cspr_jax.build.robots import load_robot
    from cspr_jax.families.swings.transitions.oscillations import minimum_oscillations, transitions_to
    from cspr_jax.motion.amplitudes import named
    from cspr_jax.motion.problem import Problem
    from cspr_jax.robots.model.limits import Limits

    rng, z0 = np.random.default_rng(0), np.full(options.count, 2.0)
    targets = rng.uniform(-3.5, 3.5, (options.count, 3))
    targets[:, 2] = 2.0 * (1.0 + options.inclination)
    problem = Problem(load_robot("transition-prototype"), Limits(), named("quintic"))
    answers = minimum_oscillations(problem, transitions_to(problem, targets, z0), z0, max_arcs=MAX_ARCS)
    seconds = time.perf_counter() - began
    feasible = int((answers.oscillations > 0).sum())
    fewer = int(((answers.oscillations > 0) & (answers.oscillations < answers.envelope_oscillations)).sum())
    print(
        f"{seconds:.1f} s, {options.count / seconds:,.0f} targets a second; {feasible:,} feasible, {fewer:,} with fewer"
    )


if __name__ == "__main__":
    main()
