"""Bounds of cables behind pulleys, over a block of time: direction, length, and what swivelling adds to accelerations.

Formulas are those of `robots.model.pulleys` and `robots.statics.cable_lengths`, in affine bounds. With phi the angle of
the wrapped arc and phi_c its value in the middle of the bounds, the sine of phi - phi_c is linear in the direction.
Since phi changes continuously, phi - phi_c stays within a right angle as long as this sine cannot reach 1.
"""

from typing import NamedTuple

import jax.numpy as jnp

from cspr_jax.numerics.bounds.affine_bounds import AffineBounds, constant, cross, dot, norm_squared, squared
from cspr_jax.numerics.bounds.function_bounds import arc_sine, reciprocal, reciprocal_root
from cspr_jax.numerics.tolerances import ROUNDING
from cspr_jax.robots.model.pulleys import Pulleys


class PulleyBounds(NamedTuple):
    """Bounds of cables behind pulleys.

    Fields:
        direction: (n_cables, 3) unit vectors of the free cables, towards the effector.
        exit: (n_cables, 3) points at which the cables leave, relative to the entry points, m.
        length: (n_cables,) lengths, including the arcs on the pulleys, m.
        inverse: (n_cables,) 1 over the free lengths, 1/m.
        swivel: (n_cables,) the term r (1 - t . k) (p . v)^2 / w of `robots.statics.cable_lengths`, m^2/s^2.
    """

    direction: AffineBounds
    exit: AffineBounds
    length: AffineBounds
    inverse: AffineBounds
    swivel: AffineBounds


def pulley_bounds(pulleys: Pulleys, ray: AffineBounds, velocity: AffineBounds) -> PulleyBounds:
    """Bounds of cables behind pulleys."""
    axes, radius = jnp.asarray(pulleys.axes), jnp.asarray(pulleys.radius)
    high = dot(ray, axes)
    across = cross(constant(axes), ray)
    wide_square = norm_squared(across)
    narrow = reciprocal_root(wide_square)
    # Coordinates of the attachment point from the centre of the pulley, along e and k.
    x, z = wide_square * narrow - radius, high
    square = squared(x) + squared(z)
    free_square = square - radius**2
    inverse = reciprocal_root(free_square)
    free, turn = free_square * inverse, reciprocal(square)
    sine, cosine = (free * x + z * radius) * turn, (free * z - x * radius) * turn
    side = (ray - _wide(high) * axes) * _wide(narrow)
    direction = side * _wide(sine) + _wide(cosine) * axes
    # A + r e + r n, with n = -(t . k) e + (t . e) k.
    exits = side * _wide((1.0 - cosine) * radius) + _wide(sine * radius) * axes
    # Speed normal to the plane of the pulley; `across` is as long as the distance from the swivel axis.
    speed = dot(across, velocity) * narrow
    swivel = (1.0 - cosine) * squared(speed) * narrow * radius
    return PulleyBounds(direction, exits, _wrapped(radius, x, z, sine, cosine) + free, inverse, swivel)


def _wide(bounds: AffineBounds) -> AffineBounds:
    return bounds.each(lambda x: x[:, None])


def _wrapped(radius, x: AffineBounds, z: AffineBounds, sine: AffineBounds, cosine: AffineBounds) -> AffineBounds:
    # Bound the length on pulleys by the angle between the direction and that in the middle; see `pulleys.exits`.
    around = jnp.arctan2(z.middle, -x.middle)
    around = jnp.where(z.middle < 0.0, around + 2.0 * jnp.pi, around)
    free = jnp.sqrt(jnp.maximum(x.middle**2 + z.middle**2 - radius**2, 0.0))
    middle = around - jnp.arctan2(free, radius)
    # Sine and cosine of the angle in the middle, with their rounding errors.
    parts = [AffineBounds(f, jnp.zeros_like(f), jnp.full_like(f, ROUNDING)) for f in (jnp.sin(middle), jnp.cos(middle))]
    return (arc_sine(sine * parts[1] - cosine * parts[0]) + middle) * radius
