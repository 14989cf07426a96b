"""Free motions for all robots within an uncertainty, against robots that NumPy simulates one by one."""

import numpy as np
import pytest
from oracles import any_motion, least_time_forms
from support.free_motions import PlacedMotion, solve
from support.other_robots import on_balls, uncertain

from cspr_jax.families.free.problem import FreeSettings
from cspr_jax.schema.verdicts import Verdict

RING = least_time_forms.ring_robot(3, 1.0, 2.0)
WEIGHT = 2.0 * 9.81
LIMITS = {"tension_min": np.full(3, 0.02 * WEIGHT), "tension_max": np.full(3, 0.8 * WEIGHT)}
ASIDE = np.array([[0.3, 0.1, 1.0], [-0.2, 0.3, 1.4]])
# A hundredth of the radius, and of the mass.
SPOOLS, FACTOR = 0.01, 1.01
# From the last target of Table 2.1 of the Dion-Gauvin thesis to the place of rest, z down: the fastest motion passes
# millimetres below the spools.
PROTOTYPE = least_time_forms.ring_robot(3, 0.26, 0.198)
CLIMB = np.array([[0.0, -1.1, 1.7], [0.0, 0.0, 1.7]])
FAST = {"tension_max": np.full(3, 1.6017), "cable_speed_max": np.full(3, 3.850)}


def least_slacks(robot, limits, free, frame, spools, factor, count, samples=201):
    """The smallest slack of each of some robots at the rim of an uncertainty, over its limit."""
    rng, least = np.random.default_rng(7), []
    for k in range(count):
        moved = robot["base_points"] + on_balls(rng, (3,), spools)
        other = robot | {"base_points": moved, "mass": robot["mass"] * factor ** (-1) ** k}
        for motion in free.motions:
            instants = np.linspace(0.0, float(motion.knots[-1]), samples)
            slacks = any_motion.verifier(other, limits, PlacedMotion(motion, frame)).slacks(instants)
            least.append(min(float(np.min(slack)) for slack in slacks.values()))
    return np.array(least)


@pytest.fixture(scope="module")
def nominal():
    return solve(RING, LIMITS, ASIDE)


@pytest.mark.thorough
def test_a_motion_is_proved_for_all_robots_and_samples_agree(nominal):
    off = uncertain(spool_positions=SPOOLS, mass_factor=FACTOR)
    free, frame = solve(RING, LIMITS | {"uncertainty": off}, ASIDE)
    assert free.answers.feasible.all()
    assert (free.answers.tolerated >= 1.0).all()
    assert least_slacks(RING, LIMITS, free, frame, SPOOLS, FACTOR, 40).min() > 0.0
    # The fastest motion of the planned robot breaks limits with most of them.
    assert np.mean(least_slacks(RING, LIMITS, *nominal, SPOOLS, FACTOR, 40) < 0.0) > 0.9
    # Room is not left for many more: robots twice as far off break limits.
    assert free.answers.not_tolerated[0] < 1.2
    assert least_slacks(RING, LIMITS, free, frame, 2.0 * SPOOLS, FACTOR**2, 40).min() < 0.0
    assert nominal[0].duration < free.duration < 1.1 * nominal[0].duration


@pytest.mark.thorough
def test_more_room_takes_more_time(nominal):
    durations = [nominal[0].duration]
    for fraction in (0.5, 1.0):
        off = uncertain(spool_positions=fraction * SPOOLS)
        free, _ = solve(RING, LIMITS | {"uncertainty": off}, ASIDE)
        assert free.answers.feasible.all()
        durations.append(free.duration)
    # To first order the time grows in proportion.
    first, second = np.diff(durations)
    assert 0.8 * first < second < 1.25 * first


@pytest.mark.thorough
def test_too_large_an_uncertainty_is_told():
    free, _ = solve(RING, LIMITS | {"uncertainty": uncertain(spool_positions=0.5)}, ASIDE)
    assert free.is_optimal
    assert free.answers.verdict[0] in (Verdict.UNCERTAINTY, Verdict.UNDECIDED)
    assert free.answers.tolerated[0] < 1.0


@pytest.mark.thorough
@pytest.mark.parametrize("fraction", [0.01, 0.05])
def test_near_the_plane_of_the_spools(fraction):
    spools = fraction * 0.26
    planned, frame = solve(PROTOTYPE, FAST, CLIMB, settings=FreeSettings())
    free, _ = solve(
        PROTOTYPE, FAST | {"uncertainty": uncertain(spool_positions=spools)}, CLIMB, settings=FreeSettings()
    )
    assert free.answers.feasible.all()
    assert least_slacks(PROTOTYPE, FAST, free, frame, spools, 1.0, 20, 2001).min() > 0.0
    assert least_slacks(PROTOTYPE, FAST, planned, frame, spools, 1.0, 20, 2001).max() < 0.0
    depths = [
        min(
            PlacedMotion(m, frame).state(np.linspace(0.0, float(m.knots[-1]), 2001)).position[:, 2].min()
            for m in one.motions
        )
        for one in (planned, free)
    ]
    assert depths[0] < depths[1]
