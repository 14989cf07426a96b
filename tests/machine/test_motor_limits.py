"""Limits of winches, proved for random motions beside dense samples of an oracle apart, on both sides of each limit."""

import collections
import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motions.test_any_motion import robot_of
from oracles import winches
from oracles.any_motion_cases import KINDS, random_case
from oracles.winch_cases import LIMITS, random_limit, random_winch

import cspr_jax
from cspr_jax.curves.interpolation import interpolated
from cspr_jax.motion.problem import Problem
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.statics.kernel_axes import centred
from cspr_jax.verification.attained import attained
from cspr_jax.verification.criteria import CriterionParts
from cspr_jax.verification.mean_torques import MeanTorques, mean_torques
from cspr_jax.verification.proved_answers import proof_of

MOTORS = CriterionParts(usual=False, motors=True, contacts=False)
BESIDE = 1e-3
FAR = 1e4  # needs beyond this one, where some 1 is usual, grow with each finer sample
RESOLVED = 1e-6  # two of the shortest blocks of time, s
# Samples of the oracle, fewer where each is a linear program.
DENSE = {"samples": 4001}
SPARSE = {"samples": 161, "rounds": 3, "parts": 6}
# Kinds of robots on as many cables as degrees of freedom.
DETERMINED = ("2T-2", "3T-3", "1R2T-3", "3R3T-6", "3R3T-6s")
FLAGS = {
    "motor_speed_max": "motor_too_fast",
    "motor_torque_max": "motor_over_torque",
    "motor_power_max": "motor_over_power",
    "motor_load_max": "motor_over_load",
}


def _motion(case, frame):
    samples, rotated = case.samples, case.samples.get("quaternions")
    if rotated is not None:
        rotated = rotated * np.concatenate([[1.0], frame.signs])
    rates, given_rates = samples.get("rates"), {}
    if rates is not None:
        names = ("velocities", "accelerations")[: rates.shape[1]]
        given_rates = {name: rates[:, i] * frame.signs for i, name in enumerate(names)}
    how = {"interpolation": samples["interpolation"], "ends": samples["ends"]}
    return interpolated(samples["times"], frame.inward(samples["positions"]), rotated, **given_rates, **how)


def _machine(seed, kind, *, pulleys=False, layers=False):
    rng = np.random.default_rng(seed)
    case = random_case(rng, pulleys, kind)
    winch, diameter = random_winch(rng, case, layers)
    robot, frame = centred(cspr_jax.with_cables(robot_of(case), cable_diameter=diameter, winch=winch))
    return rng, case, winch | {"growth": diameter}, robot, _motion(case, frame)


def compare(seed, kind, names=LIMITS, **how):
    """Compare verdicts with the oracle at limits just above and below what a motion needs, and count those proved."""
    rng, case, winch, robot, motion = _machine(seed, kind, **how)
    count, is_redundant = robot.n_cables, robot.n_cables > robot.dof
    weight = case.robot["mass"] * case.robot["gravity"]
    within = {"tension_min": np.zeros(count), "tension_max": np.full(count, 50.0 * weight)} if is_redundant else {}
    proved = collections.Counter()
    for name in names:
        limit = random_limit(rng, winch, name)
        motors = winches.Motors(case.robot, winch, within | {name: limit}, case.motion)
        need, at = winches.largest_need(motors, name, **(SPARSE if is_redundant and "speed" not in name else DENSE))
        if not need < FAR:  # a motion that these tensions cannot give, or one through a singular pose
            continue
        for factor in (1.0 + BESIDE, 1.0 - BESIDE):
            limits = Limits(**within, **{name: limit * need * factor})
            proof = proof_of(Problem(robot, limits, None), motion, parts=MOTORS)  # type: ignore[arg-type]
            expected = "feasible" if factor > 1.0 else FLAGS[name]
            # A choice of tensions from ranges that motors narrow may stay open so near a limit.
            may_stay_open = is_redundant or (factor < 1.0 and _is_brief(motors, name, at, need * factor))
            is_open = may_stay_open and proof.verdict.text == "undecided"
            assert is_open or proof.verdict.text == expected, (seed, kind, name, factor, need)
            proved[name, factor > 1.0] += not is_open
            if factor < 1.0 and not is_redundant and not is_open:
                reached = attained(Problem(robot, limits, None), motion, proof)  # type: ignore[arg-type]
                _check_cause(reached, motors, name, need, factor, start=float(case.samples["times"][0]))
    return proved


