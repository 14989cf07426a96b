"""The fastest motions between poses: closed forms, symmetries, an independent verifier, and published sequences."""

import numpy as np
import pytest
from oracles import any_motion, least_time_forms
from support.free_motions import QUICK, PlacedMotion, problem_of, solve

from cspr_jax.errors import InputError
from cspr_jax.families.free import free_motion as free_motions
from cspr_jax.families.free.poses import FreePoses
from cspr_jax.families.free.problem import FreeQuestion, FreeSettings, slacks_of, tightened
from cspr_jax.families.free.search import interior_point
from cspr_jax.families.free.search.equations import DEPTH
from cspr_jax.numerics.elementary import double_precision

RING, SQUARE = (least_time_forms.ring_robot(count, 1.0, 2.0) for count in (3, 4))
# One spool is out of the plane of the others.
UNEVEN = {**SQUARE, "base_points": SQUARE["base_points"] + np.array([[0.0, 0.0, 0.1]] + 3 * [[0.0, 0.0, 0.0]])}
WEIGHT = 2.0 * 9.81
LIMITS = {"tension_min": np.full(3, 0.02 * WEIGHT), "tension_max": np.full(3, 0.8 * WEIGHT)}
ASIDE = np.array([[0.3, 0.1, 1.0], [-0.2, 0.3, 1.4]])
# By how much splines of few intervals are slower than accelerations that jump, and searches differ.
SLOWER, SAME = 0.02, 1e-3
# Sequence of Table 2.1 of the Dion-Gauvin thesis, z down, and limits that its hypocycloids need.
SPOOLS = np.array([[0.22516660498395405, -0.13, 0.0], [-0.22516660498395405, -0.13, 0.0], [0.0, 0.26, 0.0]])
TARGETS = np.array(
    [
        [0.7, 0.7, 3.0],
        [-1.1, -1.1, 0.5],
        [-1.1, -0.9, 1.5],
        [0.8, 0.5, 1.5],
        [-0.6, 0.1, 1.9],
        [0.1, -0.6, 1.8],
        [0.0, -1.1, 1.7],
    ]
)
PROTOTYPE = {**least_time_forms.ring_robot(3, 0.26, 0.198), "base_points": SPOOLS}
PUBLISHED = {"tension_max": np.full(3, 1.6017), "cable_speed_max": np.full(3, 3.850)}
# Least durations of the six segments with free accelerations, s, as CasADi and ipopt find them on 24 intervals.
LEAST = (1.3205, 1.7040, 1.1545, 2.0059, 1.9807, 1.7390)


def check_proved(robot, limits, free, frame, samples=501):
    """Each segment is proved, and the verifier, who shares no code with the package, finds no limit broken."""
    assert free.is_optimal
    assert free.answers.feasible.all()
    for motion in free.motions:
        instants = np.linspace(0.0, float(motion.knots[-1]), samples)
        least = any_motion.verifier(robot, limits, PlacedMotion(motion, frame)).slacks(instants)
        assert {name: slack.min() for name, slack in least.items() if slack.min() < -1e-9} == {}


@pytest.fixture(scope="module")
def aside():
    return solve(RING, LIMITS, ASIDE)


def test_a_fall_along_the_axis_takes_little_more_than_the_closed_form():
    low, high = LIMITS["tension_min"][0], LIMITS["tension_max"][0]
    for start, end in ((1.0, 1.8), (1.8, 1.0)):
        free, frame = solve(RING, LIMITS, [[0.0, 0.0, start], [0.0, 0.0, end]])
        least = least_time_forms.vertical(RING, low, high, start, end)[0]
        check_proved(RING, LIMITS, free, frame)
        # A path through other points may be faster, but hardly here.
        assert least * (1.0 - SAME) < free.duration < least * (1.0 + SLOWER)


def test_a_motion_is_proved_and_the_verifier_agrees(aside):
    free, frame = aside
    check_proved(RING, LIMITS, free, frame)
    state = PlacedMotion(free.motions[0], frame).state(np.array([0.0, free.duration]))
    np.testing.assert_allclose(state.position, ASIDE, atol=1e-12)
    np.testing.assert_allclose(state.velocity, 0.0, atol=1e-9)
    # Proof and tightening cost next to nothing.
    assert free.searched < free.duration < (1.0 + 2e-3) * free.searched


