"""Cables that meet each other or the platform, thesis section 3.10.2: vectors at one instant, tests between two."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.robots.platform import PlatformRobot, pairs_apart, rays

# Points nearer than this part of the platform's size are one corner.
SAME = 1e-9
PARALLEL = 1e-14
# Squares of lengths from here on; a segment may be a point.
TINY = 1e-200


class Contacts(NamedTuple):
    """Cables and sectors of the platform that can meet.

    Fields:
        pairs: (n_pairs, 2) indices of cables.
        sides: (n_cables, 2, 3) vectors along the edges of the sector of each platform point, platform axes, m. The
            sector extends from the second side to the first, counterclockwise about the normal; for a point on an edge
            it is half of the plane. Both sides are zero where it is the whole plane, around a point inside.
        normal: (3,) normal of the platform, platform axes.
    """

    pairs: np.ndarray
    sides: np.ndarray
    normal: np.ndarray


def contacts(robot: PlatformRobot) -> Contacts:
    """Contacts possible on a robot: pairs of cables without a common point, and sectors of the platform.

    The platform is the convex hull of its points, seen along its normal.

    Returns:
        the contacts.
    """
    points = np.asarray(robot.platform_points)
    centred = points - points.mean(0)
    first, second, _ = np.linalg.svd(centred)[2]
    flat = np.stack([centred @ first, centred @ second], axis=1)
    sides = np.array([_sector(points, flat, i) for i in range(len(points))])
    return Contacts(np.array(pairs_apart(robot), int).reshape(-1, 2), sides, np.cross(first, second))


def _sector(points: np.ndarray, flat: np.ndarray, corner: int) -> np.ndarray:
    # Return the sides of the sector of a point, (2, 3); cables that share a point share its sector.
    away = flat - flat[corner]
    others = np.flatnonzero(np.linalg.norm(away, axis=1) > SAME * np.linalg.norm(flat, axis=1).max())
    angles = np.arctan2(away[others, 1], away[others, 0])
    order = np.argsort(angles)
    # The widest angle without other points lies outside of the hull.
    free = np.diff(angles[order], append=angles[order[0]] + 2.0 * np.pi)
    widest = int(free.argmax())
    if free[widest] < np.pi - SAME:
        return np.zeros((2, 3))
    ends = others[order[widest]], others[order[(widest + 1) % len(order)]]
    return np.stack([points[end] - points[corner] for end in ends])


def gaps(robot: PlatformRobot, pairs: Array, position: Array, rotation: Array) -> Array:
    """The shortest vectors between cables.

    Args:
        pairs: (n_pairs, 2) indices of cables.
        position: (3,) m.
        rotation: (3, 3).

    Returns:
        (n_pairs, 3) from the first cable of each pair to the second, m.
    """
    cables, _ = rays(robot, position, rotation)
    i, j = pairs[:, 0], pairs[:, 1]
    return between(robot.base_points[i], cables[i], robot.base_points[j], cables[j])


def between(a: Array, u: Array, b: Array, v: Array) -> Array:
    """The shortest vectors between segments a + s u and b + t v, s and t in [0, 1].

    Args:
        a: (..., 3) starts of the first segments, m.
        u: (..., 3) from start to end of the first, m.
        b: (..., 3) starts of the second segments, m.
        v: (..., 3) from start to end of the second, m.

    Returns:
        (..., 3) from the first to the second, m.
    """
    s, t = nearest(a, u, b, v)
    return b - a + t[..., None] * v - s[..., None] * u


@jax.jit
def nearest(a: Array, u: Array, b: Array, v: Array) -> tuple[Array, Array]:
    """Find where segments a + s u and b + t v are nearest to each other.

    Args:
        a: (..., 3) starts of the first segments, m.
        u: (..., 3) from start to end of the first, m.
        b: (..., 3) starts of the second segments, m.
        v: (..., 3) from start to end of the second, m.

    Returns:
        s and t, (...) each, in [0, 1].
    """
    # Find the nearest points of the lines, then clip them to the segments.
    apart = b - a
    uu, uv, vv = (jnp.sum(x * y, axis=-1) for x, y in ((u, u), (u, v), (v, v)))
    au, av = jnp.sum(apart * u, axis=-1), jnp.sum(apart * v, axis=-1)
    denominator = uu * vv - uv**2
    is_parallel = denominator <= PARALLEL * uu * vv
    s = jnp.clip(jnp.where(is_parallel, 0.0, (au * vv - av * uv) / jnp.where(is_parallel, 1.0, denominator)), 0.0, 1.0)
    t = jnp.clip((s * uv - av) / jnp.maximum(vv, TINY), 0.0, 1.0)
    return jnp.clip((au + t * uv) / jnp.maximum(uu, TINY), 0.0, 1.0), t


def cable_directions(robot: PlatformRobot, position: Array, rotation: Array) -> Array:
    """The cables as unit vectors from the platform to the spools, in the platform's axes.

    Args:
        position: (3,) m.
        rotation: (3, 3).

    Returns:
        (n_cables, 3) platform axes.
    """
    cables, _ = rays(robot, position, rotation)
    return -(cables / jnp.linalg.norm(cables, axis=1, keepdims=True)) @ rotation


def cables_cross(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Pairs of cables that passed through each other between two instants, (3.94).

    Args:
        before: (..., n_pairs, 3) of `gaps`.
        after: (..., n_pairs, 3) likewise.

    Returns:
        mask (..., n_pairs).
    """
    return np.einsum("...k,...k->...", before, after) <= 0.0


def platform_hit(sides: np.ndarray, normal: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Cables that passed over the platform between two instants, as in the thesis, in platform axes.

    Args:
        sides: (n_cables, 2, 3) of `contacts`.
        normal: (3,) of `contacts`.
        before: (..., n_cables, 3) of `cable_directions`.
        after: (..., n_cables, 3) likewise.

    Returns:
        mask (..., n_cables).
    """
    high, low = before @ normal, after @ normal
    through = high * low <= 0.0
    # Find the direction within the platform's plane, a combination of both directions with positive weights.
    weight = np.abs(low)[..., None] * before + np.abs(high)[..., None] * after
    first, second = (np.einsum("...jk,jk->...j", weight, np.cross(normal, sides[:, k])) for k in (1, 0))
    return through & (first >= 0.0) & (second <= 0.0)
