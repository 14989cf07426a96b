"""Signs of slacks where balls leave them open since a limit is met exactly: roots of polynomials, in rational numbers.

On a piece without functions but those of one angle that grows evenly, position and orientation are rational functions:
of the time, or of the tangent of half the angle. With r_k the rays, D the determinant of the balance in the scaled
tensions f_k / |r_k|, and N_k that of Cramer's rule, a limit on a tension, length, speed or acceleration is the sign of
a polynomial, such as (limit D)^2 - N_k^2 |r_k|^2. Real roots of such a polynomial are isolated without error, so that
touching is told from crossing.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import cached_property
from typing import Any, NamedTuple

import flint
import numpy as np

from cspr_jax.motion.formulas import MotionPiece, program
from cspr_jax.motion.problem import Problem
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.point_mass import plane_normal
from cspr_jax.schema.limits import LIMITS
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.verification.criteria import Criterion
from cspr_jax.verification.exact.facets import determinant
from cspr_jax.verification.exact.kinematics import StateBalance
from cspr_jax.verification.exact.series import BINARY, SeriesState, dot, run, turning

Vector = list[Any]
LARGEST_ANGLE = 1  # rad; half of a larger one may come near the pole of its tangent
ROOT_BITS = 400  # precision of the ends of intervals, and of roots that are compared with them


class NotAlgebraicError(Exception):
    """A piece, or a criterion, has no form in rational functions."""


def rational(value: Fraction | float) -> flint.fmpq:
    """A rational number of the library."""
    fraction = Fraction(value)
    return flint.fmpq(fraction.numerator, fraction.denominator)


class RationalFunction:
    """Quotient of two polynomials of a variable, with a derivative by time.

    Args:
        numerator: polynomial of the variable, exact.
        denominator: likewise, not zero.
        rate: polynomial, how fast the variable grows with time in s.
    """

    __slots__ = ("denominator", "numerator", "rate")

    def __init__(self, numerator: flint.fmpq_poly, denominator: flint.fmpq_poly, rate: flint.fmpq_poly) -> None:
        """Hold both polynomials."""
        self.numerator, self.denominator, self.rate = numerator, denominator, rate

    def _with(self, numerator: Any, denominator: Any) -> "RationalFunction":
        return RationalFunction(numerator, denominator, self.rate)

    def _other(self, value: Any) -> "RationalFunction":
        if isinstance(value, RationalFunction):
            return value
        return self._with(flint.fmpq_poly([value if isinstance(value, flint.fmpq) else rational(value)]), ONE)

    def __add__(self, value: Any) -> "RationalFunction":
        """Sum."""
        other = self._other(value)
        if self.denominator == other.denominator:
            return self._with(self.numerator + other.numerator, self.denominator)
        top = self.numerator * other.denominator + other.numerator * self.denominator
        return self._with(top, self.denominator * other.denominator)

    def __mul__(self, value: Any) -> "RationalFunction":
        """Product."""
        other = self._other(value)
        return self._with(self.numerator * other.numerator, self.denominator * other.denominator)

    def __truediv__(self, value: Any) -> "RationalFunction":
        """Quotient."""
        other = self._other(value)
        return self._with(self.numerator * other.denominator, self.denominator * other.numerator)

    def __neg__(self) -> "RationalFunction":
        """Negative."""
        return self._with(-self.numerator, self.denominator)

    def __sub__(self, value: Any) -> "RationalFunction":
        """Difference."""
        return self + -self._other(value)

    def __rsub__(self, value: Any) -> "RationalFunction":
        """Difference of a number and the function."""
        return -self + value

    __radd__ = __add__
    __rmul__ = __mul__

    def derivative(self) -> "RationalFunction":
        """Derivative by time."""
        top = self.numerator.derivative() * self.denominator - self.numerator * self.denominator.derivative()
        return self._with(top * self.rate, self.denominator * self.denominator)

    @property
    def sign_polynomial(self) -> flint.fmpq_poly:
        """Polynomial with the sign of the function."""
        return self.numerator * self.denominator


ONE = flint.fmpq_poly([1])
VARIABLE = flint.fmpq_poly([0, 1])


class AlgebraicPiece(NamedTuple):
    """Piece of a motion in rational functions.

    Fields:
        outputs: position, and quaternion of a body.
        variable: function from the time since the start of the piece to a ball of the variable, which it grows with.
        time: the inverse.
        rate: how fast the angle grows whose half has the variable as tangent, rad/s; 0: the variable is the time.
    """

    outputs: list[RationalFunction]
    variable: Callable[[Fraction], flint.arb]
    time: Callable[[flint.arb], flint.arb]
    rate: Fraction = Fraction(0)


def algebraic_piece(piece: MotionPiece, middle: Fraction) -> AlgebraicPiece:
    """A piece in rational functions, near a time since its start.

    Raises:
        NotAlgebraicError: the piece has other functions.
    """
    position, quaternion = piece.components
    steps, outputs = program([*position, *(quaternion or [])])
    angle = _angle(steps)
    if angle is None:
        time = RationalFunction(VARIABLE, ONE, ONE)
        values = run(steps, time, lambda c: time * 0 + c)
        return AlgebraicPiece([values[i] for i in outputs], _ball, lambda value: value)
    # Near half a turn the tangent has a pole: go by half a turn.
    start, rate = angle
    turns = round((float(start) + float(rate) * float(middle)) / np.pi)
    square = VARIABLE * VARIABLE
    of_time = RationalFunction(VARIABLE, ONE, (ONE + square) * (rational(rate) / 2))
    sign = -1 if turns % 2 else 1
    cosine = RationalFunction((ONE - square) * sign, ONE + square, of_time.rate)
    sine = RationalFunction(VARIABLE * (2 * sign), ONE + square, of_time.rate)
    values = [of_time * 0] * len(steps)
    for i, (name, operands) in enumerate(steps):
        if name in ("cos", "sin"):
            values[i] = cosine if name == "cos" else sine
        elif name == "poly":
            values[i] = of_time * 0 + operands[0]
        else:
            values[i] = BINARY[name](*(values[k] for k in operands))

    half_turns = flint.arb.pi() * turns

    def variable(time: Fraction) -> flint.arb:
        return ((_ball(start + rate * time) - half_turns) / 2).tan()

    def when(value: flint.arb) -> flint.arb:
        return (2 * value.atan() + half_turns - _ball(start)) / _ball(rate)

    return AlgebraicPiece([values[i] for i in outputs], variable, when, rate)


def _angle(steps: Any) -> tuple[Fraction, Fraction] | None:
    # Start and rate of the one angle of sines and cosines; None without any.
    names = {name for name, _ in steps} - {"poly", "+", "-", "*", "/"}
    if not names:
        return None
    arguments = {operands[0] for name, operands in steps if name in ("sin", "cos")}
    angles = {k for k, (name, operands) in enumerate(steps) if name == "poly" and len(operands) > 1}
    if names - {"sin", "cos"} or len(arguments) != 1 or angles - arguments:
        raise NotAlgebraicError
    name, operands = steps[arguments.pop()]
    if name != "poly" or len(operands) != 2:
        raise NotAlgebraicError
    return Fraction(operands[0]), Fraction(operands[1])


def _ball(value: Fraction) -> flint.arb:
    return flint.arb(rational(value))


class _Body(StateBalance):
    # Balance of a robot on a piece, with rays from the effector to the spools in place of unit vectors.
    def __init__(self, robot: AnyRobot, outputs: list[RationalFunction]) -> None:
        position, velocity = outputs[:3], [x.derivative() for x in outputs[:3]]
        parts = position[0] * 0, position, velocity, [x.derivative() for x in velocity]
        super().__init__(robot, SeriesState(*parts, *(turning(outputs[3:]) if outputs[3:] else ())), rational)

    @cached_property
    def rays(self) -> list[Vector]:
        """Vectors from the attachment points to the spools."""
        spools = self.numbers(self.robot.base_points)
        return [[b - x for b, x in zip(*ends, strict=True)] for ends in zip(spools, self.points, strict=True)]

    @cached_property
    def columns(self) -> list[Vector]:
        """Columns of the balance in tensions over lengths."""
        return self.columns_along(self.rays)

    def square(self, k: int) -> RationalFunction:
        """Square of the length of a cable."""
        return dot(self.rays[k], self.rays[k])

    def scaled_tension(self, k: int) -> tuple[RationalFunction, RationalFunction]:
        """Numerator and determinant of the tension of a cable over its length."""
        replaced = [self.wrench if i == k else column for i, column in enumerate(self.columns)]
        return determinant(replaced), determinant(self.columns)

    def rate_squared(self, k: int) -> RationalFunction:
        """Square of the speed of a cable."""
        along = dot(self.rays[k], self.state.velocity)
        return along * along / self.square(k)

    def acceleration_squared(self, k: int) -> RationalFunction:
        """Square of the acceleration of a cable of a point mass."""
        ray, velocity, square = self.rays[k], self.state.velocity, self.square(k)
        along = dot(ray, velocity)
        value = (dot(velocity, velocity) - dot(ray, self.state.acceleration)) * square - along * along
        return value * value / (square * square * square)


def sign_function(problem: Problem, row: Criterion, piece: AlgebraicPiece) -> tuple[list[RationalFunction], bool]:
    """Functions none of which is negative while a criterion is met, and whether none may be zero either.

    Raises:
        NotAlgebraicError: the criterion has no such form.
    """
    robot, k = problem.robot, row.cables[0] if row.cables else 0
    if robot.pulleys is not None:
        raise NotAlgebraicError
    body, is_body = _Body(robot, piece.outputs), isinstance(robot, PlatformRobot)
    limit = rational(row.allowed) + rational(row.allowance) * (1 if row.sense == "most" else -1)
    quantity = next((each.quantity for each in LIMITS if each.flag == row.flag), None)
    if row.flag in (Verdict.SLACK_CABLE, Verdict.OVER_TENSION):
        top, bottom = body.scaled_tension(k)
        signs, square = top * bottom, top * top * body.square(k)
        if row.flag == Verdict.OVER_TENSION:
            return [bottom * bottom * (limit * limit) - square], False
        is_strict = limit == 0
        return [signs] if is_strict else [signs, square - bottom * bottom * (limit * limit)], is_strict
    if row.flag == Verdict.ABOVE_SPOOLS:
        return [dot(body.numbers(plane_normal(robot)), body.state.position)], True
    if quantity == "depth" and not is_body:
        return [limit - body.state.position[2]], False
    squares: dict[str | None, Callable[[], RationalFunction]] = {
        "length": lambda: body.square(k),
        "mass_centre_speed": lambda: dot(body.state.velocity, body.state.velocity),
        "mass_centre_acceleration": lambda: dot(body.state.acceleration, body.state.acceleration),
    }
    if not is_body:
        squares |= {"speed": lambda: body.rate_squared(k), "acceleration": lambda: body.acceleration_squared(k)}
    if quantity not in squares:
        raise NotAlgebraicError
    return [limit * limit - squares[quantity]()], False


class Sign(NamedTuple):
    """Decision whether a criterion is met within an interval, with a time at which it fails.

    Fields:
        is_met: whether it is met throughout; None: not known.
        time: value of the variable, or time since the start of the piece, at which it fails; 0 if it does not.
    """

    is_met: bool | None
    time: flint.arb = flint.arb(0)


def decided_sign(problem: Problem, row: Criterion, piece: MotionPiece, interval: tuple[Fraction, Fraction]) -> Sign:
    """Sign of the slack of a criterion within an interval of time since the start of a piece; when it fails, in s."""
    first, last = interval
    middle = (first + last) / 2
    try:
        algebraic = algebraic_piece(piece, middle)
        if abs(algebraic.rate) * (last - first) > LARGEST_ANGLE:
            halves = (decided_sign(problem, row, piece, half) for half in ((first, middle), (middle, last)))
            return next((sign for sign in halves if not sign.is_met), Sign(True))
        functions, is_strict = sign_function(problem, row, algebraic)
    except NotAlgebraicError:
        return Sign(None)
    ends = sorted((algebraic.variable(first), algebraic.variable(last)), key=lambda x: float(x.mid()))
    exact_ends = () if algebraic.rate else (rational(first), rational(last))
    signs = [sign_within(each, *ends, is_strict=is_strict, exact_ends=exact_ends) for each in functions]
    failed = next((sign for sign in signs if sign.is_met is False), None)
    if failed is not None:
        return Sign(False, algebraic.time(failed.time))
    return Sign(True if all(sign.is_met for sign in signs) else None)


def sign_within(
    function: RationalFunction,
    first: flint.arb,
    last: flint.arb,
    *,
    is_strict: bool,
    exact_ends: Sequence[flint.fmpq] = (),
) -> Sign:
    """Sign of a function between two values of its variable, which may be known exactly."""
    polynomial = function.sign_polynomial
    if polynomial.is_zero():
        return Sign(not is_strict, first)
    rest, at_ends = polynomial, []
    for end in exact_ends:
        factor = VARIABLE - end
        while rest(end) == 0:
            rest, at_ends = rest // factor, [flint.arb(end)]
    if is_strict and at_ends:
        return Sign(False, at_ends[0])
    roots = [root for factor, _ in rest.numer().factor_squarefree()[1] for root in _real_roots(factor)]
    if any(not (root >= first or root < first) or not (root <= last or root > last) for root in roots):
        return Sign(None)  # at an end, within the precision
    roots = sorted((root for root in roots if root >= first and root <= last), key=lambda root: root.mid())
    if is_strict and roots:
        return Sign(False, roots[0])
    edges = [first, *roots, last]
    middles = [((before + after) / 2).mid() for before, after in itertools.pairwise(edges)]
    return _of_samples(polynomial, middles)


def _of_samples(polynomial: flint.fmpq_poly, values: Sequence[flint.arb]) -> Sign:
    # Sign of a polynomial from its signs between roots.
    signs: list[Any] = [flint.arb_poly(polynomial)(value) for value in values]
    failed = next((value for value, sign in zip(values, signs, strict=True) if sign < 0), None)
    if failed is not None:
        return Sign(False, failed)
    return Sign(True if all(sign > 0 for sign in signs) else None)


def _real_roots(factor: Any) -> list[flint.arb]:
    return [value.real for value, _ in factor.complex_roots() if value.imag == 0]