def test_the_way_back_takes_as_long(aside):
    assert solve(RING, LIMITS, ASIDE[::-1])[0].duration == pytest.approx(aside[0].duration, rel=SAME)


@pytest.mark.thorough
def test_mirrored_and_turned_poses_take_as_long(aside):
    turn = np.array([[-0.5, -np.sqrt(0.75), 0.0], [np.sqrt(0.75), -0.5, 0.0], [0.0, 0.0, 1.0]])
    axis = RING["base_points"][0, :2] / np.linalg.norm(RING["base_points"][0, :2])
    mirror = np.eye(3)
    mirror[:2, :2] = 2.0 * np.outer(axis, axis) - np.eye(2)
    for change in (turn, mirror):
        free, _ = solve(RING, LIMITS, ASIDE @ change.T)
        assert free.duration == pytest.approx(aside[0].duration, rel=SAME)


@pytest.mark.thorough
def test_larger_and_heavier_robots(aside):
    """Lengths four times as large: twice as long. Masses and tensions alike: as long."""
    large = least_time_forms.ring_robot(3, 4.0, 2.0)
    assert solve(large, LIMITS, 4.0 * ASIDE)[0].duration == pytest.approx(2.0 * aside[0].duration, rel=SAME)
    heavy = least_time_forms.ring_robot(3, 1.0, 20.0)
    limits = {name: 10.0 * value for name, value in LIMITS.items()}
    assert solve(heavy, limits, ASIDE)[0].duration == pytest.approx(aside[0].duration, rel=SAME)


def test_accelerations_at_poses_are_those_that_are_given(aside):
    given = np.array([[0.0, 0.0, 0.0], [0.4, -0.6, 0.0]])
    free, frame = solve(RING, LIMITS, ASIDE, given)
    check_proved(RING, LIMITS, free, frame)
    state = PlacedMotion(free.motions[0], frame).state(np.array([0.0, free.duration]))
    np.testing.assert_allclose(state.acceleration, given, atol=1e-9)
    assert free.duration > aside[0].duration


@pytest.mark.thorough
def test_segments_together_share_their_acceleration_and_lose_no_time(aside):
    places = np.array([*ASIDE, [0.1, -0.3, 1.2]])
    free, frame = solve(RING, LIMITS, places)
    check_proved(RING, LIMITS, free, frame)
    before, after = (PlacedMotion(motion, frame) for motion in free.motions)
    here, there = before.state(np.array([before.times[1]])), after.state(np.array([0.0]))
    np.testing.assert_allclose(here.acceleration, there.acceleration, atol=1e-8)
    np.testing.assert_allclose(here.velocity, 0.0, atol=1e-9)
    # Each alone may choose its accelerations, and is no slower; resting in between would be.
    alone = aside[0].duration + solve(RING, LIMITS, places[1:])[0].duration
    assert alone * (1.0 - SAME) < free.duration
    resting = np.full((3, 3), np.nan)
    resting[1] = 0.0
    assert free.duration < solve(RING, LIMITS, places, resting)[0].duration


@pytest.mark.thorough
def test_redundant_cables_carry_a_motion_below_their_spools():
    """The fastest search passes through the plane of the spools between two instants, where no proof can follow."""
    limits = {"tension_max": np.full(4, 2.5 * WEIGHT)}
    free, frame = solve(SQUARE, limits, [[0.0, 0.0, 2.5], [1.6, 1.2, 0.9]])
    check_proved(SQUARE, limits, free, frame)
    assert all(np.asarray(motion.position)[..., 2].min() > 0.0 for motion in free.motions)


@pytest.mark.parametrize(
    ("depths", "low", "high"),
    [
        ((1.0, 0.8), DEPTH, np.inf),
        ((0.02, 1.0), 0.01, np.inf),
        ((-1.0, -0.03), -np.inf, -0.015),
        ((0.5, -0.5), -np.inf, np.inf),
    ],
)
def test_depths_are_bounded_on_the_side_of_both_poses(depths, low, high):
    places = np.array([[0.1, 0.0, depths[0]], [0.0, 0.2, depths[1]]])
    with double_precision():
        for robot, is_bounded in ((SQUARE, True), (UNEVEN, False)):
            problem, _ = problem_of(robot, {"tension_max": np.full(4, WEIGHT)})
            poses = FreePoses(places, None, np.zeros((2, 3)), np.full((2, 3), np.nan), 1.0)
            question = FreeQuestion.of(problem, None, poses, QUICK)
            tasks, place = question.tasks(4, 3), 4
            assert question.limits.depth == (place if is_bounded else None)
            np.testing.assert_allclose(tasks.low[..., place], low if is_bounded else -np.inf, rtol=1e-12)
            np.testing.assert_allclose(tasks.high[..., place], high if is_bounded else np.inf, rtol=1e-12)


