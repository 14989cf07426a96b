"""Cables that meet each other or the platform, thesis section 3.10.2: vectors in a state, tests between two states."""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.numerics.shapes import Bool, Float, Int
from cspr_jax.robots.model.platform import PlatformRobot, rays, separate_pairs

# Points closer together than this fraction of the platform's extent are one corner.
SAME = 1e-9
PARALLEL = 1e-14
# Smallest divisor in place of squared lengths, which are 0 where a segment is a point.
TINY = 1e-200


class Contacts(NamedTuple):
    """Cables and sectors of the platform that can meet.

    Fields:
        pairs: (n_pairs, 2) indices of cables.
        sides: (n_cables, 2, 3) vectors along the sides of the sector of each platform point, platform axes, m. The
            sector extends from the second side to the first, counterclockwise about the normal; for a point on an edge
            it is half of the plane. For a point inside it is the full plane, and both vectors are zero.
        normal: (3,) normal of the platform, platform axes.
    """

    pairs: np.ndarray
    sides: np.ndarray
    normal: np.ndarray


def contacts(robot: PlatformRobot) -> Contacts:
    """Possible contacts of a robot: pairs of cables without a common point, and sectors of the platform.

    The platform is the convex hull of its points, seen along its normal.
    """
    points = np.asarray(robot.platform_points)
    centred = points - points.mean(0)
    first, second, _ = np.linalg.svd(centred)[2]
    flat = np.stack([centred @ first, centred @ second], axis=1)
    sides = np.array([_sector(points, flat, i) for i in range(len(points))])
    return Contacts(np.array(separate_pairs(robot), int).reshape(-1, 2), sides, np.cross(first, second))


def _sector(points: np.ndarray, flat: np.ndarray, corner: int) -> np.ndarray:
    # Sides of the sector of a point, (2, 3); cables that share a point share the sector.
    away = flat - flat[corner]
    others = np.flatnonzero(np.linalg.norm(away, axis=1) > SAME * np.linalg.norm(flat, axis=1).max())
    angles = np.arctan2(away[others, 1], away[others, 0])
    order = np.argsort(angles)
    # The largest angle between neighbouring directions to other points is outside of the hull.
    free = np.diff(angles[order], append=angles[order[0]] + 2.0 * np.pi)
    widest = int(free.argmax())
    if free[widest] < np.pi - SAME:
        return np.zeros((2, 3))
    ends = others[order[widest]], others[order[(widest + 1) % len(order)]]
    return np.stack([points[end] - points[corner] for end in ends])


def gaps(
    robot: PlatformRobot, pairs: Int[Array, "n_pairs 2"], position: Float[Array, "3"], rotation: Float[Array, "3 3"]
) -> Float[Array, "n_pairs 3"]:
    """The shortest vectors between cables."""
    cables, _ = rays(robot, position, rotation)
    i, j = pairs[:, 0], pairs[:, 1]
    return between(robot.base_points[i], cables[i], robot.base_points[j], cables[j])


def between(
    a: Float[Array, "... 3"], u: Float[Array, "... 3"], b: Float[Array, "... 3"], v: Float[Array, "... 3"]
) -> Float[Array, "... 3"]:
    """The shortest vectors between segments a + s u and b + t v, s and t in [0, 1]."""
    s, t = nearest(a, u, b, v)
    return b - a + t[..., None] * v - s[..., None] * u


@jax.jit
def nearest(
    a: Float[Array, "... 3"], u: Float[Array, "... 3"], b: Float[Array, "... 3"], v: Float[Array, "... 3"]
) -> tuple[Float[Array, "..."], Float[Array, "..."]]:
    """Parameters s and t at which segments a + s u and b + t v are nearest to each other."""
    # Find the nearest points of the lines, then clip them to the segments.
    offset = b - a
    uu, uv, vv = (jnp.sum(x * y, axis=-1) for x, y in ((u, u), (u, v), (v, v)))
    au, av = jnp.sum(offset * u, axis=-1), jnp.sum(offset * v, axis=-1)
    denominator = uu * vv - uv**2
    is_parallel = denominator <= PARALLEL * uu * vv
    s = jnp.clip(jnp.where(is_parallel, 0.0, (au * vv - av * uv) / jnp.where(is_parallel, 1.0, denominator)), 0.0, 1.0)
    t = jnp.clip((s * uv - av) / jnp.maximum(vv, TINY), 0.0, 1.0)
    return jnp.clip((au + t * uv) / jnp.maximum(uu, TINY), 0.0, 1.0), t


def cable_directions(
    robot: PlatformRobot, position: Float[Array, "3"], rotation: Float[Array, "3 3"]
) -> Float[Array, "n_cables 3"]:
    """The cables as unit vectors from the platform to the spools, in the platform's axes."""
    cables, _ = rays(robot, position, rotation)
    return -(cables / jnp.linalg.norm(cables, axis=1, keepdims=True)) @ rotation


def cables_cross(
    before: Float[np.ndarray, "... n_pairs 3"], after: Float[np.ndarray, "... n_pairs 3"]
) -> Bool[np.ndarray, "... n_pairs"]:
    """Pairs of cables that passed through each other between two times, (3.94)."""
    return np.einsum("...k,...k->...", before, after) <= 0.0


def platform_hit(
    sides: Float[np.ndarray, "n_cables 2 3"],
    normal: Float[np.ndarray, "3"],
    before: Float[np.ndarray, "... n_cables 3"],
    after: Float[np.ndarray, "... n_cables 3"],
) -> Bool[np.ndarray, "... n_cables"]:
    """Cables that passed over the platform between two times, by the criterion of the thesis, in platform axes."""
    high, low = before @ normal, after @ normal
    through = high * low <= 0.0
    # Find the combination of both directions, with positive weights, that lies in the platform's plane.
    weight = np.abs(low)[..., None] * before + np.abs(high)[..., None] * after
    first, second = (np.einsum("...jk,jk->...j", weight, np.cross(normal, sides[:, k])) for k in (1, 0))
    return through & (first >= 0.0) & (second <= 0.0)
