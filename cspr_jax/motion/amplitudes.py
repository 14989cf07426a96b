"""Amplitude functions A(tau): how the amplitude of the swing grows from its start to its end.

Each is a piecewise polynomial, so that values and derivatives are exact, a new function is a list of coefficients, and
proofs between samples know the largest value of any derivative.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.errors import InputError
from cspr_jax.errors.suggestions import one_of
from cspr_jax.motion.formulas import Expression, MotionPiece, powers, rational, rationals
from cspr_jax.numerics.elementary import as_float64, polynomial
from cspr_jax.numerics.shapes import Float
from cspr_jax.runtime.persistent_jit import persistent_jit

HIGHEST_DERIVATIVE = 5
NAMES = ("A1", "quintic", "A2", "A3", "effective", "effective-c3", "ideal")
BOUNDARY_TOLERANCE = 1e-9
# Shorter curved ends would need accelerations that no robot has, and lose the digits of A'' to rounding.
SMALLEST_EPSILON = 1e-3
LARGEST_COEFFICIENT = 1e9
# Tables of coefficients have at least this many columns, padded with zeros, so that few shapes have to be compiled.
COLUMNS = 6
# Coefficients below this fraction of the largest one are negligible in the search for stationary points.
NEGLIGIBLE = 1e-100


@dataclasses.dataclass(frozen=True)
class Amplitude:
    """A piecewise polynomial on [0, 1].

    Fields:
        knots: (n_pieces - 1,) values of tau where one piece ends and the next begins, increasing.
        origins: (n_pieces,) values of tau about which each piece is expanded.
        coefficients: (n_pieces, 6 or more) coefficients of the powers of (tau - origin), lowest first.
        largest: (6,) largest |A|, |A'|, ... |A^(5)| over [0, 1], rounded up.
        lowest: () smallest A over [0, 1].
        highest: () largest A over [0, 1].
        name: for people.
    """

    knots: Array
    origins: Array
    coefficients: Array
    largest: Array
    lowest: Array
    highest: Array
    name: str = ""

    def at(self, tau, order: int = 0) -> Float[Array, "..."]:
        """Value of A, or of one of its derivatives with respect to tau."""
        return derivatives(self, jnp.asarray(tau, float), order=order)[order]


# The name is not part of the pytree, so that functions with different names share compiled code.
_FIELDS = [field.name for field in dataclasses.fields(Amplitude)]
jax.tree_util.register_dataclass(Amplitude, _FIELDS[:-1], [], drop_fields=["name"])


@persistent_jit(static_argnames="order")
def derivatives(amplitude: Amplitude, tau: Float[Array, "..."], *, order: int) -> tuple[Float[Array, "..."], ...]:
    """A and its derivatives with respect to tau."""
    table = amplitude.coefficients.astype(tau.dtype)
    origins = amplitude.origins.astype(tau.dtype)
    local = jnp.broadcast_to(origins[0], tau.shape)
    selected = [jnp.broadcast_to(c, tau.shape) for c in table[0]]
    for i in range(1, table.shape[0]):
        later = tau >= amplitude.knots[i - 1].astype(tau.dtype)
        local = jnp.where(later, origins[i], local)
        selected = [jnp.where(later, c, s) for c, s in zip(table[i], selected, strict=True)]
    offset = tau - local
    return tuple(
        polynomial([math.perm(i, j) * selected[i] for i in range(j, len(selected))], offset) for j in range(order + 1)
    )


def local_bounds(
    amplitude: Amplitude, middle: Float[Array, "..."], radius: Float[Array, "..."]
) -> tuple[Float[Array, "..."], ...]:
    """Upper bounds of |A|, |A'|, ..., |A''''| on an interval with no knot inside."""
    values = derivatives(amplitude, middle, order=HIGHEST_DERIVATIVE - 1)
    largest = amplitude.largest.astype(middle.dtype)
    return tuple(jnp.minimum(jnp.abs(v) + radius * largest[j + 1], largest[j]) for j, v in enumerate(values))


def from_pieces(
    name: str, knots: Sequence[float], origins: Sequence[float], pieces: Sequence[Sequence[float]]
) -> Amplitude:
    """Amplitude function from its pieces, with its extreme values computed."""
    table = np.zeros((len(pieces), max(COLUMNS, *(len(piece) for piece in pieces))))
    for coefficients, piece in zip(table, pieces, strict=True):
        coefficients[: len(piece)] = piece
    ends = [0.0, *knots, 1.0]
    extremes = np.zeros((HIGHEST_DERIVATIVE + 1, len(pieces), 2))
    for i, (origin, coefficients) in enumerate(zip(origins, table, strict=True)):
        curve = np.polynomial.Polynomial(coefficients)
        for j in range(HIGHEST_DERIVATIVE + 1):
            extremes[j, i] = _extremes(curve.deriv(j) if j else curve, ends[i] - origin, ends[i + 1] - origin)
    largest = np.abs(extremes).max((1, 2)) * (1.0 + 1e-9)
    return Amplitude(
        as_float64(knots),
        as_float64(origins),
        as_float64(table),
        as_float64(largest),
        as_float64(extremes[0].min()),
        as_float64(extremes[0].max()),
        name,
    )


def _extremes(curve: np.polynomial.Polynomial, start: float, stop: float) -> tuple[float, float]:
    # Root finding divides by the highest coefficient; a negligible one would overflow, and only adds roots far away.
    derivative = curve.deriv().trim(NEGLIGIBLE * float(np.abs(curve.coef).max()))
    stationary = derivative.roots() if derivative.degree() > 0 else np.zeros(0)
    # A double root may come out as a close complex pair: its real part is near enough to evaluate.
    inside = [x.real for x in np.atleast_1d(stationary) if abs(x.imag) < 1e-3 and start < x.real < stop]
    values = curve(np.array([start, stop, *inside]))
    return float(values.min()), float(values.max())


def named(name: str, epsilon: float | None = None) -> Amplitude:
    """One of the amplitude functions of the thesis.

    "A1", "quintic" (also "A2"), "A3": thesis (1.101) and (2.50). "effective": (1.110), a cubic-like
    start, a straight middle, and the start rotated by 180 degrees as end. "effective-c3": the same shape with
    A'' = k tau (epsilon - tau)^2 at the start, so that A''' does not jump inside. "ideal": (1.103), A = tau, with
    A' = 1 at both ends, which serves for bounds.

    Args:
        name: one of `NAMES`.
        epsilon: length of the curved ends of "effective" and "effective-c3", from 0.001 to 0.5.

    Returns:
        the amplitude function.

    Raises:
        InputError: unknown name; epsilon missing, superfluous or out of range.
    """
    polynomials = {
        "A1": (0, 0, 0, 4, -3),
        "quintic": (0, 0, 0, 10, -15, 6),
        "A2": (0, 0, 0, 10, -15, 6),
        "A3": (0, 0, 0, 6, -7, 2),
        "ideal": (0, 1),
    }
    if name in polynomials:
        if epsilon is not None:
            raise InputError("epsilon", epsilon, f'no epsilon with "{name}"')
        return from_pieces(name, (), (0.0,), (polynomials[name],))
    if name not in NAMES:
        raise InputError("name", name, one_of(name, NAMES))
    if epsilon is None or not SMALLEST_EPSILON <= epsilon <= 0.5:
        raise InputError("epsilon", epsilon, f"a number from {SMALLEST_EPSILON} to 0.5")
    return _with_straight_middle(name, epsilon)


def _with_straight_middle(name: str, epsilon: float) -> Amplitude:
    e = epsilon
    start: tuple[float, ...]
    if name == "effective":
        rate = 1.0 / (1.0 - e)  # (1.109)
        start = (0.0, 0.0, 0.0, rate / e**2, -rate / (2 * e**3))  # (1.106)
    else:
        rate = 1.0 / (1.0 - 0.8 * e)
        k = 12.0 * rate / e**4
        start = (0.0, 0.0, 0.0, k * e**2 / 6, -k * e / 6, k / 20)
    at_knot = sum(c * e**i for i, c in enumerate(start))
    # The end is the start rotated by 180 degrees: A(tau) = 1 - start(1 - tau), in powers of tau - 1.
    end = (1.0, *(-c * (-1) ** i for i, c in enumerate(start) if i > 0))
    label = f"{name} (epsilon {e:g})"
    return from_pieces(label, (e, 1.0 - e), (0.0, e, 1.0), (start, (at_knot, rate), end))


def from_polynomial(coefficients: Sequence[float]) -> Amplitude:
    """Amplitude function of a user, c[0] + c[1] tau + c[2] tau^2 + ..."""
    if not 1 <= len(coefficients) <= 20 or not all(abs(c) <= LARGEST_COEFFICIENT for c in coefficients):
        raise InputError("polynomial", list(coefficients), "1 to 20 coefficients of at most 1e9, lowest power first")
    return from_pieces("polynomial", (), (0.0,), (tuple(coefficients),))


class LawPiece(NamedTuple):
    """A piece of an amplitude function, or of another law of normalised time, with rational numbers.

    Fields:
        coefficients: of the powers of tau minus the origin, the constant first.
        origin: tau about which the piece is expanded.
    """

    coefficients: list[Fraction]
    origin: Fraction

    def at(self, tau: Expression, order: int = 0) -> Expression:
        """The law, or one of its derivatives by tau."""
        table = [math.perm(i, order) * c for i, c in enumerate(self.coefficients) if i >= order]
        while len(table) > 1 and not table[-1]:
            table.pop()
        return powers(table, tau - self.origin)


def law_pieces(
    laws: Sequence[Amplitude],
    duration: Any,
    curve: Callable[[Expression, list[LawPiece]], tuple[list[Expression], list[Expression] | None]],
) -> list[MotionPiece]:
    """Pieces of a motion along laws with the same knots; `curve` is a function of normalised time and their pieces."""
    time, knots = rational(duration), [Fraction(0), *rationals(laws[0].knots), Fraction(1)]
    tables = [zip(rationals(law.coefficients), rationals(law.origins), strict=True) for law in laws]
    pieces = []
    for (first, last), *rows in zip(itertools.pairwise(knots), *tables, strict=True):
        each = [LawPiece(*row) for row in rows]

        def of_time(u: Expression, first: Fraction = first, each: list[LawPiece] = each) -> Any:
            return curve(u / time + first, each)

        if first < last:
            pieces.append(MotionPiece(time * first, time * last, of_time))
    return pieces


def boundary_errors(amplitude: Amplitude, *, free_end: bool = False) -> list[str]:
    """The conditions of thesis (2.49) that a function breaks.

    A(0) = 0, A(1) = 1, and A' and A'' are zero at both ends; at a free end A''(1) may have any value.
    """
    first, last = np.asarray(amplitude.coefficients)[[0, -1]]
    errors = []
    for tau, coefficients, origin in ((0, first, amplitude.origins[0]), (1, last, amplitude.origins[-1])):
        curve = np.polynomial.Polynomial(coefficients)
        primes = ("", "'") if free_end and tau == 1 else ("", "'", "''")
        for order, prime in enumerate(primes):
            value = float((curve.deriv(order) if order else curve)(tau - float(origin)))
            target = float(tau if order == 0 else 0)
            if not abs(value - target) <= BOUNDARY_TOLERANCE * float(amplitude.largest[order]):
                errors.append(f"A{prime}({tau}) = {value:g}, must be {target:g}")
    return errors
