"""Plans of platforms on ellipses, on six cables and on eight: states at joints, and tensions by NumPy and HiGHS."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import linprog
from support.motions import states_along

import cspr_jax
from cspr_jax.curves.files import reference_of
from cspr_jax.numerics.linear import rotations

SIX = {
    "schema": 1,
    "robot": "laval-mssm",
    "family": "ellipse",
    "pose": [
        {"rest": True, "position": [0.0, 0.0, 1.0]},
        {
            "ellipse": {
                "centre": [0.1, 0.0, 1.0],
                "half_axes": [[0.3, 0.0, 0.0], [0.0, 0.2, 0.05]],
                "oscillation": {"axis": [0.0, 1.0, 1.0], "angle": 0.15, "phase": 0.5},
                "phase": 0.7,
            },
            "quaternion": [0.9987502603949663, 0.0, 0.0, 0.04997916927067833],
            "turns": 1.25,
        },
        {"rest": True, "position": [0.0, 0.1, 1.1]},
    ],
}
EIGHT = {
    "schema": 1,
    "robot": "cogiro",
    "family": "ellipse",
    "tension_min": 50.0,
    "tension_max": 3000.0,
    "pose": [
        {
            "ellipse": {
                "centre": [0.0, 0.0, 2.0],
                "radius": 1.5,
                "frequency": 0.9,
                "oscillation": {"axis": [0.0, 0.0, 1.0], "angle": 0.2},
            }
        },
        {"turns": 0.5},
    ],
}


def wrenches(robot, state):
    """Wrench matrix, and the wrench that the cables supply, from the balance alone."""
    # Orientations of states count from the reference orientation.
    rotation = np.asarray(state.rotation) @ np.asarray(rotations.matrix(jnp.asarray(reference_of(robot))))
    sign = 1.0 if robot.z_axis == "down" else -1.0
    # From the mass centre, whatever point a robot file measures from.
    arms = np.asarray(robot.platform_points) @ rotation.T
    rays = np.asarray(robot.base_points) - np.asarray(state.position) - arms
    units = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    inertia = rotation @ np.asarray(robot.inertia) @ rotation.T
    spin, pull = np.asarray(state.angular_velocity), np.asarray(state.angular_acceleration)
    force = float(robot.mass) * (np.asarray(state.acceleration) - sign * np.array([0.0, 0.0, float(robot.gravity)]))
    moment = inertia @ pull + np.cross(spin, inertia @ spin)
    return np.concatenate([units.T, np.cross(arms, units).T]), np.concatenate([force, moment])


def states_of(motion, count):
    states = states_along(motion, np.linspace(0.0, 1.0, count))
    return [jax.tree.map(lambda x, i=i: x[i], states) for i in range(count)]


@pytest.fixture(scope="module")
def six():
    return cspr_jax.plan(SIX)


@pytest.mark.thorough
def test_tensions_on_six_cables(six):
    assert six.feasible
    robot = cspr_jax.load_robot("laval-mssm")
    for i, (motion, segment) in enumerate(zip(six.motions, six.to_dict()["segments"], strict=True)):
        least = min(np.linalg.solve(*wrenches(robot, state)).min() for state in states_of(motion, 501))
        assert segment["margin_bound"] <= least
        assert least == pytest.approx(segment["margin"], rel=0.01), i


@pytest.mark.thorough
def test_states_meet_between_segments(six):
    before, after = six.motions
    first, joint = states_of(before, 2)[0], states_of(before, 2)[1]
    for name, a, b in zip(joint._fields, joint, states_of(after, 2)[0], strict=True):
        np.testing.assert_allclose(a, b, atol=1e-12, err_msg=name)
    assert np.abs(first.velocity).max() + np.abs(first.angular_velocity).max() == 0.0
    np.testing.assert_allclose(first.position, [0.0, 0.0, 1.0], atol=1e-15)
    # The ellipse is left after a quarter of a turn more, at 0.7 + pi / 2, with the oscillation of that angle.
    angle = 0.7 + 2.5 * np.pi
    place = np.array([0.1, 0.0, 1.0]) + np.cos(angle) * np.array([0.3, 0, 0]) + np.sin(angle) * np.array([0, 0.2, 0.05])
    np.testing.assert_allclose(joint.position, place, atol=1e-12)
    psi = 0.15 * np.cos(angle - 0.5)
    turning = np.arccos(np.clip(0.5 * (np.trace(joint.rotation @ about_z(0.1).T) - 1.0), -1.0, 1.0))
    assert turning == pytest.approx(abs(psi), abs=1e-7)


def about_z(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


@pytest.mark.thorough
def test_margin_on_eight_cables():
    plan = cspr_jax.plan(EIGHT)
    robot = cspr_jax.load_robot("cogiro")
    segment = plan.to_dict()["segments"][0]
    assert segment["verdict"] == "feasible"
    assert segment["frequency"] == 0.9
    least = np.inf
    for state in states_of(plan.motions[0], 101):
        matrix, wrench = wrenches(robot, state)
        # Largest r with 50 + r <= t <= 3000 - r.
        rows = np.concatenate([np.hstack([-np.eye(8), np.ones((8, 1))]), np.hstack([np.eye(8), np.ones((8, 1))])])
        sides = np.concatenate([np.full(8, -50.0), np.full(8, 3000.0)])
        equal = np.hstack([matrix, np.zeros((6, 1))])
        answer = linprog([0.0] * 8 + [-1.0], rows, sides, equal, wrench, bounds=(None, None))
        least = min(least, -answer.fun)
    assert segment["margin_bound"] <= least
    assert least == pytest.approx(segment["margin"], rel=0.02)
    assert all(number > 0.0 for number in segment["rotation_frequencies"])


@pytest.mark.thorough
def test_the_fastest_frequency_of_a_platform():
    """What lies above it fails: samples know the inertia of the oscillation."""
    ellipse = SIX["pose"][1]["ellipse"] | {"oscillation": {"axis": [0.0, 0.0, 1.0], "angle": 0.3}}
    keys = {"schema": 1, "robot": "laval-mssm", "family": "ellipse", "turns": 1.0}
    fastest = cspr_jax.plan(keys | {"ellipse": ellipse | {"frequency": "fastest"}})
    assert fastest.feasible
    above = fastest.to_dict()["segments"][0]["frequency"] * (1.0 + 3e-4)
    assert not cspr_jax.plan(keys | {"ellipse": ellipse | {"frequency": above}}).feasible
