"""Limits of winches in plans of a family with its own proof, just beside demands that NumPy finds in dense rows."""

import numpy as np
import pytest

import cspr_jax
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.verification.mean_torques import mean_torques

WINCH = {"drum_radius": 0.02, "gear_ratio": 3.0, "friction": 0.005, "efficiency": 0.9, "motor_inertia": 1e-5}
SPOOLS = [[0.23, -0.13, 0.0], [-0.23, -0.13, 0.0], [0.0, 0.26, 0.0]]
PLAN = {
    "schema": 1,
    "family": "hypocycloid-standard",
    "z0": 1.4,
    "robot": {"name": "test", "base_points": SPOOLS, "mass": 0.2, "winch": WINCH},
    "pose": [{"rest": True}, {"position": [0.2, 0.1, 1.4], "arcs": 2}],
}
BESIDE = 1e-3


def _segment(**limits):
    plan = cspr_jax.plan(PLAN | ({"limits": limits} if limits else {}))
    return plan, plan.to_dict()["segments"][0]


@pytest.fixture(scope="module")
def torques():
    """Times, and torques of the motors from rates and tensions of the plan without limits, (n, 3)."""
    plan, segment = _segment()
    assert segment["verdict"] == "feasible"
    rows = plan.rows(4000.0)
    speed = -WINCH["gear_ratio"] * rows["rate"] / WINCH["drum_radius"]
    side = np.sign(speed)
    driven = rows["tension"] * WINCH["drum_radius"] / WINCH["gear_ratio"] / WINCH["efficiency"] ** side
    inertia = WINCH["motor_inertia"] * np.gradient(speed, rows["t"], axis=0)
    return rows["t"], driven + inertia + WINCH["friction"] * side


def test_largest_torque(torques):
    largest = np.abs(torques[1]).max(0)
    _, kept = _segment(motor_torque_max=float(largest.max()) * (1.0 + BESIDE))
    assert kept["verdict"] == "feasible"
    _, refused = _segment(motor_torque_max=float(largest.max()) * (1.0 - BESIDE))
    assert refused["verdict"] == "motor_over_torque"
    assert refused["cause"][0]["cable"] == largest.argmax()


def test_root_mean_square(torques):
    times, values = torques
    rms = float(np.sqrt(np.trapezoid(values**2, times, axis=0) / times[-1]).max())
    kept = _segment(motor_torque_rms_max=rms * (1.0 + BESIDE))[1]
    # Friction jumps between the points of the rule where a cable stops winding.
    assert kept["verdict"] == "feasible" and kept["motor_torque_rms_max"] == pytest.approx(rms, rel=5e-4)
    assert _segment(motor_torque_rms_max=rms * (1.0 - BESIDE))[1]["verdict"] == "motor_over_torque_rms"


def test_means_of_a_drum_with_one_layer_are_those_without_layers():
    """All of the cable lies in the first layer, of the same radius; the bounds of both are equally close."""
    layers = {"layer_turns": 100.0, "cable_length": 5.0}
    robot = PLAN["robot"] | {"cable_diameter": 1e-3}
    limits = {"motor_torque_rms_max": 1.05 * _segment(motor_torque_rms_max=1.0)[1]["motor_torque_rms_max"]}
    plans = [
        cspr_jax.plan(PLAN | {"limits": limits, "robot": robot | {"winch": WINCH | more}}) for more in ({}, layers)
    ]
    plain, layered = (mean_torques(plan.problem, [leg.motions[0] for leg in plan.legs]) for plan in plans)
    np.testing.assert_allclose(layered.rms_low, plain.rms_low, rtol=1e-9)
    np.testing.assert_allclose(layered.rms_high, plain.rms_high, rtol=1e-9)


@pytest.mark.thorough
@pytest.mark.parametrize("limits", [{"motor_torque_max": 0.013}, {"motor_torque_rms_max": 0.0084}])
def test_cells_of_maps_equal_plans(limits):
    """Verdicts and numbers of arcs of three cells, which need 1, 2 and 2 arcs without the limit."""
    usual, xs = {"amplitude": "quintic", "limits": limits}, [0.02, 0.1, 0.2]
    start = {"family": PLAN["family"], "amplitude": usual["amplitude"], "from": {"rest": True}, "max_arcs": 6}
    axes = {"x": xs, "y": [0.1], "z": [1.4], "z0": [1.4]}
    sweep = {"schema": 1, "map": "minimum-arcs", "robot": PLAN["robot"], "axes": axes, "trajectory": start}
    cells = cspr_jax.compute_sweep(sweep | {"limits": usual["limits"]})
    found = list(zip(cells["verdict"].values.ravel() == 0, cells["arcs"].values.ravel().tolist(), strict=True))
    poses = [[{"rest": True}, {"position": [x, 0.1, 1.4]}] for x in xs]
    plans = [cspr_jax.plan(PLAN | usual | {"pose": pose, "max_arcs": 6}) for pose in poses]
    assert found == [(plan.feasible, plan.to_dict()["segments"][0]["arcs"] or 0) for plan in plans]
    assert [arcs for _, arcs in found] != [1, 2, 2] and any(feasible for feasible, _ in found)


