"""Affine bounds: over a block of time, a function lies in a band around a straight line.

With s from -1 at the start of a block to 1 at its end, f(s) is within `radius` of `middle + slope s`. Sums, products,
quotients and roots of such bounds are bounds again. A smooth function's radius shrinks with the square of the length of
the block, so that halving a block closes what is open, and functions that only have to be continuous have bounds too.
Each operation widens the band by what rounding may be of it. Operations are compiled functions: kernels of hundreds of
them are traced, and written down for XLA, as calls of a few.
"""

import math
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.arithmetic import elementary

# A few roundings of an operation, in parts of the largest number in it.
ROUNDING = 8.0 * float(np.finfo(float).eps)
LARGEST_SINE = 0.9


class AffineBounds(NamedTuple):
    """Bounds of a function over one block, or of an array of functions; leaves of one shape.

    Fields:
        middle: (...) of the line, at the middle of the block.
        slope: (...) half of what the line rises from the start to the end.
        radius: (...) half of the height of the band; NaN where nothing is known.
    """

    middle: Any
    slope: Any
    radius: Any

    def reach(self) -> Array:
        """How far the function may be from `middle`.

        Returns:
            (...).
        """
        return jnp.abs(self.slope) + self.radius

    def low(self) -> Array:
        """Lower bound.

        Returns:
            (...).
        """
        return self.middle - self.reach()

    def high(self) -> Array:
        """Upper bound.

        Returns:
            (...).
        """
        return self.middle + self.reach()

    def size(self) -> Array:
        """Bound of the absolute value.

        Returns:
            (...).
        """
        return jnp.abs(self.middle) + self.reach()

    def each(self, change) -> "AffineBounds":
        """The same bounds in another order, such as transposed or with another dimension.

        Args:
            change: takes an array and keeps its numbers.

        Returns:
            the bounds.
        """
        return AffineBounds(change(self.middle), change(self.slope), change(self.radius))

    def total(self, axis: int = -1) -> "AffineBounds":
        """Bounds of the sum along an axis.

        Returns:
            the bounds.
        """
        return _total(self, axis)

    def __add__(self, other: Any) -> "AffineBounds":
        """Bounds of f + g, or of f plus constants."""
        return _sum(self, other) if isinstance(other, AffineBounds) else _shifted(self, other)

    def __mul__(self, other: Any) -> "AffineBounds":
        """Bounds of f g, or of f times constants."""
        return _product(self, other) if isinstance(other, AffineBounds) else _scaled(self, other)

    def __radd__(self, other: Any) -> "AffineBounds":
        """Bounds of constants plus f."""
        return self + other

    def __rmul__(self, other: Any) -> "AffineBounds":
        """Bounds of constants times f."""
        return self * other

    def __neg__(self) -> "AffineBounds":
        """Bounds of -f."""
        return AffineBounds(-self.middle, -self.slope, self.radius)

    def __sub__(self, other: Any) -> "AffineBounds":
        """Bounds of f - g, or of f less constants."""
        return self + -other

    def __rsub__(self, other: Any) -> "AffineBounds":
        """Bounds of constants less f."""
        return -self + other


def _rounded(bounds: AffineBounds, size: Any = 0.0) -> AffineBounds:
    # Widen the band by the rounding of numbers as large as `size` or as the bounds themselves.
    return bounds._replace(radius=bounds.radius + ROUNDING * (bounds.size() + size))


@partial(jax.jit, static_argnames="axis")
def _total(f: AffineBounds, axis: int) -> AffineBounds:
    # Up to some thirty terms.
    total = f.each(lambda x: jnp.sum(x, axis=axis))
    return total._replace(radius=total.radius + 2.0 * ROUNDING * jnp.sum(f.size(), axis=axis))


@jax.jit
def _sum(f: AffineBounds, g: AffineBounds) -> AffineBounds:
    return _rounded(AffineBounds(f.middle + g.middle, f.slope + g.slope, f.radius + g.radius))


@jax.jit
def _shifted(f: AffineBounds, constants: Array) -> AffineBounds:
    middle = f.middle + constants
    slope, radius = (jnp.broadcast_to(x, middle.shape) for x in (f.slope, f.radius))
    return AffineBounds(middle, slope, radius + ROUNDING * (radius + jnp.abs(middle)))


@jax.jit
def _scaled(f: AffineBounds, constants: Array) -> AffineBounds:
    return _rounded(AffineBounds(f.middle * constants, f.slope * constants, f.radius * jnp.abs(constants)))


