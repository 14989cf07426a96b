"""Bezier segments against plain NumPy: the motion, exact verdicts, durations by roots, limits by proof."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from oracles import beziers as oracle
from scipy.spatial.transform import Rotation
from support.motions import states_along

import cspr_jax
from cspr_jax import Limits, Verdict
from cspr_jax.errors import InputError
from cspr_jax.families.beziers.margins import smallest_cubic, smallest_margins, smallest_quadratic
from cspr_jax.families.beziers.motion import Bezier

HEIGHT = 0.35 * np.sqrt(3.0) / 2.0
SPOOLS = np.array([[0.35, 0.0, 0.0], [-0.175, HEIGHT, 0.0], [-0.175, -HEIGHT, 0.0]])
GRAVITY = 9.80665
EVERY = {
    "tension_min": 0.4,
    "tension_max": 9.0,
    "floor": 1.15,
    "cable_length_max": 1.3,
    "cable_speed_max": 1.2,
    "cable_acceleration_max": 6.0,
}


def triangles(rng, count, *, level=False):
    """Spools about the origin, no two of them near to each other."""
    found = []
    while len(found) < count:
        spools = rng.normal(size=(3, 3)) * [0.5, 0.5, 0.0 if level else 0.1]
        spools -= spools.mean(0)
        if np.linalg.norm(np.cross(spools[1] - spools[0], spools[2] - spools[0])) > 0.2:
            found.append(spools)
    return found


def segments(rng, count):
    """Control points, most of them below the spools, (count, 3, 3), and durations."""
    points = rng.normal(size=(count, 3, 3)) * [0.2, 0.2, 0.35] + [0.0, 0.0, 1.1]
    points[:, 0, 2] = np.abs(points[:, 0, 2]) + 0.5
    return points, np.exp(rng.uniform(np.log(0.6), np.log(4.0), count))


def results(spools, points, times, gravity=GRAVITY, **limits):
    robot = cspr_jax.point_mass(spools, mass=0.7, gravity=gravity)
    first, middle, last = np.moveaxis(points, 1, 0)
    limits = Limits(**limits) if limits else None
    return cspr_jax.bezier_verdicts(robot, first, middle, last, durations=times, limits=limits)


def compare_with_samples(rng, robots, each, samples):
    """Counts of feasible and of other segments, after each verdict was compared with samples."""
    counts = [0, 0]
    for spools in triangles(rng, robots):
        points, times = segments(rng, each)
        found = results(spools, points, times)
        assert not (found.verdict == Verdict.UNDECIDED).any()
        for i in range(each):
            slack, depth = oracle.least_slack(spools, GRAVITY, points[i], times[i], samples)
            flags = Verdict(int(found.verdict[i]))
            assert (slack > 0.0) == (Verdict.SLACK_CABLE not in flags), (spools, points[i], times[i])
            assert (depth > 0.0) == (Verdict.ABOVE_SPOOLS not in flags), (spools, points[i], times[i])
            assert found.margin_bound[i] <= found.margin[i]
            # Between samples a smallest value lies a little lower.
            sampled = min(3.0 * slack / GRAVITY, depth / oracle.depth(spools, points[i, 0]))
            assert sampled - 1e-3 <= found.margin[i] <= sampled + 1e-12
            counts[0 if found.feasible[i] else 1] += 1
    return counts


def test_the_motion_is_the_curve_of_its_control_points():
    robot = cspr_jax.point_mass(SPOOLS + np.array([1.0, 2.0, 0.5]), mass=1.0, gravity=GRAVITY)
    points = np.array([[0.1, 0.2, 1.3], [0.4, -0.2, 1.0], [-0.3, 0.1, 1.7]])
    motion = cspr_jax.bezier(robot, *points, duration=1.7)
    tau = np.linspace(0.0, 1.0, 41)
    state = states_along(motion, tau)
    for own, wanted in zip(state[:3], oracle.states(points, 1.7, 40), strict=True):
        np.testing.assert_allclose(own, wanted, atol=1e-13)
    # Derivatives of one another.
    changes = jax.jit(jax.vmap(lambda t: jax.jvp(lambda x: motion.state(x)[:2], (t,), (jnp.ones_like(t),))[1]))(tau)
    for change, slope in zip(changes, state[1:3], strict=True):
        np.testing.assert_allclose(np.asarray(change) / 1.7, slope, atol=1e-12)


@given(st.lists(st.floats(-3.0, 3.0), min_size=4, max_size=4))
def test_smallest_values_of_polynomials(powers):
    c = np.linspace(-1.0, 1.0, 4001)
    for function, own in ((smallest_cubic, powers), (smallest_quadratic, powers[:3])):
        values = np.polynomial.polynomial.polyval(c, own)
        found = float(jax.jit(function)(jnp.asarray(own)))
        assert found <= values.min() + 1e-12 and found >= values.min() - 1e-5


def test_verdicts_are_those_of_samples():
    feasible, other = compare_with_samples(np.random.default_rng(0), 12, 25, 1001)
    assert feasible >= 15 and other >= 150


@pytest.mark.soak
def test_verdicts_are_those_of_ten_thousand_samples():
    feasible, other = compare_with_samples(np.random.default_rng(1), 100, 100, 10_001)
    assert feasible >= 500 and feasible + other == 10_000


def test_the_printed_rule_accepts_slack_cables():
    """(25) asks for the larger one of both inner extrema: here it accepts a segment on which a cable would push."""
    rng = np.random.default_rng(2)
    points, times = segments(rng, 1500)
    found = results(SPOOLS, points, times)

    def accepted(i):
        return oracle.printed_rule(SPOOLS, GRAVITY, points[i], times[i])

    wrong = next(i for i in np.flatnonzero(found.verdict == Verdict.SLACK_CABLE) if accepted(i))
    position, _, acceleration = oracle.states(points[wrong], times[wrong], 500)
    assert oracle.tensions(SPOOLS, 0.7, GRAVITY, position, acceleration).min() < 0.0
    # What is feasible, it accepts.
    assert found.feasible.sum() > 20 and all(map(accepted, np.flatnonzero(found.feasible)[:50]))


def test_verdicts_know_no_axes_units_or_labels():
    rng = np.random.default_rng(3)
    points, times = segments(rng, 60)
    found = results(SPOOLS, points, times)
    turn = Rotation.from_euler("z", 0.7).as_matrix()
    place = np.array([3.0, -2.0, 0.4])
    cases = {
        "turned and moved": results(SPOOLS @ turn.T + place, points @ turn.T + place, times),
        "labels": results(SPOOLS[[1, 0, 2]], points, times),
        "scale": results(100.0 * SPOOLS, 100.0 * points, 10.0 * times),
        "gravity": results(SPOOLS, points, times / np.sqrt(1.7), gravity=1.7 * GRAVITY),
        "backwards": results(SPOOLS, points[:, ::-1], times),
    }
    for name, other in cases.items():
        np.testing.assert_array_equal(found.verdict, other.verdict, name)
        if name != "backwards":  # whose depth is taken over another one
            np.testing.assert_allclose(found.margin, other.margin, rtol=1e-9, atol=1e-9, err_msg=name)
    up = cspr_jax.point_mass(SPOOLS * [1, 1, -1], mass=0.7, gravity=GRAVITY, z_axis="up")
    first, middle, last = np.moveaxis(points * [1, 1, -1], 1, 0)
    np.testing.assert_array_equal(
        found.verdict, cspr_jax.bezier_verdicts(up, first, middle, last, durations=times).verdict
    )


@pytest.mark.parametrize("planar", [False, True])
@pytest.mark.parametrize("given_by", ["control points", "accelerations", "rest"])
def test_durations_by_roots_are_those_of_trial(planar, given_by):
    rng, count = np.random.default_rng(4), 12
    flat = np.array([1.0, 0.0, 1.0]) if planar else np.ones(3)
    spools = np.array([[0.3, 0.0, 0.0], [-0.5, 0.0, 0.0]]) if planar else SPOOLS + np.diag([0.0, 0.05, 0.0])
    robot = cspr_jax.point_mass(spools, mass=1.0, gravity=GRAVITY, planar=planar)
    first, last, middle = ((rng.normal(size=(count, 3)) * [0.2, 0.2, 0.1] + [0.0, 0.0, 1.2]) * flat for _ in range(3))
    turns = rng.normal(size=(count, 3)) * flat * 2.0 * (given_by == "accelerations")
    how = {"control points": {"control_points": middle}, "accelerations": {"accelerations": turns}, "rest": {}}[
        given_by
    ]
    found = cspr_jax.bezier_durations(robot, first, last, **how)
    times = np.geomspace(0.1, 40.0, 301)
    assert any(len(own) for own in found)
    for i in range(count):
        r = ((times / np.pi) ** 2)[:, None]
        middles = (
            np.broadcast_to(middle[i], (len(times), 3)) if given_by == "control points" else first[i] + r * turns[i]
        )
        same = (np.broadcast_to(x[i], middles.shape) for x in (first, last))
        feasible = cspr_jax.bezier_verdicts(robot, next(same), middles, next(same), durations=times).feasible
        inside = np.zeros(len(times), bool)
        for low, high in found[i]:
            inside |= (times >= low) & (times <= high)
        np.testing.assert_array_equal(inside, feasible)


def test_both_ends_of_feasible_durations_are_sharp():
    robot = cspr_jax.point_mass(SPOOLS, mass=1.0, gravity=GRAVITY)
    first, last = np.array([[0.1, 0.15, 0.8]]), np.array([[-0.1, -0.3, 1.2]])
    acceleration = np.array([[-1.0, -1.6, -1.2]])
    ((low, high),) = cspr_jax.bezier_durations(robot, first, last, accelerations=acceleration)[0]
    for time, side in ((low, -1.0), (high, 1.0)):
        for part, feasible in ((0.0, True), (1e-9 * side, False)):
            own = np.array([time * (1.0 + part)])
            middle = first + (own / np.pi) ** 2 * acceleration
            assert cspr_jax.bezier_verdicts(robot, first, middle, last, durations=own).feasible[0] == feasible


def test_durations_between_two_touches_of_a_cable():
    """At both ends two roots in c meet: only the discriminant tells them."""
    robot = cspr_jax.point_mass(SPOOLS, mass=1.0, gravity=9.8)
    points = np.array([[[0.3, -0.3, 1.7], [-0.3, 0.0, 0.7], [0.0, 0.2, 1.5]]])
    first, middle, last = np.moveaxis(points, 1, 0)
    ((low, high),) = cspr_jax.bezier_durations(robot, first, last, control_points=middle)[0]
    times = np.array([low * (1.0 - 1e-9), low, high, high * (1.0 + 1e-9)])
    found = cspr_jax.bezier_verdicts(robot, *(np.repeat(x, 4, axis=0) for x in (first, middle, last)), durations=times)
    np.testing.assert_array_equal(found.feasible, [False, True, True, False])
    assert (found.verdict[~found.feasible] == Verdict.SLACK_CABLE).all()


def slack_of(name, limit, points, time, samples=4000):
    """Smallest slack of a limit by samples, without a unit, and whether it is met."""
    position, velocity, acceleration = oracle.states(points, time, samples)
    tension = oracle.tensions(SPOOLS, 0.7, GRAVITY, position, acceleration)
    length, rate, second_derivative = oracle.cable_states(SPOOLS, position, velocity, acceleration)
    part = 3.0 / (0.7 * GRAVITY)
    return {
        "tension_min": lambda: (tension - limit).min() * part,
        "tension_max": lambda: (limit - tension).min() * part,
        "floor": lambda: (limit - position[:, 2]).min() / points[0, 2],
        "cable_length_max": lambda: 1.0 - length.max() / limit,
        "cable_speed_max": lambda: 1.0 - np.abs(rate).max() / limit,
        "cable_acceleration_max": lambda: 1.0 - np.abs(second_derivative).max() / limit,
    }[name]()


@pytest.mark.parametrize("name", EVERY)
def test_limits_are_those_of_samples(name):
    rng = np.random.default_rng(5)
    points, times = segments(rng, 150)
    taut = results(SPOOLS, points, times)
    some = np.flatnonzero((taut.verdict & Verdict.ABOVE_SPOOLS) == 0)[:60]
    found = results(SPOOLS, points[some], times[some], **{name: EVERY[name]})
    broken = 0
    for own, i in enumerate(some):
        slack = slack_of(name, EVERY[name], points[i], times[i])
        assert found.limit_margin[own] == pytest.approx(slack, rel=1e-4, abs=2e-5)
        assert found.limit_margin[own] <= slack + 1e-12
        other = found.verdict[own] & ~taut.verdict[i]
        assert (found.feasible[own]) == (taut.feasible[i] and slack > 0.0), (i, slack)
        broken += other != 0 or slack < 0.0
    assert 0 < broken < len(some) or name == "tension_min"


def test_gradients_of_the_exact_margin():
    """By the place where it is smallest, which moves without an effect."""
    robot = cspr_jax.point_mass(SPOOLS, mass=1.0, gravity=GRAVITY)
    problem = cspr_jax.make_problem(robot)
    start, end = np.array([0.02, 0.01, 0.7]), np.array([0.25, 0.2, 0.9])

    def margin(x):
        motion = Bezier(start, x[:3], end, x[3], np.asarray(0.7))
        return jnp.min(smallest_margins(problem.robot, motion).taut)

    at, steps = np.array([0.1, 0.02, 0.6, 1.1]), 1e-6 * np.eye(4)
    slope, value = np.asarray(jax.jit(jax.grad(margin))(at)), jax.jit(jax.vmap(margin))
    numbers = np.subtract(*np.reshape(value(np.concatenate([at + steps, at - steps])), (2, 4))) / 2e-6
    np.testing.assert_allclose(slope, numbers, rtol=1e-6, atol=1e-7)
    assert np.isfinite(slope).all() and np.abs(slope).min() > 1e-4


def test_what_is_no_segment_is_refused():
    robot = cspr_jax.point_mass(SPOOLS, mass=1.0)
    one = np.array([[0.0, 0.0, 1.0]])
    assert cspr_jax.bezier_verdicts(robot, one, one, one, durations=[1.0]).to_xarray().margin.dims == ("target",)
    with pytest.raises(InputError, match="durations"):
        cspr_jax.bezier_verdicts(robot, one, one, one, durations=[0.0])
    with pytest.raises(InputError, match="control_points"):
        cspr_jax.bezier_verdicts(robot, one, np.vstack([one, one]), one, durations=[1.0])
    with pytest.raises(InputError, match="accelerations"):
        cspr_jax.bezier_durations(robot, one, one, control_points=one, accelerations=one)
    with pytest.raises(InputError, match="point mass"):
        cspr_jax.bezier_durations(cspr_jax.load_robot("laval-mssm"), one, one)
