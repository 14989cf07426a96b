"""Affine bounds: over a block of time, a function lies in a band around a straight line.

With s from -1 at the start of a block to 1 at its end, f(s) is within `radius` of `middle + slope s`. Sums, products,
quotients and roots of such bounds are bounds again. A smooth function's radius shrinks with the square of the length of
the block, so that halving a block closes what is open, and functions that only have to be continuous have bounds too.
Each operation widens the band by what rounding may be of it.
"""

import math
from typing import Any, NamedTuple

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
        return _rounded(self.each(lambda x: jnp.sum(x, axis=axis)), jnp.sum(self.size(), axis=axis))

    def __add__(self, other: Any) -> "AffineBounds":
        """Bounds of f + g, or of f plus constants."""
        if not isinstance(other, AffineBounds):
            return _rounded(self._replace(middle=self.middle + other), jnp.abs(other))
        moved = AffineBounds(self.middle + other.middle, self.slope + other.slope, self.radius + other.radius)
        return _rounded(moved, self.size())

    def __mul__(self, other: Any) -> "AffineBounds":
        """Bounds of f g, or of f times constants."""
        if not isinstance(other, AffineBounds):
            return _rounded(self.each(lambda x: x * other)._replace(radius=self.radius * jnp.abs(other)))
        # s^2 is between 0 and 1.
        half = 0.5 * self.slope * other.slope
        sizes = (jnp.abs(self.middle) + jnp.abs(self.slope), jnp.abs(other.middle) + jnp.abs(other.slope))
        radius = jnp.abs(half) + sizes[0] * other.radius + sizes[1] * self.radius + self.radius * other.radius
        slope = self.middle * other.slope + self.slope * other.middle
        return _rounded(AffineBounds(self.middle * other.middle + half, slope, radius), sizes[0] * sizes[1])

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


def constant(values: Array) -> AffineBounds:
    """Bounds of constants.

    Args:
        values: (...).

    Returns:
        the bounds.
    """
    return AffineBounds(values, jnp.zeros_like(values), jnp.zeros_like(values))


def squared(f: AffineBounds) -> AffineBounds:
    """Bounds of f^2.

    Returns:
        the bounds.
    """
    half, line = 0.5 * f.slope**2, jnp.abs(f.middle) + jnp.abs(f.slope)
    radius = half + (2.0 * line + f.radius) * f.radius
    return _rounded(AffineBounds(f.middle**2 + half, 2.0 * f.middle * f.slope, radius), line**2)


def reciprocal(f: AffineBounds) -> AffineBounds:
    """Bounds of 1 / f, of a positive function.

    Returns:
        the bounds; NaN where f may not be positive.
    """
    value = 1.0 / f.middle
    return bent(f, value, -(value**2), 2.0 / _positive(f) ** 3)


def root(f: AffineBounds) -> AffineBounds:
    """Bounds of the square root of a positive function.

    Returns:
        the bounds; NaN where f may not be positive.
    """
    value = jnp.sqrt(f.middle)
    return bent(f, value, 0.5 / value, -0.25 * _positive(f) ** -1.5)


def reciprocal_root(f: AffineBounds) -> AffineBounds:
    """Bounds of 1 over the square root of a positive function.

    Returns:
        the bounds; NaN where f may not be positive.
    """
    value = 1.0 / jnp.sqrt(f.middle)
    return bent(f, value, -0.5 * value**3, 0.75 * _positive(f) ** -2.5)


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


def dot(f: AffineBounds, g: AffineBounds | Array) -> AffineBounds:
    """Bounds of the products of vectors.

    Args:
        f: (..., n).
        g: (..., n).

    Returns:
        (...).
    """
    return (f * g).total()


def norm_squared(f: AffineBounds) -> AffineBounds:
    """Bounds of the squared lengths of vectors.

    Args:
        f: (..., n).

    Returns:
        (...).
    """
    return squared(f).total()


def norm_bound(f: AffineBounds) -> Array:
    """Upper bounds of the lengths of vectors: at the ends of their lines, and of the band.

    Args:
        f: (..., n).

    Returns:
        (...).
    """
    start, end = (jnp.sqrt(jnp.sum((f.middle + side) ** 2, axis=-1)) for side in (-f.slope, f.slope))
    length = jnp.maximum(start, end) + jnp.sqrt(jnp.sum(f.radius**2, axis=-1))
    return length * (1.0 + ROUNDING)


def cross(f: AffineBounds, g: AffineBounds) -> AffineBounds:
    """Bounds of the vector products.

    Args:
        f: (..., 3).
        g: (..., 3).

    Returns:
        (..., 3).
    """
    ahead, behind = np.array([1, 2, 0]), np.array([2, 0, 1])

    def part(bounds: AffineBounds, order: np.ndarray) -> AffineBounds:
        return bounds.each(lambda x: x[..., order])

    return part(f, ahead) * part(g, behind) - part(f, behind) * part(g, ahead)


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
    product: AffineBounds = matrix * across if isinstance(matrix, AffineBounds) else across * matrix
    return product.total()


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
