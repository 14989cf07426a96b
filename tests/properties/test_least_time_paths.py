"""Least times along paths against closed forms and a reference that was written without a look at the package."""

import math

import numpy as np
import pytest
import scipy.spatial
from oracles import least_time, least_time_bounds, least_time_cases, least_time_forms, path_rows
from support.least_time import solve

# How much longer than the least time a proved motion may take, and how much shorter the lower bound may be.
LONGER, SHORTER = 0.003, 0.003
# A proved motion breaks no limit: but for the rounding of HiGHS, in shares of the limit, or of the weight.
ROUNDING = 1e-9
# How far a motion may be off its path, in lengths of the path and in entries of rotation matrices.
OFF = 1e-4
SAMPLES = {"quick": 501, "thorough": 5_001, "soak": 20_001}
RING, SPOOLS, MANY = (
    least_time_forms.ring_robot(3, 1.0, 2.0),
    least_time_forms.two_spools(1.0),
    least_time_forms.ring_robot(24),
)
WEIGHT = 2.0 * 9.81
LOW, HIGH = 0.1 * WEIGHT, 1.2 * WEIGHT
BETWEEN = {"tension_min": np.full(3, LOW), "tension_max": np.full(3, HIGH)}
QUICK = [("2T-2", 0, False), ("3T-4", 1, False), ("3R3T-8", 0, True)]
THOROUGH = [(kind, 1, k % 2 == 0) for k, kind in enumerate(least_time_cases.KINDS)]


class Called:
    """A motion as the verifier takes it."""

    def __init__(self, motion):
        self.state = motion


def breaches(robot, limits, answer, samples):
    """Limits that the samples of a motion break, and by what share."""
    slacks = least_time_bounds.slacks(robot, limits, Called(answer.motion), np.linspace(0.0, answer.time, samples))
    size = {"tension": robot["mass"] * robot["gravity"], **{name: np.max(value) for name, value in limits.items()}}
    least = {name: float(slack.min() / size[name]) for name, slack in slacks.items()}
    return {name: slack for name, slack in least.items() if not slack >= -ROUNDING}


def check_motion(robot, limits, path, answer, samples):
    """A motion is at rest at its ends, stays on its path, has the derivatives that it says, and breaks no limit."""
    times = np.linspace(0.0, answer.time, samples)
    state = answer.motion(times)
    size, quick = path.length, path.length / answer.time
    for end, s in ((0, 0.0), (-1, path.length)):
        np.testing.assert_allclose(state.position[end], path.at(s).position[0], atol=1e-9 * size)
        np.testing.assert_allclose(state.rotation[end], path.at(s).rotation[0], atol=1e-9)
        np.testing.assert_allclose([state.velocity[end], size * state.omega[end]], 0.0, atol=1e-9 * quick)
    near = path.at(np.linspace(0.0, path.length, 20_001))
    tree = scipy.spatial.cKDTree(np.concatenate([near.position / size, near.rotation.reshape(-1, 9)], axis=1))
    i = tree.query(np.concatenate([state.position / size, state.rotation.reshape(-1, 9)], axis=1))[1]
    ahead = near.first[i]
    s = np.linspace(0.0, path.length, 20_001)[i]
    s += np.sum((state.position - near.position[i]) * ahead, axis=1) / np.sum(ahead * ahead, axis=1)
    there = path.at(np.clip(s, 0.0, path.length))
    np.testing.assert_allclose(state.position, there.position, atol=OFF * size)
    np.testing.assert_allclose(state.rotation, there.rotation, atol=OFF)
    step = 1e-6 * answer.time
    inside = times[1:-1:7]
    before, after, state = (answer.motion(inside + k * step) for k in (-1.0, 1.0, 0.0))
    rotated = (after.rotation - before.rotation) @ np.swapaxes(state.rotation, 1, 2) / (2.0 * step)
    spin = 0.5 * np.stack([rotated[:, k, j] - rotated[:, j, k] for j, k in ((1, 2), (2, 0), (0, 1))], axis=1)
    slope = (after.position - before.position) / (2.0 * step)
    np.testing.assert_allclose(slope, state.velocity, atol=1e-5 * quick)
    np.testing.assert_allclose(spin, state.omega, atol=1e-5 * (np.abs(state.omega).max() + 1.0 / answer.time))
    # Means over the steps: where an acceleration jumps it is between both sides.
    for lower, upper in (("velocity", "acceleration"), ("omega", "alpha")):
        slope = (getattr(after, lower) - getattr(before, lower)) / (2.0 * step)
        sides = [getattr(part, upper) for part in (before, state, after)]
        room = 1e-3 * np.abs(sides).max() + 1e-6
        assert (slope >= np.min(sides, axis=0) - room).all()
        assert (slope <= np.max(sides, axis=0) + room).all()
    assert breaches(robot, limits, answer, samples) == {}


