"""The reference for workspaces against closed cases, and its ways against each other."""

import numpy as np
import pytest
from oracles import workspaces as oracle
from scipy.spatial.transform import Rotation
from support import cable_robots as robots

pytestmark = pytest.mark.thorough

G = robots.GRAVITY
EYE = np.eye(3)
UP = np.array([0.0, 0.0, 1.0])
TRIANGLE = np.array([[2.0, 0.0, 1.5], [-1.0, np.sqrt(3.0), 1.5], [-1.0, -np.sqrt(3.0), 1.5]])
BOUNDS = ("equal", "mixed", "unbounded")
SIZES = [(pattern, n) for pattern, d in robots.DEGREES.items() for n in {d, d + 1, d + 2, 10}]


def point(base, position, pattern="3T"):
    return oracle.wrench_matrix(base, np.zeros((len(base), 3)), position, EYE, pattern)


def posed(robot, rng):
    """W, rows and weight of a robot at one of its poses."""
    position, rotation = robot.pose(rng)
    kept = oracle.rows(robot.pattern, robot.platform, rotation)
    matrix = oracle.wrench_matrix(robot.base, robot.platform, position, rotation, robot.pattern)
    return matrix, kept, oracle.weight(kept, robot.mass, rotation @ np.array(robot.arm))


def same(a, b, scale):
    return a == b or abs(a - b) <= 1e-9 * scale


def agree(robot, rng):
    """All ways to a margin, to closure and to the static workspace, at one pose; the margin."""
    matrix, _, held = posed(robot, rng)
    scale = robot.mass * G + robot.low.max()
    margin = oracle.tension_margin(matrix, held, robot.low, robot.high)
    assert same(margin, oracle.margin_by_facets(matrix, held, robot.low, robot.high), scale), robot.name
    closed = oracle.is_closed(matrix)
    assert closed == oracle.closed_by_facet_normals(matrix) == (oracle.closure_margin(matrix) > 1e-9), robot.name
    free = oracle.tension_margin(matrix, held, 0.0, np.inf)
    assert oracle.is_static(matrix, held) == (free >= -1e-12 * scale), robot.name
    if oracle.rank_of(matrix) == len(matrix):
        assert np.isposinf(free) == closed, robot.name
    # The sign of the capacity margin is that of the tension margin.
    capacity = oracle.capacity_margin(matrix, held, robot.low, robot.high)
    if np.isfinite(margin) and abs(margin) > 1e-9 * scale and oracle.rank_of(matrix) == len(matrix):
        assert (capacity > 0.0) == (margin > 0.0), robot.name
    return margin


# By hand


def test_a_mass_under_the_middle_of_a_triangle():
    height, force = 0.9, 2.0 * G
    matrix = point(TRIANGLE, [0.0, 0.0, 1.5 - height])
    each = force * np.hypot(2.0, height) / (3.0 * height)
    kept = oracle.rows("3T", np.zeros((3, 3)), EYE)
    held = oracle.weight(kept, 2.0)
    np.testing.assert_allclose(oracle.farthest_tensions(matrix, held, 1.0, 100.0)[1], each)
    assert oracle.tension_margin(matrix, held, 1.0, 100.0) == pytest.approx(each - 1.0)
    assert oracle.tension_margin(matrix, held, 1.0, each + 0.5) == pytest.approx(0.5)
    assert oracle.tension_margin(matrix, held, each + 0.25, np.inf) == pytest.approx(-0.25)
    assert oracle.tension_margin(matrix, held, [0.0, each - 0.1, 0.0], np.inf) == pytest.approx(0.1)


@pytest.mark.parametrize("tilt", [0.0, 0.3])
@pytest.mark.parametrize("n", [3, 4])
def test_the_static_workspace_of_a_mass_is_the_prism_below_its_spools(n, tilt):
    rng = np.random.default_rng(n)
    base = TRIANGLE if n == 3 else np.array([[2.0, 1.0, 1.5], [-2.0, 1.0, 1.5], [-2.0, -1.0, 1.5], [2.0, -1.0, 1.5]])
    base = base + tilt * np.outer(base[:, 0], UP)
    for _ in range(60):
        position = rng.uniform([-2.5, -2.0, -1.0], [2.5, 2.0, 2.2])
        level = 1.5 + tilt * position[0]
        steps = np.roll(base, -1, 0) - base
        sides = steps[:, 0] * (position - base)[:, 1] - steps[:, 1] * (position - base)[:, 0]
        inside = bool((sides > 0).all() or (sides < 0).all()) and position[2] < level
        assert oracle.is_static(point(base, position), [0.0, 0.0, G]) == inside


def test_the_specific_forces_of_a_mass_are_the_cone_over_its_spools():
    rng = np.random.default_rng(1)
    position = np.array([0.3, -0.2, 0.1])
    for _ in range(60):
        specific = rng.normal(size=3) + UP
        hit = position + specific * 1.4 / specific[2]
        steps = np.roll(TRIANGLE, -1, 0) - TRIANGLE
        sides = steps[:, 0] * (hit - TRIANGLE)[:, 1] - steps[:, 1] * (hit - TRIANGLE)[:, 0]
        assert oracle.is_static(point(TRIANGLE, position), specific) == bool((sides > 0).all() and specific[2] > 0)


