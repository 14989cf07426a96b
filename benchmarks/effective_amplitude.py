"""Savings by the amplitude function "effective-c3": smallest numbers of arcs of 1,000 segments, for several epsilon.

Half of the segments start at rest, half at a pose; those that interfere or are singular at an end, which no amplitude
function can mend, fail with all of them.
"""

import argparse
import time

import jax
import numpy as np

from cspr_jax import load_robot
from cspr_jax.families.platforms.arcs import Candidates, smallest_arcs
from cspr_jax.families.platforms.beta_hat import OPTIONS, end_options
from cspr_jax.families.platforms.motion_checker import MANY
from cspr_jax.families.platforms.six_cable_proof.checker import PlatformChecker
from cspr_jax.motion import amplitudes
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.linear.rotations import from_tilt_torsion
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.statics.reference_pose import aligned

Z0, MAX_ARCS = 1.7, 20
EPSILONS = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5)


def poses(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Random poses: up to 3 m from the middle, 1 to 2 m below the spools, tilts up to 60 and torsions up to 45 degrees.

    Args:
        rng: of the numbers.
        count: of poses.

    Returns:
        positions (n, 3) m, and quaternions (n, 4).
    """
    radius, azimuth = 3.0 * np.sqrt(rng.random(count)), rng.uniform(-np.pi, np.pi, count)
    position = np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), rng.uniform(1.0, 2.0, count)], axis=1)
    angles = rng.uniform([-np.pi, 0.0, -np.pi / 4.0], [np.pi, np.pi / 3.0, np.pi / 4.0], (count, 3))
    return position, from_tilt_torsion(angles)


def candidates(robot, rng: np.random.Generator, count: int) -> Candidates:
    """Random segments, each with its values of beta-hat.

    Args:
        robot: the platform.
        rng: of the numbers.
        count: of segments.

    Returns:
        the candidates.
    """
    start, end, depth = poses(rng, count), poses(rng, count), np.full(count, Z0)
    at_rest = np.arange(count) < count // 2
    start[0][at_rest], start[1][at_rest] = [0.0, 0.0, Z0], [1.0, 0.0, 0.0, 0.0]
    first = end_options(robot, *start, depth, 1)[0][:, 0]
    values, can_end = end_options(robot, *end, depth, OPTIONS)
    can_start = end_options(robot, *start, depth, 1)[1]
    motion, option = np.nonzero(~np.isnan(values) & (can_end & can_start & ~np.isnan(first))[:, None])
    beta_hats = (np.where(at_rest, -1.0, first)[motion], values[motion, option])
    return Candidates(start, end, depth, motion, beta_hats)


def main() -> None:
    """Print how many arcs each amplitude function needs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--segments", type=int, default=1000)
    options = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    robot = aligned(load_robot("laval-mssm"))[0]
    some = candidates(robot, np.random.default_rng(0), options.segments)
    names: list[tuple[str, float | None]] = [("quintic", None), ("effective", 0.1)]
    arcs = {}
    for name, epsilon in [*names, *(("effective-c3", e) for e in EPSILONS)]:
        begun = time.perf_counter()
        amplitude = amplitudes.named(name, epsilon)
        found = smallest_arcs(PlatformChecker(Problem(robot, Limits(), amplitude), batch=MANY), some, max_arcs=MAX_ARCS)
        least = np.zeros(options.segments, int)
        best = np.flatnonzero(found.arcs > 0)
        least[some.motion[best]] = found.arcs[best]
        arcs[amplitude.name] = least
        print(
            f"{amplitude.name:30s} {np.count_nonzero(least):5d} feasible  {time.perf_counter() - begun:6.1f} s",
            flush=True,
        )
    both = np.all([least > 0 for least in arcs.values()], axis=0)
    plain = arcs["quintic"][both]
    print(f"{both.sum()} of {options.segments} segments are feasible with every one; of these:")
    for name, least in arcs.items():
        saved = plain - least[both]
        print(
            f"{name:30s} {least[both].mean():6.3f} arcs, {saved.mean():+.3f} saved; fewer in {(saved > 0).mean():.1%}, "
            f"more in {(saved < 0).mean():.1%}"
        )


if __name__ == "__main__":
    main()
