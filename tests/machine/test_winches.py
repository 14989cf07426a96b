"""Winches: angles, torques and power by an oracle apart, by the balance of power, and wrong numbers in files."""

import dataclasses

import jax
import numpy as np
import pytest

import cspr_jax
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.robots.model import winches as w

SPOOLS = [[0.23, -0.13, 0.0], [-0.23, -0.13, 0.0], [0.0, 0.26, 0.0]]
WINCH = {
    "drum_radius": [0.02, 0.025, 0.03],
    "gear_ratio": 5.0,
    "motor_inertia": 2e-5,
    "friction": 0.01,
    "viscous_friction": 3e-5,
    "efficiency": 0.9,
    "zero_length": [1.0, 1.5, 2.0],
    "direction": [1.0, -1.0, 1.0],
}
LAYERS = {"layer_turns": [7.5, 10.0, 12.0], "cable_length": [9.0, 12.0, 20.0]}


def _winches(**more):
    robot = cspr_jax.point_mass(SPOOLS, mass=0.2)
    return cspr_jax.with_cables(robot, cable_diameter=0.002, winch=WINCH | more).winches


def _each(function, winches, *arrays):
    return jax.vmap(lambda *rows: function(winches, *rows))(*arrays)


def _laid(radius, growth, turns, total, length):
    """Radius and angle of a drum, layer by layer."""
    left, angle = total - length, 0.0
    while left >= (full := 2.0 * np.pi * radius * turns):
        left, angle, radius = left - full, angle + 2.0 * np.pi * turns, radius + growth
    return radius, angle + left / radius


def test_layers_are_laid_one_after_the_other():
    winches, rng = _winches(**LAYERS), np.random.default_rng(1)
    lengths = rng.uniform(0.1, 8.9, (200, 3))
    for k in range(3):
        drum = (WINCH["drum_radius"][k], 0.002, LAYERS["layer_turns"][k], LAYERS["cable_length"][k])
        laid = np.array([_laid(*drum, length) for length in lengths[:, k]])
        zero = _laid(*drum, WINCH["zero_length"][k])[1]
        np.testing.assert_allclose(np.asarray(_each(w.radii, winches, lengths))[:, k], laid[:, 0], atol=1e-12)
        expected = WINCH["direction"][k] * 5.0 * (zero - laid[:, 1])
        np.testing.assert_allclose(np.asarray(_each(w.motor_angles, winches, lengths))[:, k], expected, atol=1e-9)


@pytest.mark.parametrize("more", [{}, LAYERS])
def test_lengths_follow_from_angles(more):
    winches, lengths = _winches(**more), np.random.default_rng(2).uniform(0.1, 8.9, (500, 3))
    again = _each(w.cable_lengths, winches, _each(w.motor_angles, winches, lengths))
    np.testing.assert_allclose(again, lengths, atol=1e-12)


def test_power_is_balanced():
    """Work of the motors: of the cables, of friction, and kinetic energy of the rotors, over random motions."""
    plain = dataclasses.replace(_winches(), efficiency=np.ones(3))
    rng = np.random.default_rng(3)
    lengths, rates, accelerations = rng.uniform(1, 3, (3, 50, 3)) * np.array([1.0, -1.0, 0.5])[:, None, None]
    tensions = rng.uniform(1.0, 9.0, (50, 3))
    for sign in (1.0, -1.0):
        states = _each(w.motor_states, plain, lengths, sign * rates, accelerations, tensions)
        kinetic = WINCH["motor_inertia"] * np.asarray(states.speed) * np.asarray(states.acceleration)
        lost = 0.01 * np.abs(states.speed) + 3e-5 * np.asarray(states.speed) ** 2
        np.testing.assert_allclose(states.power, -tensions * sign * rates + kinetic + lost, rtol=1e-12)
        np.testing.assert_allclose(states.power, np.asarray(states.torque) * states.speed, rtol=1e-12)


def test_efficiency_costs_power_in_both_directions():
    winches = dataclasses.replace(_winches(), friction=np.zeros(3), viscous_friction=np.zeros(3))
    zeros, tensions = np.zeros(3), np.array([3.0, 4.0, 5.0])
    winds = w.motor_states(winches, np.ones(3), np.full(3, -0.5), zeros, tensions).power
    pays = w.motor_states(winches, np.ones(3), np.full(3, 0.5), zeros, tensions).power
    np.testing.assert_allclose(winds, tensions * 0.5 / 0.9)
    np.testing.assert_allclose(pays, -tensions * 0.5 * 0.9)