@pytest.mark.thorough
def test_retimed_plans_keep_the_root_mean_square():
    """Two slow lines: as fast as tensions allow they take too much torque; the one that takes most stays as planned."""
    poses = [{"position": place} for place in ([0.0, 0.0, 1.3], [0.05, 0.02, 1.2], [0.02, 0.0, 1.25])]
    robot = PLAN["robot"] | {"tension_max": 2.0}
    lines = {"schema": 1, "family": "quintic", "max_acceleration": 0.3, "pose": poses}

    def means(plan):
        return mean_torques(plan.problem, [motion for leg in plan.legs for motion in leg.motions])

    def retimed(largest):
        plan = cspr_jax.plan(lines | {"robot": robot | {"winch": WINCH | {"motor_torque_rms_max": largest}}})
        return plan, cspr_jax.retime(plan, grid=40)

    plan, free = retimed(9.0)
    before, after = means(plan).rms_high.max(), means(free).rms_low.max()
    assert free.answers.is_retimed.all() and after > 1.1 * before
    planned, kept = retimed(float(0.3 * after + 0.7 * before))
    assert planned.feasible and kept.feasible and not kept.answers.is_retimed.all()
    assert any("motor_torque_rms_max" in line for line in kept.warnings)


def test_motors_bind_rows_of_motion_files(torques):
    """Where the limit of torque is nearest, its motor is named; it is exceeded where NumPy says so."""
    limit = 0.9 * float(np.abs(torques[1]).max())
    rows = _segment(motor_torque_max=limit)[0].rows(4000.0)
    assert len(rows["binding"]) == len(torques[0])
    over = np.abs(torques[1]) > limit * (1.0 + BESIDE)
    named = rows["binding"] == Verdict.MOTOR_OVER_TORQUE
    inside = slice(2, -2)  # ends, where NumPy's differences are one-sided
    assert over[inside].any() and named[inside][over[inside].any(1)].all()
    assert (_segment(motor_torque_max=1e3 * limit)[0].rows(100.0)["binding"] == Verdict.SLACK_CABLE).any()
    worst = np.abs(torques[1]).argmax(1) + 1
    np.testing.assert_array_equal(rows["binding_cable"][inside][named[inside]], worst[inside][named[inside]])


def _poses(times, positions):
    return [{"time": time, "position": each} for time, each in zip(times.tolist(), positions.tolist(), strict=True)]


def test_means_of_many_checks():
    """Two motions of 2 s, of which the longer one needs more torque on average."""
    times, positions = np.linspace(0.0, 2.0, 5), np.zeros((2, 5, 3))
    positions[..., 2] = 1.4
    positions[0, :, 0], positions[1, :, 0] = np.linspace(0.0, 0.02, 5), np.linspace(0.0, 0.1, 5)
    robot = cspr_jax.with_cables(cspr_jax.point_mass_robot(SPOOLS, mass=0.2), winch=WINCH)
    plans = [
        {"schema": 1, "family": "spline", "robot": PLAN["robot"], "pose": _poses(times, each)} for each in positions
    ]
    segments = [cspr_jax.plan(plan).to_dict()["segments"] for plan in plans]
    # The motor with the largest mean is the same in all segments, which are of one duration.
    means = [np.sqrt(np.mean([row["motor_torque_rms_max"] ** 2 for row in rows])) for rows in segments]
    between = 0.5 * float(means[0] + means[1])
    checks = cspr_jax.check_many(robot, times, positions, limits={"motor_torque_rms_max": between})
    assert means[0] < means[1] and checks.verdict.tolist()[0] == 0
    assert [cause.criterion for cause in checks.causes[1]] == ["motor_over_torque_rms"]


@pytest.mark.thorough
def test_means_beside_obstacles_leave_clearances():
    """Clearances of a map are those without the limit of the mean, which every cell keeps."""
    start = {"family": PLAN["family"], "amplitude": "quintic", "from": {"rest": True}, "max_arcs": 6}
    axes = {"x": [0.1, 0.2], "y": [0.1], "z": [1.4], "z0": [1.4]}
    ball = {"name": "ball", "kind": "sphere", "centre": [0.2, 0.1, 1.9], "radius": 0.1}
    sweep = {"schema": 1, "map": "minimum-arcs", "robot": PLAN["robot"], "axes": axes, "trajectory": start}
    sweep["obstacle"] = [ball]
    clearances = [
        cspr_jax.compute_sweep(sweep | {"limits": limits})["clearance"].values
        for limits in ({}, {"motor_torque_rms_max": 0.02})
    ]
    assert np.isfinite(clearances[0]).all()
    np.testing.assert_array_equal(*clearances)