def _products(f: AffineBounds, g: AffineBounds) -> tuple[AffineBounds, Array]:
    # Bounds of f g but for rounding, and the size of the numbers in its line; s^2 is between 0 and 1.
    half = 0.5 * f.slope * g.slope
    sizes = jnp.abs(f.middle) + jnp.abs(f.slope), jnp.abs(g.middle) + jnp.abs(g.slope)
    radius = jnp.abs(half) + sizes[0] * g.radius + (sizes[1] + g.radius) * f.radius
    slope = f.middle * g.slope + f.slope * g.middle
    return AffineBounds(f.middle * g.middle + half, slope, radius), sizes[0] * sizes[1]


@jax.jit
def _product(f: AffineBounds, g: AffineBounds) -> AffineBounds:
    product, size = _products(f, g)
    return product._replace(radius=product.radius + ROUNDING * (product.radius + size))


def constant(values: Array) -> AffineBounds:
    """Bounds of constants.

    Args:
        values: (...).

    Returns:
        the bounds.
    """
    return AffineBounds(values, jnp.zeros_like(values), jnp.zeros_like(values))


@jax.jit
def squared(f: AffineBounds) -> AffineBounds:
    """Bounds of f^2.

    Returns:
        the bounds.
    """
    half, line = 0.5 * f.slope**2, jnp.abs(f.middle) + jnp.abs(f.slope)
    radius = half + (2.0 * line + f.radius) * f.radius
    return _rounded(AffineBounds(f.middle**2 + half, 2.0 * f.middle * f.slope, radius), line**2)


@jax.jit
def reciprocal(f: AffineBounds) -> AffineBounds:
    """Bounds of 1 / f, of a positive function.

    Returns:
        the bounds; NaN where f may not be positive.
    """
    value = 1.0 / f.middle
    return bent(f, value, -(value**2), 2.0 / _positive(f) ** 3)


@jax.jit
def root(f: AffineBounds) -> AffineBounds:
    """Bounds of the square root of a positive function.

    Returns:
        the bounds; NaN where f may not be positive.
    """
    value = jnp.sqrt(f.middle)
    return bent(f, value, 0.5 / value, -0.25 * _positive(f) ** -1.5)


@jax.jit
def reciprocal_root(f: AffineBounds) -> AffineBounds:
    """Bounds of 1 over the square root of a positive function.

    Returns:
        the bounds; NaN where f may not be positive.
    """
    value = 1.0 / jnp.sqrt(f.middle)
    return bent(f, value, -0.5 * value**3, 0.75 * _positive(f) ** -2.5)


@jax.jit
def arc_sine(f: AffineBounds) -> AffineBounds:
    """Bounds of the angle of a sine, between -pi/2 and pi/2.

    Returns:
        the bounds; NaN where f may be larger than 0.9, or smaller than -0.9: near 1 no digits are left of 1 - x^2.
    """
    size = jnp.where(f.size() < LARGEST_SINE, f.size(), jnp.nan)
    # The second derivative, x (1 - x^2)^-1.5, changes its sign with x, and is largest where |x| is.
    bend = 0.5 * size * f.reach() ** 2 * (1.0 - size**2) ** -1.5
    value, slope = jnp.arcsin(f.middle), (1.0 - f.middle**2) ** -0.5
    return _rounded(AffineBounds(value, slope * f.slope, slope * f.radius + bend))


def selected(choices: Array, f: AffineBounds, g: AffineBounds) -> AffineBounds:
    """Bounds of f where a condition holds, else of g.

    Args:
        choices: (...) whether it holds; of the shape of both, or one that extends to it.

    Returns:
        the bounds.
    """
    return AffineBounds(*(jnp.where(choices, a, b) for a, b in zip(f, g, strict=True)))


def _positive(f: AffineBounds) -> Array:
    low = f.low()
    return jnp.where(low > 0.0, low, jnp.nan)


def bent(f: AffineBounds, value: Array, slope: Array, bend: Array) -> AffineBounds:
    """Bounds of F(f) for a function F whose second derivative keeps its sign.

    Args:
        value: (...) of F at the middle of f.
        slope: (...) of its derivative there.
        bend: (...) the largest second derivative within the band, with its sign.

    Returns:
        the bounds.
    """
    # By Taylor about the middle, the remainder is between 0 and bend reach^2 / 2.
    half = 0.25 * bend * f.reach() ** 2
    return _rounded(AffineBounds(value + half, slope * f.slope, jnp.abs(slope) * f.radius + jnp.abs(half)), value)


