"""Winches under control in MuJoCo, beside an integration of the same equations by SciPy; what control is good for."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import cspr_jax
from cspr_jax.config.catalogue import CATALOGUE
from cspr_jax.errors import ConfigError

pytest.importorskip("mujoco")
SPOOLS = np.array([[0.23, -0.13, 0.0], [-0.23, -0.13, 0.0], [0.0, 0.26, 0.0]])
WINCH = {"drum_radius": 0.02, "gear_ratio": 3.0, "motor_inertia": 2e-5}
ROBOT = {"name": "prototype", "base_points": SPOOLS.tolist(), "mass": 0.2, "axial_stiffness": 2e4}
PLAN = {
    "schema": 1,
    "family": "spline",
    "pose": [{"position": [0.0, 0.0, 1.2], "time": 0.0}, {"position": [0.04, 0.02, 1.17], "time": 0.8}],
}
SMOOTH = {"delay": 0.0, "encoder_counts": 0.0}


def _plan(**winch):
    return cspr_jax.plan(PLAN | {"robot": ROBOT | {"winch": WINCH | winch}})


@pytest.fixture(scope="module")
def plan():
    return _plan()


def _integrated(points, gains, mass, ticks, damping_time):
    """Positions at the ticks: motors without friction, torques held from tick to tick; z down."""
    angle, speed, torque = points
    stiffness, fall, inertia = 2e4, 0.02 / 3.0, 2e-5

    def derivative(_, state, command):
        position, velocity, turned, rate = np.split(state, [3, 6, 9])
        rays = position - SPOOLS
        length = np.linalg.norm(rays, axis=1)
        along = rays / length[:, None]
        paid = -fall * turned
        stretch = length - paid + damping_time * (along @ velocity + fall * rate)
        tension = np.maximum(stiffness * stretch / paid, 0.0)
        acceleration = np.array([0.0, 0.0, 9.81]) - along.T @ tension / mass
        return np.concatenate([velocity, acceleration, rate, (command - fall * tension) / inertia])

    state, reached, estimate, before = np.concatenate([START, np.zeros(3), angle[0], speed[0]]), [], speed[0], angle[0]
    for k in range(len(ticks)):
        reached.append(state[:3])
        if k:
            estimate = 0.5 * estimate + 0.5 * (state[6:9] - before) / (ticks[1] - ticks[0])
        before = state[6:9]
        command = torque[k] + gains[0] * (angle[k] - state[6:9]) + gains[1] * (speed[k] - estimate)
        period = (0.0, ticks[1] - ticks[0])
        state = solve_ivp(derivative, period, state, args=(command,), rtol=1e-9, atol=1e-12, method="LSODA").y[:, -1]
    return np.array(reached)


START = np.array([0.0, 0.0, 1.2])


def test_the_loop_moves_as_its_equations_say(plan):
    """A heavier effector makes the loop work; set points by formulas, torques without friction."""
    found = cspr_jax.simulate(plan, rate=500.0, bandwidth=40.0, mass_factor=1.2, **SMOOTH)
    rows = plan.rows(500.0)
    length, tension = rows["length"], rows["tension"]
    angle = -length / (1.0 + tension / 2e4) * 3.0 / 0.02
    speed = np.gradient(angle, rows["t"], axis=0, edge_order=2)
    speed[[0, -1]] = 0.0
    effective = 2e-5 + 0.2 * (0.02 / 3.0) ** 2 / 3.0
    gains = effective * 40.0**2, 2.0 * effective * 40.0
    expected = _integrated((angle, speed, found.torque), gains, 0.24, rows["t"][:-1], 0.002)
    strayed = np.linalg.norm(expected - rows["position"][:-1], axis=1).max()
    assert strayed > 1e-4
    np.testing.assert_allclose(found.reached[: len(expected)], expected, atol=0.01 * strayed)


def test_control_holds_what_set_points_alone_do_not(plan):
    held = cspr_jax.simulate(plan, mass_factor=1.05).error.max()
    alone = cspr_jax.simulate(plan, mass_factor=1.05, bandwidth=0.0).error.max()
    assert held < 2e-4 and alone > 10.0 * held


def test_set_points_alone_suffice_for_the_plan_itself(plan):
    """What is left is half a tick, by which held torques lag."""
    found, slower = (cspr_jax.simulate(plan, bandwidth=0.0, rate=rate, **SMOOTH) for rate in (2000.0, 1000.0))
    assert found.error.max() < 1e-4 and found.error.max() < 0.6 * slower.error.max()
    np.testing.assert_allclose(found.tension_reached, found.tension, atol=0.02)


def test_friction_holds_motors_that_set_points_leave():
    """Friction larger than half of the holding torque, which the set points at standstill do not have, holds."""
    found = cspr_jax.simulate(_plan(friction=0.003), bandwidth=0.0, mass_factor=1.1, **SMOOTH)
    assert found.error[0] < 1e-12 and found.error[:20].max() < 1e-4


@pytest.mark.parametrize(
    ("robot", "words"),
    [
        (ROBOT, "winch: must be given"),
        (ROBOT | {"winch": WINCH | {"motor_inertia": 0.0}}, "winch.motor_inertia: must be greater than 0"),
    ],
)
def test_robots_without_their_numbers_are_refused(robot, words):
    with pytest.raises(ConfigError, match=words):
        cspr_jax.simulate(PLAN | {"robot": robot})


def test_motors_give_no_more_torque_than_they_may(plan):
    largest = 1.001 * float(np.abs(plan.rows(2000.0)["tension"]).max()) * WINCH["drum_radius"] / WINCH["gear_ratio"]
    for more in ({"motor_torque_max": largest}, {"motor_stall_torque": largest, "motor_no_load_speed": 1e4}):
        found = cspr_jax.simulate(_plan(**more), mass_factor=1.1, anyway=True)
        assert np.abs(found.torque_reached).max() == pytest.approx(largest, rel=1e-12)


def test_a_plan_without_a_motion_is_not_driven():
    line = {"schema": 1, "family": "quintic", "robot": ROBOT | {"winch": WINCH}}
    outside = cspr_jax.plan(line | {"pose": [{"position": [0.0, 0.0, 1.2]}, {"position": [0.5, 0.0, 1.2]}]})
    assert np.isnan(outside.answers.duration).all()
    with pytest.raises(ConfigError, match="a segment has no motion; see its verdict"):
        cspr_jax.simulate(outside, anyway=True)


EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"


def _of_catalogue(name, stiffness, **winch):
    return tomllib.loads((CATALOGUE / f"{name}.toml").read_text("utf-8")) | {
        "axial_stiffness": stiffness,
        "winch": winch | {"viscous_friction": 1e-5, "efficiency": 0.9},
    }


def _keeps(found, position, end, rotation, tension):
    assert found.error.max() < position and found.error[-1] < end and found.rotated.max() < rotation
    assert np.abs(found.tension_reached - found.tension).max() < tension
    assert found.tension_reached.min() > 0.0


@pytest.mark.thorough
def test_the_camera_of_the_documents_keeps_its_bounds():
    _keeps(cspr_jax.simulate(EXAMPLES / "camera_plan.toml"), 2.5e-3, 1e-4, 1e-9, 3.0)


@pytest.mark.soak
def test_a_platform_on_six_cables_keeps_the_bounds_of_the_documents():
    winch = {"drum_radius": 0.03, "gear_ratio": 5.0, "motor_inertia": 5e-5, "friction": 0.02}
    target = {"position": [0.5, 0.2, 1.3], "tilt_torsion": [0.5, 0.2, 0.0]}
    plan = {"schema": 1, "family": "hypocycloid", "z0": 1.4, "pose": [{"rest": True}, target, {"rest": True}]}
    found = cspr_jax.simulate(plan | {"robot": _of_catalogue("laval-mssm", 2e5, **winch)})
    _keeps(found, 2.5e-4, 5e-5, 1e-3, 1.0)


@pytest.mark.soak
def test_cogiro_keeps_the_bounds_of_the_documents():
    winch = {"drum_radius": 0.05, "gear_ratio": 15.0, "motor_inertia": 1.5e-3, "friction": 0.3}
    at = {0: [0, 0, 1.5], 2: [2, 1, 2.0], 5: [-2, 1.5, 1.2], 7: [0, 0, 1.5]}
    poses = [{"position": list(map(float, position)), "time": float(time)} for time, position in at.items()]
    plan = {"schema": 1, "family": "spline", "pose": poses, "robot": _of_catalogue("cogiro", 1e6, **winch)}
    _keeps(cspr_jax.simulate(plan), 3e-4, 3e-4, 2e-4, 8.0)
