"""Motions with bounds of their states within an uncertainty, against robots that NumPy simulates one by one."""

import jax
import numpy as np
import pytest
from scipy.optimize import linprog
from support.motions import states_along
from support.other_robots import on_balls, uncertain
from support.splines import random_spline

import cspr_jax
from cspr_jax.motion.amplitudes import named
from cspr_jax.motion.problem import Problem
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.statics.kernel_axes import centred
from cspr_jax.verification.bounds.block_slacks import block_slacks
from cspr_jax.verification.robustness.motion_tolerances import motion_tolerances, states_as_bounds
from cspr_jax.verification.robustness.uncertain_slacks import Radii, lower_slacks

# Robots, where they move and how far, m, their tilt, limits.
CASES = {
    "prototype": ((0.0, 0.0, 1.0), 0.06, 0.0, {"tension_max": 2.5}),
    "transition-planar": ((0.0, 0.0, 2.0), 0.2, 0.0, {}),
    "boralugoda-rectangle": ((0.0, 0.0, 2.0), 0.4, 0.0, {"tension_min": 30.0, "tension_max": 1000.0}),
    "laval-mssm": ((0.0, 0.0, 1.7), 0.1, 0.03, {}),
    "cogiro": ((0.0, 0.0, 4.0), 1.0, 0.05, {"tension_min": 10.0, "tension_max": 5000.0}),
}
SPOOLS, CENTRE, FACTOR = 0.003, 0.005, 1.02


def case(name, seed, **more):
    middle, size, tilt, limits = CASES[name]
    robot = centred(cspr_jax.load_robot(name))[0]
    numbers = {key: np.full(robot.n_cables, value) for key, value in (limits | more).items()}
    off = uncertain(spool_positions=SPOOLS, mass_centre=CENTRE if tilt else 0.0, mass_factor=FACTOR)
    spline = random_spline(seed, middle=middle, size=size, tilt=tilt)[0]
    return Problem(robot, Limits(**numbers, uncertainty=off), named("quintic")), spline


def states_of(spline, samples):
    return states_along(spline, np.linspace(0.0, 1.0, samples))


def balances(robot, state, base, centre=(0.0, 0.0, 0.0), ratio=1.0):
    """Wrench matrices and wrenches of another robot about its own mass centre, (m, dof, n) and (m, dof)."""
    base, centre, gravity = np.asarray(base), np.asarray(centre), np.array([0.0, 0.0, float(robot.gravity)])
    mass = ratio * float(robot.mass)
    if robot.pattern != "3R3T":
        away = base - state.position[:, None]
        axes = [0, 2] if robot.pattern == "2T" else [0, 1, 2]
        matrix = np.swapaxes(away / np.linalg.norm(away, axis=2, keepdims=True), 1, 2)
        return matrix[:, axes], (mass * (state.acceleration - gravity))[:, axes]
    turn, omega, alpha = state.rotation, state.angular_velocity, state.angular_acceleration
    shift = turn @ centre
    arms = (np.asarray(robot.platform_points) - centre) @ np.swapaxes(turn, 1, 2)
    away = base - (state.position + shift)[:, None] - arms
    units = away / np.linalg.norm(away, axis=2, keepdims=True)
    acceleration = state.acceleration + np.cross(alpha, shift) + np.cross(omega, np.cross(omega, shift))
    inertia = turn @ (ratio * np.asarray(robot.inertia)) @ np.swapaxes(turn, 1, 2)
    spin = np.cross(omega, (inertia @ omega[..., None])[..., 0]) + (inertia @ alpha[..., None])[..., 0]
    matrix = np.concatenate([units, np.cross(arms, units)], axis=2)
    return np.swapaxes(matrix, 1, 2), np.concatenate([mass * (acceleration - gravity), spin], axis=1)


def room(limits, matrix, wrench):
    """Largest distance of tensions from their limits at each instant, (m,) N, negative where there is none."""
    count = matrix.shape[2]
    low = np.zeros(count) if limits.tension_min is None else np.asarray(limits.tension_min)
    high = np.full(count, np.inf) if limits.tension_max is None else np.asarray(limits.tension_max)
    if count == matrix.shape[1]:
        tension = np.linalg.solve(matrix, wrench[..., None])[..., 0]
        return np.minimum(tension - low, high - tension).min(1)
    ones, rooms = np.ones((count, 1)), []
    for a, w in zip(matrix, wrench, strict=True):
        rows, ends = np.block([[-np.eye(count), ones], [np.eye(count), ones]]), np.concatenate([-low, high])
        left = np.column_stack([a, np.zeros(len(a))])
        rooms.append(-linprog([0.0] * count + [-1.0], rows, ends, left, w, bounds=(None, None), method="highs").fun)
    return np.array(rooms)


