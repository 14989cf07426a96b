"""Functions of affine bounds: reciprocals, roots, sines, angles of sines, determinants."""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp
from jax import Array

from cspr_jax.numerics import elementary
from cspr_jax.numerics.bounds.affine_bounds import AffineBounds, flat, rounded
from cspr_jax.numerics.shapes import Bool, Float

LARGEST_SINE = 0.9


@jax.jit
def reciprocal(f: AffineBounds) -> AffineBounds:
    """Bounds of 1 / f, of a positive function."""
    value = 1.0 / f.middle
    if f.square is not None:
        return _parabola_deviation(f, (value, -(value**2), 2.0 * value**3), 6.0 / _positive(f) ** 4)
    return deviation(f, value, -(value**2), 2.0 / _positive(f) ** 3)


@jax.jit
def root(f: AffineBounds) -> AffineBounds:
    """Bounds of the square root of a positive function."""
    f = flat(f)
    value = jnp.sqrt(f.middle)
    return deviation(f, value, 0.5 / value, -0.25 * _positive(f) ** -1.5)


@jax.jit
def reciprocal_root(f: AffineBounds) -> AffineBounds:
    """Bounds of 1 over the square root of a positive function."""
    value = 1.0 / jnp.sqrt(f.middle)
    if f.square is not None:
        return _parabola_deviation(f, (value, -0.5 * value**3, 0.75 * value**5), 1.875 * _positive(f) ** -3.5)
    return deviation(f, value, -0.5 * value**3, 0.75 * _positive(f) ** -2.5)


@jax.jit
def arc_sine(f: AffineBounds) -> AffineBounds:
    """Bounds of the angle of a sine, between -pi/2 and pi/2."""
    f = flat(f)
    magnitude = jnp.where(f.magnitude() < LARGEST_SINE, f.magnitude(), jnp.nan)
    # The second derivative, x (1 - x^2)^-1.5, has the sign of x and grows with |x|.
    second_derivative = 0.5 * magnitude * f.half_range() ** 2 * (1.0 - magnitude**2) ** -1.5
    value, derivative = jnp.arcsin(f.middle), (1.0 - f.middle**2) ** -0.5
    return rounded(AffineBounds(value, derivative * f.linear, derivative * f.radius + second_derivative))


def _positive(f: AffineBounds) -> Array:
    low = f.low()
    return jnp.where(low > 0.0, low, jnp.nan)


def deviation(
    f: AffineBounds, value: Float[Array, "..."], first: Float[Array, "..."], second: Float[Array, "..."]
) -> AffineBounds:
    """Bounds of F(f), from values of F and F' in the middle and a bound of F'', which must not change its sign."""
    # By Taylor's theorem about the middle, the remainder is between 0 and F'' half_range^2 / 2.
    half = 0.25 * second * f.half_range() ** 2
    return rounded(AffineBounds(value + half, first * f.linear, jnp.abs(first) * f.radius + jnp.abs(half)), value)


def _parabola_deviation(f: AffineBounds, values: tuple[Array, Array, Array], third: Array) -> AffineBounds:
    # Bounds of F(f), from F and its first two derivatives in the middle and a bound of the third over the block.
    value, derivative, second_derivative = values
    off, squared = jnp.abs(f.square) + f.radius, 0.5 * second_derivative * f.linear**2
    radius = jnp.abs(derivative) * f.radius + 0.5 * jnp.abs(second_derivative) * (2.0 * jnp.abs(f.linear) + off) * off
    parabola = AffineBounds(
        value, derivative * f.linear, radius + third / 6.0 * f.half_range() ** 3, derivative * f.square + squared
    )
    return rounded(parabola, jnp.abs(value) + jnp.abs(derivative * f.square) + jnp.abs(squared))


@jax.jit
def sincospi(f: AffineBounds) -> tuple[AffineBounds, AffineBounds]:
    """Bounds of sin(pi f) and cos(pi f)."""
    f = flat(f)
    sine, cosine = elementary.sincospi(f.middle)
    # At a distance d from the middle m, sin(m + d) = sin m cos d + cos m sin d; cos d is from 1 - d^2 / 2 to 1, and
    # sin d within |d|^3 / 6 of d.
    half_range, half = math.pi * f.half_range(), (0.5 * math.pi * f.half_range()) ** 2

    def one(value: Array, derivative: Array) -> AffineBounds:
        radius = jnp.abs(value) * half + jnp.abs(derivative) * (math.pi * f.radius + half_range**3 / 6.0)
        return rounded(AffineBounds(value * (1.0 - half), math.pi * derivative * f.linear, radius), 1.0 + half_range)

    return one(sine, cosine), one(cosine, -sine)


def determinant(matrix: AffineBounds) -> AffineBounds:
    """Bounds of the determinant of a small matrix, by elimination; pivots are the largest entries in the middle."""
    rest, product = matrix, matrix.each(lambda x: jnp.ones((), x.dtype))
    product = product._replace(linear=jnp.zeros_like(product.linear), radius=jnp.zeros_like(product.radius))
    while len(rest.middle) > 1:
        count = len(rest.middle)
        index = jnp.argmax(jnp.abs(rest.middle))
        rows, columns = _swapped(count, index // count), _swapped(count, index % count)
        rest = rest.each(lambda x, rows=rows, columns=columns: x[rows][:, columns])
        # A swap of two rows, or of two columns, changes the sign.
        is_odd = (index // count > 0) != (index % count > 0)
        pivot = rest.each(lambda x: x[0, 0])
        sign = jnp.where(pivot.middle < 0.0, -1.0, 1.0)
        product = product * pivot * jnp.where(is_odd, -1.0, 1.0)
        factors = rest.each(lambda x: x[1:, 0]) * (reciprocal(pivot * sign) * sign).each(lambda x: x[None])
        across = factors.each(lambda x: x[:, None]) * rest.each(lambda x: x[0, 1:][None])
        rest = rest.each(lambda x: x[1:, 1:]) - across
    return product * rest.each(lambda x: x[0, 0])


def _swapped(count: int, other: Array) -> Array:
    # Indices that swap the first element with another one.
    index = jnp.arange(count)
    return jnp.where(index == other, 0, jnp.where(index == 0, other, index))


def magnitude_range(number: AffineBounds) -> tuple[Float[Array, "..."], Float[Array, "..."]]:
    """Bounds of the absolute value."""
    low, high = number.low(), number.high()
    minimum = jnp.where(low > 0.0, low, jnp.where(high < 0.0, -high, 0.0))
    maximum = number.magnitude()
    return minimum, jnp.where(jnp.isnan(maximum), jnp.inf, maximum)


def changes_sign(number: AffineBounds) -> Bool[Array, "..."]:
    """Tell whether a number is proved to have opposite signs at both ends of the block."""
    return jnp.abs(number.middle) < jnp.abs(number.linear) - number.radius
