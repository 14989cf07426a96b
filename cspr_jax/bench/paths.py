"""Fastest motions along random paths a second, many at a time, from paths to path speeds on grids."""

import numpy as np

from cspr_jax.bench import motions
from cspr_jax.bench.timing import best
from cspr_jax.curves.interpolation import interpolated
from cspr_jax.errors import SelfCheckError
from cspr_jax.families.paths.geometry.section import Section, SectionSettings
from cspr_jax.families.paths.least_time.discrete import discretes
from cspr_jax.families.paths.least_time.jumping import jumping_motions

# Number of paths solved at a time, and number of cells of each.
TOGETHER, CELLS = 64, 500
# Splines overshoot their waypoints: a small radius keeps tensions at rest within the limits there too.
REGIONS = {"3 cables": motions.THREE._replace(radius=0.06), "8 cables": motions.EIGHT}


def _section(region: motions.Region, rng: np.random.Generator) -> Section:
    # Return a cubic spline through random poses, parametrized by the length of their polygon.
    positions, turns = motions.poses(region, rng)
    knots = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(positions, axis=0), axis=1)))
    curve = interpolated(knots, positions, turns, ends="natural")
    return Section(curve, np.full(len(knots) - 1, np.inf), knots)


def rate(region: motions.Region) -> float:
    """Paths a second, `TOGETHER` at a time."""
    problem, rng = motions.problem(region), np.random.default_rng(0)
    sections = [_section(region, rng) for _ in range(TOGETHER)]
    settings = [SectionSettings(CELLS, 0.0)] * TOGETHER

    def solve() -> None:
        if any(motion.run is None for motion in jumping_motions(discretes(problem, sections, settings))):
            raise SelfCheckError("a path of the bench cannot be run along")

    return TOGETHER / best(solve)


def rates() -> dict[str, float]:
    """Paths a second for all regions."""
    return {name: rate(region) for name, region in REGIONS.items()}


def lines(measured: dict[str, float]) -> list[str]:
    """Lines for people."""
    return ["least times along paths a second", *(f"  {name:26s} {rate:8.3g}" for name, rate in measured.items())]