@jax.jit
def sincospi(f: AffineBounds) -> tuple[AffineBounds, AffineBounds]:
    """Bounds of sin(pi f) and cos(pi f).

    Args:
        f: angle in half turns.

    Returns:
        the bounds of both.
    """
    sine, cosine = elementary.sincospi(f.middle)
    # At d from the middle, sin(m + d) = sin m cos d + cos m sin d, with cos d from 1 - d^2 / 2 to 1, and sin d within
    # |d|^3 / 6 of d.
    reach, half = math.pi * f.reach(), (0.5 * math.pi * f.reach()) ** 2

    def one(value: Array, slope: Array) -> AffineBounds:
        radius = jnp.abs(value) * half + jnp.abs(slope) * (math.pi * f.radius + reach**3 / 6.0)
        return _rounded(AffineBounds(value * (1.0 - half), math.pi * slope * f.slope, radius), 1.0 + reach)

    return one(sine, cosine), one(cosine, -sine)


@jax.jit
def dot(f: AffineBounds, g: AffineBounds | Array) -> AffineBounds:
    """Bounds of the products of vectors.

    Args:
        f: (..., n).
        g: (..., n).

    Returns:
        (...).
    """
    if not isinstance(g, AffineBounds):
        return (f * g).total()
    product, size = _products(f, g)
    total = product.each(lambda x: jnp.sum(x, axis=-1))
    return total._replace(radius=total.radius + 3.0 * ROUNDING * (total.radius + jnp.sum(size, axis=-1)))


@jax.jit
def norm_squared(f: AffineBounds) -> AffineBounds:
    """Bounds of the squared lengths of vectors.

    Args:
        f: (..., n).

    Returns:
        (...).
    """
    return squared(f).total()


@jax.jit
def norm(f: AffineBounds) -> AffineBounds:
    """Bounds of the lengths of vectors, also of those that vanish.

    Args:
        f: (..., n).

    Returns:
        (...).
    """
    # A length is convex: it lies below the chord between the ends of the line, and above its part along any direction.
    start, end = (jnp.sqrt(jnp.sum((f.middle + side) ** 2, axis=-1)) for side in (-f.slope, f.slope))
    apart, size = jnp.sqrt(jnp.sum(f.radius**2, axis=-1)), jnp.sqrt(jnp.sum(f.middle**2, axis=-1))
    along = jnp.sum(f.middle * f.slope, axis=-1) / jnp.where(size > 0.0, size, 1.0)
    slope, above = 0.5 * (end - start), 0.5 * (start + end) + apart
    below = size - apart - jnp.abs(along - slope)
    return _rounded(AffineBounds(0.5 * (above + below), slope, 0.5 * (above - below)), start + end)


@jax.jit
def cross(f: AffineBounds, g: AffineBounds) -> AffineBounds:
    """Bounds of the vector products.

    Args:
        f: (..., 3).
        g: (..., 3).

    Returns:
        (..., 3).
    """

    def ahead(bounds: AffineBounds) -> AffineBounds:
        return bounds.each(lambda x: jnp.concatenate([x[..., 1:], x[..., :1]], axis=-1))

    return ahead(f * ahead(g) - ahead(f) * g)


@jax.jit
def turned(matrix: AffineBounds | Array, f: AffineBounds | Array) -> AffineBounds:
    """Bounds of matrices times vectors; one of both may be constant.

    Args:
        matrix: (..., m, n).
        f: (..., n).

    Returns:
        (..., m).
    """
    across: Any = f.each(lambda x: x[..., None, :]) if isinstance(f, AffineBounds) else f[..., None, :]
    # Constants go to the right.
    return dot(matrix, across) if isinstance(matrix, AffineBounds) else dot(across, matrix)


def stacked(bounds: "list[AffineBounds]", axis: int = -1) -> AffineBounds:
    """Bounds of several functions in one array.

    Args:
        bounds: of one shape.

    Returns:
        the bounds, with one more axis.
    """
    return AffineBounds(*(jnp.stack(leaves, axis) for leaves in zip(*bounds, strict=True)))


def joined(bounds: "list[AffineBounds]", axis: int = -1) -> AffineBounds:
    """Bounds one after the other along an axis.

    Returns:
        the bounds.
    """
    return AffineBounds(*(jnp.concatenate(leaves, axis) for leaves in zip(*bounds, strict=True)))
