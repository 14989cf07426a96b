"""A point mass in a prism, off by a millimetre in each number, as measured by a tracker beside it."""

import numpy as np

import cspr_jax

SIDE, HEIGHT, ERROR = 0.6, 0.65, 1e-3
PRISM = SIDE * np.array(
    [[0.5, -0.5 / np.sqrt(3.0), 0.0], [-0.5, -0.5 / np.sqrt(3.0), 0.0], [0.0, 1.0 / np.sqrt(3.0), 0.0]]
)


def prism(**changes):
    return cspr_jax.point_mass(PRISM, mass=1.0, name="prism", **changes)


def prism_positions(rng, count):
    """Positions within the prism below the spools."""
    weights = rng.dirichlet([1.0, 1.0, 1.0], count)
    return np.c_[(weights @ PRISM)[:, :2], rng.uniform(0.1, 1.0, count) * HEIGHT]


def off_prism(rng):
    """Spools and offsets off by a millimetre in each number."""
    return PRISM + ERROR * rng.choice([-1.0, 1.0], (3, 3)), ERROR * rng.choice([-1.0, 1.0], 3)


def prism_case(seed, noise, count=60):
    rng = np.random.default_rng(seed)
    (spools, offsets), positions = off_prism(rng), prism_positions(rng, count)
    readings = np.linalg.norm(positions[:, None] - spools, axis=2) - offsets
    readings, seen = readings + noise * rng.normal(size=readings.shape), positions + noise * rng.normal(size=(count, 3))
    return spools, offsets, readings, seen, positions
