"""Points at which cables leave swivelling pulleys, and lengths that are wrapped around these.

A cable reaches the pulley at its entry point A, along the swivel axis k, about which the pulley turns towards the
attachment point B. Pulley and cable lie in one plane: with e the unit vector normal to k on the side of B, the centre
is C = A + r e. Let v = B - C, s^2 = v.v - r^2, and K the rotation by a right angle that takes -e to k. With unit
vectors n, from C to the point at which the cable leaves, and t = K n along the cable, v = r n + s t. Hence
n = (r v - s K v) / v.v and t = (s v + r K v) / v.v; the only angle needed is the angle of the wrapped arc, from A on.
"""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.errors import InputError
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.linear.lanes import Vector, combined, dot
from cspr_jax.numerics.shapes import Float

LARGEST_RADIUS = 1e6  # m, the bound of coordinates


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class Pulleys:
    """Swivelling pulleys of a robot; the base points are their entry points.

    Fields:
        radius: (n_cables,) radius of the cable's centre line, 0 or more; m.
        axes: (n_cables, 3) unit vectors of the swivel axes, in the direction in which the cables enter.
    """

    radius: Array
    axes: Array


class Exit(NamedTuple):
    """A cable that leaves its pulley. Vectors are arrays (..., 3), or three arrays (...) as lanes.

    Fields:
        point: point at which the cable leaves the pulley, m.
        direction: unit vector from the point to the attachment point.
        wrapped: (...) length of the arc on the pulley, m.
        free: (...) length from the pulley to the attachment point, m; NaN where that point lies within the pulley.
    """

    point: Array | Vector
    direction: Array | Vector
    wrapped: Array
    free: Array


def pulleys_of(radius, axes, n_cables: int, z_axis: str) -> Pulleys:
    """Pulleys of a robot, from checked radii and axes."""
    radii = np.asarray(radius, float)
    if radii.shape not in ((), (n_cables,)) or not ((radii >= 0.0) & (radii <= LARGEST_RADIUS)).all():
        raise InputError("pulley_radius", radius, f"a number >= 0, in m, or {n_cables}: one a cable")
    up = [0.0, 0.0, 1.0 if z_axis == "up" else -1.0]
    directions = np.asarray(up if axes is None else axes, float)
    if directions.shape not in ((3,), (n_cables, 3)) or not np.isfinite(directions).all():
        raise InputError("pulley_axes", axes, f"a vector [x, y, z], or {n_cables}: one a cable")
    largest = np.abs(directions).max(-1, keepdims=True)
    if not (largest > 0.0).all():
        raise InputError("pulley_axes", directions.tolist(), "vectors that are not zero")
    directions = directions / largest
    units = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
    return Pulleys(as_float64(np.broadcast_to(radii, (n_cables,))), as_float64(np.broadcast_to(units, (n_cables, 3))))


def exits(
    entry: Float[Array, "... 3"],
    axis: Float[Array, "... 3"],
    radius: Float[Array, "..."],
    target: Float[Array, "... 3"],
) -> Exit:
    """Find where cables leave their pulleys."""
    ray = target - entry
    # Square roots at 0 have no derivative, which would spoil gradients even where their values are not selected.
    is_wheel = jnp.broadcast_to(radius > 0.0, ray.shape[:-1])
    high = jnp.sum(ray * axis, axis=-1)
    aside = ray - high[..., None] * axis
    square = jnp.sum(aside**2, axis=-1)
    is_beside = square > 0.0
    wide = jnp.where(is_beside, jnp.sqrt(jnp.where(is_beside, square, 1.0)), 0.0)
    side = aside / _nonzero(wide)[..., None]
    (a, b), (c, d), wrapped, free = _in_plane(radius, jnp.where(is_wheel, wide, 1.0), jnp.where(is_wheel, high, 1.0))
    point = entry + a[..., None] * side + b[..., None] * axis
    straight = jnp.sqrt(jnp.where(is_wheel, 1.0, jnp.sum(ray**2, axis=-1)))
    along = jnp.where(is_wheel[..., None], c[..., None] * side + d[..., None] * axis, ray / straight[..., None])
    return Exit(
        jnp.where(is_wheel[..., None], point, entry),
        along,
        jnp.where(is_wheel, wrapped, 0.0),
        jnp.where(is_wheel, free, straight),
    )


def exit_lanes(entry: Vector, axis: Vector, radius: Float[Array, "..."], target: Vector) -> Exit:
    """Find where cables leave their pulleys, one lane a case: the fast form of `exits`."""
    ray = tuple(target[i] - entry[i] for i in range(3))
    high = dot(ray, axis)
    aside = tuple(ray[i] - high * axis[i] for i in range(3))
    wide = jnp.sqrt(dot(aside, aside))
    side = tuple(x / _nonzero(wide) for x in aside)
    (a, b), (c, d), wrapped, free = _in_plane(radius, wide, high)
    offset = combined([(a, side), (b, axis)])
    point = tuple(entry[i] + offset[i] for i in range(3))
    return Exit(point, combined([(c, side), (d, axis)]), wrapped, free)


def _nonzero(width):
    # Avoid a division by zero for attachment points above or below the entry point, where the side does not matter.
    return jnp.where(width > 0.0, width, 1.0)


def _in_plane(radius, wide, high):
    # Point and direction, from A, in components along e and k; `wide` and `high` are the components of B.
    x, z = wide - radius, high
    square = x * x + z * z
    free = jnp.sqrt(square - radius * radius)
    # K v = (z, -x)
    normal = ((radius * x - free * z) / square, (radius * z + free * x) / square)
    along = ((free * x + radius * z) / square, (free * z - radius * x) / square)
    around = jnp.arctan2(z, -x)  # angle of B about C, from A on
    around = jnp.where(z < 0.0, around + 2.0 * jnp.pi, around)
    wrapped = radius * jnp.maximum(around - jnp.arctan2(free, radius), 0.0)
    return (radius + radius * normal[0], radius * normal[1]), along, wrapped, free
