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


def cone_planes(position):
    """(3)-(6): normals of the sides of the cone of accelerations over a rectangle, inwards."""
    x, y, z = position
    depth = SIDES["z_max"] - z
    rows = np.array([[0, depth / y, 1], [depth / (x - 45), 0, 1], [0, depth / (y - 30), 1], [depth / x, 0, 1]])
    return rows / np.linalg.norm(rows, axis=1)[:, None]


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


@pytest.mark.parametrize("seed", range(5))
def test_margin_of_four_cables_is_the_best_along_the_null_space(seed):
    rng = np.random.default_rng(seed)
    position, push = inside(rng), rng.normal(scale=4.0, size=3)
    rays = oracle.BASE - position
    units = (rays / np.linalg.norm(rays, axis=1)[:, None]).T
    some = np.linalg.lstsq(units, 10.0 * (push + LIFT), rcond=None)[0]
    null = np.linalg.svd(units)[2][-1]
    for most in (60.0, np.inf):
        # Lines in the place along the null space; their lower envelope is highest where two of them cross.
        heights, slopes = np.append(some - 2.0, most - some), np.append(null, -null)
        heights, slopes = heights[np.isfinite(heights)], slopes[np.isfinite(heights)]
        pairs = [pair for pair in itertools.combinations(range(len(slopes)), 2) if np.prod(slopes[list(pair)]) < 0.0]
        places = [(heights[j] - heights[i]) / (slopes[i] - slopes[j]) for i, j in pairs]
        expected = max((heights + slopes * place).min() for place in places)
        found = oracle.tension_margin(oracle.BASE, position, push, tension_min=2.0, tension_max=most, **LOAD)
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_margin_of_cables_in_one_plane():
    beside = [20.0, 10.0, 30.0]
    assert oracle.tension_margin(oracle.BASE, beside, [0, 0, 0], **LOAD) == -np.inf
    free_fall = oracle.tension_margin(oracle.BASE, beside, [1, 0, -G], **LOAD)
    assert free_fall == pytest.approx(oracle.CAP * 10.0 * G)
    assert oracle.tension_margin(oracle.BASE, [22.5, 15, 30], -LIFT, tension_max=50.0, **LOAD) == pytest.approx(25.0)
    assert not oracle.can_be_held(oracle.BASE, beside, [0, 0, 0], gravity=G)


def test_what_can_be_held_has_a_margin_and_a_distance_and_lies_in_the_cone():
    rng = np.random.default_rng(0)
    seen = set()
    for _ in range(60):
        position, push = inside(rng), rng.normal(scale=6.0, size=3)
        held = oracle.can_be_held(oracle.BASE, position, push, gravity=G)
        seen.add(held)
        margin = oracle.tension_margin(oracle.BASE, position, push, **LOAD)
        distance = oracle.distance_to_infeasible(oracle.BASE, position, push, **LOAD)
        nearest = float((cone_planes(position) @ (push + LIFT)).min())
        assert held == (margin > 0.0) == (distance > 0.0) == (nearest > 0.0)
        if held:
            assert distance == pytest.approx(nearest, rel=1e-9)
        else:
            assert distance <= nearest + 1e-9  # nearest to an edge or to the apex, or to a side
    assert seen == {True, False}


@pytest.mark.parametrize("cables", [2, 3, 4])
@pytest.mark.parametrize("limits", [{"tension_min": 2.0, "tension_max": 90.0}, {"tension_min": 5.0}, {}])
def test_hull_against_linear_programs(cables, limits):
    """The nearest infeasible acceleration lies across a pair of cables (one, in a plane): a step there ends it."""
    rng = np.random.default_rng(cables)
    planar = cables == 2
    base = oracle.BASE[:cables]
    least, most = limits.get("tension_min", 0.0) / 10.0, limits.get("tension_max", np.inf) / 10.0
    for _ in range(4):
        position = inside(rng, base)
        rays = base - position
        if planar:
            rays[:, 1], position[1] = 0.0, 0.0
        units = rays / np.linalg.norm(rays, axis=1)[:, None]
        fraction = rng.uniform(0.2, 0.8, cables) * 5.0 + least
        push = fraction @ units - LIFT
        if planar:
            normals = np.cross(units, [0.0, 1.0, 0.0])
        else:
            normals = np.array([np.cross(*pair) for pair in itertools.combinations(units, 2)])
        normals = np.vstack([normals, -normals])
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        # How far the set reaches along each normal.
        along = units @ normals.T
        along[np.abs(along) < 1e-12] = 0.0
        with np.errstate(invalid="ignore"):
            reach = np.where(along > 0.0, most * along, least * along)
        reach[along == 0.0] = 0.0
        gaps = reach.sum(0) - normals @ (push + LIFT)
        setup = {"planar": planar, **LOAD, **limits}
        found = oracle.distance_to_infeasible(base, position, push, **setup)
        assert found == pytest.approx(gaps.min(), rel=1e-9)
        out = normals[gaps.argmin()]
        for step, feasible in ((found * (1 - 1e-6), True), (found * (1 + 1e-6), False)):
            assert (oracle.tension_margin(base, position, push + step * out, **setup) > 0.0) == feasible
        beyond = oracle.distance_to_infeasible(base, position, push + (found + 0.5) * out, **setup)
        assert -0.5 - 1e-9 <= beyond < 0.0
        if cables == 4 and not limits:
            assert beyond == pytest.approx(-0.5)


