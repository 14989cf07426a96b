"""Motions that touch a limit exactly: a cable that just loses its tension is slack, a limit that is reached is kept."""

import math
from fractions import Fraction

import numpy as np
import pytest
from oracles import exact_motions as oracle
from scipy.interpolate import BPoly

import cspr_jax
from exact import cases

BASE = [[1.0, 0.0, 0.0], [-0.5, 0.75, 0.0], [-0.5, -0.75, 0.0]]
# Tension 0 of a level motion at DEPTH vanishes where q = x + x'' DEPTH / GRAVITY is on the line of the other spools.
DEPTH, GRAVITY, EDGE = 2.0, 8.0, Fraction(-1, 2)
SMALL = Fraction(1, 1 << 40)
THOROUGH = pytest.mark.thorough


def bernstein(powers, width):
    """Bernstein coefficients on [0, width] of a polynomial, which floating-point numbers hold exactly."""
    scaled = [Fraction(c) * Fraction(width) ** j for j, c in enumerate(powers)]
    degree = len(scaled) - 1
    shares = [[Fraction(math.comb(k, j), math.comb(degree, j)) for j in range(k + 1)] for k in range(degree + 1)]
    rows = [sum(a * b for a, b in zip(row, scaled, strict=False)) for row in shares]
    assert all(Fraction(float(row)) == row for row in rows)
    return [float(row) for row in rows]


def derivative(powers):
    """Derivative of a polynomial, lowest power first."""
    return [j * c for j, c in enumerate(powers)][1:] or [Fraction(0)]


def add(*polynomials):
    """Sum of polynomials."""
    count = max(map(len, polynomials))
    return [sum(p[j] for p in polynomials if j < len(p)) for j in range(count)]


def times(*polynomials):
    """Product of polynomials; numbers are polynomials of degree 0."""
    product = [Fraction(1)]
    for factor in polynomials:
        factor = factor if isinstance(factor, list) else [Fraction(factor)]
        rows = [Fraction(0)] * (len(product) + len(factor) - 1)
        for i, a in enumerate(product):
            for j, b in enumerate(factor):
                rows[i + j] += a * b
        product = rows
    return product


def curve(columns, width):
    """Curve of SciPy of one piece, from polynomials of x, y and z."""
    degree = max(len(column) for column in columns)
    padded = [[*column, *[Fraction(0)] * (degree - len(column))] for column in columns]
    table = np.array([bernstein(column, width) for column in padded]).T
    return BPoly(table[:, None, :], [0.0, float(width)])


def level_motion(q, width, y=(Fraction(0),)):
    """Level motion for which q is a given polynomial: x = q - q'' c + q'''' c^2 - ..., c = DEPTH / GRAVITY."""
    ratio, term, x, sign = Fraction(DEPTH) / Fraction(GRAVITY), list(q), list(q), -1
    while len(term) > 2:
        term = times(ratio, derivative(derivative(term)))
        x = add(x, times(sign, term))
        sign = -sign
    return curve([x, list(y), [Fraction(DEPTH)]], width)


@pytest.fixture(scope="module")
def robot():
    return cspr_jax.point_mass(BASE, mass=1.0, gravity=GRAVITY)


def check_slack(check, times_of_touch, cables=(0,)):
    """Infeasible since a cable is slack, at one of some times."""
    assert check.verdict == "slack_cable"
    cause = check.cause[0]
    assert cause["criterion"] == "slack_cable"
    assert cause["cable"] in cables
    assert min(abs(cause["t"] - t) for t in times_of_touch) < 1e-6
    assert abs(cause["needed"]) < 1e-9


# Above the edge by a multiple of a square: its zeros are the times of touch.
SQUARES = {
    "one time": ([-1, 1], 2, [1.0]),
    "an irrational time": ([-2, 0, 1], 2, [math.sqrt(2.0)]),
    "two times": (times([-1, 1], [-3, 1]), 4, [1.0, 3.0]),
    "two irrational times": ([1, -4, 1], 4, [2.0 - math.sqrt(3.0), 2.0 + math.sqrt(3.0)]),
}


def above_edge(root, shift=0):
    """Polynomial q that touches the edge where a polynomial is zero; threes make Bernstein coefficients short."""
    square = times(Fraction(3, 64), [Fraction(c) for c in root], [Fraction(c) for c in root])
    return add(square, [EDGE + shift])