def _is_brief(motors, name, time, level):
    """Whether the need about a time is above a level for less time than proofs resolve: a motor stands still at an end.

    Friction then acts on the other side for that instant alone.
    """
    (start, end), beside = motors.motion.times, time + RESOLVED * np.array([-1.0, 1.0])
    return bool((motors.needs(name, beside[(beside > start) & (beside < end)]) < level).all())


def _check_cause(proof, motors, name, need, factor, start):
    """The worst motor is one that needs most, and the failing intervals hold times at which it fails."""
    times = np.array([time for intervals in proof.proof.failing for time in intervals.mean(1)]) + start
    # At the ends of a motion, and where a winch turns back, both sides of friction count.
    assert (motors.needs(name, times) > need * factor * (1.0 - 1e-9)).all()
    worst = int(np.argmin(proof.proof.high / proof.scales))
    row = proof.criteria[worst]
    # Samples may miss the time at which a layer begins, and with it some of what the motor needs.
    missed = 1e-4 if motors.winch.get("layer_turns") is None else BESIDE
    assert row.value(float(proof.proof.high[worst])) / row.allowed == pytest.approx(1.0 / factor, rel=missed)


def each_once(names):
    """Each limit is proved to be kept, and to be exceeded, once; `test_motor_limit_plans` has the root mean square."""
    return {(name, is_kept): 1 for name in names for is_kept in (True, False)}


def test_spatial_point_mass():
    assert compare(1, "3T-3", layers=True) == each_once(LIMITS)


def test_redundant_planar_point_mass():
    names = ("motor_torque_max", "motor_power_max")
    assert compare(4, "2T-3", names=names) == each_once(names)


def test_an_instant_of_standstill_stays_open():
    """At its end a motor that pays out stands still for some 1e-9 s, where friction on the other side takes more."""
    names = ("motor_speed_max", "motor_torque_max")
    expected = each_once(names) | {("motor_torque_max", False): 0}
    assert compare(30, "2T-2", names=names, layers=True) == collections.Counter(expected)


def test_blocks_without_bounds_prove_nothing():
    """Lengths of cables over pulleys have no bounds over the first blocks, nor have radii of drums with layers then."""
    names = ("motor_load_max",)
    assert compare(8, "2T-2", names=names, layers=True, pulleys=True) == each_once(names)


# Kinds whose cases take longest, and most of those with layers, run with `test_any_seed`.
@pytest.mark.thorough
@pytest.mark.parametrize(
    ("kind", "layers"),
    [
        *((kind, False) for kind in KINDS if kind not in ("3T-8", "3R3T-8", "3R3T-12")),
        *((kind, True) for kind in ("2T-2", "2T-3", "1R2T-3", "3R3T-7")),
    ],
)
def test_all_kinds(kind, layers):
    proved = compare(0, kind, layers=layers) + compare(1, kind, layers=layers)
    # Limits that choose tensions may stay open on both sides; all others are proved.
    assert each_once(LIMITS if kind in DETERMINED else ["motor_speed_max"]).keys() <= proved.keys(), proved


@pytest.mark.thorough
@pytest.mark.parametrize("kind", ["3T-3", "3R3T-6"])
def test_pulleys(kind):
    proved = sum((compare(seed, kind, pulleys=True) for seed in range(4)), collections.Counter())
    assert each_once(LIMITS).keys() <= proved.keys(), proved


@pytest.mark.soak
@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=100, deadline=None)
@given(seed=st.integers(0, 2**32), layers=st.booleans(), pulleys=st.booleans())
def test_any_seed(kind, seed, layers, pulleys):
    compare(seed, kind, layers=layers, pulleys=pulleys)


def test_touched_limits_are_kept():
    rng, case, winch, robot, motion = _machine(1, "3T-3")
    for name in LIMITS:
        limit = random_limit(rng, winch, name)
        need, _ = winches.largest_need(winches.Motors(case.robot, winch, {name: limit}, case.motion), name)
        for factor, expected in ((1.0, "feasible"), (1.0 - 1e-6, FLAGS[name])):
            problem = Problem(robot, Limits(**{name: limit * need * factor}), None)  # type: ignore[arg-type]
            assert proof_of(problem, motion, parts=MOTORS).verdict.text == expected