def test_distance_in_flat_and_boundless_sets():
    beside = [20.0, 10.0, 30.0]
    assert oracle.distance_to_infeasible(oracle.BASE, beside, [0, 0, 0], **LOAD) == pytest.approx(-G)
    assert oracle.distance_to_infeasible(oracle.BASE, beside, [0, 0, -G], **LOAD) == 0.0
    around = np.array([[0.0, 0.0], [2.0, 0.0], [1.0, 3.0]])
    assert oracle.distance_to_infeasible(around, [1.0, 1.0], [5.0, 5.0], planar=True, **LOAD) == np.inf
    with pytest.raises(ValueError, match="tensions"):
        oracle.distance_to_infeasible(oracle.BASE, oracle.START, [0, 0, 0], tension_max=[9, 9, 9, np.inf], **LOAD)
    with pytest.raises(ValueError, match="base point"):
        oracle.tension_margin(oracle.BASE, oracle.BASE[0], [0, 0, 0], **LOAD)
    with pytest.raises(ValueError, match="out of its plane"):
        oracle.tension_margin(oracle.BASE, oracle.START, [0, 0, 0], planar=True, **LOAD)


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


@pytest.mark.parametrize("cables", [2, 3, 4])
def test_path_limits_leave_no_margin(cables):
    rng = np.random.default_rng(cables)
    base, planar = oracle.BASE[:cables], cables == 2
    start, end = inside(rng, base), inside(rng, base)
    if planar:
        start[1] = end[1] = 0.0
    setup = {"tension_min": 4.0, "tension_max": 300.0, "planar": planar, **LOAD}
    s = np.array([[0.0, 0.3], [0.8, 1.0]])
    for limit in oracle.path_limits(base, start, end, s, **setup):
        assert limit.shape == s.shape
        for here, second_derivative in zip(s.ravel(), limit.ravel(), strict=True):
            place, push = start + here * (end - start), second_derivative * (end - start)
            assert oracle.tension_margin(base, place, push, **setup) == pytest.approx(0.0, abs=1e-7)


def test_path_limits_without_a_limit_or_without_a_way():
    up = oracle.path_limits(oracle.BASE, [9, 9, 2], [9, 9, 4], [0.0, 1.0], **LOAD)
    assert np.allclose(up, [[-G / 2, -G / 2], [np.inf, np.inf]])
    down = oracle.path_limits(oracle.BASE, [9, 9, 4], [9, 9, 2], 0.5, **LOAD)
    assert np.allclose(down, [-np.inf, G / 2])
    outside = oracle.path_limits(oracle.BASE, [-9, 9, 4], [-9, 9, 2], 0.5, tension_min=1.0, **LOAD)
    assert np.array_equal(outside, [np.inf, -np.inf])
    still = oracle.path_limits(oracle.BASE, [9, 9, 4], [9, 9, 4], 0.5, **LOAD)
    assert np.array_equal(still, [-np.inf, np.inf])


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


def test_energy_of_each_half_is_2_over_t_squared():
    p, duration = 2.5, 10.0
    for begin, end in ((0.0, p), (p, duration)):
        t = np.linspace(begin, end, 200_001)
        s, _, second_derivative = oracle.s_curve(t, p, duration)
        assert abs(np.trapezoid(second_derivative, s)) == pytest.approx(2.0 / duration**2, rel=1e-9)


@pytest.mark.parametrize("law", [oracle.quintic, oracle.cubic, lambda t, duration: oracle.s_curve(t, 1.1, duration)])
def test_laws_go_from_rest_to_rest(law):
    s, speed, second_derivative = law(np.array([0.0, 2.5]), 2.5)
    assert np.allclose([s, speed], [[0.0, 1.0], [0.0, 0.0]], atol=1e-14)
    if law is oracle.cubic:
        assert np.allclose(second_derivative, [6.0 / 2.5**2, -6.0 / 2.5**2])
    else:
        assert np.allclose(second_derivative, 0.0, atol=1e-14)
    t = np.linspace(0.1, 2.4, 50)
    before, here, after = law(t - 1e-5, 2.5), law(t, 2.5), law(t + 1e-5, 2.5)
    for order in (0, 1):
        assert np.allclose((after[order] - before[order]) / 2e-5, here[order + 1], atol=1e-4)


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