@pytest.mark.quick("two irrational times")
@pytest.mark.parametrize("name", SQUARES)
def test_a_cable_just_loses_its_tension(robot, name):
    root, width, touches = SQUARES[name]
    check_slack(cspr_jax.check(robot, level_motion(above_edge(root), width)), touches)
    assert cspr_jax.check(robot, level_motion(above_edge(root, SMALL), width)).verdict == "feasible"
    check_slack(cspr_jax.check(robot, level_motion(above_edge(root, -SMALL), width)), touches)


@pytest.mark.quick("end")
@pytest.mark.parametrize("reverse", [False, True], ids=["end", "start"])
def test_a_tension_vanishes_at_an_end(robot, reverse):
    """Linearly, at the last or the first time alone."""
    falling = [Fraction(1, 4), Fraction(-1, 8)]
    q = times(Fraction(1, 8), [Fraction(0), Fraction(1)]) if reverse else falling
    touch = 0.0 if reverse else 2.0
    check_slack(cspr_jax.check(robot, level_motion(add(q, [EDGE]), 2)), [touch])
    assert cspr_jax.check(robot, level_motion(add(q, [EDGE + SMALL]), 2)).verdict == "feasible"
    check_slack(cspr_jax.check(robot, level_motion(add(q, [EDGE - SMALL]), 2)), [touch])


@THOROUGH
def test_all_tensions_vanish_at_one_time():
    """Free fall at one time: z'' = g - 36 (t - 1)^2."""
    heavy = cspr_jax.point_mass(BASE, mass=1.0, gravity=24.0)

    def fall(shift):
        second = add([Fraction(24) + shift], times(-36, [-1, 1], [-1, 1]))
        z = [Fraction(3), Fraction(0)] + [c / ((j + 1) * (j + 2)) for j, c in enumerate(second)]
        return cspr_jax.check(heavy, curve([[Fraction(0)], [Fraction(0)], z], 2))

    check_slack(fall(0), [1.0], range(3))
    assert fall(-3 * SMALL).verdict == "feasible"
    check_slack(fall(3 * SMALL), [1.0], range(3))


@THOROUGH
def test_no_tension_over_an_interval(robot):
    """Free fall throughout, and a motion along the line of two spools."""
    fall = [Fraction(1), Fraction(0), Fraction(GRAVITY) / 2]
    check = cspr_jax.check(robot, curve([[Fraction(0)], [Fraction(0)], fall], 1))
    assert check.verdict == "slack_cable"
    along = cspr_jax.check(robot, level_motion([EDGE], 2, y=(Fraction(-1, 4), Fraction(1, 4))))
    assert along.verdict == "slack_cable"
    assert along.cause[0]["cable"] == 0


def test_no_tension_over_one_piece_of_several():
    """Accelerations 0, g, g, 0 at the knots: tensions vanish over the middle piece, and nowhere else."""
    heavy, width, g = cspr_jax.point_mass(BASE, mass=1.0, gravity=24.0), Fraction(1, 2), Fraction(24)
    rows, z, v = [], Fraction(1), Fraction(0)
    for first, last in ((Fraction(0), g), (g, g), (g, Fraction(0))):
        powers = [z, v, first / 2, (last - first) / (6 * width)]
        rows.append(bernstein(powers, width))
        z, v = sum(c * width**j for j, c in enumerate(powers)), v + width * (first + last) / 2
    table = np.zeros((4, 3, 3))
    table[:, :, 2] = np.array(rows).T
    check = cspr_jax.check(heavy, BPoly(table, [0.0, 0.5, 1.0, 1.5]))
    (motion,) = check.plan.legs[0].motions
    assert oracle.pieces_of(motion)[1].position[2].derivative().derivative() == oracle.fmpq_poly([24])
    assert check.verdict == "slack_cable"
    assert 0.5 - 1e-6 <= check.cause[0]["t"] <= 1.0 + 1e-6


# Exactly reached limits. Sums of two numbers of different size are what no single floating-point number holds.


def allowance(limit: float) -> float:
    """What a limit allows in addition."""
    return oracle.ALLOWANCE * limit


