"""Bounds of determinants over a block, by elimination in affine bounds with the largest pivots of the middle."""

from __future__ import annotations

from typing import TYPE_CHECKING

import jax.numpy as jnp
from jax import Array

from cspr_jax.numerics.bounds.affine_bounds import AffineBounds
from cspr_jax.numerics.bounds.function_bounds import reciprocal

if TYPE_CHECKING:
    from jaxtyping import Float


def determinant(matrix: AffineBounds) -> AffineBounds:
    """Bounds of the determinant of a small matrix."""
    rest, product = matrix, matrix.each(lambda x: jnp.ones((), x.dtype))
    product = product._replace(linear=jnp.zeros_like(product.linear), radius=jnp.zeros_like(product.radius))
    while len(rest.middle) > 1:
        count = len(rest.middle)
        place = jnp.argmax(jnp.abs(rest.middle))
        rows, columns = _swapped(count, place // count), _swapped(count, place % count)
        rest = rest.each(lambda x, rows=rows, columns=columns: x[rows][:, columns])
        # A swap of two rows, or of two columns, changes the sign.
        is_odd = (place // count > 0) != (place % count > 0)
        pivot = rest.each(lambda x: x[0, 0])
        sign = jnp.where(pivot.middle < 0.0, -1.0, 1.0)
        product = product * pivot * jnp.where(is_odd, -1.0, 1.0)
        shares = rest.each(lambda x: x[1:, 0]) * (reciprocal(pivot * sign) * sign).each(lambda x: x[None])
        across = shares.each(lambda x: x[:, None]) * rest.each(lambda x: x[0, 1:][None])
        rest = rest.each(lambda x: x[1:, 1:]) - across
    return product * rest.each(lambda x: x[0, 0])


def _swapped(count: int, place: Array) -> Array:
    # Indices that swap the first element with another one.
    index = jnp.arange(count)
    return jnp.where(index == place, 0, jnp.where(index == 0, place, index))


def magnitude_range(number: AffineBounds) -> tuple[Float[Array, "..."], Float[Array, "..."]]:
    """Bounds of the absolute value."""
    low, high = number.low(), number.high()
    minimum = jnp.where(low > 0.0, low, jnp.where(high < 0.0, -high, 0.0))
    maximum = number.magnitude()
    return minimum, jnp.where(jnp.isnan(maximum), jnp.inf, maximum)


def changes_sign(number: AffineBounds) -> Float[Array, "..."]:
    """Tell whether a number is proved to have opposite signs at both ends of the block."""
    return jnp.abs(number.middle) < jnp.abs(number.linear) - number.radius
