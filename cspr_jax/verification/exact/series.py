"""Series of balls: functions of time around a time, with bounds of their coefficients that include all rounding.

A motion over a block of time is a power series whose coefficients are balls. Around the exact middle the balls are
tiny; with a ball in place of the middle, coefficient k encloses that of every time within the block, so that the last
one bounds the remainder.
"""

from __future__ import annotations

import bisect
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from fractions import Fraction
from typing import Any, NamedTuple

import flint

from cspr_jax.motion.formulas import MotionPiece, Program, program
from cspr_jax.runtime.exact_arithmetic import LIBRARY_LOCK

ORDER = 3  # coefficients of slacks: value, first derivative, half of the second one
STATES = ORDER + 2  # coefficients of positions, whose second derivatives enter slacks
Series: Any = flint.arb_series


@contextmanager
def precision(bits: int) -> Iterator[None]:
    """Compute with balls of this precision, and with as many coefficients as slacks need; one thread at a time."""
    with LIBRARY_LOCK:
        earlier = flint.ctx.prec, flint.ctx.cap
        flint.ctx.prec, flint.ctx.cap = bits, STATES
        try:
            yield
        finally:
            flint.ctx.prec, flint.ctx.cap = earlier


def ball(number: Fraction | float | int | str) -> flint.arb:
    """Ball around a rational number."""
    value = Fraction(number)
    return flint.arb(flint.fmpq(value.numerator, value.denominator))


def number(value: flint.arb) -> Fraction:
    """Exact rational number of the middle of a ball."""
    mantissa, exponent = value.mid().man_exp()
    return Fraction(int(mantissa)) * Fraction(2) ** int(exponent)


class SeriesState(NamedTuple):
    """Position and orientation with derivatives, as series; lists of 3, of rotations 3 lists of 3.

    Fields:
        time: since the start of the piece, s.
        position: m.
        velocity: m/s.
        acceleration: m/s^2.
        rotation: None for a point mass.
        angular_velocity: fixed axes, rad/s.
        angular_acceleration: rad/s^2.
        piece: index of the piece of the motion.
    """

    time: Any
    position: list[Any]
    velocity: list[Any]
    acceleration: list[Any]
    rotation: Any = None
    angular_velocity: Any = None
    angular_acceleration: Any = None
    piece: int = 0


class SeriesPiece:
    """Piece of a motion that is evaluated as series.

    Args:
        piece: with its formulas.
        index: its number in the motion, from 0 on.
    """

    def __init__(self, piece: MotionPiece, index: int = 0) -> None:
        """Find the program of the piece."""
        self.index = index
        self.start, self.end = piece.start, piece.end
        position, quaternion = piece.components
        self.program: Program = program([*position, *(quaternion or [])])
        self._is_body = quaternion is not None
        self._balls: dict[int, list[tuple[str, Sequence[Any]]]] = {}

    def state(self, middle: flint.arb, radius: flint.arb | None = None) -> SeriesState:
        """State around a time since the start of the piece; with a radius, enclosed for all times within it."""
        outputs = self._outputs(Series([middle, 1]))
        u = Series([middle if radius is None else middle + flint.arb(0, radius.upper()), 1])
        if radius is not None:
            offset = flint.arb_poly([flint.arb(0, radius.upper()), 1])
            outputs = [_narrowed(*pair, offset) for pair in zip(outputs, self._outputs(u), strict=True)]
        position, velocity = outputs[:3], [x.derivative() for x in outputs[:3]]
        acceleration = [x.derivative() for x in velocity]
        if not self._is_body:
            return SeriesState(u, position, velocity, acceleration, piece=self.index)
        return SeriesState(u, position, velocity, acceleration, *turning(outputs[3:]), self.index)

    def _outputs(self, u: Any) -> list[Any]:
        values = run(self._steps(), u, lambda x: Series([x]))
        return [values[i] for i in self.program.outputs]

    def _steps(self) -> list[tuple[str, Sequence[Any]]]:
        # Coefficients become balls once for each precision.
        bits = flint.ctx.prec
        if bits not in self._balls:
            self._balls[bits] = [
                (name, [ball(c) for c in operands] if name == "poly" else operands)
                for name, operands in self.program.steps
            ]
        return self._balls[bits]


def _narrowed(middle: Any, over: Any, offset: Any) -> Any:
    # Balls over a block from the Taylor polynomial in its middle; the last coefficient over the block is the remainder.
    # Coefficients beyond the order of a series read as zero: where the order is too low, nothing is bounded.
    last = STATES - 1
    if min(middle.prec, over.prec) < STATES:
        return _unbounded()
    if not (over[last].is_finite() and all(middle[k].is_finite() for k in range(last))):
        return over
    polynomial = flint.arb_poly([*(middle[k] for k in range(last)), over[last]])
    return Series(polynomial(offset).coeffs(), STATES)