def test_bounds_tighten_more_each_time(aside):
    """By what is missed and more, so that rounds come to an end."""
    free, frame = aside
    with double_precision():
        problem, _ = problem_of(RING, LIMITS)
        poses = FreePoses(frame.inward(ASIDE), None, np.zeros((2, 3)), np.full((2, 3), np.nan), 1.0)
        question = FreeQuestion.of(problem, None, poses, QUICK)
        tasks, slacks = question.tasks(12, 3), slacks_of(question, free.motions)
        missed = 1e-3 * WEIGHT
        low = np.where(np.arange(len(slacks.low))[:, None] == 5, -missed, 1.0)
        rises = [
            tightened(question, tasks, slacks._replace(low=low * np.ones_like(slacks.low)), number).low - tasks.low
            for number in (4, 5, 6)
        ]
    here = [rise[0, 0, 5, 0, :3] for rise in rises]
    assert (here[0] > 1e-3).all()
    np.testing.assert_allclose(here[1] / here[0], here[2] / here[1], rtol=1e-2)
    assert (here[1] > 1.2 * here[0]).all()
    assert not rises[2][0, 0, 8:, :, :3].any()


@pytest.mark.parametrize(
    ("misses", "starts", "intervals"),
    [
        (3, None, [6, 6, 12, 4]),
        *(pytest.param(0, *one, marks=pytest.mark.thorough) for one in ((None, [6]), (1, [6, 6, 12]))),
    ],
)
def test_few_intervals_are_tried_where_no_start_has_led_to_a_motion(monkeypatch, misses, starts, intervals):
    """The search after the usual ones is for such segments alone, not for those of which no two starts agree."""
    begun, whole = [], interior_point.optima

    def missing(tasks, *arguments, **keywords):
        result = whole(tasks, *arguments, **keywords)
        begun.append(len(tasks.basis.tau))
        return result if len(begun) > misses else result._replace(is_optimal=np.zeros_like(result.is_optimal))

    monkeypatch.setattr(free_motions, "optima", missing)
    free, _ = solve(RING, LIMITS, ASIDE, settings=QUICK._replace(starts=starts))
    assert begun == intervals
    assert free.parts[0].is_optimal
    assert free.answers.feasible.all()


@pytest.mark.thorough
def test_no_motion_is_found_above_what_cables_carry():
    limits = LIMITS | {"tension_max": np.full(3, 0.2 * WEIGHT)}
    free, _ = solve(RING, limits, ASIDE, np.zeros((2, 3)))
    assert not free.is_optimal
    assert not free.answers.feasible.any()


def test_a_largest_tension_is_needed():
    with pytest.raises(InputError, match=r"tension_max.*impulses"):
        solve(RING, {"tension_min": LIMITS["tension_min"]}, ASIDE)
    most = np.array([10.0, np.inf, 10.0])
    with pytest.raises(InputError, match="tension_max"):
        solve(RING, {"tension_max": most}, ASIDE)


@pytest.mark.ci("0")
@pytest.mark.thorough
@pytest.mark.parametrize("i", range(6))
def test_table_2_1(i):
    free, frame = solve(PROTOTYPE, PUBLISHED, TARGETS[i : i + 2], settings=FreeSettings())
    check_proved(PROTOTYPE, PUBLISHED, free, frame, 20_001)
    assert free.duration < LEAST[i]
    assert free.duration < 1.002 * free.searched


@pytest.mark.thorough
def test_other_robots():
    """Two cables in a plane, and four in space, with limits of cables."""
    two = least_time_forms.two_spools(1.0)
    limits = {"tension_max": np.full(2, 20.0), "cable_acceleration_max": np.full(2, 8.0)}
    check_proved(two, limits, *solve(two, limits, [[-0.5, 0.0, 1.0], [0.5, 0.0, 1.2]]))
    four = least_time_forms.ring_robot(4)
    limits = {"tension_min": np.full(4, 0.5), "tension_max": np.full(4, 8.0), "cable_speed_max": np.full(4, 1.0)}
    check_proved(four, limits, *solve(four, limits, ASIDE))
