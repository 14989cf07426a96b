"""Limits of winches in workspaces: those of poses at rest, and refusals of those that motions decide."""

import numpy as np
import pytest

import cspr_jax
from cspr_jax.errors import CsprError, InputError
from cspr_jax.schema.verdicts import Verdict

SPOOLS = [[0.23, -0.13, 0.0], [-0.23, -0.13, 0.0], [0.0, 0.26, 0.0]]
DRUM = {"drum_radius": 0.02, "gear_ratio": [2.0, 3.0, 4.0]}
ROBOT = {"name": "three", "base_points": SPOOLS, "mass": 0.2}
LINE = {"motor_stall_torque": 0.4, "motor_no_load_speed": 300.0}
AXES = {"x": [-0.2, 0.0, 0.3], "y": [0.0, 0.1, 0.2], "z": [0.4, 1.4]}
# Largest motor speeds, rad/s; those of the cables are 0.7, 0.75 and 0.8 m/s.
SPEEDS = [70.0, 112.5, 160.0]


def _swept(winch, **limits):
    workspace = {"conditions": ["wrench-feasible"], "speed": 0.9}
    sweep = {"schema": 1, "map": "workspace", "robot": ROBOT | {"winch": winch}, "axes": AXES, "workspace": workspace}
    run = {"store": ["verdict", "speed_margin"]}
    return cspr_jax.compute_sweep(sweep | {"limits": limits, "run": run})


def test_speeds_of_motors_are_speeds_of_cables():
    of_motors, of_cables = _swept(DRUM | {"motor_speed_max": SPEEDS}), _swept(DRUM, cable_speed_max=[0.7, 0.75, 0.8])
    both = _swept(DRUM | {"motor_speed_max": SPEEDS}, cable_speed_max=[2.0, 2.0, 0.6])
    np.testing.assert_allclose(of_motors["speed_margin"], of_cables["speed_margin"], atol=1e-12)
    verdicts = [np.asarray(one["verdict"].values).ravel() for one in (of_motors, of_cables, both)]
    too_fast, flags = (verdicts[1] & Verdict.CABLE_TOO_FAST) != 0, Verdict.CABLE_TOO_FAST | Verdict.MOTOR_TOO_FAST
    assert too_fast.any() and ((verdicts[0] & flags) == np.where(too_fast, Verdict.MOTOR_TOO_FAST, 0)).all()
    assert ((verdicts[2] & flags) & Verdict.CABLE_TOO_FAST).any() and (verdicts[2] & Verdict.MOTOR_TOO_FAST).any()


@pytest.mark.parametrize(
    ("winch", "words"),
    [
        ({"motor_power_max": 20.0}, "motor_power_max"),
        (LINE, "winch.motor_stall_torque"),
        ({"motor_torque_max": 0.3, "viscous_friction": 1e-4}, "motor_torque_max"),
        ({"motor_torque_max": 0.3, "motor_inertia": 1e-4}, "motor_torque_max"),
    ],
)
def test_limits_that_speeds_decide_are_refused(winch, words):
    with pytest.raises(CsprError, match=f"(?s){words}.*absent beside speeds|absent beside speeds.*{words}"):
        _swept(DRUM | winch | {"motor_speed_max": 100.0})


def _robot(**winch):
    return cspr_jax.with_cables(cspr_jax.load_robot("prototype"), winch={"drum_radius": 0.02} | winch)


@pytest.mark.parametrize("limit", [{"motor_torque_max": 0.05}, {"motor_torque_rms_max": 0.05}, LINE])
def test_inertia_takes_torque(limit):
    """Of accelerations; without it limits of torque are limits of tension."""
    place = [[0.0, 0.0, 1.4]]
    plain, heavy = _robot(**limit), _robot(**limit, motor_inertia=1e-5)
    largest = (limit.get("motor_stall_torque") or next(iter(limit.values()))) / 0.02
    expected = cspr_jax.available_accelerations(_robot(), place, tension_max=[largest] * 3)
    found = cspr_jax.available_accelerations(plain, place)
    np.testing.assert_allclose(found.margin([0.0, 0.0, -9.0]), expected.margin([0.0, 0.0, -9.0]), rtol=1e-12)
    with pytest.raises(InputError, match="absent beside accelerations"):
        cspr_jax.available_accelerations(heavy, place)
    how = {"condition": "wrench-feasible", "tension_max": np.inf}
    with pytest.raises(InputError, match="absent beside accelerations"):
        cspr_jax.workspace(heavy, place, acceleration=0.1, **how)
    assert cspr_jax.workspace(heavy, place, **how).verdict[0] == 0


def test_the_line_of_a_motor_is_named():
    winch = LINE | {"drum_radius": 0.02, "layer_turns": 20.0, "cable_length": 5.0}
    robot = cspr_jax.with_cables(cspr_jax.load_robot("prototype"), cable_diameter=1e-3, winch=winch)
    with pytest.raises(InputError, match=r"motor_load_max.*follows from winch.motor_stall_torque"):
        cspr_jax.workspace(robot, [[0.0, 0.0, 1.4]], condition="wrench-feasible")
