"""Proofs that cables touch each other, or the platform, within a step between two times.

Two cables from a and b along u and v lie in one plane if F = (b - a) . (u x v) vanishes. If F changes sign in a step
while the nearest points of the lines stay inside both cables, the cables touch within the step. A cable touches the
platform if its height over the platform's plane vanishes while it points into the sector of its corner.

A vector r with |r''| <= C stays within |r1 - r0| / 2 + C h^2 / 8 of the mean of its values at both ends of a step of
length h; so what holds for all vectors within this distance holds during the step. Steps without a change of sign are
skipped.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cspr_jax.numerics.shapes import Float, Int

# Rounding may change F, or a height, by this fraction of the product of the norms of its factors.
PRODUCT_ERROR = 1e-13


class CablesOfStep(NamedTuple):
    """Cables at times of n blocks, with equal steps between them.

    Fields:
        rays: (m, n, n_cables, 3) from spool to platform, m.
        platform_rays: (m, n, n_cables, 3) from platform to spool in the axes of the platform, m.
        deviation: (n, n_cables) bound C h^2 / 8 for `rays`, m.
        platform_deviation: (n,) bound C h^2 / 8 for `platform_rays`, m.
    """

    rays: np.ndarray
    platform_rays: np.ndarray
    deviation: np.ndarray
    platform_deviation: np.ndarray


class _Balls(NamedTuple):
    # Balls that contain vectors.
    center: np.ndarray  # (k, 3)
    radius: np.ndarray  # (k,)

    def cross(self, other: "_Balls") -> "_Balls":
        return _Balls(np.cross(self.center, other.center), self._product_radius(other))

    def dot(self, other: "_Balls") -> tuple[np.ndarray, np.ndarray]:
        # Return the smallest and the largest product.
        product, radius = (self.center * other.center).sum(-1), self._product_radius(other)
        return product - radius, product + radius

    def _product_radius(self, other: "_Balls") -> np.ndarray:
        return _norm(self.center) * other.radius + _norm(other.center) * self.radius + self.radius * other.radius


def cables_meet(
    base: Float[np.ndarray, "n_cables 3"], pairs: Float[np.ndarray, "n_pairs 2"], cables: CablesOfStep
) -> Int[np.ndarray, "n"]:
    """Steps in which two cables certainly touch."""
    meets = np.full(cables.rays.shape[1], -1)
    i, j = pairs.T
    spools = base[j] - base[i]
    u, v = cables.rays[:, :, i], cables.rays[:, :, j]
    volume = (np.cross(spools, u) * v).sum(-1)
    step, block, pair = _sign_changes(volume, _norm(spools) * (_norm(u) * _norm(v)).max(0))
    first = _within(cables.rays, (step, block, i[pair]), cables.deviation)
    second = _within(cables.rays, (step, block, j[pair]), cables.deviation)
    between = _Balls(spools[pair], np.zeros(len(pair)))
    normal = first.cross(second)
    minimum = normal.dot(normal)[0]
    inside = minimum > 0.0
    for other in (second, first):
        # Bound the fraction of a cable at which the lines are nearest, times the squared norm of the normal.
        low, high = between.cross(other).dot(normal)
        inside &= (low > 0.0) & (high < minimum)
    meets[block[inside]] = step[inside]
    return meets


def cables_hit(
    sides: Float[np.ndarray, "n_cables 2 3"], normal: Float[np.ndarray, "3"], cables: CablesOfStep
) -> Int[np.ndarray, "n"]:
    """Steps in which a cable certainly touches the platform."""
    hits = np.full(cables.platform_rays.shape[1], -1)
    step, block, cable = _sign_changes(cables.platform_rays @ normal, _norm(cables.platform_rays).max(0))
    deviation = np.broadcast_to(cables.platform_deviation[:, None], cables.platform_rays.shape[1:3])
    rays = _within(cables.platform_rays, (step, block, cable), deviation)
    one, two = sides[cable, 0], sides[cable, 1]
    # If a vector moves, the area between it and a side changes by at most the side's length times the displacement.
    inside = np.cross(two, rays.center) @ normal > _norm(two) * rays.radius
    inside &= np.cross(rays.center, one) @ normal > _norm(one) * rays.radius
    inside |= (sides[cable] == 0.0).all((1, 2))  # the sector is all of the plane
    hits[block[inside]] = step[inside]
    return hits


def _sign_changes(values: np.ndarray, magnitudes: np.ndarray) -> tuple[np.ndarray, ...]:
    # Return the steps, blocks and pairs (or cables) in which values (m, n, ...) change sign beyond rounding.
    is_high, is_low = values > PRODUCT_ERROR * magnitudes, values < -PRODUCT_ERROR * magnitudes
    return np.nonzero((is_high[:-1] & is_low[1:]) | (is_low[:-1] & is_high[1:]))


def _within(vectors: np.ndarray, indices: tuple[np.ndarray, ...], deviation: np.ndarray) -> _Balls:
    # Enclose vectors during the steps that start at given times.
    step, block, cable = indices
    before, after = vectors[step, block, cable], vectors[step + 1, block, cable]
    return _Balls(0.5 * (before + after), 0.5 * _norm(after - before) + deviation[block, cable])


def _norm(vectors: np.ndarray) -> np.ndarray:
    return np.sqrt((vectors * vectors).sum(-1))
