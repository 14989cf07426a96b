"""Bezier segments on more cables than degrees of freedom, beside linear programs at samples."""

import numpy as np
import pytest
from oracles import beziers as oracle
from scipy.optimize import least_squares
from support.commands import planned
from support.redundant import MASS, PLANAR_THREE, RECTANGLE, largest_distances, least_distances

import cspr_jax
from cspr_jax.errors import ConfigError, InputError

KEYS = {"schema": 1, "family": "bezier", "samples": 241}
# Places inside the footprint, and outside of it, where no mass rests.
CASES = {
    "boralugoda-planar-three": (PLANAR_THREE, [[10.0, 0.0, 5.0], [35.0, 0.0, 12.0], [50.0, 0.0, 8.0]]),
    "boralugoda-rectangle": (RECTANGLE, [[10.0, 10.0, 5.0], [35.0, 20.0, 12.0], [50.0, 18.0, 8.0]]),
}
ROBOTS = ["boralugoda-planar-three", pytest.param("boralugoda-rectangle", marks=pytest.mark.thorough)]


def plan_of(robot, places, durations, **more):
    poses = [{"position": place} for place in places]
    for pose, duration in zip(poses[1:], durations, strict=True):
        pose |= {} if duration is None else {"duration": duration}
    return cspr_jax.plan(KEYS | {"robot": robot, "pose": poses} | more)


def distance(base, points, duration, **limits):
    """The least largest distance from limits along a segment, at 241 instants, N."""
    positions, _, accelerations = oracle.states(np.array(points, float), duration, 240)
    return float(largest_distances(base, positions, accelerations, **limits).min())


@pytest.mark.parametrize("robot", ROBOTS)
def test_given_durations_are_proved_and_margins_are_those_of_linear_programs(robot):
    """A feasible segment and one that fails, whose cause has the numbers of the programs."""
    base, places = CASES[robot]
    answer = plan_of(robot, places[:2], [5.0])
    (sampled,), answers = least_distances(base, answer, 241), answer.answers
    assert answer.feasible and 0.0 < answers.margin_bound[0] <= min(sampled * (1.0 + 1e-9), answers.margin[0])
    assert answers.margin[0] == pytest.approx(sampled, rel=0.01)
    assert answer.details(0)["margin_unit"] == "N" and answer.details(0)["failing"] == []
    fast = plan_of(robot, places[:2], [3.0])
    (sampled,), (cause,) = least_distances(base, fast, 241), fast.causes[0]
    assert fast.answers.verdict[0] == cspr_jax.Verdict.WRENCH_INFEASIBLE and sampled < 0.0
    assert cause.criterion == "wrench_infeasible" and cause.needed == pytest.approx(sampled, rel=0.01)
    (start, end), *_ = fast.details(0)["failing"]
    assert start <= cause.t <= end <= 3.0


@pytest.mark.thorough
@pytest.mark.parametrize("robot", ROBOTS)
def test_durations_are_an_interval_whose_ends_are_those_of_linear_programs(robot):
    base, places = CASES[robot]
    loaded = cspr_jax.load_robot(robot)
    inside, outside = cspr_jax.bezier_durations(loaded, [places[0]] * 2, places[1:])
    assert inside.shape == outside.shape == (1, 2) and np.isinf(inside[0, 1]) and np.isfinite(outside).all()
    for end, (low, high) in zip(places[1:], (inside[0], outside[0]), strict=True):
        points = [places[0], places[0], end]
        assert distance(base, points, low * (1.0 - 1e-3)) < 0.0 < distance(base, points, low * (1.0 + 1e-6))
        if np.isfinite(high):
            assert distance(base, points, high * (1.0 + 1e-3)) < 0.0 < distance(base, points, high * (1.0 - 1e-6))
    answer = plan_of(robot, [places[0], places[2]], [None])
    assert answer.feasible and answer.answers.duration[0] == outside[0, 0]
    assert answer.details(0)["taut_durations"] == outside.tolist()
    times = outside[0] * np.array([1.0 - 1e-6, 1.0 + 1e-6])
    starts, ends = np.array([places[0]] * 2), np.array([places[2]] * 2)
    assert not cspr_jax.bezier_verdicts(loaded, starts, starts, ends, durations=times).feasible.any()
    with pytest.raises(InputError, match="on more cables"):
        cspr_jax.bezier_durations(loaded, places[:1], places[1:2], accelerations=[[1.0, 0.0, 0.0]])