def test_least_duration_between_constants():
    gain, loss = 3.0, 0.7
    duration, p = oracle.least_duration_of_s_curve(lambda s: -loss, lambda s: gain)
    assert duration == pytest.approx(2.0 * math.sqrt(1 / gain + 1 / loss), rel=1e-9)
    assert p == pytest.approx(duration * loss / (gain + loss), rel=1e-7)
    assert oracle.least_duration_of_s_curve(lambda s: 0 * s - 1.0, lambda s: 0 * s - 0.1)[0] == np.inf
    assert oracle.least_duration_of_s_curve(lambda s: 0.1 - s, lambda s: 0 * s + 1.0)[0] == np.inf


@pytest.mark.parametrize("seed", range(3))
def test_least_duration_is_feasible_and_nothing_shorter_is(seed):
    """Limits that bend, so that the curve may touch them beside its corners."""
    rng = np.random.default_rng(seed)
    a, b, c, d = rng.uniform(0.05, 0.5, 2), rng.uniform(0.0, 3.0), rng.uniform(0.05, 0.5, 2), rng.uniform(0.0, 3.0)
    settings = (lambda s: -c[0] - c[1] * np.abs(s - 0.4) * d, lambda s: a[0] + a[1] * np.abs(s - 0.15) * b)
    duration, p = oracle.least_duration_of_s_curve(*settings)

    def worst(p, duration):
        s, _, second_derivative = oracle.s_curve(np.linspace(0.0, duration, 4001), p, duration)
        s = np.clip(s, 0.0, 1.0)
        return max(np.max(second_derivative - settings[1](s)), np.max(settings[0](s) - second_derivative))

    assert worst(p, duration * (1 + 1e-6)) < 0.0
    shorter = duration * (1 - 1e-4)
    assert all(worst(ratio * shorter, shorter) > 0.0 for ratio in np.linspace(0.005, 0.995, 397))


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


def test_least_time_of_closed_cases():
    assert oracle.least_time(lambda s: -0.7, lambda s: 3.0) == pytest.approx(math.sqrt(2 * (1 / 3 + 1 / 0.7)), rel=1e-8)
    # Without a limit up to speed: from full speed to rest.
    assert oracle.least_time(lambda s: -2.0, lambda s: np.inf) == pytest.approx(1.0, rel=1e-8)
    # A limit that grows from nothing is never left; one that breaks the motion's way, or an empty one, neither.
    assert oracle.least_time(lambda s: -2.0, lambda s: s) == np.inf
    assert oracle.least_time(lambda s: -2.0, lambda s: 1.0 - 3.0 * s) == np.inf
    assert oracle.least_time(lambda s: 0.5 - s, lambda s: 0.4 * np.ones_like(s)) == np.inf
    # Braking on the way: v^2/2 goes up to 0.4, down to 0.3, up to 0.63 and to rest; v changes by s'' times the time.
    dip = oracle.least_time(lambda s: -9.0, lambda s: np.where(np.abs(s - 0.5) < 0.1, -0.5, 1.0))
    first, second, last = np.sqrt([0.8, 0.6, 1.26])
    assert dip == pytest.approx(first + (first - second) / 0.5 + (last - second) + last / 9.0, rel=1e-4)


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


def test_tension_couples_of_the_test_case_stay_below_130_newtons():
    duration, p = corner_rule(*(line.c for line in oracle.case_lines()[::-1]))
    s, _, second_derivative = oracle.s_curve(np.linspace(0.0, duration, 2001), p, duration)
    position, push = oracle.START + s[:, None] * STEP, second_derivative[:, None] * STEP
    couples = oracle.tension_couples(position, push, **SIDES, **LOAD)
    assert couples.shape == (2001, 4)
    assert 0.0 < couples.max() < 130.0
    # 1-2 is nothing at t = p/2 and 2-3 at (T + p)/2, where (24) and (25) are touched.
    corner, late = (oracle.s_curve(at, p, duration) for at in (p / 2, (duration + p) / 2))
    touched = [
        oracle.tension_couples(oracle.START + s * STEP, second_derivative * STEP, **SIDES, **LOAD)
        for s, _, second_derivative in (corner, late)
    ]
    assert touched[0][0] == pytest.approx(0.0, abs=1e-9)
    assert touched[1][1] == pytest.approx(0.0, abs=1e-9)
    assert couples.min() > -1e-6


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