def test_motors_at_standstill_hold_the_cables():
    states = w.motor_states(_winches(), np.ones(3), np.zeros(3), np.zeros(3), np.array([3.0, 4.0, 5.0]))
    holding = np.array([0.02, 0.025, 0.03]) * [3.0, 4.0, 5.0] / 5.0
    np.testing.assert_allclose(states.torque, -np.array([1.0, -1.0, 1.0]) * holding)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"drum_radius": None}, "winch.drum_radius: missing: a number > 0"),
        ({"drum_radius": [0.1, 0.2]}, "winch.drum_radius = [0.1, 0.2]: must be a number > 0, at most 1e+06, or 3"),
        ({"efficiency": 1.2}, "winch.efficiency = 1.2: must be a number > 0, at most 1"),
        ({"encoder_counts": 10.5}, "winch.encoder_counts = 10.5: must be a whole number > 0"),
        ({"drum": 0.5}, "winch.drum = 0.5: must be absent"),
        ({"direction": 0.5}, "winch.direction = 0.5: must be 1 or -1"),
        ({"layer_turns": 8.0}, "winch.cable_length: missing: given beside layer_turns"),
        ({"motor_stall_torque": 2.0}, "winch.motor_no_load_speed: missing: given beside motor_stall_torque"),
    ],
)
def test_wrong_numbers_are_refused(changes, words):
    with pytest.raises(InputError) as caught:
        _winches(**changes)
    assert str(caught.value).startswith(words)


@pytest.mark.parametrize("value", [2.0, 0.0, -7.0])
def test_directions_in_files_are_1_or_minus_1(tmp_path, value):
    path = tmp_path / "r.toml"
    keys = f'name = "r"\nmass = 1.0\nbase_points = {SPOOLS}\n'
    path.write_text(f"{keys}[winch]\ndrum_radius = 0.02\ndirection = {value}\n")
    with pytest.raises(ConfigError, match=rf"r.toml: winch.direction = {value}: must be 1 or -1, or one per cable$"):
        cspr_jax.load_robot(path)


def test_a_pair_of_cables_is_on_one_winch():
    six = cspr_jax.with_cables(
        cspr_jax.parallel_pair_robot(0.8, 0.2, mass=2.0),
        axial_stiffness=[1e4, 2e4, 3e4, 4e4, 5e4, 6e4],
        winch={"drum_radius": [0.02, 0.02, 0.03, 0.03, 0.04, 0.04]},
    )
    three = cspr_jax.three_cable_equivalent(six)
    assert three.axial_stiffness.tolist() == [3e4, 7e4, 11e4]
    assert three.winches.drum_radius.tolist() == [0.02, 0.03, 0.04]
    differing = cspr_jax.with_cables(six, winch={"drum_radius": [0.02, 0.03, 0.03, 0.03, 0.04, 0.04]})
    with pytest.raises(InputError, match="their numbers differ"):
        cspr_jax.three_cable_equivalent(differing)


def test_tensions_within_limits_of_motors_are_those_whose_demands_are():
    """Just inside the ends all demands keep the limits; just outside, one does not; a cable at rest winds and pays."""
    line = {"motor_stall_torque": 1.2, "motor_no_load_speed": 400.0}
    winches, rng = _winches(**line), np.random.default_rng(4)
    limits = cspr_jax.Limits(motor_torque_max=0.6, motor_power_max=20.0, motor_load_max=0.8)
    lengths, rates, accelerations = rng.uniform(1, 3, (3, 400, 3)) * np.array([1.0, 0.4, 9.0])[:, None, None]
    rates[::2] *= -1.0
    accelerations[::3] *= -1.0
    rates[:20] = 0.0
    motions = lengths, rates, accelerations

    def within(length, rate, acceleration):
        unbounded = jax.numpy.full(3, -1e3), jax.numpy.full(3, 1e3)
        return jax.numpy.stack(w.tensions_within(winches, limits, (length, rate, acceleration), unbounded))

    def excess(tensions):
        demands = _each(lambda w_, *row: w.motor_demands(w_, row[:3], row[3]), winches, *motions, tensions)
        return np.max([demands.motor_torque - 0.6, demands.motor_power - 20.0, demands.motor_load - 0.8], axis=0)

    low, high = np.moveaxis(np.asarray(jax.vmap(within)(*motions)), 1, 0)
    assert (low < high).all()
    for end, outside in ((low, -1e-6), (high, 1e-6)):
        assert (excess(end - outside) <= 0.0).all() and (excess(end + outside) > 0.0).all()
