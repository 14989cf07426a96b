"""Numbers that a caller gives from Python: one check of their types, shapes and ranges."""

import dataclasses
import math
import numbers as kinds
import operator
import sys
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from cspr_jax.errors import InputError

# Lengths, times, rates and limits are within these bounds, in SI units: beyond them squares and quotients vanish or
# overflow. No robot is near them.
SMALLEST, LARGEST = 1e-9, 1e9
# Stands in a shape for any length from 1 on.
ANY = None
DEPTH = 4  # levels of lists and dictionaries that are searched for tracers of jax


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
            return values.astype(float)  # bfloat16 and similar types
        if values.dtype.kind == "O" and all(_is_real(entry) for entry in values.flat):
            return np.array([float(entry) for entry in values.flat]).reshape(values.shape)
    except (TypeError, ValueError, OverflowError, RecursionError) as error:
        raise InputError(key, value, allowed) from error
    raise InputError(key, value, allowed)


def checked_integer(key: str, value: Any, minimum: int, maximum: int) -> int:
    """Integer that a caller gave."""
    allowed = f"an integer from {minimum} to {maximum}"
    try:
        number = operator.index(value)
    except TypeError as error:
        raise InputError(key, value, allowed) from error
    if isinstance(value, bool) or not minimum <= number <= maximum:
        raise InputError(key, value, allowed)
    return number


@dataclasses.dataclass(frozen=True)
class Numbers:
    """Rule that an argument of real numbers must satisfy.

    Fields:
        allowed: in words, for errors.
        shapes: those allowed, where `ANY` stands for a length from 1 on; None: all.
        minimum: smallest number.
        maximum: largest finite number; inf: unbounded.
        positive: whether numbers must be from `SMALLEST` to `LARGEST`, above 0.
        infinite: whether inf is taken.
        nan: whether NaN is taken here, and refused by the function itself with a message of its own.
        traced: whether tracers of jax pass, where jax may trace the function.
    """

    allowed: str
    shapes: tuple[tuple[int | None, ...], ...] | None = ((),)
    minimum: float = -math.inf
    maximum: float = math.inf
    positive: bool = False
    infinite: bool = False
    nan: bool = False
    traced: bool = False

    def __call__(self, key: str, value: Any) -> None:
        """Refuse other values."""
        if not (self.traced and traced_part(value) is not None):
            self.array(key, value)

    def array(self, key: str, value: Any) -> np.ndarray:
        """The checked numbers as an array."""
        values = numbers(key, value, self.allowed)
        if self.shapes is not None and not any(_fits(values.shape, shape) for shape in self.shapes):
            if not values.ndim:
                raise InputError(key, value, self.allowed)
            raise InputError(key, None, f"must be {self.allowed}", problem=f"an array of shape {values.shape}")
        inside = (values > 0.0 if self.positive else values >= self.minimum) & (values <= self.maximum)
        inside &= ~np.isnan(values) if self.infinite else np.isfinite(values)
        inside |= np.isnan(values) & self.nan
        if self.positive and inside.all() and ((values < SMALLEST) | (values > LARGEST)).any():
            beyond = float(values.min() if values.min() < SMALLEST else values.max())
            raise InputError(key, beyond, f"{self.allowed}, from {SMALLEST:g} to {LARGEST:g}")
        if not inside.all():
            # One row of points, or one number, is enough to show.
            at = tuple(np.argwhere(~inside)[0][: 1 if values.ndim == 2 else values.ndim])
            raise InputError(key, values[at].tolist(), self.allowed)
        return values


def _fits(shape: tuple[int, ...], lengths: tuple[int | None, ...]) -> bool:
    return len(shape) == len(lengths) and all(
        n >= 1 if length is ANY else n == length for n, length in zip(shape, lengths, strict=True)
    )


def _is_real(value: object) -> bool:
    is_number = isinstance(value, kinds.Real) or type(value).__name__ == "Decimal"
    return is_number and not isinstance(value, bool | np.bool_)


def traced_part(value: Any, depth: int = DEPTH) -> str | None:
    """First tracer of jax within a value, as Python writes its access, such as "[0].mass"; None: there is none."""
    jax = sys.modules.get("jax")
    if jax is None or isinstance(value, jax.core.Tracer):
        return None if jax is None else ""
    parts: Iterable[tuple[str, Any]] = ()
    if isinstance(value, Mapping):
        parts = ((f"[{key!r}]", part) for key, part in value.items())
    elif isinstance(value, list | tuple):
        parts = ((f"[{i}]", part) for i, part in enumerate(value))
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        parts = ((f".{field.name}", getattr(value, field.name)) for field in dataclasses.fields(value))
    inner = ((name, traced_part(part, depth - 1)) for name, part in parts) if depth else ()
    return next((name + rest for name, rest in inner if rest is not None), None)


def refuse_tracers(key: str, value: Any, instead: str) -> None:
    """Refuse tracers of jax anywhere in an argument of a function that computes with NumPy."""
    part = traced_part(value)
    if part is not None:
        error = "a tracer of jax, as grad, jit and vmap pass"
        raise InputError(key + part, None, f"must be numbers: {instead}", problem=error)