@pytest.mark.thorough
def test_a_curve_that_depends_on_its_duration_has_no_interval_but_a_least_duration(tmp_path):
    """The second segment goes on with the acceleration of the first."""
    base, places = CASES["boralugoda-planar-three"]
    back = [places[0], places[1], [20.0, 0.0, 8.0]]
    answer = plan_of("boralugoda-planar-three", back, [8.0, None])
    details = answer.details(1)
    assert answer.feasible and details["taut_durations"] is None and details["least_duration"] is None
    assert min(least_distances(base, answer, 241)) > -1e-6
    time = float(answer.answers.duration[1])
    faster = plan_of("boralugoda-planar-three", back, [8.0, time * (1.0 - 1e-6)])
    assert faster.is_feasible.tolist() == [True, False]
    body = "".join(f"[[pose]]\nposition = {place}\n" for place in back) + "duration = 9.0\n"
    text = planned(tmp_path, 'schema = 1\nrobot = "boralugoda-planar-three"\nfamily = "bezier"\n' + body, code=1)
    assert text["segments"][1]["taut_durations"] is None and text["segments"][0]["margin_unit"] == "N"
    assert text["segments"][0]["tension_margin"] == text["segments"][0]["margin"]


@pytest.mark.parametrize("robot", ROBOTS)
def test_random_segments_are_proved_or_refuted_as_linear_programs_have_it(robot):
    base, rng = CASES[robot][0], np.random.default_rng(1)
    box = np.array([[-10.0, 0.0, 0.0], [60.0, 30.0 * ("rect" in robot), 25.0]])
    points, times = rng.uniform(*box, size=(30, 3, 3)), rng.uniform(2.0, 12.0, 30)
    answers = cspr_jax.bezier_verdicts(cspr_jax.load_robot(robot), *np.moveaxis(points, 1, 0), durations=times)
    sampled = np.array([distance(base, *case) for case in zip(points, times, strict=True)])
    assert ((answers.verdict == 0) == (sampled > 0.0)).all() and 3 < answers.feasible.sum() < 27
    assert (answers.margin_bound <= sampled + 1e-9 * np.abs(sampled)).all()
    np.testing.assert_allclose(answers.margin, sampled, rtol=0.01, atol=0.02 * MASS)


@pytest.mark.thorough  # each set of limits compiles kernels of its own
@pytest.mark.parametrize(
    ("limits", "name"),
    [
        ({"tension_min": 5.0, "tension_max": 75.0}, None),
        ({"cable_speed_max": 3.0}, "cable_too_fast"),
        ({"cable_acceleration_max": 1.5}, "cable_accelerates_too_fast"),
    ],
)
def test_the_least_duration_under_limits(limits, name):
    base, places = CASES["boralugoda-planar-three"]
    held = plan_of("boralugoda-planar-three", places[:2], [None], **limits)
    time, free = float(held.answers.duration[0]), held.details(0)["taut_durations"][0][0]
    assert held.feasible and time > free
    faster = plan_of("boralugoda-planar-three", places[:2], [time * (1.0 - 1e-5)], **limits)
    assert not faster.feasible and faster.causes[0][0].needed != faster.causes[0][0].allowed
    if name is None:
        points = [places[0], *places[:2]]
        assert distance(base, points, time * (1.0 - 1e-3), low=5.0, high=75.0) < 0.0
        assert distance(base, points, time * (1.0 + 1e-6), low=5.0, high=75.0) > 0.0


@pytest.mark.soak
def test_the_least_total():
    """Shorter than one segment after the other, proved, and a little less is not feasible."""
    base, places = CASES["boralugoda-planar-three"]
    waypoints = [[10.0, 0.0, 5.0], [30.0, 0.0, 10.0], [15.0, 0.0, 12.0]]
    answer = plan_of("boralugoda-planar-three", waypoints, [None, None], least="total")
    times = answer.answers.duration
    assert answer.feasible and min(least_distances(base, answer, 241)) > -1e-6 and len(places) == 3
    for shorter in ([0.999, 1.0], [1.0, 0.999], [0.999, 0.999]):
        assert not plan_of("boralugoda-planar-three", waypoints, (times * shorter).tolist()).feasible
    each = plan_of("boralugoda-planar-three", waypoints, [None, None])
    assert not each.feasible or times.sum() <= each.answers.duration.sum() * (1.0 + 1e-9)