def check_exact(robot, limits, path, exact, samples=SAMPLES["quick"]):
    """A least time that is known lies between the package's bounds, which are close."""
    answer = solve(robot, path, limits)
    assert answer.verdict == "feasible"
    assert (1.0 - SHORTER) * exact <= answer.lower <= exact * (1.0 + 1e-9)
    assert exact * (1.0 - 1e-6) <= answer.time <= (1.0 + LONGER) * exact
    check_motion(robot, limits, path, answer, samples)
    return answer


@pytest.mark.quick("ends0")
@pytest.mark.parametrize("ends", [(0.6, 1.5), (1.5, 0.6)])
def test_vertical_lines(ends):
    exact, _ = least_time_forms.vertical(RING, LOW, HIGH, *ends)
    check_exact(RING, BETWEEN, path_rows.line(*([0.0, 0.0, depth] for depth in ends)), exact)


def test_level_lines():
    exact, _ = least_time_forms.level(1.0, 0.8, -0.5, 0.3)
    limits = {"tension_min": np.zeros(2), "tension_max": np.full(2, 100.0)}
    check_exact(SPOOLS, limits, path_rows.line([-0.5, 0.0, 0.8], [0.3, 0.0, 0.8]), exact)


def test_lines_in_space():
    ends = [-0.2, 0.1, 0.8], [0.25, -0.05, 1.4]
    exact = least_time_forms.straight(RING, BETWEEN, *ends)
    check_exact(RING, BETWEEN, path_rows.line(*ends), exact)


def test_limits_of_speed_and_acceleration():
    loose = {"tension_min": np.zeros(3), "tension_max": np.full(3, 1e3)}
    exact = least_time_forms.trapezoid(1.0, 0.9, 3.0)
    limits = {**loose, "acceleration_max": 3.0, "speed_max": 0.9}
    check_exact(RING, limits, path_rows.line([0.0, 0.0, 0.5], [0.0, 0.3, 0.5 + math.sqrt(0.91)]), exact)
    exact = least_time_forms.circle_by_acceleration(0.2, 1.5)
    check_exact(RING, {**loose, "acceleration_max": 1.5}, path_rows.circle([0.0, 0.0, 0.8], 0.2), exact)


@pytest.mark.soak
def test_a_circle_under_many_spools_does_not_chatter():
    """At 48 places the acceleration along the path drops out of a row."""
    limits = {"tension_min": np.zeros(24), "tension_max": np.full(24, 1e3)}
    path = path_rows.circle([0.0, 0.0, 0.8], 0.3)
    outer, inner = (least_time_forms.level_circle(0.3, reach, 0.8) for reach in (1.0, math.cos(math.pi / 24.0)))
    answer = solve(MANY, path, limits)
    assert answer.verdict == "feasible"
    assert (1.0 - SHORTER) * outer <= answer.lower <= inner
    assert outer <= answer.time <= (1.0 + LONGER) * inner
    check_motion(MANY, limits, path, answer, SAMPLES["quick"])
    state = answer.motion(np.linspace(0.0, answer.time, 2_001))
    out = state.position / np.linalg.norm(state.position[:, :2], axis=1)[:, None]
    along = state.acceleration[:, 1] * out[:, 0] - state.acceleration[:, 0] * out[:, 1]
    # Without chatter it sums to 52 m/s2; a scheme that chatters has 190.
    assert np.abs(np.diff(along)).sum() < 90.0


