"""Poses from lengths of cables a second: three cables by a closed form, eight by least squares."""

import numpy as np

from cspr_jax.bench import motions
from cspr_jax.bench.timing import best
from cspr_jax.errors import SelfCheckError
from cspr_jax.machine.forward_kinematics.solutions import Search
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.numerics.linear.frames import IDENTITY
from cspr_jax.workspaces.poses import geometry

# Regions of poses, and numbers of poses.
REGIONS = {"3 cables": (motions.THREE, 1 << 20), "8 cables": (motions.EIGHT, 1 << 15)}
CLOSE = 1e-6  # m


def rate(region: motions.Region, count: int) -> float:
    """Poses a second of one region."""
    rng, robot = np.random.default_rng(0), motions.problem(region).robot
    positions = np.array(region.middle) + region.radius * rng.uniform(-1.0, 1.0, (count, 3))
    quaternions = np.array(IDENTITY) + region.tilt * rng.uniform(-1.0, 1.0, (count, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    with double_precision():
        lengths = np.asarray(geometry.cable_lengths(robot, positions, quaternions))
        search = Search(robot, np.ones(robot.n_cables), None, np.zeros(3))

        def solve() -> None:
            poses = search.all_solutions(lengths) if search.is_closed else search.usual(lengths)
            if not np.abs(poses.positions[:, 0] - positions).max() < CLOSE:
                raise SelfCheckError("a pose of the bench is not that of its lengths")

        return count / best(solve)


def rates() -> dict[str, float]:
    """Poses a second of all regions."""
    return {name: rate(*region) for name, region in REGIONS.items()}


def lines(measured: dict[str, float]) -> list[str]:
    """Lines for people."""
    return ["poses from lengths of cables a second", *(f"  {name:26s} {rate:8.3g}" for name, rate in measured.items())]
