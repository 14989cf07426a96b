"""Functions of time as Taylor series whose coefficients are balls, at an instant or for all instants of a part."""

from collections.abc import Callable, Sequence
from operator import add, mul, sub
from typing import Any

from flint import arb, arb_poly, arb_series

ORDER = 6  # coefficients of positions; those of accelerations are two less


class Undefined(ArithmeticError):
    """A function is not defined on all of a part, as far as balls show."""


def term(series: Any, k: int = 0) -> Any:
    """Return a coefficient; raises Undefined if it is not known, as by a lower ctx.cap of another thread."""
    if not 0 <= k < series.prec:  # flint returns zero
        raise Undefined("the order of a series is too low")
    return series[k]


def apply(name: str, series: Any) -> Any:
    """Apply a function of arb_series; raises Undefined where it may have no derivatives, as x / x has none at 0."""
    ball = term(series)
    if not {"inv": ball.abs_lower() > 0, "sqrt": ball > 0, "acos": abs(ball) < 1}.get(name, ball.is_finite()):
        raise Undefined("a division by zero, or a root or an arc cosine of a number outside its range")
    return getattr(series, name)()


def angle(x: Any, y: Any) -> Any:
    """Return the angle of the vector (x, y), in ]-pi, pi]; it may not cross the end of that range."""
    rate = (x * y.derivative() - y * x.derivative()) * apply("inv", x * x + y * y)
    return rate.integral() + arb.atan2(term(y), term(x))


def run(program: list[list[Any]], time: Any, radius: Any) -> list[Any]:
    """Return the functions of all steps, at times from the start of the piece, s; raises Undefined."""
    steps: list[Any] = []
    for name, *operands in program:
        if name == "poly":  # shifted before a ball is put in: powers of a ball alone would be too wide
            middle = arb_poly(operands[0])(arb_poly([time, 1]))
            steps.append(arb_series(middle(arb_poly([arb(0, radius), 1])).coeffs(), ORDER))
        elif name in BINARY:
            steps.append(BINARY[name](*(steps[k] for k in operands)))
        else:
            steps.append(apply(name, steps[operands[0]]))
    return steps


BINARY: dict[str, Callable[..., Any]] = {"+": add, "-": sub, "*": mul, "/": lambda a, b: a * apply("inv", b)}


def tight(middle: Any, over: Any, radius: Any) -> Any:
    """Return narrower balls for all instants of a part: the Taylor polynomial at its middle with remainder, shifted."""
    last = over.prec - 1
    polynomial = arb_poly([term(middle, k) for k in range(last)] + [term(over, last)])
    return arb_series(polynomial(arb_poly([arb(0, radius), 1])).coeffs(), last + 1)


def dot(first: Sequence[Any], second: Sequence[Any]) -> Any:
    """Return the scalar product of two vectors of series or numbers."""
    terms = [a * b for a, b in zip(first, second, strict=True)]
    return sum(terms[1:], terms[0])


def cross(a: Sequence[Any], b: Sequence[Any]) -> list[Any]:
    """Return the vector product."""
    return [a[k - 2] * b[k - 1] - a[k - 1] * b[k - 2] for k in range(3)]


def plus(first: Sequence[Any], second: Sequence[Any], factor: Any = 1) -> list[Any]:
    """Return the first vector plus a factor times the second."""
    return [a + b * factor for a, b in zip(first, second, strict=True)]
