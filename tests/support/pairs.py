"""Platforms on six cables in three parallel pairs: that of the text, and random ones."""

import numpy as np

import cspr_jax
from cspr_jax.robots.model.platform import PlatformRobot

R, SMALL = 0.35, 0.09
HIGH = np.sqrt(3.0)
# Machines 11 (2), 2023, 224, (30) and (31), z up.
LAUNCH_BASE = np.array(
    [
        [R - SMALL / 2, -HIGH * SMALL / 2, 0.0],
        [R + SMALL / 2, HIGH * SMALL / 2, 0.0],
        [SMALL - R / 2, HIGH * R / 2, 0.0],
        [-SMALL - R / 2, HIGH * R / 2, 0.0],
        [-(R + SMALL) / 2, HIGH * (SMALL - R) / 2, 0.0],
        [(SMALL - R) / 2, -HIGH * (SMALL + R) / 2, 0.0],
    ]
)
LAUNCH_PLATFORM = SMALL * np.array(
    [[-0.5, -HIGH / 2, 0.0], [0.5, HIGH / 2, 0.0], [1, 0, 0], [-1, 0, 0], [-0.5, HIGH / 2, 0.0], [0.5, -HIGH / 2, 0.0]]
)


def random_pairs(seed: int) -> dict:
    """A random robot: spools, platform points, mass centre, pairs, lambda of each, and the equivalent's spools; z down.

    Lines of any direction through the mass centre, divided by it anywhere; cables in any order.
    """
    rng = np.random.default_rng(seed)
    angles = np.array([0.0, 2.1, 4.2]) + rng.uniform(-0.5, 0.5, 3)
    exits = np.stack([np.cos(angles), np.sin(angles), rng.uniform(-0.3, 0.3, 3)], 1) + rng.normal(size=3)
    along = rng.normal(size=(3, 3))
    along *= rng.uniform(0.2, 0.6, (3, 1)) / np.linalg.norm(along, axis=1, keepdims=True)
    places = rng.uniform(0.1, 0.9, 3)
    parts = np.stack([-places, 1.0 - places], 1)
    centre = 0.3 * rng.normal(size=3)
    points = parts[:, :, None] * along[:, None]
    order = rng.permutation(6)
    base, platform = (x.reshape(6, 3)[order] for x in (exits[:, None] + points, centre + points))
    pairs = np.argsort(order).reshape(3, 2)
    return {"base": base, "platform": platform, "centre": centre, "pairs": pairs, "places": places, "exits": exits}


def made(given: dict, **more) -> PlatformRobot:
    """The platform of a random robot."""
    options = {"mass": 1.7, "inertia": 0.1 * np.eye(3), "centre_of_mass": given["centre"]} | more
    return cspr_jax.platform(given["base"], given["platform"], **options)
