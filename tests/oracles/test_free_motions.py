"""The reference for free motions: its bounds and verifier against closed forms, and its answers where casadi is."""

import dataclasses

import numpy as np
import pytest

from oracles import (
    free_motion_bounds,
    free_motion_times,
    free_motions,
    least_time_forms,
    motion_verifier,
    sampled_motion,
)

pytestmark = pytest.mark.thorough

Pose = free_motions.Pose
# So deep that the sum of 1 / distance is concave over the ring and largest on its axis: no path is better than it.
RING = least_time_forms.ring_robot(4, 0.5, 2.0)
PULLS = {"tension_min": np.zeros(4), "tension_max": np.full(4, 0.6 * 2.0 * 9.81)}
UP = Pose([0.0, 0.0, 3.0]), Pose([0.0, 0.0, 1.6])
FREE = np.full(3, -np.inf)
SPEEDS = {"tension_min": FREE, "speed_max": 1.0, "acceleration_max": 3.0}
LENGTHS = {"tension_min": FREE, "cable_speed_max": [0.7, 0.9, 1.0], "cable_acceleration_max": [3.0, 4.0, 2.5]}
ACROSS = Pose([0.1, -0.2, 1.1]), Pose([-0.4, 0.3, 1.6])
THREE = least_time_forms.ring_robot(3, 0.8, 1.5)


def lengths(robot, pose):
    return np.linalg.norm(np.asarray(robot["base_points"]) - pose.position, axis=1)


def exact_cases():
    """Robots, limits, poses, and least times of all motions in closed form."""
    changes = np.abs(lengths(THREE, ACROSS[1]) - lengths(THREE, ACROSS[0]))
    distance = np.linalg.norm(np.subtract(ACROSS[1].position, ACROSS[0].position))
    # Each length has its own trapezoid, along a straight line in lengths, which the slowest one leads.
    pairs = zip(changes, LENGTHS["cable_speed_max"], LENGTHS["cable_acceleration_max"], strict=True)
    return {
        "vertical": (RING, PULLS, *UP, least_time_forms.vertical(RING, 0.0, PULLS["tension_max"][0], 3.0, 1.6)[0]),
        "speeds": (THREE, SPEEDS, *ACROSS, least_time_forms.trapezoid(distance, 1.0, 3.0)),
        "lengths": (THREE, LENGTHS, *ACROSS, max(least_time_forms.trapezoid(*pair) for pair in pairs)),
    }


def least(robot, limits, start, end):
    return free_motion_bounds.least(robot, limits, start, end, near=0.005)


@pytest.mark.parametrize("name", ["vertical", "speeds", "lengths"])
def test_bounds_are_below_and_near_exact_times(name):
    *case, exact = exact_cases()[name]
    assert 0.98 * exact < least(*case) <= exact * (1.0 + 1e-12)


@pytest.mark.parametrize("name", free_motion_times.NAMES)
def test_references_are_met_and_above_the_bounds(name):
    known = free_motion_times.reference(name)
    case = known.case
    assert 0.0 < known.below < known.infimum < known.time < 1.012 * known.infimum
    assert 1 <= known.agreeing <= known.starts
    sides = case.start, case.end
    verification = motion_verifier.verified(
        case.robot, case.limits, known.motion.state, known.time, *sides, samples=1501
    )
    assert verification.faults(near=1e-5) == []
    reach = free_motion_bounds.Reach(case.robot, case.limits, *sides)
    assert not reach.refutes(known.time)


def changed(motion, **parts):
    """State of a motion with parts of it changed: functions of times and of what they were."""

    def state(times):
        made = motion.state(times)
        return dataclasses.replace(made, **{k: change(times, getattr(made, k)) for k, change in parts.items()})

    return state


def turning(times, rotation):
    """Turned about z by ever more."""
    half = 0.5e-3 * np.asarray(times)
    return sampled_motion.rotations(np.stack([np.cos(half), 0 * half, 0 * half, np.sin(half)], axis=1)) @ rotation


def late(times):
    """Time since a certain instant, else 0, (k, 1)."""
    return np.maximum(np.asarray(times)[:, None] - 0.1234, 0.0)


FAULTS = {
    "end position": {"position": lambda t, p: 1.00001 * p},
    "end velocity": {"velocity": lambda t, v: v + 1e-5},
    "end rotation": {"rotation": turning},
    "rotation": {"rotation": turning},
    "end omega": {"omega": lambda t, w: w + 1e-4},
    "position": {"velocity": lambda t, v: 1.001 * v},
    "velocity": {"acceleration": lambda t, a: 1.001 * a},
    "omega": {"alpha": lambda t, a: 1.001 * a + 1e-4},
    "acceleration jump": {
        "position": lambda t, p: p + 0.005 * late(t) ** 2,
        "velocity": lambda t, v: v + 0.01 * late(t),
        "acceleration": lambda t, a: a + 0.01 * (late(t) > 0.0),
    },
}


@pytest.mark.parametrize("fault", FAULTS)
def test_the_verifier_sees_faults(fault):
    known = free_motion_times.reference("3R3T-6 0 inside")
    sides = known.case.robot, known.case.limits
    state = changed(known.motion, **FAULTS[fault])
    faults = motion_verifier.verified(*sides, state, known.time, known.case.start, known.case.end, 1501).faults()
    assert any(text.startswith(fault + ":") for text in faults), faults


@pytest.mark.parametrize("limit, fraction", [("tension_max", 0.9999), ("cable_speed_max", 0.9999)])
def test_the_verifier_sees_limits_that_are_touched(limit, fraction):
    """The fastest motions are on their limits: a smaller one is broken."""
    known = free_motion_times.reference("segment 1")
    limits = {**known.case.limits, limit: fraction * known.case.limits[limit]}
    sides = known.time, known.case.start, known.case.end
    faults = motion_verifier.verified(known.case.robot, limits, known.motion.state, *sides, samples=1501).faults()
    name = "tension" if limit.startswith("tension") else limit
    assert any(text.startswith(f"limit {name}") for text in faults), faults


def test_the_verifier_sees_a_motion_above_the_spools():
    known = free_motion_times.reference("segment 4")
    lower = {**known.case.robot, "base_points": known.case.robot["base_points"] + [0.0, 0.0, 0.5]}
    sides = known.motion.state, known.time, known.case.start, known.case.end
    assert any(text.startswith("depth") for text in motion_verifier.verified(lower, {}, *sides, samples=501).faults())


@pytest.fixture(scope="module")
def casadi():
    return pytest.importorskip("casadi")


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["segment 1", "2T-3 0 outside", "3T-4 0 inside", "1R2T-4 0 inside"])
def test_references_are_made_again(name, casadi):
    fresh, known = free_motion_times.made(name), free_motion_times.reference(name)
    assert fresh["infimum"] == pytest.approx(known.infimum, rel=1e-4)
