"""Bounds on a function and its first two derivatives over an interval, and their arithmetic.

A proof that holds between samples needs a bound of the second derivative of each constraint. Instead of deriving it by
hand, the factors of constraints are bounded, and their bounds combined by Leibniz' rule.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array

from cspr_jax.numerics.shapes import Float


def hypotenuse(a: Float[Array, "..."], b: Float[Array, "..."]) -> Float[Array, "..."]:
    """Length of a plane vector; `jnp.hypot` takes several times as long, since it keeps squares from overflowing."""
    return jnp.sqrt(a * a + b * b)


class Bounds(NamedTuple):
    """Upper bounds of |f|, |f'| and |f''| over one interval; arrays of one shape.

    Fields:
        value: (...) bound of |f|.
        derivative: (...) bound of |f'|, with respect to the interval's variable.
        curvature: (...) bound of |f''|.
    """

    value: Array
    derivative: Array
    curvature: Array

    def __add__(self, other: "Bounds") -> "Bounds":  # type: ignore[override]
        """Bounds of f + g, and of f - g."""
        return Bounds(self.value + other.value, self.derivative + other.derivative, self.curvature + other.curvature)

    def __mul__(self, other: "Bounds") -> "Bounds":  # type: ignore[override]
        """Bounds of f g (Leibniz)."""
        return Bounds(
            self.value * other.value,
            self.derivative * other.value + self.value * other.derivative,
            self.curvature * other.value + 2.0 * self.derivative * other.derivative + self.value * other.curvature,
        )

    def times(self, factor: Array | float) -> "Bounds":
        """Bounds of f times a constant, whose sign does not matter."""
        magnitude = jnp.abs(factor)
        return Bounds(magnitude * self.value, magnitude * self.derivative, magnitude * self.curvature)

    def combined(self, other: "Bounds") -> "Bounds":
        """Bounds of the length of a vector, from bounds of two components at a right angle."""
        return Bounds(
            hypotenuse(self.value, other.value),
            hypotenuse(self.derivative, other.derivative),
            hypotenuse(self.curvature, other.curvature),
        )

    def rotated(self, rate: Array) -> "Bounds":
        """Bounds of the lengths of a vector and its derivatives in axes that rotate at a constant rate."""
        return Bounds(
            self.value,
            self.derivative + rate * self.value,
            self.curvature + 2.0 * rate * self.derivative + rate**2 * self.value,
        )