def others_of(robot, rng, multiple, count):
    """Robots at the rim of a multiple of the uncertainty: spools, mass centre, ratio of masses."""
    base = np.asarray(robot.base_points)
    for _ in range(count):
        spools = on_balls(rng, (len(base),), multiple * SPOOLS)
        if robot.pattern == "2T":
            spools = spools * np.array([1.0, 0.0, 1.0])
        centre = on_balls(rng, (), multiple * CENTRE) if robot.pattern == "3R3T" else np.zeros(3)
        yield base + spools, centre, FACTOR ** (multiple * rng.choice([-1.0, 1.0]))


def worst_rooms(problem, state, multiple):
    """Least room of robots that are worst to first order, each at its instant, by differences."""
    robot, limits = problem.robot, problem.limits
    base, step = np.asarray(robot.base_points), 1e-6
    is_platform = robot.pattern == "3R3T"
    for ratio in FACTOR ** (multiple * np.array([-1.0, 1.0])):
        planned = room(limits, *balances(robot, state, base, ratio=ratio))
        slopes, turns = np.zeros((len(planned), *base.shape)), np.zeros((len(planned), 3))
        for j, i in np.ndindex(*base.shape):
            move = np.zeros_like(base)
            move[j, i] = step
            slopes[:, j, i] = (room(limits, *balances(robot, state, base + move, ratio=ratio)) - planned) / step
        for i in range(3 * is_platform):
            turns[:, i] = (room(limits, *balances(robot, state, base, step * np.eye(3)[i], ratio)) - planned) / step
        for k in range(len(planned)):
            one = jax.tree.map(lambda x, k=k: x[k : k + 1], state)
            spools = -multiple * SPOOLS * slopes[k] / np.linalg.norm(slopes[k], axis=1, keepdims=True)
            centre = -multiple * CENTRE * turns[k] / np.linalg.norm(turns[k]) if is_platform else np.zeros(3)
            yield room(limits, *balances(robot, one, base + spools, centre, ratio))[0]


@pytest.mark.ci("prototype")
@pytest.mark.thorough
@pytest.mark.parametrize("name", CASES)
def test_no_robot_within_a_proved_multiple_fails_and_one_within_a_refuted_one_does(name):
    is_redundant = name in ("boralugoda-rectangle", "cogiro")
    rng = np.random.default_rng(0)
    for seed in range(2):
        problem, spline = case(name, seed)
        (proved,), (refuted,) = motion_tolerances(problem, spline)
        assert (0.1 if is_redundant else 0.7) * refuted < proved < refuted
        state = states_of(spline, 41 if is_redundant else 801)
        for base, centre, ratio in others_of(problem.robot, rng, proved, 4 if is_redundant else 100):
            assert (room(problem.limits, *balances(problem.robot, state, base, centre, ratio)) > 0.0).all()
        assert min(worst_rooms(problem, state, 0.999 * proved)) > 0.0
        assert min(worst_rooms(problem, state, 1.02 * refuted)) < 0.0


# Earlier answers: sums of lower and upper bounds of slacks over 64 blocks, multiples that are proved and refuted.
EARLIER = {
    "prototype": (539.926155335892, 547.8629590650987, 17.381225303436, 17.55679323579394),
    "transition-planar": (212.39536948122557, 214.64128138189074, 164.81993372082331, 171.7738975524902),
    "boralugoda-rectangle": (19540.70280540089, 20003.536303128818, 38.412865660858145, 47.59375),
    "laval-mssm": (1839.5049888590202, 1863.4279621750402, 9.423449796712482, 10.122499651727225),
    "cogiro": (18142.480461788335, 19227.320430081763, 42.545277191162114, 128.75),
}


@pytest.mark.thorough
@pytest.mark.parametrize(
    "name", [name if name == "prototype" else pytest.param(name, marks=pytest.mark.thorough) for name in EARLIER]
)
def test_answers_are_those_of_before(name):
    """However the kernels are written and compiled."""
    problem, spline = case(name, 1)
    edges = np.linspace(0.0, float(spline.duration()), 65)
    slacks = block_slacks(problem.robot, problem.limits, spline.bounds, edges[:-1], edges[1:])
    multiples = np.concatenate(motion_tolerances(problem, spline)[:2])
    np.testing.assert_allclose([slacks.low.sum(), slacks.high.sum(), *multiples], EARLIER[name], rtol=1e-9)


def demands(base, state):
    """Lengths, speeds and accelerations of the cables of a point mass, (m, n_cables) each."""
    rays = state.position[:, None] - base
    length = np.linalg.norm(rays, axis=2)
    rate = np.sum(rays * state.velocity[:, None], axis=2) / length
    second_derivative = (
        np.sum(state.velocity**2, axis=1)[:, None] + np.sum(rays * state.acceleration[:, None], axis=2) - rate**2
    )
    return length, np.abs(rate), np.abs(second_derivative / length)


