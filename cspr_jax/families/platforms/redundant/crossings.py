"""Motions whose cables cross between samples: steps are halved until cables turn little within each step."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.contacts.interference import cables_cross, platform_hit

HALVINGS = 12
# A step is halved if the cosine of the angle by which a cable, or a vector between cables, turns is below this.
MIN_COSINE = 0.8

CableVectors = tuple[np.ndarray, np.ndarray]  # between cables (k, n_pairs, 3), along cables (k, n_cables, 3)


def crossings(
    cable_vectors: Callable[[np.ndarray, np.ndarray], CableVectors],
    platform: tuple[Float[np.ndarray, "n_cables 2 3"], Float[np.ndarray, "3"]] | None,
    motion: Float[np.ndarray, "k"],
    ends: tuple[Float[np.ndarray, "k"], Float[np.ndarray, "k"]],
    count: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Tell in which motions cables cross within a step, and in which a cable crosses the platform."""
    met, hit = (np.zeros(count, bool) for _ in range(2))
    if not len(motion):
        return met, hit
    vectors = tuple(cable_vectors(motion, tau) for tau in ends)
    for level in range(HALVINGS + 1):
        (gap, direction), (next_gap, next_direction) = vectors
        is_open = _turns_much(gap, next_gap) | _turns_much(direction, next_direction)
        is_closed = ~is_open if level < HALVINGS else np.ones(len(motion), bool)
        met[motion[is_closed & cables_cross(gap, next_gap).any(1)]] = True
        if platform is not None:
            hit[motion[is_closed & platform_hit(*platform, direction, next_direction).any(1)]] = True
        motion, before, after = motion[~is_closed], ends[0][~is_closed], ends[1][~is_closed]
        if not len(motion):
            break
        middle = 0.5 * (before + after)
        between = cable_vectors(motion, middle)
        first, last = ((gap[~is_closed], direction[~is_closed]) for gap, direction in vectors)
        vectors = _joined(first, between), _joined(between, last)
        ends = np.concatenate([before, middle]), np.concatenate([middle, after])
        motion = np.concatenate([motion, motion])
    return met, hit


def _joined(first: CableVectors, second: CableVectors) -> CableVectors:
    return np.concatenate([first[0], second[0]]), np.concatenate([first[1], second[1]])


def _turns_much(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    inner = (before * after).sum(2)
    squares = (before * before).sum(2) * (after * after).sum(2)
    return ((inner < 0.0) | (inner**2 < MIN_COSINE**2 * squares)).any(1)
