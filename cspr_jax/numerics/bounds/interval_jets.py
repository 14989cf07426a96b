"""Interval jets: bounds of a function and of its first two derivatives over many blocks at once.

Formulas of +, -, *, / and ** that are written for arrays take jets as well. Derivatives follow from the product rule
and the chain rule, in interval arithmetic. Their purpose is a bound of the second derivative: over a block of width w
no value lies further below the chord between its ends than w^2 / 8 times the largest second derivative.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from cspr_jax.numerics.shapes import Float

Interval = tuple[np.ndarray, np.ndarray]


def _product(a: Interval, b: Interval) -> Interval:
    corners = [x * y for x in a for y in b]
    return np.minimum.reduce(corners), np.maximum.reduce(corners)


def _sum(a: Interval, b: Interval) -> Interval:
    return a[0] + b[0], a[1] + b[1]


def _square(a: Interval) -> Interval:
    low, high = a[0] ** 2, a[1] ** 2
    return np.where((a[0] < 0.0) & (a[1] > 0.0), 0.0, np.minimum(low, high)), np.maximum(low, high)


def _scaled(a: Interval, factor: Any) -> Interval:
    ends = a[0] * factor, a[1] * factor
    return np.minimum(*ends), np.maximum(*ends)


class Jet:
    """Bounds over blocks.

    Args:
        value: lower and upper bounds of the values, arrays of the blocks' shape.
        derivative: bounds of the first derivative, likewise.
        second_derivative: bounds of the second derivative, likewise.
    """

    # Makes NumPy arrays leave arithmetic with jets to the methods of jets.
    __array_ufunc__ = None

    def __init__(self, value: Interval, derivative: Interval, second_derivative: Interval) -> None:
        """Keep the bounds."""
        self.value, self.derivative, self.second_derivative = value, derivative, second_derivative

    def _each(self, change: Callable[..., np.ndarray], *others: "Jet") -> "Jet":
        jets = (self, *others)
        parts = zip(*((jet.value, jet.derivative, jet.second_derivative) for jet in jets), strict=True)
        return Jet(*((change(*(x[0] for x in part)), change(*(x[1] for x in part))) for part in parts))

    def expanded(self, axis: int) -> "Jet":
        """The same bounds with a new axis."""
        return self._each(lambda x: np.expand_dims(x, axis))

    def joined(self, other: "Jet") -> "Jet":
        """Bounds of two functions side by side in the last dimension."""
        return self._each(lambda x, y: np.concatenate(np.broadcast_arrays(x, y), axis=-1), other)

    def summed(self) -> "Jet":
        """Bounds of the sum over the last dimension."""
        return self._each(lambda x: x.sum(-1))

    def __add__(self, other: Any) -> "Jet":
        """Sum with a jet or with constants."""
        if not isinstance(other, Jet):
            return Jet((self.value[0] + other, self.value[1] + other), self.derivative, self.second_derivative)
        return Jet(
            _sum(self.value, other.value),
            _sum(self.derivative, other.derivative),
            _sum(self.second_derivative, other.second_derivative),
        )

    def __mul__(self, other: Any) -> "Jet":
        """Product with a jet or with constants."""
        if not isinstance(other, Jet):
            return Jet(*(_scaled(x, other) for x in (self.value, self.derivative, self.second_derivative)))
        crossed = _scaled(_product(self.derivative, other.derivative), 2.0)
        second_derivative = _sum(
            _sum(_product(self.second_derivative, other.value), crossed), _product(self.value, other.second_derivative)
        )
        derivative = _sum(_product(self.derivative, other.value), _product(self.value, other.derivative))
        return Jet(_product(self.value, other.value), derivative, second_derivative)

    __radd__, __rmul__ = __add__, __mul__

    def __neg__(self) -> "Jet":
        """Negative."""
        return self * -1.0

    def __sub__(self, other: Any) -> "Jet":
        """This jet minus a jet or constants."""
        return self + -other

    def __rsub__(self, other: Any) -> "Jet":
        """Constants minus this jet."""
        return -self + other

    def __pow__(self, power: float) -> "Jet":
        """Square, or any other power of a function whose values are positive."""
        if power == 2:
            chained = _sum(_square(self.derivative), _product(self.value, self.second_derivative))
            return Jet(_square(self.value), _scaled(_product(self.value, self.derivative), 2.0), _scaled(chained, 2.0))
        low, high = self.value
        positive = np.where(low > 0.0, low, 0.0), np.where(high > 0.0, high, 0.0)

        def power_derivative(order: int) -> Interval:
            factor = np.prod([power - i for i in range(order)])
            ends = [x ** (power - order) for x in positive]
            return _scaled((np.minimum(*ends), np.maximum(*ends)), factor)

        with np.errstate(divide="ignore", invalid="ignore"):
            first = power_derivative(1)
            second_derivative = _sum(
                _product(power_derivative(2), _square(self.derivative)), _product(first, self.second_derivative)
            )
            return Jet(power_derivative(0), _product(first, self.derivative), second_derivative)

    def __truediv__(self, other: Any) -> "Jet":
        """Quotient by a jet of positive values, or by constants."""
        return self * (other**-1.0 if isinstance(other, Jet) else 1.0 / other)


def lowest(ends: Float[np.ndarray, "2 ..."], jet: Jet) -> Float[np.ndarray, "..."]:
    """Lower bounds of a function over blocks."""
    minimum = ends.min(0)
    with np.errstate(invalid="ignore"):
        low = minimum - np.maximum(jet.second_derivative[1], 0.0) / 8.0
        # A function whose derivative keeps its sign is nowhere below the lower of its values at both ends.
        steady = (jet.derivative[0] >= 0.0) | (jet.derivative[1] <= 0.0)
    return np.where(steady, minimum, np.where(np.isnan(low), -np.inf, low))