def check_case(case, samples, count):
    """Whether there is a motion, and how long it takes, against the reference's bounds."""
    answer = solve(case.robot, case.path, case.limits)
    below = least_time_bounds.below(case.robot, case.limits, case.path, count)
    above = least_time_bounds.above(case.robot, case.limits, case.path, 2 * count)[1]
    time, change = least_time_bounds.estimate(case.robot, case.limits, case.path, 2 * count)
    assert (answer.motion is None) == (answer.time == math.inf)
    if below == math.inf:
        assert answer.motion is None
    if above < math.inf:
        assert answer.verdict == "feasible"
        assert answer.lower <= above * (1.0 + 1e-6)
        assert answer.lower <= time + 3.0 * change
        assert time - 3.0 * change <= answer.time <= (1.0 + LONGER) * min(above, time + 3.0 * change)
    if answer.motion is not None:
        assert (1.0 - SHORTER) * answer.time - LONGER * answer.time <= answer.lower <= answer.time
        assert answer.time >= below * (1.0 - 1e-6)
    if answer.verdict == "feasible":
        check_motion(case.robot, case.limits, case.path, answer, samples)


@pytest.mark.ci("2T-2-0-False", "3T-4-1-False")
@pytest.mark.parametrize("kind, seed, outside", QUICK)
def test_random_paths(kind, seed, outside):
    check_case(least_time_cases.case(kind, seed, outside), SAMPLES["quick"], 60)


@pytest.mark.thorough
@pytest.mark.parametrize("kind, seed", [("2T-4", 152), ("3T-4", 148)])
def test_bounds_where_multipliers_change_fast(kind, seed):
    """In one cell y . a' - y' . a is negative at first."""
    case = least_time_cases.case(kind, seed, outside=True)
    answer = solve(case.robot, case.path, case.limits)
    assert (1.0 - SHORTER) * answer.time <= answer.lower <= answer.time


@pytest.mark.ci("3R3T-7-1-True", "3T-4-1-True")
@pytest.mark.thorough
@pytest.mark.parametrize("kind, seed, outside", THOROUGH)
def test_more_random_paths(kind, seed, outside):
    check_case(least_time_cases.case(kind, seed, outside), SAMPLES["thorough"], 150)


def with_all_limits(case):
    """Limits of a case; absent ones are so far away that they bind nowhere: all cases of a robot compile alike."""
    size, gravity = np.ptp(np.asarray(case.robot["base_points"]), axis=0).max(), case.robot["gravity"]
    speeds = dict.fromkeys(("cable_speed_max", "speed_max"), 1e4 * math.sqrt(gravity * size))
    return speeds | dict.fromkeys(("cable_acceleration_max", "acceleration_max"), 1e4 * gravity) | case.limits


@pytest.mark.soak
@pytest.mark.parametrize("kind", least_time_cases.KINDS)
def test_samples_never_break_a_proof(kind):
    """1,000 paths of each robot; every fourth is partly outside the footprint."""
    broken, proved = {}, 0
    for seed in range(100, 1_100):
        case = least_time_cases.case(kind, seed, seed % 4 == 0)
        answer = solve(case.robot, case.path, with_all_limits(case))
        if answer.verdict == "feasible":
            proved += 1
            found = breaches(case.robot, case.limits, answer, SAMPLES["soak"])
            if found or not answer.lower <= answer.time:
                broken[seed] = found, answer.lower, answer.time
    assert broken == {}
    assert proved > 500


