"""Exact values of motions: rational functions of time, their extremes, and what limits allow, for tests of decisions.

Written from Newton's and Euler's equations alone. A spline is a list of pieces whose components are polynomials with
rational coefficients, so that at a rational time each squared quantity is a rational number. Of point masses on as many
cables as degrees of freedom the squares are quotients of products of polynomials in time, and their extremes lie at
real roots of one polynomial. Of platforms, of redundant cables and of other families extremes are found by samples and
the golden section, at rational times or in balls of 300 bits.

All is in the axes of the kernels: from the centroid of the spools, z down.
"""

import dataclasses
import functools
import itertools
import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import flint
import numpy as np
from flint import arb, arb_poly, arb_series, fmpq, fmpq_mat, fmpq_poly, fmpz_poly

ROOT_BITS = 400
BALL_BITS = 300
# Times of the golden section are multiples of this.
GRID = 1 << 140
# Brackets shrink to this share of their piece: an extreme with a slope of zero is known to its square.
BRACKET = fmpq(1, 1 << 80)
# A corner, at which two facets meet, needs the full width.
CORNER_BRACKET = fmpq(1, 1 << 130)
GOLDEN = fmpq(1836311903, 2971215073)
ALLOWANCE = 1e-8
# Terms of series of which the rest is below the width of balls: at 0.1, and at 4 half turns.
ARCSINE_TERMS, COSINE_TERMS = 100, 80
LIMIT_OF = {
    "tension": "tension_max",
    "least tension": "tension_min",
    "length": "cable_length_max",
    "cable speed": "cable_speed_max",
    "cable acceleration": "cable_acceleration_max",
    "speed": "speed_max",
    "acceleration": "acceleration_max",
    "depth": "floor",
}
FLAG_OF = {
    "tension": "over_tension",
    "least tension": "slack_cable",
    "length": "cable_too_long",
    "cable speed": "cable_too_fast",
    "cable acceleration": "cable_over_acceleration",
    "speed": "too_fast",
    "acceleration": "over_acceleration",
    "depth": "below_floor",
}
OF_EACH_CABLE = ("tension", "least tension", "length", "cable speed", "cable acceleration")


def rational(number) -> fmpq:
    """The rational number that a floating-point number or a fraction is."""
    exact = Fraction(number) if isinstance(number, Fraction | int) else Fraction(float(number))
    return fmpq(exact.numerator, exact.denominator)


def rationals(array) -> list:
    """Rational numbers of an array, as nested lists."""
    array = np.asarray(array, float)
    return [rationals(row) for row in array] if array.ndim else rational(array)


def dot(a, b):
    """Scalar product."""
    return sum((x * y for x, y in zip(a[1:], b[1:], strict=True)), a[0] * b[0])


