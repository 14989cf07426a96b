"""The reference for least times along paths: against finite differences, itself by other ways, and closed forms."""

import math

import numpy as np
import pytest

from oracles import (
    any_motion,
    least_time,
    least_time_bounds,
    least_time_cases,
    least_time_forms,
    path_rows,
    sampled_motion,
)

pytestmark = pytest.mark.thorough

RING, SPOOLS = least_time_forms.ring_robot(3, 1.0, 2.0), least_time_forms.two_spools(1.0)
WEIGHT = 2.0 * 9.81
LOW, HIGH = 0.1 * WEIGHT, 1.2 * WEIGHT
BETWEEN = {"tension_min": np.full(3, LOW), "tension_max": np.full(3, HIGH)}
TAUT = {"tension_min": np.zeros(2)}


@pytest.fixture(scope="module")
def cases():
    return {kind: least_time_cases.case(kind, 1) for kind in least_time_cases.KINDS}


def time_of(robot, limits, path, count, scheme):
    return least_time.solved(least_time.problem(robot, limits, path, count, scheme)).time


@pytest.mark.parametrize("kind", least_time_cases.KINDS)
def test_rows_are_those_of_motions(kind, cases):
    """The wrench, the cables and the slacks of a motion along a path, from the oracle of any motion."""
    case = cases[kind]
    s, u, x = np.linspace(0.1, 0.9, 5) * case.path.length, 0.7, 1.3
    place, rotated = case.path.at(s), sampled_motion.Motion(case.path.positions, case.path.quaternions).state(s)
    speed = math.sqrt(x)
    state = sampled_motion.State(
        place.position,
        place.first * speed,
        place.first * u + place.second * x,
        place.rotation,
        place.omega * speed,
        place.omega * u + place.alpha * x,
    )
    np.testing.assert_allclose(place.rotation, rotated.rotation, atol=1e-13)
    np.testing.assert_allclose(place.omega, rotated.omega, atol=1e-13)
    np.testing.assert_allclose(place.alpha, rotated.alpha, atol=1e-12)
    found, balance = any_motion.cables(case.robot, state), path_rows.balance(case.robot, place)
    matrix, wrench = any_motion.balance(case.robot, state, found)
    size = np.linalg.norm(wrench[:, -1:], axis=1) / np.linalg.norm(
        (balance.a * u + balance.b * x + balance.c)[:, -1:], axis=1
    )
    keep = slice(0, 3 if case.robot["pattern"] == "3R3T" else 2)
    np.testing.assert_allclose((balance.a * u + balance.b * x + balance.c)[:, keep], wrench[:, keep], rtol=1e-12)
    np.testing.assert_allclose(size, size[0], rtol=1e-9)
    length, rate, second_derivative = path_rows.lengths(case.robot, place)
    np.testing.assert_allclose(length, found.lengths, rtol=1e-13)
    np.testing.assert_allclose(rate * speed, found.rates, atol=1e-12)
    np.testing.assert_allclose(rate * u + second_derivative * x, found.accelerations, atol=1e-11)
    # The half-planes' margin over |y|_1 has the sign of that by linear programs.
    centring = any_motion.Centring(*path_rows.tension_range(case.robot, case.limits))
    rows = path_rows.tension_rows(case.robot, case.limits, place)
    least = (rows[2] - rows[0] * u - rows[1] * x).min(1)
    np.testing.assert_allclose(least, centring.largest(matrix, wrench), atol=1e-9 * np.abs(wrench).max())