def test_two_opposite_cables():
    matrix = point(np.array([[0, 0, 1.0], [0, 0, -1.0]]), np.zeros(3), "1T")
    np.testing.assert_array_equal(matrix, [[1.0, -1.0]])
    assert oracle.tension_margin(matrix, [4.0], 1.0, 21.0) == pytest.approx(8.0)
    assert oracle.tension_margin(matrix, [[4.0], [-6.0]], 1.0, 21.0) == pytest.approx(7.0)
    assert oracle.capacity_margin(matrix, [4.0], 1.0, 21.0) == pytest.approx(16.0)
    assert oracle.tension_margin(matrix, [4.0], 1.0, np.inf) == np.inf
    assert oracle.tension_margin(matrix, [4.0], 1.0, [21.0, np.inf]) == pytest.approx(8.0)
    assert oracle.tension_margin(matrix, [4.0], 1.0, [np.inf, 21.0]) == pytest.approx(10.0)
    assert oracle.is_closed(matrix) and oracle.closure_margin(matrix) == pytest.approx(1.0)


def test_the_narrowest_range_bounds_the_margin_beside_the_facet_normals():
    """The least over facet normals alone would be half of the mean range, 57.5 N, where the wrench is in the middle."""
    matrix = np.array([[1.0, -1.0]])
    low, high = np.array([1.0, 1.0]), np.array([200.0, 32.0])
    middle = matrix @ (low + high) / 2.0
    for margin in (oracle.tension_margin, oracle.margin_by_facets):
        assert margin(matrix, middle, low, high) == pytest.approx(15.5)


@pytest.mark.parametrize("crossed", [False, True])
def test_a_planar_square_at_its_middle(crossed):
    square = np.array([[2, 0, 2], [-2, 0, 2], [-2, 0, -2], [2, 0, -2]], float)
    platform = (0.25 * square)[[1, 0, 3, 2] if crossed else [0, 1, 2, 3]]
    matrix = oracle.wrench_matrix(square, platform, np.zeros(3), EYE, "1R2T")
    fraction = 1.5 / np.hypot(2.5 if crossed else 1.5, 1.5)
    held = [0.0, 3.0 * G, 0.0]
    assert oracle.tension_margin(matrix, held, 5.0, 105.0) == pytest.approx((100.0 - 3.0 * G / (2.0 * fraction)) / 2.0)
    assert oracle.rank_of(matrix) == (3 if crossed else 2)
    assert oracle.is_closed(matrix) == crossed
    # Without a rank of 3 any weight is held, and no moment.
    assert oracle.tension_margin(matrix, held, 5.0, np.inf) == np.inf
    assert (oracle.tension_margin(matrix, [0.0, 0.0, 1.0], 5.0, np.inf) == np.inf) == crossed


def test_a_cross_is_closed_though_its_null_vectors_come_in_pairs():
    matrix = np.array([[1.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0]])
    null = np.linalg.svd(matrix)[2][2:].T
    products = null[:, None, 0] * null[None, :, 1] - null[:, None, 1] * null[None, :, 0]
    assert max(np.delete(products[i], i).min() for i in range(4)) < 1e-12  # though all are in a half plane
    assert oracle.is_closed(matrix) and oracle.closed_by_facet_normals(matrix)
    assert oracle.closure_margin(matrix) == pytest.approx(1.0)


def test_a_pulley():
    matrix = oracle.wrench_matrix(
        [[0, 0, 0.0]], [[0, 0, 0.0]], [0.2, 0.0, -3.0], EYE, "3T", pulley_radii=[0.1], pulley_axes=[UP]
    )
    np.testing.assert_allclose(matrix[:, 0], UP, atol=1e-12)  # down from the far side, after half a turn
    leaves, length = oracle.tangent_point(np.zeros(3), UP, 0.1, np.array([0.2, 0.0, -3.0]))
    np.testing.assert_allclose(leaves, [0.2, 0.0, 0.0], atol=1e-12)
    assert length == pytest.approx(0.1 * np.pi + 3.0)
    with pytest.raises(ValueError, match="inside"):
        oracle.tangent_point(np.zeros(3), UP, 0.1, np.array([0.15, 0.0, 0.02]))


def test_weight_on_a_joint():
    """The cables of 3R hold the moment of the weight about the joint."""
    kept = oracle.rows("3R", np.zeros((1, 3)), EYE)
    np.testing.assert_allclose(oracle.weight(kept, 2.0, [0.5, 0.0, 0.3]), [0.0, -2.0 * G * 0.5, 0.0])


# Wrench matrices