WINCH = {"drum_radius": 0.02, "gear_ratio": 3.0, "friction": 0.005, "efficiency": 0.9, "motor_inertia": 1e-5}
PLAN = {
    "schema": 1,
    "family": "spline",
    "pose": [
        {"position": [0.0, 0.0, 1.4], "time": 0.0},
        {"position": [0.1, 0.05, 1.3], "time": 1.0},
        {"position": [0.0, 0.0, 1.4], "time": 2.5},
    ],
}
SPOOLS = [[0.23, -0.13, 0.0], [-0.23, -0.13, 0.0], [0.0, 0.26, 0.0]]


def _plan(winch=None, **more):
    robot = {"name": "test", "base_points": SPOOLS, "mass": 0.2} | ({} if winch is None else {"winch": winch})
    return PLAN | {"robot": robot} | more


@pytest.mark.parametrize(
    ("winch", "more", "words"),
    [
        (None, {"limits": {"motor_speed_max": 3.0}}, "the robot has no winches"),
        (WINCH, {"limits": {"motor_load_max": 1.0}}, "no motor_stall_torque"),
        (WINCH, {"limits": {"motor_torque_max": [1.0, 2.0]}}, "3: one a cable"),
        (WINCH, {"limits": {"motor_torque_max": 1.0, "uncertainty": {"mass_factor": 1.1}}}, "a limit of winches"),
        (WINCH | {"motor_load_max": 1.0}, {}, "motor_stall_torque"),
        (WINCH | {"motor_power_max": -1.0}, {}, "motor_power_max"),
    ],
)
def test_wrong_limits_are_refused_in_one_line(winch, more, words):
    with pytest.raises(cspr_jax.errors.ConfigError) as caught:
        cspr_jax.plan(_plan(winch, **more))
    assert words in str(caught.value) and "\n" not in str(caught.value)


def test_functions_without_such_a_proof_refuse_them():
    plain = cspr_jax.point_mass(SPOOLS, mass=0.2)
    robot = cspr_jax.with_cables(plain, winch=WINCH | {"motor_speed_max": 3.0})
    with pytest.raises(cspr_jax.errors.InputError, match="does not exist yet for limits of winches"):
        cspr_jax.minimum_arcs(robot, [[0.1, 0.1, 1.4]], z0=1.4)
    assert dataclasses.asdict(robot.limits)["motor_speed_max"].tolist() == [3.0] * 3
    line = WINCH | {"motor_stall_torque": 0.1, "motor_no_load_speed": 100.0}
    with pytest.raises(cspr_jax.errors.InputError, match=r"follows from winch\.motor_stall_torque"):
        cspr_jax.minimum_arcs(cspr_jax.with_cables(plain, winch=line), [[0.1, 0.1, 1.4]], z0=1.4)


def test_only_segments_at_fault_are_refused():
    """The first segment alone takes more than the root mean square that is allowed, and so does the plan."""
    poses = [pose | {"time": time} for pose, time in zip(PLAN["pose"], (0.0, 1.0, 3.0), strict=True)]
    free = cspr_jax.plan(_plan(WINCH | {"motor_torque_rms_max": 9.0}, pose=poses))
    means = mean_torques(free.problem, [motion for leg in free.legs for motion in leg.motions])
    limit = 0.97 * means.rms_low
    assert (means.rms_of_each[1] < limit).all() and (limit < means.rms_of_each[0]).all()
    plan = cspr_jax.plan(_plan(WINCH | {"motor_torque_rms_max": limit.tolist()}, pose=poses))
    first, second = plan.answers.proof
    assert plan.is_feasible.tolist() == [False, True]
    assert second.is_feasible and first.verdict.text == "motor_over_torque_rms"
    assert plan.causes[1] == () and plan.causes[0][0].criterion == "motor_over_torque_rms"


@pytest.mark.parametrize("duration", [0.0, np.nan])
def test_means_over_no_time_are_open(duration):
    """Neither proved nor refuted."""
    totals = MeanTorques(np.zeros((1, 2)), np.zeros((1, 2)), np.array([duration]))
    assert (totals.rms_low == 0.0).all() and np.isposinf(totals.rms_high).all() and (totals.rms_of_each == 0.0).all()
