"""One million transitions of a platform to poses: from a cold start to numbers of arcs, margins and verdicts."""

import argparse
import time

MAX_ARCS, Z0 = 20, 1.7
# As a map does: so many candidates at a time.
AT_A_TIME = 131_072


def main() -> None:
    """Print seconds and segments a second."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=1_000_000)
    parser.add_argument(
        "--search", action="store_true", help="several values of beta-hat at each target, not the preferred one"
    )
    parser.add_argument("--from-pose", action="store_true", help="start at a pose instead of at rest")
    options = parser.parse_args()
    began = time.perf_counter()
    from pathlib import Path

    import jax
    import numpy as np

    jax.config.update("jax_enable_x64", True)
    from cspr_jax.config.reading import checked
    from cspr_jax.config.robot import resolve_robot
    from cspr_jax.config.sweep import SweepFile
    from cspr_jax.families.platforms.orientations.poses_map import PosesMap

    here = Path(__file__)
    start = {"position": [1.2, -0.4, 1.5], "tilt_torsion": [0.5, 0.4, 0.2]} if options.from_pose else {"rest": True}
    keys = {
        "schema": 1,
        "map": "poses",
        "robot": "laval-mssm",
        "axes": {"x": [0.0], "y": [0.0], "z": [1.0], "z0": [Z0]},
        "trajectory": {
            "family": "hypocycloid",
            "amplitude": {"name": "effective-c3", "epsilon": 0.1},
            "max_arcs": MAX_ARCS,
            "from": start,
        },
    }
    if not options.search:
        keys["trajectory"]["beta_hat"] = "preferred"
    poses = PosesMap(resolve_robot("laval-mssm", here, here.parent), checked(SweepFile, keys, here), here)
    rng, count = np.random.default_rng(0), options.count
    radius, azimuth = 3.0 * np.sqrt(rng.random(count)), rng.uniform(-np.pi, np.pi, count)
    cells = {
        "x": radius * np.cos(azimuth),
        "y": radius * np.sin(azimuth),
        "z": rng.uniform(1.0, 2.0, count),
        "tilt_azimuth": rng.uniform(-np.pi, np.pi, count),
        "tilt": rng.uniform(0.0, np.pi / 3.0, count),
        "torsion": rng.uniform(-np.pi / 4.0, np.pi / 4.0, count),
        "z0": np.full(count, Z0),
    }
    found = poses(cells)
    seconds = time.perf_counter() - began
    print(
        f"{seconds:.1f} s, {count / seconds:,.0f} segments a second; {(found['arcs'] > 0).sum():,} feasible, "
        f"{(found['verdict'] & (2048 | 8192) > 0).sum():,} with something undecided"
    )


if __name__ == "__main__":
    main()