@pytest.mark.parametrize("pulleys", [False, True])
def test_a_wrench_matrix_takes_lengths_off(pulleys):
    """The power of unit tensions is the rate at which the cables get shorter."""
    rng = np.random.default_rng(2)
    for _ in range(5):
        robot = robots.spatial(rng, 6)
        position, rotation = robot.pose(rng)
        radii, axes = rng.uniform(0.02, 0.2, 6), UP + 0.2 * rng.normal(size=(6, 3))
        given = {"pulley_radii": radii, "pulley_axes": axes} if pulleys else {}
        matrix = oracle.wrench_matrix(robot.base, robot.platform, position, rotation, "3R3T", **given)
        twist = rng.normal(size=6)

        def lengths(h, robot=robot, position=position, rotation=rotation, twist=twist, radii=radii, axes=axes):
            rotated = Rotation.from_rotvec(h * twist[3:]).as_matrix() @ rotation
            ends = position + h * twist[:3] + robot.platform @ rotated.T
            if not pulleys:
                return np.linalg.norm(ends - robot.base, axis=1)
            return np.array([oracle.tangent_point(*p)[1] for p in zip(robot.base, axes, radii, ends, strict=True)])

        rates = (lengths(1e-5) - lengths(-1e-5)) / 2e-5
        np.testing.assert_allclose(matrix.T @ twist, -rates, atol=1e-7)


# Ways against each other


@pytest.mark.parametrize("bounds", BOUNDS)
@pytest.mark.parametrize(("pattern", "n"), SIZES)
def test_programs_and_facets_agree(pattern, n, bounds):
    rng = np.random.default_rng([n, len(pattern), BOUNDS.index(bounds)])
    for suspended in (False, True):
        agree(robots.any_robot(rng, pattern, n, suspended, bounds), rng)


@pytest.mark.parametrize("robot", robots.degenerate(), ids=lambda robot: robot.name)
def test_programs_and_facets_agree_where_something_vanishes(robot):
    rng = np.random.default_rng(8)
    for bounded in (robot, robot.with_bounds(0.0, np.inf), robot.with_bounds(0.0, 60.0)):
        agree(bounded, rng)
        at = dict(vars(bounded), space=np.zeros(3))
        agree(robots.CableRobot(**at), rng)


def test_capacity_is_the_ball_of_wrenches_that_fits():
    rng = np.random.default_rng(9)
    matrix = posed(robots.spatial(rng, 8, suspended=False), rng)[0]
    low, high = 1.0, 1000.0
    middle = matrix @ np.full(8, 500.5)
    radius = oracle.capacity_margin(matrix, middle, low, high)
    assert radius > 0.0
    directions = np.r_[rng.normal(size=(20, 6)), oracle.facet_normals(matrix)[0]]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    margins = [oracle.tension_margin(matrix, middle + radius * e, low, high) for e in directions]
    assert min(margins) == pytest.approx(0.0, abs=1e-8)
    assert oracle.ellipsoid_margin(matrix, middle, radius * np.eye(6), low, high) == pytest.approx(0.0, abs=1e-8)


@pytest.mark.parametrize("bounds", BOUNDS)
@pytest.mark.parametrize(("pattern", "n"), [("3T", 4), ("1R2T", 5), ("2R3T", 7), ("3R3T", 8), ("3R", 5)])
def test_sets_of_wrenches(pattern, n, bounds):
    rng = np.random.default_rng([10, n])
    robot = robots.any_robot(rng, pattern, n, bounds=bounds)
    matrix, _, held = posed(robot, rng)
    given = robot.low, robot.high
    scale = robot.mass * G
    shape = 0.1 * scale * rng.normal(size=(len(matrix), 2))
    exact = oracle.ellipsoid_margin(matrix, held, shape, *given)
    assert exact <= oracle.ellipsoid_bound(matrix, held, shape, *given, 5, rng) + 1e-9 * scale
    # The wrench that is worst for the deciding facet gives the exact margin to a linear program.
    reached = oracle.facet_normals(matrix)[0] @ shape
    worst = held + (reached / np.maximum(np.linalg.norm(reached, axis=1, keepdims=True), 1e-30)) @ shape.T
    assert same(exact, oracle.tension_margin(matrix, worst, *given), scale)
    half = np.r_[0.1 * scale, np.zeros(len(matrix) - 2), 0.05 * scale]
    box = oracle.box_margin(matrix, held, half, *given)
    assert same(box, oracle.margin_by_facets(matrix, oracle.corners(held, half), *given), scale)
    assert box <= oracle.ellipsoid_margin(matrix, held, np.diag(half), *given) + 1e-9 * scale
    assert box <= oracle.tension_margin(matrix, held, *given) + 1e-9 * scale


def test_a_mass_level_with_its_spools_jumps():
    """There the margin of unbounded cables, one of them below, is far below zero; a hair lower it is infinite."""
    base = np.array([[1, 0, 1], [0, 1, 1], [-1, 0, 1], [0, -1, 1], [0, 0, -1]], float)
    for lower in (0.0, 1e-6):
        matrix = point(base, [0.1, 0.2, 1.0 - lower])
        assert oracle.is_closed(matrix) == oracle.closed_by_facet_normals(matrix) == (lower > 0.0)
        for margin in (oracle.tension_margin, oracle.margin_by_facets):
            found = margin(matrix, [0.0, 0.0, G], 0.0, np.inf)
            assert found == np.inf if lower else found < -0.99 * G
