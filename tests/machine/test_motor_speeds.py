"""Searches for least time keep limits of motor speeds: those of cables times radius over gear ratio, cable by cable."""

import numpy as np
import pytest

import cspr_jax
from cspr_jax.curves.interpolation import interpolated
from cspr_jax.families.free.search.time_bounds import time_bounds
from cspr_jax.robots.model.winches import radii

SPOOLS = [[0.23, -0.13, 0.0], [-0.23, -0.13, 0.0], [0.0, 0.26, 0.0]]
DRUM = {"drum_radius": 0.02, "gear_ratio": [2.0, 3.0, 4.0], "motor_inertia": 1e-6}
ROBOT = {"name": "three", "base_points": SPOOLS, "mass": 0.2, "tension_max": 20.0}
POSES = [{"position": [0.0, 0.0, 1.3]}, {"position": [0.05, 0.02, 1.2]}]
# Largest motor speeds, rad/s, and those of the cables, m/s.
MOTORS, CABLES = [25.0, 45.0, 44.0], [0.25, 0.3, 0.22]
FAMILIES = {
    "path": {"path": {"kind": "line", "grid": 60}},
    "quintic": {},
    "s-curve": {"rule": "optimum"},
    "bezier": {"first_control_point": [0.0, 0.0, 1.3]},
    "free": {"starts": 1},
}


def _plan(family, winch=DRUM, **limits):
    robot = ROBOT | {"winch": winch} | ({"cable_diameter": 1e-3} if "layer_turns" in winch else {})
    plan = {"schema": 1, "family": family, "robot": robot, "pose": POSES, "limits": limits}
    return cspr_jax.plan(plan | FAMILIES[family])


def _segment(plan):
    return plan.to_dict()["segments"][0]


@pytest.mark.quick("path")
@pytest.mark.parametrize("family", FAMILIES)
def test_speeds_of_motors_equal_those_of_cables(family):
    of_motors, of_cables, unlimited = (
        _plan(family, DRUM | {"motor_speed_max": MOTORS}),
        _plan(family, cable_speed_max=CABLES),
        _plan(family),
    )
    assert of_motors.feasible
    found, expected = _segment(of_motors), _segment(of_cables)
    assert found["duration"] == pytest.approx(expected["duration"], rel=1e-9)
    assert found["duration"] > 1.02 * _segment(unlimited)["duration"]
    for key in ("lower_bound", "least_duration"):
        if isinstance(expected.get(key), float):
            assert found[key] == pytest.approx(expected[key], rel=1e-9) and found[key] <= found["duration"]
    # The fastest motor is as fast as it may be.
    speed = np.abs(of_motors.rows(2000.0)["rate"]) * np.array(DRUM["gear_ratio"]) / DRUM["drum_radius"]
    assert (speed / np.array(MOTORS)).max() == pytest.approx(1.0, abs=2e-3)


def test_motors_are_named_where_they_bind():
    plans = _plan("path", DRUM | {"motor_speed_max": MOTORS}), _plan("quintic", DRUM | {"motor_speed_max": MOTORS})
    text = str(_segment(plans[0]))
    assert "motor_too_fast" in text and "cable_too_fast" not in text
    assert "motor_speed_max" in _segment(plans[1])["active"]


@pytest.mark.thorough
def test_a_given_duration_is_refused_for_the_motor():
    """Of a Bezier segment; both limits are given, and only a motor exceeds its own."""
    least = _segment(_plan("bezier"))["duration"]
    pose = [POSES[0], POSES[1] | {"duration": 1.05 * least}]
    robot = ROBOT | {"winch": DRUM | {"motor_speed_max": MOTORS}, "cable_speed_max": [1.0, 1.0, 0.9]}
    plan = {"schema": 1, "family": "bezier", "robot": robot, "pose": pose} | FAMILIES["bezier"]
    assert _segment(cspr_jax.plan(plan))["verdict"] == "motor_too_fast"


@pytest.mark.thorough
def test_drums_with_layers_are_searched_on_the_first_and_bounded_on_the_last():
    """Radii grow by 1 mm in a layer of two turns; several lie on the drum."""
    winch = DRUM | {"layer_turns": 2.0, "cable_length": 3.0, "motor_speed_max": MOTORS}
    layered, first = _plan("path", winch), _plan("path", DRUM | {"motor_speed_max": MOTORS})
    robot = layered.problem.robot
    largest = float(np.max(radii(robot.winches, np.zeros(3))))
    assert largest > 0.025 and layered.feasible
    assert _segment(layered)["duration"] == pytest.approx(_segment(first)["duration"], rel=1e-9)
    widest = _plan("path", DRUM | {"drum_radius": largest, "motor_speed_max": MOTORS})
    bound, exact = _segment(layered)["lower_bound"], _segment(widest)["lower_bound"]
    assert 0.9 * exact < bound <= exact * (1.0 + 1e-3) and bound < _segment(widest)["duration"]
    ends = interpolated(np.array([0.0, 1.0]), np.array([pose["position"] for pose in POSES]))
    assert time_bounds(layered.problem, [ends])[0] == time_bounds(widest.problem, [ends])[0]
    assert time_bounds(layered.problem, [ends])[0] < time_bounds(first.problem, [ends])[0]