def cross(a, b):
    """Vector product."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def minus(a, b):
    """Difference of vectors."""
    return [x - y for x, y in zip(a, b, strict=True)]


def power(x, exponent: int):
    """Integer power by products, which keep a ball about zero finite."""
    total = functools.reduce(lambda a, b: a * b, [x] * abs(exponent))
    return total if exponent > 0 else 1 / total


def plus(*vectors):
    """Sum of vectors."""
    return [sum(rest, first) for first, *rest in zip(*vectors, strict=True)]


def times(factor, vector):
    """A vector times a number."""
    return [factor * x for x in vector]


@dataclasses.dataclass(frozen=True)
class Piece:
    """A polynomial piece of a motion.

    Fields:
        start: time at which it starts, s.
        width: duration, s.
        position: (3) polynomials of the time since its start, m.
        quaternion: (4) polynomials, of any norm; None for a point mass.
    """

    start: fmpq
    width: fmpq
    position: list
    quaternion: list | None


def pieces_of(spline) -> list[Piece]:
    """Pieces of a spline of the package, whose tables hold Bernstein coefficients."""
    knots = rationals(spline.knots)
    pieces = []
    for i, (start, end) in enumerate(itertools.pairwise(knots)):
        fraction = fmpq_poly([0, 1 / (end - start)])

        def polynomials(table, i=i, fraction=fraction):
            degree = table.shape[1] - 1
            basis = [math.comb(degree, k) * fraction**k * (1 - fraction) ** (degree - k) for k in range(degree + 1)]
            columns = zip(*rationals(table[i]), strict=True)
            return [sum((c * b for c, b in zip(column, basis, strict=True)), fmpq_poly()) for column in columns]

        quaternion = None if spline.quaternion is None else polynomials(np.asarray(spline.quaternion))
        pieces.append(Piece(start, end - start, polynomials(np.asarray(spline.position)), quaternion))
    return pieces


@dataclasses.dataclass(frozen=True)
class Robot:
    """Numbers of a robot as rational numbers; of a platform also attachment points and inertia in its own axes."""

    base: list
    mass: fmpq
    gravity: fmpq
    dof: int
    platform: list | None
    inertia: list | None


def robot_of(robot) -> Robot:
    """The robot of a plan's problem."""
    body = getattr(robot, "platform_points", None)
    inertia = None if body is None else rationals(robot.inertia)
    body = None if body is None else rationals(body)
    return Robot(rationals(robot.base_points), *rationals([robot.mass, robot.gravity]), int(robot.dof), body, inertia)


# What limits allow.


def floor_allowance(base_points) -> float:
    """What a floor allows, m."""
    return ALLOWANCE * float(np.linalg.norm(np.asarray(base_points, float), axis=1).max())


def threshold(limit: float, quantity: str, allowance: float | None = None) -> fmpq:
    """Value at which a limit just counts as kept: the limit and its allowance, each as the number that it is."""
    limit = float(limit)
    allowance = ALLOWANCE * limit if allowance is None else allowance
    return rational(limit) + (-1 if quantity == "least tension" else 1) * rational(allowance)


def keeps(square, limit: float, quantity: str, allowance: float | None = None) -> bool:
    """Whether a squared extreme keeps a limit; of a depth it is the depth itself.

    Raises:
        ValueError: it is as near as the ball of the extreme is wide.
    """
    allowed = threshold(limit, quantity, allowance)
    allowed = allowed if quantity == "depth" else allowed**2
    with flint.ctx.workprec(ROOT_BITS):
        difference = square - allowed if isinstance(square, fmpq) else square - arb(allowed)
        if quantity == "least tension":
            difference = -difference
        if difference <= 0:
            return True
        if difference > 0:
            return False
    raise ValueError("the extreme is not known well enough")


def near_limits(square, quantity: str, shares, allowance: float | None = None) -> list[float]:
    """Limits whose thresholds lie beside an extreme by shares of it, and the nearest numbers on both sides."""
    with flint.ctx.workprec(ROOT_BITS):
        value = float(arb(square) if quantity == "depth" else arb(square).sqrt())

    def limit_at(allowed):
        if allowance is not None:
            return allowed - allowance
        return allowed / (1.0 - ALLOWANCE if quantity == "least tension" else 1.0 + ALLOWANCE)

    floats = [limit_at(value)]
    for _ in range(4):
        floats = [np.nextafter(floats[0], -np.inf), *floats, np.nextafter(floats[-1], np.inf)]
    kept = [keeps(square, limit, quantity, allowance) for limit in floats]
    change = next(i for i in range(len(floats) - 1) if kept[i] != kept[i + 1])
    return [limit_at(value * (1.0 + share)) for share in shares] + [float(floats[change]), float(floats[change + 1])]


# Point masses on as many cables as degrees of freedom: products of powers of polynomials.


