"""Affine bounds: Taylor models of the first order, over a block of time.

With s from -1 at the start of a block to 1 at its end, f(s) is within `radius` of `middle + linear s`. Sums, products,
quotients and roots of such bounds are bounds again. The radius of a smooth function shrinks with the square of the
length of the block, so that halving blocks settles what is undecided; functions that are only continuous have bounds
too. Remainders of models of the second order, `middle + linear s + square s^2`, shrink with the third power; few
operations support them. Each operation adds a bound of its rounding error to the radius. Operations are compiled
functions, so that a kernel of hundreds of them is traced and lowered for XLA as calls of a few.
"""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from cspr_jax.numerics.shapes import Bool, Float
from cspr_jax.numerics.tolerances import ROUNDING


class AffineBounds(NamedTuple):
    """Bounds of a function over one block, or of an array of functions; leaves of one shape.

    Fields:
        middle: (...) value of the line at the middle of the block.
        linear: (...) coefficient of s: half of the rise of the line from start to end.
        radius: (...) bound of the remainder; NaN where there is none.
        square: (...) coefficient of s^2; None: the bounds are around a line.
    """

    middle: Any
    linear: Any
    radius: Any
    square: Any = None

    def half_range(self) -> Float[Array, "..."]:
        """Largest distance of the function from `middle`."""
        bound = jnp.abs(self.linear) + self.radius
        return bound if self.square is None else bound + jnp.abs(self.square)

    def low(self) -> Float[Array, "..."]:
        """Lower bound."""
        return self.middle - self.half_range() if self.square is None else -(-self).high()

    def high(self) -> Float[Array, "..."]:
        """Upper bound."""
        if self.square is None:
            return self.middle + self.half_range()
        # The vertex of a parabola may lie within the block.
        rise, is_within = jnp.abs(self.linear), -2.0 * self.square > jnp.abs(self.linear)
        top = jnp.where(is_within, -0.25 * rise**2 / jnp.where(is_within, self.square, 1.0), rise + self.square)
        return self.middle + top + self.radius

    def magnitude(self) -> Float[Array, "..."]:
        """Bound of the absolute value."""
        return jnp.abs(self.middle) + self.half_range()

    def each(self, change) -> "AffineBounds":
        """The same bounds with all arrays rearranged by a function, such as a transposition."""
        return jax.tree.map(change, self)

    def total(self, axis: int = -1) -> "AffineBounds":
        """Bounds of the sum along an axis."""
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
        return AffineBounds(-self.middle, -self.linear, self.radius, None if self.square is None else -self.square)

    def __sub__(self, other: Any) -> "AffineBounds":
        """Bounds of f - g, or of f less constants."""
        return self + -other

    def __rsub__(self, other: Any) -> "AffineBounds":
        """Bounds of constants less f."""
        return -self + other


def rounded(bounds: AffineBounds, magnitude: Any = 0.0) -> AffineBounds:
    """Bounds whose radius is widened by the rounding of their own numbers, and of others up to a magnitude."""
    return bounds._replace(radius=bounds.radius + ROUNDING * (bounds.magnitude() + magnitude))


@partial(jax.jit, static_argnames="axis")
def _total(f: AffineBounds, axis: int) -> AffineBounds:
    # The rounding errors are bounded for up to some thirty terms.
    total = f.each(lambda x: jnp.sum(x, axis=axis))
    return total._replace(radius=total.radius + 2.0 * ROUNDING * jnp.sum(f.magnitude(), axis=axis))


@jax.jit
def _sum(f: AffineBounds, g: AffineBounds) -> AffineBounds:
    line = AffineBounds(f.middle + g.middle, f.linear + g.linear, f.radius + g.radius)
    is_line = f.square is None and g.square is None
    return rounded(line if is_line else line._replace(square=squares(f) + squares(g)))


@jax.jit
def _shifted(f: AffineBounds, constants: Array) -> AffineBounds:
    middle = f.middle + constants
    wide = f.each(lambda x: jnp.broadcast_to(x, middle.shape))
    return wide._replace(middle=middle, radius=wide.radius + ROUNDING * (wide.radius + jnp.abs(middle)))


@jax.jit
def _scaled(f: AffineBounds, constants: Array) -> AffineBounds:
    scaled = f.each(lambda x: x * constants)
    return rounded(scaled._replace(radius=f.radius * jnp.abs(constants)))


def _products(f: AffineBounds, g: AffineBounds) -> tuple[AffineBounds, Array]:
    # Bounds of f g without rounding errors, and the magnitude of the numbers that enter them; s^2 is between 0 and 1.
    if f.square is not None or g.square is not None:
        return _parabola_products(f, g)
    half = 0.5 * f.linear * g.linear
    norms = jnp.abs(f.middle) + jnp.abs(f.linear), jnp.abs(g.middle) + jnp.abs(g.linear)
    radius = jnp.abs(half) + norms[0] * g.radius + (norms[1] + g.radius) * f.radius
    linear = f.middle * g.linear + f.linear * g.middle
    return AffineBounds(f.middle * g.middle + half, linear, radius), norms[0] * norms[1]


