"""The reference for any motion: against SciPy, finite differences, power, geometry by hand and HiGHS."""

import numpy as np
import pytest
import scipy.interpolate
import scipy.optimize
from oracles import any_motion, any_motion_cases, sampled_motion

pytestmark = pytest.mark.thorough

STEP = 1e-5


def nearby(motion, times):
    """States a step before and after instants inside a motion."""
    return motion.state(times - STEP), motion.state(times + STEP)


def inner_times(rng, motion, count=12):
    start, end = motion.times
    return np.sort(rng.uniform(start + 0.01 * (end - start), end - 0.01 * (end - start), count))


def case_of(kind, seed, pulleys=False):
    """A case of a kind; with pulleys, one that has them."""
    rng = np.random.default_rng(seed)
    while True:
        case = any_motion_cases.random_case(rng, pulleys, kind)
        if not pulleys or case.robot["pulley_radius"] is not None:
            return case, rng


@pytest.mark.parametrize("ends", ["rest", "natural", "periodic"])
@pytest.mark.parametrize("interpolation", ["cubic", "quintic"])
def test_splines_are_those_of_scipy(interpolation, ends):
    rng = np.random.default_rng(1)
    times, values = np.cumsum(rng.uniform(0.2, 1.0, 9)), rng.normal(size=(9, 3))
    if ends == "periodic":
        values[-1] = values[0]
    degree, zero = {"cubic": 3, "quintic": 5}[interpolation], np.zeros(3)
    orders = {"rest": {3: [1], 5: [1, 2]}, "natural": {3: [2], 5: [3, 4]}, "periodic": {3: [], 5: []}}[ends][degree]
    conditions = "periodic" if ends == "periodic" else 2 * ([(order, zero) for order in orders],)
    theirs = scipy.interpolate.make_interp_spline(times, values, k=degree, bc_type=conditions)
    ours = sampled_motion.spline(times, values, interpolation, ends)
    t = np.linspace(times[0], times[-1], 300)[:-1]
    for order in range(degree):
        np.testing.assert_allclose(ours(t, order), theirs(t, order), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_states_have_the_derivatives_of_finite_differences(seed):
    case, rng = case_of("3R3T-8", seed)
    times = inner_times(rng, case.motion)
    times = times[np.abs(times[:, None] - case.samples["times"]).min(1) > 2.0 * STEP]
    before, after = nearby(case.motion, times)
    state = case.motion.state(times)
    rate = (after.rotation - before.rotation) / (2.0 * STEP)
    spin = np.cross(state.omega[:, :, None], state.rotation, axis=1)
    np.testing.assert_allclose(rate, spin, atol=1e-8)
    np.testing.assert_allclose(np.linalg.det(state.rotation), 1.0, atol=1e-13)
    for name, derivative in (("position", "velocity"), ("velocity", "acceleration"), ("omega", "alpha")):
        difference = (getattr(after, name) - getattr(before, name)) / (2.0 * STEP)
        np.testing.assert_allclose(difference, getattr(state, derivative), rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("pulleys", [False, True])
@pytest.mark.parametrize("kind", ["2T-2", "3T-4", "1R2T-4", "3R3T-8"])
def test_cables_have_the_derivatives_of_finite_differences(kind, pulleys):
    case, rng = case_of(kind, 5, pulleys)
    times = inner_times(rng, case.motion)
    before, after = (any_motion.cables(case.robot, state) for state in nearby(case.motion, times))
    found = any_motion.cables(case.robot, case.motion.state(times))
    np.testing.assert_allclose((after.lengths - before.lengths) / (2.0 * STEP), found.rates, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose((after.rates - before.rates) / (2.0 * STEP), found.accelerations, rtol=1e-6, atol=1e-6)
    free = np.linalg.norm(found.attachments - found.leaving, axis=2)
    straight = found.attachments + free[..., None] * found.towards
    np.testing.assert_allclose(straight, found.leaving, atol=1e-12 * free.max())


@pytest.mark.parametrize("pulleys", [False, True])
@pytest.mark.parametrize("kind", ["2T-2", "3T-3", "1R2T-3", "3R3T-6"])
def test_cables_do_the_work_that_the_energy_takes_up(kind, pulleys):
    case, rng = case_of(kind, 11, pulleys)
    robot, times = case.robot, inner_times(rng, case.motion)

    def energy(state):
        """Kinetic and potential energy."""
        total = 0.5 * robot["mass"] * np.sum(state.velocity**2, axis=1)
        total -= robot["mass"] * state.position @ any_motion.gravity(robot)
        if robot["platform_points"] is not None:
            rotated = np.einsum("kji,kj->ki", state.rotation, state.omega)
            total += 0.5 * np.einsum("ki,ij,kj->k", rotated, robot["inertia"], rotated)
        return total

    before, after = nearby(case.motion, times)
    state = case.motion.state(times)
    found = any_motion.cables(robot, state)
    f = any_motion.tensions(*any_motion.balance(robot, state, found))
    scale = np.abs(f * found.rates).max()
    power = (energy(after) - energy(before)) / (2.0 * STEP)
    np.testing.assert_allclose(power, -np.sum(f * found.rates, axis=1), atol=1e-5 * scale)


def test_a_cable_over_a_pulley_by_hand():
    # The cable comes up at the origin, goes over half of the pulley, and hangs straight down 3 m.
    case, _ = case_of("2T-2", 0)
    robot = {**case.robot, "pulley_radius": np.full(2, 0.1), "pulley_axes": np.tile([0.0, 0.0, 1.0], (2, 1))}
    robot["base_points"] = np.array([[0.0, 0.0, 0.0], [0.4, 0.0, 0.0]])
    still = np.zeros((1, 3))
    state = sampled_motion.State(np.array([[0.2, 0.0, -3.0]]), still, still, np.eye(3)[None], still, still)
    found = any_motion.cables(robot, state)
    np.testing.assert_allclose(found.lengths, 0.1 * np.pi + 3.0, rtol=1e-14)
    np.testing.assert_allclose(found.leaving, [[[0.2, 0.0, 0.0]] * 2], atol=1e-14)
    np.testing.assert_allclose(found.towards, [[[0.0, 0.0, 1.0]] * 2], atol=1e-14)


@pytest.mark.parametrize("kind", ["2T-3", "3T-4", "3T-8", "1R2T-4", "3R3T-7", "3R3T-8", "3R3T-12"])
def test_common_distances_are_those_of_highs(kind):
    case, rng = case_of(kind, 21)
    state = case.motion.state(np.linspace(*case.motion.times, 400))
    matrix, wrench = any_motion.balance(case.robot, state, any_motion.cables(case.robot, state))
    centring = any_motion.Centring(*any_motion.tension_limits(case.robot, case.limits))
    largest = centring.largest(matrix, wrench)
    assert centring.programs < 200
    weight = case.robot["mass"] * case.robot["gravity"]
    for i in rng.integers(0, 400, 12):
        assert largest[i] == pytest.approx(centring.program(matrix[i], wrench[i])[0], abs=1e-8 * weight)


def test_intervals_of_failure_between_samples():
    # A dip of 2e-5 s and a gap of 2e-5 s, between samples 1e-3 s apart, and a failure up to the end.
    def slack(t):
        return np.minimum(np.abs(t - 0.20053) - 1e-5, 0.9123 - t)

    def gap(t):
        return np.where((t > 0.4) & (t < 0.6), 1e-5 - np.abs(t - 0.50027), 1.0)

    times = np.linspace(0.0, 1.0, 1001)
    found = any_motion.failing(slack, times, slack(times))
    np.testing.assert_allclose(found, [[0.20052, 0.20054], [0.9123, 1.0]], atol=1e-9)
    found = any_motion.failing(gap, times, gap(times))
    np.testing.assert_allclose(found, [[0.4, 0.50026], [0.50028, 0.6]], atol=1e-9)
    assert any_motion.smallest(slack, times, slack(times)) == pytest.approx(-0.0877)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_slacks_of_limits_by_hand(sign):
    # Straight up and down below the middle of two spools: cables of 5 m at 4 m, whose rates are 4/5 of the speed.
    case, _ = case_of("2T-2", 0)
    axis = {1.0: "up", -1.0: "down"}[sign]
    robot = {**case.robot, "base_points": np.array([[3.0, 0, 0], [-3.0, 0, 0]]), "mass": 2.0, "z_axis": axis}
    limits = {"tension_min": 1.0, "tension_max": 30.0, "floor": -6.5 * sign, "cable_length_max": 5.5}
    limits |= {"cable_speed_max": 1.0, "cable_acceleration_max": 2.0}
    rates = np.array([[[0.0, 0.0, -sign]], [[0.0, 0.0, -sign]]])
    positions = np.array([[0.0, 0.0, -4.0 * sign], [0.0, 0.0, -5.0 * sign]])
    motion = sampled_motion.sampled([0.0, 1.0], positions, interpolation="hermite", rates=rates)
    expected = {
        "tension": 2.0 * 9.81 / 1.6 - 1.0,
        "floor": 2.5,
        "cable_length_max": 0.5,
        "cable_speed_max": 0.2,
        "cable_acceleration_max": 2.0 - 0.36 / 5.0,
    }
    found = any_motion.verifier(robot, limits, motion).slacks([0.0])
    assert {name: value[0] for name, value in found.items()} == pytest.approx(expected, rel=1e-12)