def power_product(robot: Robot, position, quantity: str, cable: int) -> list[tuple[Any, int]]:
    """Square of a quantity along a polynomial piece, as factors and their exponents; of a depth the depth itself."""
    velocity = [p.derivative() for p in position]
    acceleration = [p.derivative() for p in velocity]
    if quantity == "depth":
        return [(position[2], 1)]
    if quantity == "speed":
        return [(dot(velocity, velocity), 1)]
    if quantity == "acceleration":
        return [(dot(acceleration, acceleration), 1)]
    rays = [[fmpq_poly([x]) - p for x, p in zip(spool, position, strict=True)] for spool in robot.base]
    square = dot(rays[cable], rays[cable])
    if quantity == "length":
        return [(square, 1)]
    approach = dot(rays[cable], velocity)
    if quantity == "cable speed":
        return [(approach, 2), (square, -1)]
    if quantity == "cable acceleration":
        return [((dot(velocity, velocity) - dot(rays[cable], acceleration)) * square - approach**2, 2), (square, -3)]
    carried = times(robot.mass, [*acceleration[:2], acceleration[2] - robot.gravity])
    upper, lower = balance_determinants(robot.dof, rays, carried, cable)
    return [(upper, 2), (square, 1), (lower, -2)]


def balance_determinants(dof: int, rays, carried, cable: int):
    """Numerator and denominator of Cramer's rule for the tension over the length of a cable."""
    if dof == 1:
        return carried[2], rays[0][2]
    if dof == 2:
        other = rays[1 - cable]

        def area(a, b):
            return a[0] * b[2] - a[2] * b[0]

        return area(carried, other), area(rays[cable], other)
    first, second = rays[(cable + 1) % 3], rays[(cable + 2) % 3]
    normal = cross(first, second)
    return dot(carried, normal), dot(rays[cable], normal)


@dataclasses.dataclass(frozen=True)
class Extreme:
    """Square of an extreme (of a depth the depth itself), a ball or a rational number, and its time, s."""

    square: Any
    time: Any

    def value(self, quantity: str) -> float:
        """The extreme as the nearest floating-point number."""
        with flint.ctx.workprec(ROOT_BITS):
            return float(arb(self.square) if quantity == "depth" else arb(self.square).sqrt())

    def seconds(self) -> float:
        """Its time as a floating-point number."""
        with flint.ctx.workprec(ROOT_BITS):
            return float(arb(self.time))


def _value(factors, u):
    # A factor that is zero at the end of a piece is zero there exactly: rational times give rational numbers.
    total = u * 0 + 1
    for polynomial, exponent in factors:
        value = polynomial(u) if isinstance(u, fmpq) else arb_poly(polynomial)(u)
        total = total * power(value, exponent)
    return total if isinstance(total, arb) else arb(total)


def _stationary(factors, width):
    # Real roots of the numerator of the logarithmic derivative within the piece.
    numerator = fmpq_poly()
    for i, (polynomial, exponent) in enumerate(factors):
        others = [p for j, (p, _) in enumerate(factors) if j != i]
        numerator += exponent * functools.reduce(lambda a, b: a * b, others, polynomial.derivative())
    if numerator.degree() < 1:
        return []
    whole = fmpz_poly([int(c) for c in (numerator * numerator.denom()).coeffs()])
    roots = [root for factor, _ in whole.factor_squarefree()[1] for root, _ in factor.complex_roots()]
    real = [root.real for root in roots if root.imag.contains(0)]
    return [root for root in real if root >= 0 and root <= arb(width)]


def polynomial_extreme(robot: Robot, pieces: list[Piece], quantity: str, cable: int = 0) -> Extreme:
    """Extreme along a spline, by roots, of a point mass on as many cables as degrees of freedom.

    It is the smallest of "least tension", else the largest.
    """
    found = None
    with flint.ctx.workprec(ROOT_BITS):
        for piece in pieces:
            factors = power_product(robot, piece.position, quantity, cable)
            for u in [fmpq(0), piece.width, *_stationary(factors, piece.width)]:
                square = _value(factors, u)
                is_better = found is None or (
                    square < found.square if quantity == "least tension" else square > found.square
                )
                if is_better:
                    found = Extreme(square, arb(piece.start) + u)
    return found