def _parabola_products(f: AffineBounds, g: AffineBounds) -> tuple[AffineBounds, Array]:
    # s^3 is within 1/4 of 3 s / 4, and s^4 between 0 and 1.
    f, g = (x._replace(square=squares(x)) for x in (f, g))
    cubic, quartic = f.linear * g.square + f.square * g.linear, f.square * g.square
    norms = [jnp.abs(x.middle) + jnp.abs(x.linear) + jnp.abs(x.square) for x in (f, g)]
    radius = 0.25 * jnp.abs(cubic) + 0.5 * jnp.abs(quartic) + norms[0] * g.radius + (norms[1] + g.radius) * f.radius
    product = AffineBounds(
        f.middle * g.middle + 0.5 * quartic,
        f.middle * g.linear + f.linear * g.middle + 0.75 * cubic,
        radius,
        f.middle * g.square + f.linear * g.linear + f.square * g.middle,
    )
    return product, norms[0] * norms[1]


@jax.jit
def _product(f: AffineBounds, g: AffineBounds) -> AffineBounds:
    product, magnitude = _products(f, g)
    return product._replace(radius=product.radius + ROUNDING * (product.radius + magnitude))


def squares(f: AffineBounds) -> Float[Array, "..."]:
    """Coefficients of s^2."""
    return jnp.zeros_like(f.middle) if f.square is None else f.square


def flat(f: AffineBounds) -> AffineBounds:
    """Bounds around a line, from bounds around a parabola."""
    if f.square is None:
        return f
    half = 0.5 * f.square
    return rounded(AffineBounds(f.middle + half, f.linear, f.radius + jnp.abs(half)))


def constant(values: Float[Array, "..."]) -> AffineBounds:
    """Bounds of constants."""
    return AffineBounds(values, jnp.zeros_like(values), jnp.zeros_like(values))


@jax.jit
def squared(f: AffineBounds) -> AffineBounds:
    """Bounds of f^2."""
    if f.square is not None:
        return f * f
    half, line = 0.5 * f.linear**2, jnp.abs(f.middle) + jnp.abs(f.linear)
    radius = half + (2.0 * line + f.radius) * f.radius
    return rounded(AffineBounds(f.middle**2 + half, 2.0 * f.middle * f.linear, radius), line**2)


def selected(choices: Bool[Array, "..."], f: AffineBounds, g: AffineBounds) -> AffineBounds:
    """Bounds of f where a condition holds, else of g."""
    return jax.tree.map(lambda a, b: jnp.where(choices, a, b), f, g)


@jax.jit
def dot(f: AffineBounds, g: AffineBounds | Float[Array, "... n"]) -> AffineBounds:
    """Bounds of the products of vectors."""
    if not isinstance(g, AffineBounds):
        return (f * g).total()
    product, magnitude = _products(f, g)
    total = product.each(lambda x: jnp.sum(x, axis=-1))
    return total._replace(radius=total.radius + 3.0 * ROUNDING * (total.radius + jnp.sum(magnitude, axis=-1)))


@jax.jit
def norm_squared(f: AffineBounds) -> AffineBounds:
    """Bounds of the squared lengths of vectors."""
    return squared(f).total()


@jax.jit
def norm(f: AffineBounds) -> AffineBounds:
    """Bounds of the lengths of vectors, which may vanish within the block."""
    f = flat(f)
    # A length is convex: it lies below the chord between the ends of the line, and above its part along any direction.
    start, end = (jnp.sqrt(jnp.sum((f.middle + side) ** 2, axis=-1)) for side in (-f.linear, f.linear))
    deviation, length = jnp.sqrt(jnp.sum(f.radius**2, axis=-1)), jnp.sqrt(jnp.sum(f.middle**2, axis=-1))
    along = jnp.sum(f.middle * f.linear, axis=-1) / jnp.where(length > 0.0, length, 1.0)
    linear, above = 0.5 * (end - start), 0.5 * (start + end) + deviation
    below = length - deviation - jnp.abs(along - linear)
    return rounded(AffineBounds(0.5 * (above + below), linear, 0.5 * (above - below)), start + end)


@jax.jit
def cross(f: AffineBounds, g: AffineBounds) -> AffineBounds:
    """Bounds of the vector products."""

    def ahead(bounds: AffineBounds) -> AffineBounds:
        return bounds.each(lambda x: jnp.concatenate([x[..., 1:], x[..., :1]], axis=-1))

    return ahead(f * ahead(g) - ahead(f) * g)


@jax.jit
def rotated(matrix: AffineBounds | Float[Array, "... m n"], f: AffineBounds | Float[Array, "... n"]) -> AffineBounds:
    """Bounds of matrices times vectors; either of the two may be constant."""
    across: Any = f.each(lambda x: x[..., None, :]) if isinstance(f, AffineBounds) else f[..., None, :]
    # `dot` takes constants as its second argument.
    return dot(matrix, across) if isinstance(matrix, AffineBounds) else dot(across, matrix)


def stacked(bounds: "list[AffineBounds]", axis: int = -1) -> AffineBounds:
    """Bounds of several functions in one array."""
    return jax.tree.map(lambda *leaves: jnp.stack(leaves, axis), *bounds)


def joined(bounds: "list[AffineBounds]", axis: int = -1) -> AffineBounds:
    """Bounds one after the other along an axis."""
    return jax.tree.map(lambda *leaves: jnp.concatenate(leaves, axis), *bounds)
