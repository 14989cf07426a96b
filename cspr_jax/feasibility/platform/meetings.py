"""Proofs that cables meet each other, or lie on the platform, at some instant between two others.

Two cables from a and b along u and v lie in one plane where F = (b - a) . (u x v) vanishes. If F changes its sign
between two instants, and the lines' nearest points stay inside both cables all the while, the cables meet in between.
A cable is on the platform where its height over the platform's plane vanishes while it points into its corner's sector.
What stays so is bounded from the middle of the step, by how far points can move.
"""

from typing import NamedTuple

import numpy as np

# Part of the sizes of the factors by which rounding may move F or a height.
ROUNDING = 1e-13


class Step(NamedTuple):
    """Cables at the beginning, in the middle and at the end of n steps, the first axis.

    Fields:
        rays: (3, n, n_cables, 3) from spool to platform, m.
        seen: (3, n, n_cables, 3) from platform to spool in platform axes, m.
        moved: (n, n_cables) bound of how far the ends of the cables move from the middle on, m.
        turned: (n, n_cables) likewise of the cables as the platform sees them, m.
    """

    rays: np.ndarray
    seen: np.ndarray
    moved: np.ndarray
    turned: np.ndarray


def cables_meet(base: np.ndarray, pairs: np.ndarray, step: Step) -> np.ndarray:
    """Steps in which two cables meet for certain.

    Args:
        base: (n_cables, 3) spools, m.
        pairs: (n_pairs, 2) of cables that can meet.
        step: n steps.

    Returns:
        (n,).
    """
    if not len(pairs):
        return np.zeros(step.rays.shape[1], bool)
    i, j = pairs.T
    apart = (base[j] - base[i])[None]
    u, v = step.rays[:, :, i], step.rays[:, :, j]
    volume = (apart[None] * np.cross(u, v)).sum(-1)
    sizes = np.linalg.norm(apart, axis=-1) * np.linalg.norm(u, axis=-1).max(0) * np.linalg.norm(v, axis=-1).max(0)
    changes = (volume[0] * volume[2] < 0.0) & (np.abs(volume[[0, 2]]) > ROUNDING * sizes).all(0)
    # At the middle, and by how much these vectors may differ in the step.
    u, v, off_u, off_v = u[1], v[1], step.moved[:, i], step.moved[:, j]
    across, size = np.cross(u, v), np.linalg.norm
    off = size(u, axis=-1) * off_v + size(v, axis=-1) * off_u + off_u * off_v
    square = size(across, axis=-1) ** 2
    spread = 2.0 * size(across, axis=-1) * off + off**2
    inside = changes & (spread < square)
    for other, moved in ((v, off_v), (u, off_u)):
        weight = np.cross(np.broadcast_to(apart, other.shape), other)
        off_weight = size(apart, axis=-1) * moved
        top = (weight * across).sum(-1)
        slack = size(weight, axis=-1) * off + off_weight * size(across, axis=-1) + off_weight * off
        # The share of the cable at which the lines are nearest, between 0 and 1.
        inside &= (top - slack > 0.0) & (top + slack < square - spread)
    return inside.any(1)


def cables_hit(sides: np.ndarray, normal: np.ndarray, step: Step) -> np.ndarray:
    """Steps in which a cable lies on the platform for certain.

    Args:
        sides: (n_cables, 2, 3) of `interference.contacts`.
        normal: (3,) of it.
        step: n steps.

    Returns:
        (n,).
    """
    height = step.seen @ normal
    sizes = np.linalg.norm(step.seen, axis=-1).max(0)
    hits = (height[0] * height[2] < 0.0) & (np.abs(height[[0, 2]]) > ROUNDING * sizes).all(0)
    one, two = sides[:, 0], sides[:, 1]
    across = np.cross(one, two) @ normal
    for first, second in ((step.seen[1], two), (one, step.seen[1])):
        side = np.linalg.norm(two if second is two else one, axis=-1)
        # A coordinate along one side times the area that the sides span: it changes by no more than the other's length.
        share = (np.cross(first, second) @ normal) * np.sign(across)
        hits &= share > side * step.turned
    return hits.any(1)