@pytest.mark.soak
@pytest.mark.parametrize("kind", least_time_cases.KINDS)
def test_verdicts_are_those_of_linear_programs(kind):
    """The problem on a grid by HiGHS, tensions its unknowns, 100 paths a robot: the same verdicts.

    The package is proved, and hardly slower; it may be faster: the reference's motion keeps one acceleration along a
    cell. It may leave open what is within rounding of its limits.
    """
    differ = {}
    for seed in range(2_000, 2_100):
        case = least_time_cases.case(kind, seed, seed % 2 == 0)
        answer = solve(case.robot, case.path, with_all_limits(case), grid=200)
        theirs = least_time.ByTensions(case.robot, case.limits, case.path, 200).solve()
        is_other = answer.verdict != "undecided" and (answer.verdict == "feasible") != (theirs.verdict == "feasible")
        if is_other or (answer.verdict == "feasible" and answer.time > (1.0 + LONGER) * theirs.time):
            differ[seed] = answer.verdict, answer.time, theirs.verdict, theirs.time
    assert differ == {}


@pytest.mark.thorough
def test_no_largest_tension_is_a_very_large_one():
    """Faces without a bound bound no motion, and the lower bound holds beside them."""
    path = path_rows.through(np.array([[-0.15, 0.0, 0.8], [0.0, 0.12, 1.1], [0.15, -0.05, 0.9]]))
    least, speeds = {"tension_min": np.full(3, LOW)}, {"cable_speed_max": np.full(3, 1.5)}
    large = solve(RING, path, {**least, **speeds, "tension_max": np.full(3, 1e6)}, 150)
    none = solve(RING, path, {**least, **speeds}, 150)
    assert none.verdict == "feasible"
    assert none.time == pytest.approx(large.time, rel=1e-3)
    assert (1.0 - 2.0 * SHORTER) * none.time <= none.lower <= none.time


@pytest.mark.thorough
@pytest.mark.parametrize("kind", ["2T-3", pytest.param("3R3T-7", marks=pytest.mark.soak)])
def test_backwards_it_takes_as_long(kind):
    case = least_time_cases.case(kind, 1)
    ahead, back = (solve(case.robot, path, case.limits) for path in (case.path, case.path.backwards()))
    assert ahead.verdict == back.verdict == "feasible"
    assert ahead.time == pytest.approx(back.time, rel=LONGER)
    assert max(ahead.lower, back.lower) <= min(ahead.time, back.time)


@pytest.mark.thorough
@pytest.mark.parametrize("kind", ["3T-3", pytest.param("1R2T-4", marks=pytest.mark.soak)])
def test_lengths_and_masses_scale(kind):
    case, scale = least_time_cases.case(kind, 1), least_time_forms.Scale(4.0, 7.0)
    small = solve(case.robot, case.path, case.limits)
    large = solve(scale.robot(case.robot), case.path.scaled(scale.size), scale.limits(case.limits))
    assert small.verdict == large.verdict == "feasible"
    assert large.time == pytest.approx(scale.time * small.time, rel=1e-5)
    assert large.lower == pytest.approx(scale.time * small.lower, rel=1e-5)


@pytest.mark.thorough
def test_ramps_cost_little_and_leave_no_jumps():
    path, ramp = path_rows.line([-0.2, 0.1, 0.8], [0.25, -0.05, 1.4]), 0.05
    sharp, smooth = (solve(RING, path, BETWEEN, ramp_time=t) for t in (0.0, ramp))
    assert smooth.verdict == "feasible"
    assert sharp.time * (1.0 - 1e-6) <= smooth.time <= 1.2 * sharp.time
    check_motion(RING, BETWEEN, path, smooth, SAMPLES["quick"])
    times = np.linspace(0.0, smooth.time, 5_001)
    acceleration = smooth.motion(times).acceleration
    steps = np.linalg.norm(np.diff(acceleration, axis=0), axis=1)
    whole = np.linalg.norm(acceleration.max(0) - acceleration.min(0))
    assert steps.max() <= 3.0 * whole * times[1] / ramp