@pytest.mark.parametrize("scheme", list(least_time.SCHEMES))
@pytest.mark.parametrize("kind", ["2T-3", "3T-4", "3T-8", "1R2T-4", "3R3T-6", "3R3T-8"])
def test_three_ways_agree(kind, scheme, cases):
    case = cases[kind]
    problem = least_time.problem(case.robot, case.limits, case.path, 12, scheme)
    ours, corners = least_time.solved(problem), least_time.solved(problem, least_time.vertex_span)
    programs = least_time.ByTensions(case.robot, case.limits, case.path, 12, scheme).solve()
    assert ours.verdict == corners.verdict == programs.verdict == "feasible"
    np.testing.assert_allclose(corners.sets, ours.sets, rtol=1e-10, atol=1e-9)
    np.testing.assert_allclose(programs.sets, ours.sets, rtol=1e-6, atol=1e-7)
    np.testing.assert_allclose(corners.x, ours.x, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(programs.x, ours.x, rtol=1e-5, atol=1e-6)
    if scheme == "interpolation":  # the others come to rest where the grid is so coarse
        assert ours.time == pytest.approx(programs.time, rel=1e-7)


@pytest.mark.parametrize("kind", ["2T-3", "3T-4", "3R3T-6"])
@pytest.mark.parametrize("scheme", ["interpolation", "midpoint"])
def test_greedy_solutions_take_little_longer_than_the_optimum(kind, scheme, cases):
    case = cases[kind]
    problem = least_time.problem(case.robot, case.limits, case.path, 100, scheme)
    greedy = least_time.solved(problem)
    below, time, x = least_time.optimum(problem, greedy)
    assert below <= time <= greedy.time
    assert below > (1.0 - 2e-5) * time
    assert greedy.time < (1.002 if scheme == "interpolation" else 1.02) * time
    assert (x <= greedy.sets[:, 1] * (1.0 + 1e-6) + 1e-6).all()
    u = np.diff(x) / (2.0 * np.diff(problem.nodes))
    for fraction, rows in zip(problem.shares, problem.rows, strict=True):
        slack = path_rows.slack(rows, u, x[:-1] + 2.0 * fraction * np.diff(problem.nodes) * u)
        assert (slack > -1e-5 * np.abs(rows.c)).all()


@pytest.mark.parametrize("ends", [(0.6, 1.5), (1.5, 0.6)])
def test_vertical_line(ends):
    exact, _ = least_time_forms.vertical(RING, LOW, HIGH, *ends)
    path = path_rows.line(*([0.0, 0.0, depth] for depth in ends))
    assert least_time_forms.straight(RING, BETWEEN, [0.0, 0.0, ends[0]], [0.0, 0.0, ends[1]]) == pytest.approx(
        exact, rel=1e-11
    )
    off = [[time_of(RING, BETWEEN, path, n, s) / exact - 1.0 for n in (50, 200)] for s in ("midpoint", "interpolation")]
    assert 0.0 < off[0][1] < 3e-5
    assert 0.0 < off[1][1] < 3e-4
    assert 3.0 < off[1][0] / off[1][1] < 6.0  # order 1
    assert -3e-5 < least_time_bounds.below(RING, BETWEEN, path, 200) / exact - 1.0 < 0.0
    assert 0.0 < least_time_bounds.above(RING, BETWEEN, path, 200)[1] / exact - 1.0 < 3e-4


def test_level_line():
    exact, _ = least_time_forms.level(1.0, 0.8, -0.5, 0.3)
    ends = [-0.5, 0.0, 0.8], [0.3, 0.0, 0.8]
    assert least_time_forms.straight(SPOOLS, TAUT, *ends) == pytest.approx(exact, rel=1e-11)
    assert 0.0 < time_of(SPOOLS, TAUT, path_rows.line(*ends), 200, "midpoint") / exact - 1.0 < 6e-5


@pytest.mark.parametrize("kind, fraction", [("2T-3", 0.945), ("3T-3", 0.985), ("1R2T-4", 0.965), ("3R3T-7", 0.988)])
def test_bounds_enclose_the_estimate(kind, fraction, cases):
    case = cases[kind]
    motion, above = least_time_bounds.above(case.robot, case.limits, case.path, 150)
    below = least_time_bounds.below(case.robot, case.limits, case.path, 150)
    time, change = least_time_bounds.estimate(case.robot, case.limits, case.path, 200)
    assert fraction * above < below < time + change
    assert time - change < above < 1.01 * time
    assert change < 2e-3 * time
    slacks = least_time_bounds.slacks(case.robot, case.limits, motion, np.linspace(*motion.times, 400))
    weight = case.robot["mass"] * case.robot["gravity"]
    for name, slack in slacks.items():
        assert slack.min() > -1e-4 * (weight if name == "tension" else np.max(case.limits[name])), name


def test_the_verifier_sees_a_motion_that_is_too_fast(cases):
    case = cases["3R3T-7"]
    motion, _ = least_time_bounds.above(case.robot, case.limits, case.path, 100)
    faster = least_time_bounds.Timed(motion.path, motion.nodes, 1.05 * motion.x)
    slacks = least_time_bounds.slacks(case.robot, case.limits, faster, np.linspace(*faster.times, 200))
    weight = case.robot["mass"] * case.robot["gravity"]
    assert min(slacks["tension"].min() / weight, *(v.min() for k, v in slacks.items() if k != "tension")) < -1e-3
