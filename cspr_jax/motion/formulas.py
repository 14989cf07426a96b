"""Formulas of motions, with rational numbers: for exact decisions, and for certificates (docs/certificates.md).

A piece of a motion is a function of the time u since its start, in s. Its expressions are built by ordinary arithmetic;
a program lists their steps, each after those that it uses. Numbers are those of the motion, taken as rational.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np

Number = Fraction | int


class Expression:
    """A function of time: an operation on others, or a polynomial.

    Args:
        operation: "poly", "+", "-", "*", "/", "sin", "cos", "sin_pi", "cos_pi", "acos" or "sqrt".
        operands: what it is applied to; none of a polynomial.
        coefficients: rational coefficients of a polynomial, the constant first.
    """

    __slots__ = ("coefficients", "operands", "operation")

    def __init__(
        self, operation: str, operands: tuple["Expression", ...] = (), coefficients: tuple[Number, ...] = ()
    ) -> None:
        """Hold the operation."""
        self.operation, self.operands, self.coefficients = operation, operands, coefficients

    def __add__(self, other: "Expression | Number") -> "Expression":
        """Sum; of two polynomials a polynomial."""
        other = constant(other)
        if self.operation == other.operation == "poly":
            first, second = sorted((self.coefficients, other.coefficients), key=len)
            return polynomial([a + b for a, b in zip(first, second, strict=False)] + list(second[len(first) :]))
        return Expression("+", (self, other))

    def __mul__(self, other: "Expression | Number") -> "Expression":
        """Product; of two polynomials a polynomial."""
        other = constant(other)
        if self.operation == other.operation == "poly":
            coefficients = [Fraction(0)] * (len(self.coefficients) + len(other.coefficients) - 1)
            for (i, a), (j, b) in itertools.product(enumerate(self.coefficients), enumerate(other.coefficients)):
                coefficients[i + j] += a * b
            return polynomial(coefficients)
        return Expression("*", (self, other))

    def __sub__(self, other: "Expression | Number") -> "Expression":
        """Difference."""
        other = constant(other)
        return self + other * -1 if other.operation == "poly" else Expression("-", (self, other))

    def __rsub__(self, other: Number) -> "Expression":
        """Difference of a number and the expression."""
        return self * -1 + other

    def __truediv__(self, other: "Expression | Number") -> "Expression":
        """Quotient."""
        if not isinstance(other, Expression):
            return self * (1 / Fraction(other))
        return Expression("/", (self, other))

    def __neg__(self) -> "Expression":
        """Negative."""
        return self * -1

    __radd__ = __add__
    __rmul__ = __mul__


class MotionPiece(NamedTuple):
    """MotionPiece of a motion.

    Fields:
        start: time at which it starts, s.
        end: time at which it ends, s.
        curve: function from the time since its start to position (3) and quaternion (4), scalar first, of any norm but
            0; None instead of the quaternion of a point mass.
    """

    start: Fraction
    end: Fraction
    curve: "Callable[[Expression], tuple[list[Expression], list[Expression] | None]]"

    @property
    def components(self) -> tuple[list[Expression], list[Expression] | None]:
        """Position and quaternion as functions of the time since the start."""
        return self.curve(polynomial([0, 1]))


@runtime_checkable
class HasFormulas(Protocol):
    """Motion that knows its formulas."""

    def formulas(self) -> list[MotionPiece]:
        """Pieces of the motion, one after the other from time 0 to its duration."""
        ...


def rational(number: Any) -> Fraction:
    """The rational number that a floating-point number is."""
    return Fraction(float(number))


def rationals(numbers: Any) -> list[Any]:
    """Rational numbers of an array, as nested lists."""
    return np.vectorize(Fraction, otypes=[object])(np.asarray(numbers, float)).tolist()


def constant(value: Expression | Number) -> Expression:
    """A number as an expression."""
    return value if isinstance(value, Expression) else Expression("poly", (), (value,))


def polynomial(coefficients: Sequence[Number]) -> Expression:
    """A polynomial of the time since the start of the piece."""
    return Expression("poly", (), tuple(coefficients))


def powers(coefficients: Sequence[Number], x: Expression) -> Expression:
    """A polynomial of an expression, by Horner's scheme."""
    value = constant(coefficients[-1])
    for coefficient in reversed(coefficients[:-1]):
        value = value * x + coefficient
    return value


def function(name: str, x: Expression) -> Expression:
    """A function "sin", "cos", "sin_pi", "cos_pi", "acos" or "sqrt" of an expression."""
    return Expression(name, (x,))


def pi() -> Expression:
    """The number pi."""
    return function("acos", constant(0)) * 2


def combined(factors: Sequence[Any], vectors: Sequence[Sequence[Number]]) -> list[Expression]:
    """Sum of numeric vectors, each times an expression."""
    sums = []
    for numbers in zip(*vectors, strict=True):
        total = constant(0)
        for factor, number in zip(factors, numbers, strict=True):
            total = total + (factor if isinstance(factor, Expression) else constant(factor)) * number
        sums.append(total)
    return sums


def product(left: Sequence[Expression], right: Sequence[Expression]) -> list[Expression]:
    """Product of two quaternions, of which the right one rotates first."""
    a, b, c, d = left
    w, x, y, z = right
    return [
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    ]


def rotated_by(quaternion: Sequence[Expression], vector: Sequence[Number]) -> list[Expression]:
    """A vector turned by a quaternion of any norm but 0."""
    w, *axis = quaternion
    conjugate = [w, *(-part for part in axis)]
    moved = product(product(quaternion, [constant(0), *map(constant, vector)]), conjugate)[1:]
    square = sum((part * part for part in axis), w * w)
    return [part / square for part in moved]


def backwards(pieces: Sequence[MotionPiece]) -> list[MotionPiece]:
    """The pieces of a motion run from its end to its start."""
    duration = pieces[-1].end

    def reversed_piece(piece: MotionPiece) -> MotionPiece:
        width = piece.end - piece.start
        return MotionPiece(duration - piece.end, duration - piece.start, lambda u: piece.curve(width - u))

    return [reversed_piece(piece) for piece in reversed(pieces)]


class Program(NamedTuple):
    """Steps of expressions, each after those that it uses.

    Fields:
        steps: names of operations, with the indices of the steps that they use, or with the coefficients of a
            polynomial.
        outputs: indices of the steps of the expressions.
    """

    steps: list[tuple[str, tuple[Any, ...]]]
    outputs: list[int]


def program(expressions: Sequence[Expression]) -> Program:
    """Program of expressions, in which equal steps stand once."""
    steps: dict[tuple[str, tuple[Any, ...]], int] = {}
    numbers: dict[int, int] = {}

    def number(expression: Expression) -> int:
        index = numbers.get(id(expression))
        if index is None:
            operands = expression.coefficients or tuple(number(each) for each in expression.operands)
            index = numbers[id(expression)] = steps.setdefault((expression.operation, operands), len(steps))
        return index

    outputs = [number(each) for each in expressions]
    return Program(list(steps), outputs)
