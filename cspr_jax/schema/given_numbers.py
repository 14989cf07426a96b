"""Numbers that a caller gives from Python: one check of their types, shapes and ranges."""

import dataclasses
import math
import numbers as kinds
import operator
from typing import Any

import numpy as np

from cspr_jax.errors import InputError

# Sizes, times, rates and limits are within these bounds, in SI units: beyond, their squares and quotients vanish or
# overflow. No robot is near them.
SMALLEST, LARGEST = 1e-9, 1e9
# A shape has this in place of a length that may be any from 1 on.
ANY = None


def numbers(key: str, value: Any, allowed: str) -> np.ndarray:
    """Real numbers that a caller gave.

    Strings, truth values and complex numbers are refused: NumPy would read the first two as numbers, and drop the
    imaginary part of the last.
    """
    try:
        values = np.asarray(value)
        if values.dtype.kind in "iuf":
            return values.astype(float)
        if values.dtype.kind == "V" and values.dtype.names is None and np.can_cast(values.dtype, float):
            return values.astype(float)  # bfloat16 and its like
        if values.dtype.kind == "O" and all(_is_real(entry) for entry in values.flat):
            return np.array([float(entry) for entry in values.flat]).reshape(values.shape)
    except (TypeError, ValueError, OverflowError, RecursionError) as error:
        raise InputError(key, value, allowed) from error
    raise InputError(key, value, allowed)


def whole(key: str, value: Any, least: int, largest: int) -> int:
    """Integer that a caller gave."""
    allowed = f"an integer from {least} to {largest}"
    try:
        number = operator.index(value)
    except TypeError as error:
        raise InputError(key, value, allowed) from error
    if isinstance(value, bool) or not least <= number <= largest:
        raise InputError(key, value, allowed)
    return number


@dataclasses.dataclass(frozen=True)
class Numbers:
    """Rule that an argument of real numbers must satisfy.

    Fields:
        allowed: in words, for errors.
        shapes: that are allowed; `ANY` is a length from 1 on. None: all.
        least: smallest number.
        largest: largest number; inf: none, and infinite ones are taken only with `infinite`.
        above: whether the smallest number itself is refused.
        infinite: whether inf is taken.
        nan: whether NaN is taken, since the function itself says what it allows instead.
    """

    allowed: str
    shapes: tuple[tuple[int | None, ...], ...] | None = ((),)
    least: float = -math.inf
    largest: float = math.inf
    above: bool = False
    infinite: bool = False
    nan: bool = False

    def array(self, key: str, value: Any) -> np.ndarray:
        """The numbers."""
        values = numbers(key, value, self.allowed)
        if self.shapes is not None and not any(_fits(values.shape, shape) for shape in self.shapes):
            if not values.ndim:
                raise InputError(key, value, self.allowed)
            raise InputError(key, None, f"must be {self.allowed}", fault=f"an array of shape {values.shape}")
        inside = (values > self.least if self.above else values >= self.least) & (values <= self.largest)
        inside &= ~np.isnan(values) if self.infinite else np.isfinite(values)
        inside |= np.isnan(values) & self.nan
        if self.above and self.least == 0.0 and inside.all() and ((values < SMALLEST) | (values > LARGEST)).any():
            beyond = float(values.min() if values.min() < SMALLEST else values.max())
            raise InputError(key, beyond, f"{self.allowed}, from {SMALLEST:g} to {LARGEST:g}")
        if not inside.all():
            # One row of points, or one number, is enough to show.
            at = tuple(np.argwhere(~inside)[0][: 1 if values.ndim == 2 else values.ndim])
            raise InputError(key, values[at].tolist(), self.allowed)
        return values


def _fits(shape: tuple[int, ...], lengths: tuple[int | None, ...]) -> bool:
    return len(shape) == len(lengths) and all(
        size >= 1 if length is ANY else size == length for size, length in zip(shape, lengths, strict=True)
    )


def _is_real(value: object) -> bool:
    is_number = isinstance(value, kinds.Real) or type(value).__name__ == "Decimal"
    return is_number and not isinstance(value, bool | np.bool_)
