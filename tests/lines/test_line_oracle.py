"""The reference for straight lines against closed cases and against what boralugoda-thesis prints."""

import itertools
import math

import numpy as np
import pytest
from oracles import lines as oracle

# The quick tests compare the program with it, and so with each other.
pytestmark = pytest.mark.soak

G = oracle.GRAVITY
SIDES = {"x_max": 45.0, "y_max": 30.0, "z_max": 30.0}
LOAD = {"mass": 10.0, "gravity": G}
STEP = oracle.END - oracle.START
LIFT = np.array([0.0, 0.0, G])
# Of Tables 4.3a and 4.3b, the first four rows.
P_VALUES, DURATIONS = np.arange(1.8, 2.76, 0.05), np.array([2.9, 2.95, 3.0, 3.05])
MAX_A = """
0.3646 0.3449 0.3263 0.3087 0.2920 0.2762 0.2611 0.2469 0.2333 0.2204
0.2081 0.1963 0.1851 0.1744 0.1641 0.1543 0.1449 0.1359 0.1273 0.1190
0.3510 0.3316 0.3133 0.2960 0.2796 0.2641 0.2493 0.2353 0.2219 0.2092
0.1971 0.1856 0.1745 0.1640 0.1539 0.1443 0.1350 0.1262 0.1177 0.1096
0.3378 0.3188 0.3008 0.2838 0.2676 0.2524 0.2378 0.2241 0.2109 0.1984
0.1865 0.1752 0.1643 0.1540 0.1440 0.1346 0.1255 0.1168 0.1084 0.1004
0.3251 0.3064 0.2887 0.2719 0.2561 0.2410 0.2268 0.2132 0.2003 0.1880
0.1763 0.1651 0.1544 0.1443 0.1345 0.1252 0.1162 0.1077 0.0995 0.0916
"""
MAX_B = """
0.81848 0.87695 0.94139 1.01275 1.09217 1.18108 1.28125 1.39496 1.52508 1.67541
1.851 2.05875 2.30829 2.61356 2.99546 3.48683 4.14241 5.06071 6.43878 8.73639
0.74439 0.79677 0.85424 0.91759 0.98774 1.06581 1.15321 1.2517 1.36347 1.49139
1.63917 1.81179 2.01601 2.26132 2.56142 2.93685 3.41989 4.06435 4.96709 6.3218
0.67716 0.72427 0.77577 0.83229 0.89459 0.96356 1.04034 1.12628 1.22312 1.33303
1.45882 1.60414 1.77388 1.9747 2.21592 2.51102 2.88019 3.35518 3.9889 4.87659
0.61594 0.65848 0.70481 0.75547 0.81106 0.87234 0.94018 1.0157 1.10023 1.19548
1.30359 1.42732 1.57025 1.73721 1.93474 2.17201 2.46227 2.82539 3.29259 3.91592
"""


def printed(text):
    return np.array(text.split(), dtype=float).reshape(4, 20)


def inside(rng, base=oracle.BASE):
    """A point inside the footprint and below the base."""
    fraction = rng.dirichlet(np.ones(len(base)))
    return fraction @ base - np.array([0.0, 0.0, rng.uniform(2.0, 28.0)])


def corner_rule(upper, lower):
    """T and p with the corners of the curve on two lines (slope, height): (28) and (29), quadratic in p/T."""
    (a, b), (c, d) = upper, lower
    # 4 = T^2 r (a r/6 + b) and 4 = -T^2 (1 - r) (c (r + 5)/6 + d)
    ratios = np.roots([a / 6 - c / 6, b + c / 6 - 5 * c / 6 - d, 5 * c / 6 + d])
    (ratio,) = ratios[(ratios > 0.0) & (ratios < 1.0)]
    duration = 2.0 / math.sqrt(ratio * (a * ratio / 6 + b))
    return duration, ratio * duration