# States at single times: rational along splines, balls along other families.


@dataclasses.dataclass(frozen=True)
class State:
    """Position, velocity, acceleration, and of a platform rotation, angular velocity and angular acceleration."""

    position: list
    velocity: list
    acceleration: list
    rotation: list | None = None
    omega: list | None = None
    alpha: list | None = None


def product(a, b):
    """Product of two quaternions, scalar first."""
    u, v = a[1:], b[1:]
    return [a[0] * b[0] - dot(u, v), *plus(times(a[0], v), times(b[0], u), cross(u, v))]


def rotation_of(quaternion, first, second):
    """Rotation matrix, angular velocity and acceleration of a quaternion of any norm and its derivatives."""
    w, x, y, z = quaternion
    norm = dot(quaternion, quaternion)
    matrix = [
        [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
    ]
    conjugate = [w, -x, -y, -z]
    omega = times(2 / norm, product(first, conjugate)[1:])
    growth = 2 * dot(quaternion, first) / norm
    alpha = minus(times(2 / norm, product(second, conjugate)[1:]), times(growth, omega))
    return [[entry / norm for entry in row] for row in matrix], omega, alpha


def piece_state(piece: Piece, u: fmpq) -> State:
    """State at a rational time after the start of a piece."""

    def jet(polynomials):
        first = [p.derivative() for p in polynomials]
        return [[p(u) for p in row] for row in (polynomials, first, [p.derivative() for p in first])]

    position = jet(piece.position)
    return State(*position) if piece.quaternion is None else State(*position, *rotation_of(*jet(piece.quaternion)))


def applied(matrix, vector):
    """A matrix times a vector."""
    return [dot(row, vector) for row in matrix]


def attachments(robot: Robot, state: State):
    """Position, velocity and acceleration of the point at which each cable is attached, and its arm."""
    for i in range(len(robot.base)):
        if robot.platform is None:
            yield state.position, state.velocity, state.acceleration, None
            continue
        arm = applied(state.rotation, robot.platform[i])
        turning = cross(state.omega, arm)
        yield (
            plus(state.position, arm),
            plus(state.velocity, turning),
            plus(state.acceleration, cross(state.alpha, arm), cross(state.omega, turning)),
            arm,
        )


def wrench(robot: Robot, state: State):
    """Force and moment about the mass centre that the cables must supply; of a point mass the force."""
    force = times(robot.mass, [*state.acceleration[:2], state.acceleration[2] - robot.gravity])
    if robot.platform is None:
        return force
    turned = list(zip(*state.rotation, strict=True))

    def inertia(vector):
        return applied(state.rotation, applied(robot.inertia, applied(turned, vector)))

    return force + plus(inertia(state.alpha), cross(state.omega, inertia(state.omega)))


def signed_square(robot: Robot, state: State, quantity: str, cable: int = 0):
    """Square of a quantity at one time, with the quantity's sign; of a depth the depth itself."""
    if quantity == "depth":
        points = [] if robot.platform is None else [a[0][2] for a in attachments(robot, state)]
        return functools.reduce(lambda a, b: b if b > a else a, points, state.position[2])
    if quantity in ("speed", "acceleration"):
        vector = state.velocity if quantity == "speed" else state.acceleration
        return dot(vector, vector)
    points = list(attachments(robot, state))
    rays = [minus(spool, point[0]) for spool, point in zip(robot.base, points, strict=True)]
    ray, (_, velocity, acceleration, _) = rays[cable], points[cable]
    square, approach = dot(ray, ray), dot(ray, velocity)
    if quantity == "length":
        return square
    if quantity == "cable speed":
        return power(approach, 2) / square
    if quantity == "cable acceleration":
        upper = (dot(velocity, velocity) - dot(ray, acceleration)) * square - power(approach, 2)
        return power(upper, 2) / power(square, 3)
    if robot.platform is None:
        upper, lower = balance_determinants(robot.dof, rays, wrench(robot, state), cable)
        density = upper / lower
    else:
        columns = [ray + cross(point[3], ray) for ray, point in zip(rays, points, strict=True)]
        density = _solved(columns, wrench(robot, state))[cable]
    return density * abs(density) * square


def _solved(columns, right):
    size = len(right)
    rows = [[columns[j][i] for j in range(size)] for i in range(size)]
    if isinstance(right[0], fmpq):
        solution = fmpq_mat(rows).solve(fmpq_mat([[x] for x in right]))
    else:
        solution = flint.arb_mat(rows).solve(flint.arb_mat([[x] for x in right]))
    return [solution[i, 0] for i in range(size)]


# Extremes by the golden section.


def on_grid(u: fmpq) -> fmpq:
    """A nearby time with few digits."""
    return fmpq(int((u * GRID).floor()), GRID)


def golden_maximum(function: Callable[[fmpq], Any], low: fmpq, high: fmpq, bracket: fmpq):
    """Time and value of the largest value of a function with one maximum between two times."""

    def both():
        inner = [on_grid(high - GOLDEN * (high - low)), on_grid(low + GOLDEN * (high - low))]
        return inner, [function(u) for u in inner]

    inner, values = both()
    while high - low > bracket:
        if values[0] > values[1]:
            high, inner[1], values[1] = inner[1], inner[0], values[0]
            inner[0] = on_grid(high - GOLDEN * (high - low))
            values[0] = function(inner[0])
        else:
            low, inner[0], values[0] = inner[0], inner[1], values[1]
            inner[1] = on_grid(low + GOLDEN * (high - low))
            values[1] = function(inner[1])
        # Errors of the ratio grow from step to step.
        if not fmpq(1, 10) < (inner[1] - inner[0]) / (high - low) < fmpq(2, 5):
            inner, values = both()
    best = 0 if values[0] > values[1] else 1
    return inner[best], values[best]


def largest_value(functions: list[Callable[[fmpq], Any]], widths: list[fmpq], count: int, bracket: fmpq):
    """Number of the piece, time and value of the largest value of functions over [0, width] each.

    Local maxima of samples are refined if a parabola through their neighbours could reach above the best sample.
    """
    samples, peaks, best = [], [], None
    for piece, (function, width) in enumerate(zip(functions, widths, strict=True)):
        samples.append([on_grid(width * i / count) for i in range(count)] + [width])
        values = [function(u) for u in samples[piece]]
        for i, value in enumerate(values):
            left, right = values[max(i - 1, 0)], values[min(i + 1, count)]
            if not (value < left or value < right):
                peaks.append((piece, i, value + value - (left if left < right else right)))
            if best is None or value > best[2]:
                best = (piece, samples[piece][i], value)
    for piece, i, reach in peaks:
        if not reach < best[2]:
            ends = samples[piece][max(i - 1, 0)], samples[piece][min(i + 1, count)]
            u, value = golden_maximum(functions[piece], *ends, bracket * widths[piece])
            best = (piece, u, value) if value > best[2] else best
    return best


def rational_extreme(robot: Robot, pieces: list[Piece], quantity: str, cable: int = 0, count: int = 48) -> Extreme:
    """Extreme of a quantity along a spline, at rational times: the smallest of "least tension", else the largest."""
    sign = -1 if quantity == "least tension" else 1

    def function(piece):
        return lambda u: sign * signed_square(robot, piece_state(piece, u), quantity, cable)

    index, u, square = largest_value([function(p) for p in pieces], [p.width for p in pieces], count, BRACKET)
    return Extreme(sign * square, pieces[index].start + u)


# Redundant point masses.


def needed_tension_max(robot: Robot, state: State, least: fmpq | int = 0) -> arb:
    """Smallest limit M of all tensions for which tensions between `least` and M supply the force, in space.

    Forces that tensions between both supply are the sum of segments along the rays, a body whose facets have normals
    that are products of two rays; the force lies within each facet.
    """
    rays = [minus([arb(x) for x in spool], state.position) for spool in robot.base]
    units = [times(1 / dot(ray, ray).sqrt(), ray) for ray in rays]
    force = wrench(robot, state)
    needed = arb(least)
    for i in range(len(units)):
        for j in range(i):
            for normal in (cross(units[i], units[j]), cross(units[j], units[i])):
                along = [dot(normal, unit) for k, unit in enumerate(units) if k not in (i, j)]
                reach = sum((x for x in along if x > 0), arb(0))
                missing = dot(normal, force) - sum((x * least for x in along if not x > 0), arb(0))
                if reach > 0:
                    value = missing / reach
                    needed = value if value > needed else needed
                elif missing > 0:
                    raise ValueError("no tensions supply the force")
    return needed


def redundant_extreme(robot: Robot, pieces: list[Piece], least: fmpq | int = 0, count: int = 48) -> Extreme:
    """Largest `needed_tension_max` along a spline, squared."""

    def function(piece):
        def value(u):
            exact = piece_state(piece, u)
            balls = [[arb(x) for x in vector] for vector in (exact.position, exact.velocity, exact.acceleration)]
            return needed_tension_max(robot, State(*balls), least)

        return value

    with flint.ctx.workprec(BALL_BITS):
        index, u, value = largest_value([function(p) for p in pieces], [p.width for p in pieces], count, CORNER_BRACKET)
        return Extreme(value * value, pieces[index].start + u)


# Other families, by the formulas of docs/theory; what a motion object holds counts as the rational numbers that it is.


@dataclasses.dataclass(frozen=True)
class Formula:
    """A part of a motion between knots of its law.

    Fields:
        start: time at which it starts, s.
        width: duration, s.
        position: position (3) as power series in time from time after the start of the motion, as a power series.
        quaternion: likewise a unit quaternion (4); None for a point mass.
    """

    start: fmpq
    width: fmpq
    position: Callable
    quaternion: Callable | None = None

    def state(self, u: fmpq) -> State:
        """State at a time after its start, in balls of the precision that is set."""
        cap, flint.ctx.cap = flint.ctx.cap, 3
        try:
            time = arb_series([arb(self.start + u), 1])
            position = _derivatives(self.position(time))
            if self.quaternion is None:
                return State(*position)
            return State(*position, *rotation_of(*_derivatives(self.quaternion(time))))
        finally:
            flint.ctx.cap = cap


def _derivatives(series):
    series = [arb_series(x) for x in series]
    return [[math.factorial(k) * x[k] for x in series] for k in range(3)]


def law_polynomials(law) -> list:
    """Pieces of an amplitude function: first and last normalised time, origin, coefficients, lowest first."""
    knots = [fmpq(0), *rationals(law.knots), fmpq(1)]
    rows = zip(knots[:-1], knots[1:], rationals(law.origins), rationals(law.coefficients), strict=True)
    return [row for row in rows if row[1] > row[0]]


def horner(coefficients, x):
    """Value of a polynomial."""
    total = x * 0
    for coefficient in reversed(coefficients):
        total = total * x + arb(coefficient)
    return total


def formulas_of(motion) -> list[Formula]:
    """Formulas of a motion of the package that is no spline."""
    motion = getattr(motion, "motion", motion) if type(motion).__name__ == "Placed" else motion
    kind = type(motion).__name__
    if kind == "Backwards":
        inner = formulas_of(motion.motion)
        full = inner[-1].start + inner[-1].width

        def reverse(formula):
            curves = [
                curve and (lambda t, curve=curve: curve(arb(full) - t))
                for curve in (formula.position, formula.quaternion)
            ]
            return Formula(full - formula.start - formula.width, formula.width, *curves)

        return [reverse(formula) for formula in reversed(inner)]
    duration = rational(motion.duration())
    if kind == "Bezier":
        return [Formula(fmpq(0), duration, functools.partial(bezier_position, motion, duration))]
    law, *functions = {
        "EllipseMotion": ("law", ellipse_position),
        "Hypocycloid": ("amplitude", swing_position),
        "TimedLine": ("law", line_position),
        "PlatformMotion": ("amplitude", platform_position, platform_quaternion),
    }[kind]
    formulas = []
    for i, (first, last, *_) in enumerate(law_polynomials(getattr(motion, law))):
        curves = [functools.partial(function, motion, duration, i) for function in functions]
        formulas.append(Formula(first * duration, (last - first) * duration, *curves))
    return formulas


def _law(law, index: int, tau, order: int = 0):
    _, _, origin, coefficients = law_polynomials(law)[index]
    for _ in range(order):
        coefficients = [k * c for k, c in enumerate(coefficients)][1:]
    return horner(coefficients, tau - arb(origin))


def bezier_position(motion, duration: fmpq, t):
    """Bezier curve of the second order at s = (1 - cos(pi t / T)) / 2."""
    s = (1 - (t / arb(duration)).cos_pi()) / 2
    points = zip(*(rationals(x) for x in (motion.start, motion.middle, motion.end)), strict=True)
    return [arb(a) * (1 - s) * (1 - s) + 2 * arb(b) * s * (1 - s) + arb(c) * s * s for a, b, c in points]


def line_position(motion, duration: fmpq, index: int, t):
    """Straight line by the law s(t / T)."""
    s = _law(motion.law, index, t / arb(duration))
    rows = zip(rationals(motion.start), rationals(motion.direction), strict=True)
    return [arb(a) + s * arb(d) for a, d in rows]


def ellipse_position(motion, duration: fmpq, index: int, t):
    """C + a cos(theta) + b sin(theta), all of which go along the law from those of the first ellipse to the last."""
    s = _law(motion.law, index, t / arb(duration))
    progress = _law(motion.progress, index, t / arb(duration))
    start, end = (arb(x) for x in rationals(motion.frequencies))
    angle = arb(rational(motion.phase)) + start * t + (end - start) * arb(duration) * progress
    factors = (1, angle.cos(), angle.sin())
    columns = [rationals(x) for ellipse in (motion.first, motion.last) for x in ellipse]
    position = []
    for axis in range(3):
        first, last = [column[axis] for column in columns[:3]], [column[axis] for column in columns[3:]]
        mixed = [arb(a) + s * arb(b - a) for a, b in zip(first, last, strict=True)]
        position.append(dot(mixed, factors))
    return position


def swing_position(motion, duration: fmpq, index: int, t, is_variable: bool = False):
    """Precessing ellipse: r (C e_r + nu S e_t), C and S of the phase p pi tau, the axes turned by delta tau.

    Of variable amplitude, thesis (3.44), it has the part -r' S / (p pi) e_r as well.
    """
    segment, tau = motion.segment, t / arb(duration)
    arcs, sense = arb(rational(motion.arcs)), arb(rational(segment.sense))
    first, last = (arb(rational(x)) for x in (segment.start_radius, segment.end_radius))
    precession = arb(rational(segment.precession))
    r = first + (last - first) * _law(motion.amplitude, index, tau)
    phase, turn = tau * (sense * arcs), tau * (sense * precession)
    along, across = r * phase.cos_pi(), r * phase.sin_pi() * (precession / arcs)
    if is_variable:
        slope = (last - first) * _law(motion.amplitude, index, tau, 1)
        along = along - slope * phase.sin_pi() / (sense * arcs * arb.pi())
    x = turn.cos_pi() * along + turn.sin_pi() * across
    y = turn.cos_pi() * across - turn.sin_pi() * along
    rows = zip(rationals(segment.center), rationals(segment.plane), strict=True)
    return [arb(c) + arb(q1) * x + arb(q2) * y for c, (q1, q2) in rows]


def platform_position(motion, duration: fmpq, index: int, t):
    """Swing of the mass centre of a platform."""
    return swing_position(motion, duration, index, t, motion.kind.variable)


def platform_quaternion(motion, duration: fmpq, index: int, t):
    """Oscillating SLERP, thesis (3.58) to (3.65): exp(beta u), u half of the rotation vector of the envelope."""
    slerp, tau = motion.segment.slerp, t / arb(duration)
    angle = arb(rational(slerp.angle)) * _law(motion.amplitude, index, tau)
    cosine, sine = angle.cos(), angle.sin()
    rows = zip(rationals(slerp.start), rationals(slerp.across), strict=True)
    vector = half_rotation_vector([arb(a) * cosine + arb(b) * sine for a, b in rows])
    return exponential(times(rotation_law(motion, tau), vector))


def rotation_law(motion, tau):
    """beta_ff of the thesis (3.93), where beta'' at the ends is beta-hat (p pi)^2 (1 - nu^2); or beta_1 (3.66)."""
    slerp, arcs = motion.segment.slerp, rational(motion.arcs)
    once, thrice = (tau * arb(arcs)).cos_pi(), (tau * arb(3 * arcs)).cos_pi()
    if motion.kind.plain:
        return once
    fraction = 1 - (rational(motion.segment.precession) / arcs) ** 2
    first, last = (rational(x) * fraction for x in (slerp.start_beta_hat, slerp.end_beta_hat))
    bend = arb(first) + arb(last - first) * tau
    return ((9 + bend) * once - (1 + bend) * thrice) / 8


def half_rotation_vector(quaternion):
    """Half of the rotation vector of a quaternion of any norm with a scalar part that is not negative."""
    scalar, vector = quaternion[0], quaternion[1:]
    norm, size = dot(quaternion, quaternion), dot(vector, vector)
    square = size / norm
    if square[0] < 0.1:  # by the series of arcsin, which is regular at zero, to more digits than balls have
        ratio = horner(_series_balls("arcsine", flint.ctx.prec), square)
        return times(ratio / norm.sqrt(), vector)
    size = size.sqrt()
    return times(2 * (size / (norm.sqrt() + scalar)).atan() / size, vector)


def exponential(vector):
    """Unit quaternion of half of a rotation vector, by series, to more digits than balls have."""
    square = -dot(vector, vector)
    cosine, ratio = (horner(_series_balls(name, flint.ctx.prec), square) for name in ("cosine", "sine"))
    return [cosine, *times(ratio, vector)]


@functools.cache
def _series_balls(name: str, _: int) -> list[arb]:
    # Coefficients of arcsin(x) / x by x^2, and of cos(x) and sin(x) / x by -x^2, in balls of the precision that is set.
    if name == "arcsine":
        return [arb(fmpq(math.comb(2 * k, k), 4**k * (2 * k + 1))) for k in range(ARCSINE_TERMS)]
    return [1 / arb(math.factorial(2 * k + (name == "sine"))) for k in range(COSINE_TERMS)]


def formula_extreme(robot: Robot, formulas: list[Formula], quantity: str, cable: int = 0, count: int = 200) -> Extreme:
    """Extreme of a quantity along formulas: the smallest of "least tension", else the largest."""
    sign = -1 if quantity == "least tension" else 1

    def function(formula):
        return lambda u: sign * signed_square(robot, formula.state(u), quantity, cable)

    with flint.ctx.workprec(BALL_BITS):
        index, u, square = largest_value([function(f) for f in formulas], [f.width for f in formulas], count, BRACKET)
        return Extreme(sign * square, arb(formulas[index].start + u))