def test_slacks_of_light_and_heavy_robots():
    """At instants, of robots whose mass alone is another one: bounds are the slacks themselves."""
    problem, spline = case("prototype", 0, tension_min=0.05)
    robot, limits, nothing = problem.robot, problem.limits, np.zeros(9)
    instants = states_as_bounds(spline, np.linspace(0.0, 1.0, 9))
    found = lower_slacks(robot, limits, (instants, Radii(nothing, nothing, nothing + 1.3)))
    state, base = states_of(spline, 9), robot.base_points
    matrices = [balances(robot, state, base, ratio=ratio) for ratio in (1.0 / 1.3, 1.3)]
    tensions = np.array([np.linalg.solve(matrix, wrench[..., None])[..., 0] for matrix, wrench in matrices])
    wanted = np.concatenate([tensions.min(0) - limits.tension_min, limits.tension_max - tensions.max(0)], axis=1)
    np.testing.assert_allclose(found[:, : wanted.shape[1]], wanted, atol=1e-9)


@pytest.mark.thorough
@pytest.mark.parametrize("row", [0, 1, 2])
def test_limits_of_cables_hold_for_all_robots(row):
    names = "cable_length_max", "cable_speed_max", "cable_acceleration_max"
    problem, spline = case("prototype", 0)
    state, base = states_of(spline, 801), np.asarray(problem.robot.base_points)
    largest = demands(base, state)[row].max()
    problem, spline = case("prototype", 0, **{names[row]: 1.01 * largest})
    (proved,), (refuted,) = motion_tolerances(problem, spline)
    # Bounds of accelerations take their terms one by one.
    assert (0.4 if row == 2 else 0.9) * refuted < proved < refuted
    rng, reached = np.random.default_rng(1), []
    for other, _, _ in others_of(problem.robot, rng, proved, 400):
        reached.append(demands(other, state)[row].max() / (1.01 * largest))
    assert 0.99 < max(reached) < 1.0


@pytest.mark.thorough
def test_hypocycloids_tolerate_what_their_own_proof_says():
    off = {"spool_positions": 0.004, "mass_factor": 1.05}
    keys = {
        "schema": 1,
        "robot": "prototype",
        "family": "hypocycloid-standard",
        "z0": 1.4,
        "limits": {"uncertainty": off, "tension_min": 0.05},
        "pose": [{"position": [0, 0, 1.4], "rest": True}, {"position": [0.2, 0.1, 1.3]}, {"position": [-0.1, 0, 1.2]}],
    }
    plan = cspr_jax.plan(keys)
    for i, motion in enumerate(plan.legs[0].motions):
        (proved,), (refuted,) = motion_tolerances(plan.problem, motion)
        exact = plan.answers.tolerated[i], plan.answers.not_tolerated[i]
        assert proved == pytest.approx(exact[0], rel=0.03) and refuted == pytest.approx(exact[1], rel=0.03)
        assert max(proved, exact[0]) < min(refuted, exact[1])


TIMES = np.linspace(0.0, 6.0, 7)
PLACES = np.array([0.0, 0.0, 1.0]) + 0.06 * np.random.default_rng(1).uniform(-1.0, 1.0, (7, 3))


@pytest.mark.thorough
def test_checks_are_of_all_robots():
    small = cspr_jax.check("prototype", TIMES, PLACES, limits={"uncertainty": {"spool_positions": 0.01}})
    shown = small.to_dict()
    assert small.feasible and 1.0 < shown["tolerated"] < shown["not_tolerated"] and shown["cause"] == []
    assert f"{shown['tolerated']:.3g} of the uncertainty" in small.lines()[-1]
    size = 0.01 * shown["not_tolerated"] * 1.02
    large = cspr_jax.check("prototype", TIMES, PLACES, limits={"uncertainty": {"spool_positions": size}})
    shown = large.to_dict()
    assert large.verdict == "uncertainty" and not large.feasible and len(large.failing) == 0
    (cause,) = shown["cause"]
    assert (cause["criterion"], cause["needed"], cause["unit"]) == ("uncertainty", 1.0, "1")
    assert cause["allowed"] == shown["tolerated"] < shown["not_tolerated"] <= 1.0
    assert "of the uncertainty, 1 needed" in large.lines()[-1]
    limits = cspr_jax.Limits(uncertainty=uncertain(spool_positions=size))
    assert cspr_jax.check("prototype", TIMES, PLACES, limits=limits).to_dict() == shown
    many = cspr_jax.check_many("prototype", TIMES, PLACES[None], limits={"uncertainty": {"spool_positions": size}})
    assert many.verdict[0] == large.plan.answers.verdict[0]
    assert cspr_jax.check("prototype", TIMES, PLACES).to_dict()["tolerated"] is None
