"""Functions of bounded functions: reciprocals, roots, sines and angles of sines, as `numerics.bounds.affine_bounds`."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import jax
import jax.numpy as jnp
from jax import Array

from cspr_jax.numerics import elementary
from cspr_jax.numerics.bounds.affine_bounds import AffineBounds, flat, rounded

if TYPE_CHECKING:
    from jaxtyping import Float

LARGEST_SINE = 0.9


@jax.jit
def reciprocal(f: AffineBounds) -> AffineBounds:
    """Bounds of 1 / f, of a positive function."""
    value = 1.0 / f.middle
    if f.square is not None:
        return _bent_parabola(f, (value, -(value**2), 2.0 * value**3), 6.0 / _positive(f) ** 4)
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
        return _bent_parabola(f, (value, -0.5 * value**3, 0.75 * value**5), 1.875 * _positive(f) ** -3.5)
    return deviation(f, value, -0.5 * value**3, 0.75 * _positive(f) ** -2.5)


@jax.jit
def arc_sine(f: AffineBounds) -> AffineBounds:
    """Bounds of the angle of a sine, between -pi/2 and pi/2."""
    f = flat(f)
    size = jnp.where(f.magnitude() < LARGEST_SINE, f.magnitude(), jnp.nan)
    # The second derivative, x (1 - x^2)^-1.5, changes its sign with x, and is largest where |x| is.
    second_derivative = 0.5 * size * f.half_range() ** 2 * (1.0 - size**2) ** -1.5
    value, slope = jnp.arcsin(f.middle), (1.0 - f.middle**2) ** -0.5
    return rounded(AffineBounds(value, slope * f.linear, slope * f.radius + second_derivative))


def _positive(f: AffineBounds) -> Array:
    low = f.low()
    return jnp.where(low > 0.0, low, jnp.nan)


def deviation(
    f: AffineBounds, value: Float[Array, "..."], slope: Float[Array, "..."], second_derivative: Float[Array, "..."]
) -> AffineBounds:
    """Bounds of F(f) for a function F whose second derivative keeps its sign."""
    # By Taylor about the middle, the remainder is between 0 and bend reach^2 / 2.
    half = 0.25 * second_derivative * f.half_range() ** 2
    return rounded(AffineBounds(value + half, slope * f.linear, jnp.abs(slope) * f.radius + jnp.abs(half)), value)


def _bent_parabola(f: AffineBounds, values: tuple[Array, Array, Array], third: Array) -> AffineBounds:
    # F(f) from F and its first two derivatives in the middle, and the size of the third one within the band.
    value, slope, second_derivative = values
    off, squared = jnp.abs(f.square) + f.radius, 0.5 * second_derivative * f.linear**2
    radius = jnp.abs(slope) * f.radius + 0.5 * jnp.abs(second_derivative) * (2.0 * jnp.abs(f.linear) + off) * off
    parabola = AffineBounds(
        value, slope * f.linear, radius + third / 6.0 * f.half_range() ** 3, slope * f.square + squared
    )
    return rounded(parabola, jnp.abs(value) + jnp.abs(slope * f.square) + jnp.abs(squared))


@jax.jit
def sincospi(f: AffineBounds) -> tuple[AffineBounds, AffineBounds]:
    """Bounds of sin(pi f) and cos(pi f)."""
    f = flat(f)
    sine, cosine = elementary.sincospi(f.middle)
    # At d from the middle, sin(m + d) = sin m cos d + cos m sin d, with cos d from 1 - d^2 / 2 to 1, and sin d within
    # |d|^3 / 6 of d.
    reach, half = math.pi * f.half_range(), (0.5 * math.pi * f.half_range()) ** 2

    def one(value: Array, slope: Array) -> AffineBounds:
        radius = jnp.abs(value) * half + jnp.abs(slope) * (math.pi * f.radius + reach**3 / 6.0)
        return rounded(AffineBounds(value * (1.0 - half), math.pi * slope * f.linear, radius), 1.0 + reach)

    return one(sine, cosine), one(cosine, -sine)