def check_touched(robot, motion, name: str, limit: float, flag: str):
    """A limit is reached exactly: it is kept, and one that is lower by its last digit is not."""
    assert cspr_jax.check(robot, motion, limits={name: limit}).verdict == "feasible"
    assert cspr_jax.check(robot, motion, limits={name: float(np.nextafter(limit, 0.0))}).verdict == flag


def guide():
    return cspr_jax.point_mass([[0.0, 0.0, 0.0]], mass=1.0, gravity=10.0, pattern="1T")


def vertical(coefficients, width):
    """Curve on the guide by its Bernstein coefficients."""
    table = np.zeros((len(coefficients), 1, 3))
    table[:, 0, 2] = coefficients
    return BPoly(table, [0.0, width])


def level(x, width):
    """Level curve along x by its Bernstein coefficients."""
    table = np.zeros((len(x), 1, 3))
    table[:, 0, 0], table[:, 0, 2] = x, DEPTH
    return BPoly(table, [0.0, width])


def test_a_speed_is_reached(robot):
    """In the middle, by 3 (b2 - b1) / (2 width), and throughout."""
    limit = 0.125
    low = -allowance(limit)
    check_touched(robot, level([low, low, limit, limit], 1.5), "speed_max", limit, "too_fast")
    check_touched(robot, level([low, limit], 1.0), "speed_max", limit, "too_fast")


@THOROUGH
def test_a_length_is_reached():
    """In the middle, by (b0 + 4 b1 + 6 b2 + 4 b3 + b4) / 16."""
    limit = 2.0
    inner = 2.0 * allowance(limit)
    check_touched(guide(), vertical([1.0, inner, 5.0, inner, 1.0], 8.0), "cable_length_max", limit, "cable_too_long")


@THOROUGH
@pytest.mark.parametrize("reverse", [False, True], ids=["start", "end"])
def test_a_speed_is_reached_at_an_end(robot, reverse):
    """By (b1 - b0) 2 / width."""
    limit = 0.125
    x = [-allowance(limit), limit, limit]
    check_touched(robot, level(x[::-1] if reverse else x, 2.0), "speed_max", limit, "too_fast")


@THOROUGH
def test_a_tension_is_reached_at_the_start():
    """Where z'' = 6 (b2 - 2 b1 + b0) / width^2 = gravity - tension."""
    limit = 10.5625  # its allowance is a multiple of three of its last digits
    middle, low = (1.0 + (limit - 10.0) * 2.0 / 3.0) / 2.0, -allowance(limit) * 2.0 / 3.0
    exact = Fraction(3, 2) * (Fraction(low) - 2 * Fraction(middle) + 1)
    assert 10 - exact == Fraction(limit) + Fraction(allowance(limit))
    check_touched(guide(), vertical([1.0, middle, low, 1.0], 2.0), "tension_max", limit, "over_tension")


@THOROUGH
@pytest.mark.parametrize("quantity", ["tension", "least tension", "length"])
def test_rest_at_a_limit(quantity):
    """At rest every value is constant; limits are the nearest numbers on both sides."""
    robot = cspr_jax.point_mass(BASE, mass=1.3, gravity=9.81)
    case = cases.Case(robot, {"times": [0.0, 1.0, 2.0], "positions": [[0.1, 0.05, 1.3]] * 3, "interpolation": "cubic"})
    kernel, pieces = cases.exact_form(case)
    extreme = oracle.polynomial_extreme(kernel, pieces, quantity, 1)
    assert not any(cases.wrong_verdicts(case, quantity, 1, extreme, (1e-9, 1e-14, -1e-14)))


# An ellipse along x about a centre at z = 2: q = x (1 - w^2 z / g).


@THOROUGH
@pytest.mark.parametrize(
    ("share", "verdict"), [(0, "slack_cable"), (2.0**-45, "slack_cable"), (-(2.0**-45), "feasible")]
)
def test_a_cable_just_loses_its_tension_on_a_line(share, verdict):
    robot = cspr_jax.point_mass(BASE, mass=1.0, gravity=10.0)
    size = 0.625 * (1.0 + share)
    motion = cspr_jax.ellipse(robot, [0.0, 0.0, 2.0], [size, 0.0, 0.0], [0.0, 0.0, 0.0], frequency=1.0)
    check = cspr_jax.check(robot, motion)
    assert check.verdict == verdict
    if verdict == "slack_cable":
        check_slack(check, [math.pi])