@pytest.mark.parametrize("seed", range(5))
def test_margin_of_as_many_cables_as_axes_is_that_of_the_only_tensions(seed):
    rng = np.random.default_rng(seed)
    limits = {"tension_min": 3.0, "tension_max": 70.0}
    base, push = oracle.BASE[:3], rng.normal(scale=3.0, size=3)
    position = inside(rng, base)
    rays = base - position
    tensions = 10.0 * np.linalg.solve(rays.T, push + LIFT) * np.linalg.norm(rays, axis=1)
    expected = min(tensions.min() - 3.0, 70.0 - tensions.max())
    found = oracle.tension_margin(base, position, push, **LOAD, **limits)
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-9)

    flat, level = oracle.BASE[:2], np.array([position[0], 0.0, position[2]])
    rays = (flat - level)[:, [0, 2]]
    tensions = 10.0 * np.linalg.solve(rays.T, push[[0, 2]] + LIFT[[0, 2]]) * np.linalg.norm(rays, axis=1)
    for columns in ([0, 1, 2], [0, 2]):
        along = push * [1, 0, 1]
        found = oracle.tension_margin(
            flat[:, columns], level[columns], along[columns], planar=True, tension_min=3.0, **LOAD
        )
        assert found == pytest.approx(tensions.min() - 3.0, rel=1e-9, abs=1e-9)


def test_path_limits_are_the_printed_lines():
    s = np.linspace(0.0, 1.0, 11)
    lower, upper = oracle.path_limits(oracle.BASE, oracle.START, oracle.END, s, **LOAD)
    rows = [[-G * 8 / 104, -G * 20 / 104], [-G * 14 / 498, G * 44 / 498], [-G * 8 / 224, G * 10 / 224]]
    rows.append([-G * 14 / 318, -G / 318])
    expected = [[-0.755, -1.887], [-0.276, 0.867], [-0.350, 0.438], [-0.432, -0.031]]
    assert np.array_equal(np.round(rows, 3), expected)
    below, above1, above2, least = (np.polyval(row, s) for row in rows)
    assert np.allclose(upper, np.minimum(above1, above2), rtol=1e-10)
    assert np.allclose(lower, np.maximum(below, least), rtol=1e-10)
    for line, row in zip(oracle.case_lines(), (rows[3], rows[2]), strict=True):
        assert np.allclose(line.c, row, rtol=1e-10)
    braked = oracle.path_limits(oracle.BASE, oracle.START, oracle.END, s, max_acceleration=5.0, **LOAD)
    most = 5.0 / np.linalg.norm(STEP)
    assert np.allclose(braked, np.clip([lower, upper], -most, most), rtol=1e-10)


@pytest.mark.parametrize(("p", "duration"), [(2.5, 10.0), (2.2396, 4.3769), (0.9, 1.0)])
def test_s_curve_is_tables_3_2_and_3_3(p, duration):
    at, big = np.array([0.0, p / 2, p, (duration + p) / 2, duration]), duration
    table = [[0, 0, 0], [p / 6 / big, 1 / big, 4 / big / p], [p / big, 2 / big, 0]]
    table += [[p / 6 / big + 5 / 6, 1 / big, -4 / big / (big - p)], [1, 0, 0]]
    assert np.allclose(np.transpose(oracle.s_curve(at, p, duration)), table, atol=1e-14)

    t = np.linspace(0.0, duration, 1001)
    rest, late = big - p, 3 * big * (big - p) ** 2
    conditions = [t < p / 2, t < p, t < (big + p) / 2]
    s = [
        4 * t**3 / (3 * big * p**2),
        p / 6 / big + (p**3 - 12 * p**2 * t + 24 * p * t**2 - 8 * t**3) / (6 * big * p**2),
    ]
    s.append(p / big - 2 * (p - t) * (3 * big**2 - 6 * big * p + p**2 + 4 * p * t - 2 * t**2) / late)
    last = -(big**3) - 6 * big**2 * p + 12 * big**2 * t + 3 * big * p**2 - 12 * big * t**2 + 4 * t**3
    speed = [4 * t**2 / big / p**2, 1 / big - (3 * p - 2 * t) * (p - 2 * t) / big / p**2]
    speed.append(2 / big - 4 * (p - t) ** 2 / big / rest**2)
    second_derivative = [8 * t / big / p**2, 8 * (p - t) / big / p**2, 8 * (p - t) / big / rest**2]
    expected = [
        np.select(conditions, s, last / late),
        np.select(conditions, speed, 4 * (big - t) ** 2 / big / rest**2),
        np.select(conditions, second_derivative, -8 * (big - t) / big / rest**2),
    ]
    assert np.allclose(oracle.s_curve(t, p, duration), expected, atol=1e-11)