@pytest.mark.thorough
@pytest.mark.parametrize("least", ["each", pytest.param("total", marks=pytest.mark.thorough)])
def test_nothing_bounds_the_accelerations_of_cables_that_pull_against_each_other(least):
    """A square of cables without largest tensions gives any acceleration; with them a least duration exists."""
    square = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 0.0, 3.0], [0.0, 0.0, 3.0]]
    robot = {"base_points": square, "mass": MASS, "planar": True, "z_axis": "up", "name": "square"}
    places = [[1.0, 0.0, 1.0], [3.0, 0.0, 2.0]]
    with pytest.raises(ConfigError, match=r"pose\[1\].duration: must be a number without tension_max"):
        plan_of(robot, places, [None], least=least)
    assert plan_of(robot, places, [0.01]).feasible


@pytest.mark.thorough
def test_a_launch_is_proved_and_lands_on_its_target():
    base, places = CASES["boralugoda-rectangle"]
    keys = KEYS | {"robot": "boralugoda-rectangle", "pose": [{"position": places[0]}, {}]}
    launch = {"segment": 0, "point": [30.0, 20.0, 8.0], "target": [60.0, 40.0, -30.0], "choose": "energy"}
    errors = {"cable_length": 0.01, "throws": 2000}
    answer = cspr_jax.plan(keys | {"launch": launch | {"errors": errors}})
    (outcome,) = answer.outcomes
    assert answer.feasible and least_distances(base, answer, 241)[0] > -1e-6
    np.testing.assert_allclose(outcome.landing, launch["target"], atol=1e-6)
    fall = np.array([0.0, 0.0, -9.81]) * outcome.flight_time**2 / 2.0
    np.testing.assert_allclose(outcome.position + outcome.velocity * outcome.flight_time + fall, launch["target"])
    # Lengths with errors put the mass where the sum of squares of what is left is least, by SciPy.
    steps = np.concatenate([np.eye(4), -np.eye(4)]) * 1e-4
    landings = np.array([landing(np.array(base), outcome, launch["target"], step) for step in steps])
    slopes = (landings[:4] - landings[4:]) / 2e-4
    np.testing.assert_allclose(outcome.scatter.first_order, 0.01**2 * slopes.T @ slopes, rtol=1e-4)
    spread = np.abs(outcome.scatter.covariance - outcome.scatter.first_order).max()
    assert spread < 0.15 * np.trace(outcome.scatter.first_order)


def landing(base, outcome, target, errors):
    """Place at the height of the target, (2,), of a launch whose lengths have errors."""

    def units(place):
        rays = place - base
        return rays / np.linalg.norm(rays, axis=1)[:, None]

    rates = units(outcome.position) @ outcome.velocity
    lengths = np.linalg.norm(outcome.position - base, axis=1) + errors
    options = {"xtol": 1e-14, "ftol": 1e-14, "gtol": 1e-14}
    place = least_squares(lambda x: np.linalg.norm(x - base, axis=1) - lengths, outcome.position, **options).x
    velocity = np.linalg.lstsq(units(place), rates)[0]
    time = (velocity[2] + np.sqrt(velocity[2] ** 2 + 2.0 * 9.81 * (place[2] - target[2]))) / 9.81
    return (place + velocity * time)[:2]


@pytest.mark.soak
def test_maps_of_launches_have_the_numbers_of_proofs():
    robot, start = cspr_jax.load_robot("boralugoda-planar-three"), [20.0, 0.0, 10.0]
    answers = cspr_jax.launch_range(robot, [[70.0, 0.0, -20.0], [500.0, 0.0, -20.0]], start=start, population=32)
    assert answers.feasible[0] and answers.largest_margin[0] > 0.0
    fall = np.array([0.0, 0.0, -0.5 * 9.81 * answers.flight_time[0] ** 2])
    speed = np.linalg.norm((np.array([70.0, 0.0, -20.0]) - answers.releases[0] - fall) / answers.flight_time[0])
    assert answers.release_speed[0] == pytest.approx(speed)