class SeriesPieces:
    """Pieces of a motion, each of which becomes one of series when it is first needed.

    Args:
        formulas: pieces of the motion, in order.
    """

    def __init__(self, formulas: Sequence[MotionPiece]) -> None:
        """Hold the formulas."""
        self.formulas = formulas
        self._pieces: dict[int, SeriesPiece] = {}

    def __getitem__(self, index: int) -> SeriesPiece:
        """The piece of an index."""
        if index not in self._pieces:
            self._pieces[index] = SeriesPiece(self.formulas[index], index)
        return self._pieces[index]

    def at(self, time: Fraction) -> SeriesPiece:
        """The piece in which a time lies."""
        return self[min(bisect.bisect_left(self.formulas, time, key=lambda piece: piece.end), len(self.formulas) - 1)]

    def around(self, time: Fraction) -> list[SeriesPiece]:
        """The pieces that hold a time: two where one ends and the next begins."""
        first = self.at(time)
        later = self.formulas[first.index + 1 : first.index + 2]
        return [first, *(self[first.index + 1] for piece in later if piece.start == time)]

    def __iter__(self) -> Iterator[SeriesPiece]:
        """All pieces."""
        return (self[index] for index in range(len(self.formulas)))


def run(steps: Sequence[tuple[str, Sequence[Any]]], u: Any, constant: Callable[[Any], Any]) -> list[Any]:
    """Values of the steps of a program, in any arithmetic."""
    values: list[Any] = []
    for name, operands in steps:
        if name == "poly":
            value = constant(operands[-1])
            for coefficient in reversed(operands[:-1]):
                value = value * u + coefficient
            values.append(value)
        elif name in BINARY:
            values.append(BINARY[name](values[operands[0]], values[operands[1]]))
        elif name == "sqrt":
            values.append(root(values[operands[0]]))
        else:
            values.append(getattr(values[operands[0]], name)())
    return values


def quotient(x: Any, y: Any) -> Any:
    """Quotient; without bounds where the divisor may be zero."""
    if isinstance(y, Series) and not (y[0] > 0 or y[0] < 0):
        return _unbounded()
    return x / y


def root(x: Any) -> Any:
    """Square root; without bounds where the number may be zero or negative."""
    return x.sqrt() if x[0] > 0 else _unbounded()


def _unbounded() -> Any:
    return Series([flint.arb("nan")] * STATES, STATES)


BINARY: dict[str, Callable[[Any, Any], Any]] = {
    "+": lambda x, y: x + y,
    "-": lambda x, y: x - y,
    "*": lambda x, y: x * y,
    "/": quotient,
}


def dot(left: Sequence[Any], right: Sequence[Any]) -> Any:
    """Scalar product."""
    total = left[0] * right[0]
    for x, y in zip(left[1:], right[1:], strict=True):
        total = total + x * y
    return total


def cross(left: Sequence[Any], right: Sequence[Any]) -> list[Any]:
    """Vector product."""
    (a, b, c), (x, y, z) = left, right
    return [b * z - c * y, c * x - a * z, a * y - b * x]


def times(matrix: Sequence[Sequence[Any]], vector: Sequence[Any]) -> list[Any]:
    """Product of a matrix and a vector."""
    return [dot(row, vector) for row in matrix]


def absolute(x: Any) -> Any:
    """Absolute value; where the sign is not known, without bounds from the second derivative on."""
    value = x[0]
    if value > 0:
        return x
    if value < 0:
        return -x
    rate = abs(x[1])
    return Series([abs(value), rate.union(-rate), flint.arb("nan")], min(x.prec, ORDER))


def turning(quaternion: Sequence[Any]) -> tuple[list[list[Any]], list[Any], list[Any]]:
    """Rotation matrix, angular velocity and acceleration of a quaternion of any norm."""
    w, x, y, z = quaternion
    square = dot(quaternion, quaternion)
    rotation = [
        [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
    ]
    first = [part.derivative() for part in quaternion]
    across = cross(first[1:], [x, y, z])
    velocity = [
        quotient(2 * (first[k + 1] * w - first[0] * part - across[k]), square) for k, part in enumerate((x, y, z))
    ]
    return (
        [[quotient(part, square) for part in row] for row in rotation],
        velocity,
        [part.derivative() for part in velocity],
    )