def test_least_duration_of_the_test_case():
    lower, upper = oracle.case_lines()
    duration, p = oracle.least_duration_of_s_curve(lower, upper)
    assert (round(duration, 4), round(p, 4)) == (4.3769, 2.2396)
    assert (duration, p) == pytest.approx(corner_rule(upper.c, lower.c), rel=1e-9)
    assert (duration, p) == pytest.approx((4.37688606, 2.23955703), rel=2e-9)
    braked = 10.0 / np.linalg.norm(STEP)
    limited = oracle.least_duration_of_s_curve(
        lambda s: np.maximum(lower(s), -braked), lambda s: np.minimum(upper(s), braked)
    )
    assert limited == pytest.approx((duration, p), rel=1e-12)


def test_least_time_of_the_test_case():
    lower, upper = oracle.case_lines()
    (a, b), (c, d) = -upper.c, -lower.c
    # v^2 = -2 b s - a s^2 up, (c (1 - s^2) + 2 d (1 - s)) down: an arc cosine each, meeting where both are one.
    (switch,) = (root.real for root in np.roots([a - c, 2 * b - 2 * d, c + 2 * d]) if 0.0 < root.real < 1.0)
    up = math.acos(1.0 + a * switch / b) / math.sqrt(a)
    down = math.acos(1.0 - c * (1.0 - switch) / (c + d)) / math.sqrt(c)
    found = oracle.least_time(lower, upper)
    assert found == pytest.approx(up + down, rel=1e-9)
    assert found == pytest.approx(3.10085856, abs=5e-9)
    most = 10.0 / np.linalg.norm(STEP)
    limited = oracle.least_time(lambda s: np.maximum(lower(s), -most), lambda s: np.minimum(upper(s), most))
    assert limited == found


def test_tension_couples_are_those_of_tensions():
    rng = np.random.default_rng(3)
    for _ in range(10):
        position, push = inside(rng), rng.normal(scale=2.0, size=3)
        rays = oracle.BASE - position
        forces = rays * (np.linalg.lstsq(rays.T, 10.0 * (push + LIFT), rcond=None)[0])[:, None]
        across = [forces[[0, 1]].sum(0), forces[[1, 2]].sum(0), forces[[2, 3]].sum(0), forces[[3, 0]].sum(0)]
        # In the plane across their side each pair pulls towards that side; upwards is a tension.
        expected = [np.hypot(v[1 - i % 2], v[2]) * np.sign(v[2]) for i, v in enumerate(across)]
        found = oracle.tension_couples(position, push, **SIDES, **LOAD)
        assert np.allclose(found, expected, rtol=1e-9)
        assert abs(oracle.couples_mismatch(found, position, **SIDES)) < 1e-12 * np.abs(found).max()
        x, _, z = position
        lift, depth = push[2] + G, 30.0 - z
        printed_31 = 10.0 * (lift * x + push[0] * depth) / (30.0 * depth) * np.hypot(45.0 - x, depth)
        assert found[1] == pytest.approx(printed_31 * 30.0 / 45.0)
        wrong = np.array([found[0], printed_31, *found[2:]])
        assert abs(oracle.couples_mismatch(wrong, position, **SIDES)) > 1e-3


def test_table_4_3_to_the_last_digit():
    for max_acceleration, after_p in itertools.product((None, oracle.MAX_ACCELERATION), (True, False)):
        above, below = oracle.table_4_3(
            P_VALUES, DURATIONS, max_acceleration=max_acceleration, after_p=after_p, samples=101
        )
        assert np.abs(np.round(above, 4) - printed(MAX_A)).max() < 1e-9
        assert np.abs(np.round(below, 5) - printed(MAX_B)).max() < 1e-9
    above, below = oracle.table_4_3(P_VALUES, DURATIONS, decimals=None, samples=101)
    assert np.sum(np.abs(np.round(above, 4) - printed(MAX_A)) > 1e-9) == 2
    assert np.sum(np.abs(np.round(below, 5) - printed(MAX_B)) > 1e-9) == 43


def test_whole_table_4_3_allows_one_pair():
    durations = np.arange(2.9, 4.41, 0.05)
    above, below = oracle.table_4_3(P_VALUES, durations, samples=101)
    ((row, column),) = np.argwhere((above < 0.0) & (below < 0.0))
    assert (durations[row], P_VALUES[column]) == pytest.approx((4.4, 2.25))
    stated = np.isclose(durations, 4.35)
    assert above[stated, column] == pytest.approx(0.00094, abs=5e-6)
    # Over all t Max_b stays above its value at t = 0.
    other = oracle.table_4_3(P_VALUES, durations, samples=101, after_p=False)[1]
    assert np.array_equal(other, np.maximum(below, oracle.case_lines(5)[0](0.0)))
    assert np.sum(below < other) == 15
