"""Straight lines under limits and on spools in any layout, against brute force by linear programs."""

import dataclasses

import numpy as np
import pytest
from oracles import least_time_bounds, path_rows
from oracles import lines as oracle
from oracles.least_time_forms import ring_robot
from support.motions import states_along

import cspr_jax
from cspr_jax import Verdict
from cspr_jax.families.lines.durations import by_formula
from cspr_jax.families.lines.timed_lines import timed_lines
from cspr_jax.families.lines.verdicts import verdicts
from cspr_jax.motion.given_limits import limits_over
from cspr_jax.motion.problem import Problem
from cspr_jax.robots.statics.kernel_axes import prepared

MASS = 10.0


def case(rng, *, in_plane=None, every=False):
    """Spools, two places below them, and limits, some of which bind."""
    count = 4 if every else int(rng.integers(3, 6))
    angle = np.sort(rng.uniform(0, 2 * np.pi, count)) if count > 3 else np.arange(3) * 2.1 + rng.uniform(0, 6)
    base = np.c_[10 * np.cos(angle), 8 * np.sin(angle), np.full(count, 12.0)]
    if not (rng.integers(2) if in_plane is None else in_plane):
        base[:, 2] += rng.uniform(-3, 3, count)
    weights = rng.dirichlet(np.ones(count), 2)
    places = weights @ base - np.c_[np.zeros((2, 2)), rng.uniform(3, 10, 2)]
    limits = {
        "tension_min": rng.uniform(0.2, 3.0),
        "tension_max": rng.uniform(90.0, 300.0),
        "cable_speed_max": rng.uniform(1.0, 8.0),
        "cable_acceleration_max": rng.uniform(1.0, 8.0),
    }
    kept = {name: value for name, value in limits.items() if every or rng.integers(2)}
    return base, *places, kept, float(rng.uniform(3.0, 15.0))


def problem_of(base, limits, planar=False):
    robot = cspr_jax.point_mass(base, mass=MASS, z_axis="up", planar=planar)
    own, frame = prepared(robot)
    given = cspr_jax.Limits(**{name: np.full(len(base), value) for name, value in limits.items()})
    return Problem(own, limits_over(robot, given), None), frame


def largest_rate(base, start, end, limits, largest):
    """Function of r = p / T, the largest 1 / T^2 that all limits allow an s-curve: they are linear in it."""
    step, x = end - start, np.linspace(0.0, 1.0, 801)
    tensions = {name: limits[name] for name in ("tension_min", "tension_max") if name in limits}
    ends = oracle.path_limits(
        base, start, end, x, mass=MASS, gravity=oracle.GRAVITY, max_acceleration=largest, **tensions
    )
    if not (ends[0] <= ends[1]).all():
        return lambda fraction: 0.0

    def rate(fraction):
        s, velocity, second = oracle.s_curve(np.linspace(0.0, 1.0, 8001), fraction, 1.0)
        low, high = (np.interp(s, x, end) for end in ends)
        rays = start + s[:, None] * step - base[:, None]
        lengths = np.linalg.norm(rays, axis=2)
        slopes = rays @ step / lengths
        changes = slopes * second + (step @ step - slopes**2) / lengths * velocity**2
        moves = second != 0.0
        with np.errstate(divide="ignore"):
            sides = np.sort([low[moves] / second[moves], high[moves] / second[moves]], axis=0)
            by_velocity = (limits.get("cable_speed_max", np.inf) / np.abs(slopes * velocity)).min() ** 2
            by_change = (limits.get("cable_acceleration_max", np.inf) / np.abs(changes)).min()
        most = min(sides[1].min(), by_velocity, by_change)
        rests = (low[~moves] <= 0.0).all() and (high[~moves] >= 0.0).all()
        return most if rests and most >= max(sides[0].max(), 0.0) else 0.0

    return rate


def least_duration(rate):
    """By a grid of fractions, finer and finer about the best."""
    fractions = np.linspace(0.01, 0.99, 99)
    for width in 0.01 * 0.25 ** np.arange(7):
        rates = np.array([rate(fraction) for fraction in fractions])
        best = fractions[rates.argmax()]
        fractions = np.clip(np.linspace(best - width, best + width, 13), 1e-4, 1.0 - 1e-4)
    return rates.max() ** -0.5 if rates.max() > 0.0 else np.inf


def check(count, seed, **how):
    """Durations are those of brute force, verdicts hold at dense samples; how many were compared, and how many bind."""
    rng, compared, bound = np.random.default_rng(seed), 0, 0
    for _ in range(count):
        base, start, end, limits, largest = case(rng, **how)
        problem, frame = problem_of(base, limits)
        ends = frame.inward(start[None]), frame.inward(end[None])
        answers = timed_lines(problem, *ends, max_acceleration=largest)
        rate = largest_rate(base, start, end, limits, largest)
        wanted = least_duration(rate)
        if not np.isfinite(wanted):
            assert answers.verdict[0] != 0
            continue
        assert answers.verdict[0] == 0, (answers.verdict, wanted)
        assert answers.duration[0] == pytest.approx(wanted, rel=2e-4)
        assert answers.margin_bound[0] > 0.0 and answers.limit_margin[0] > 0.0
        assert answers.duration[0] >= answers.least_duration[0]
        robot = ring_robot(3, mass=MASS, z_axis="up") | {"base_points": base}
        known = {name: value for name, value in limits.items() if name != "cable_acceleration_max"}
        path = path_rows.line(start, end)
        least, change = least_time_bounds.estimate(robot, known | {"acceleration_max": largest}, path)
        assert answers.least_duration[0] >= 0.995 * least
        assert len(known) < len(limits) or answers.least_duration[0] <= least + 3.0 * change
        fraction = answers.acceleration_time[0] / answers.duration[0]
        assert answers.duration[0] ** -2 <= rate(fraction) * (1.0 + 1e-5)
        compared += 1
        bound += bool(set(names_at(answers)) & set(limits))
    return compared, bound


def names_at(answers):
    return answers.details(0)["active"]


@pytest.mark.parametrize(
    "in_plane", [pytest.param(True, marks=pytest.mark.soak), pytest.param(False, marks=pytest.mark.thorough)]
)
def test_durations_are_those_of_brute_force(in_plane):
    compared, bound = check(1, 3, in_plane=in_plane, every=True)
    assert compared == bound == 1


@pytest.mark.soak
def test_durations_are_those_of_brute_force_all():
    compared, bound = check(150, 4)
    assert compared > 80 and bound > 40


RECTANGLE = [[0, 0, 30], [45, 0, 30], [45, 30, 30], [0, 30, 30]]


def least(spools, start, end, **limits):
    robot = cspr_jax.point_mass(spools, mass=10.0, z_axis="up", limits=cspr_jax.Limits(**limits))
    return cspr_jax.least_time(robot, [end], start=start, max_acceleration=10.0)


@pytest.mark.soak
@pytest.mark.parametrize("height", [3.0, 0.5, 0.02])
def test_a_line_beside_a_spool(height):
    """A cable that gets short accelerates for an instant: slow enough, every line is feasible, and no faster one."""
    spool, limit = np.array([20.0, 15.0, 10.0]), 5.0
    start, end = np.array([12.3, 15.0, 10.0 + height]), np.array([29.1, 15.0, 10.0 + height])
    found = least([*RECTANGLE, spool], start, end, cable_acceleration_max=limit)
    assert found.verdict[0] == 0

    def largest(duration):
        robot = cspr_jax.point_mass(RECTANGLE, mass=10.0, z_axis="up")
        fraction = found.acceleration_time[0] / found.duration[0]
        motion = cspr_jax.straight_line(robot, start, end, duration=duration, acceleration_time=fraction * duration)
        position, velocity, acceleration = states_along(motion, np.linspace(0.0, 1.0, 200_001))[:3]
        ray = position - spool
        length = np.linalg.norm(ray, axis=1)
        rate = (ray * velocity).sum(1) / length
        return np.abs(((velocity**2).sum(1) + (ray * acceleration).sum(1) - rate**2) / length).max()

    assert largest(found.duration[0]) <= limit < largest(found.duration[0] * (1.0 - 1e-3))


@pytest.mark.thorough
def test_rest_that_breaks_a_limit_says_which():
    """Whatever the layout of the spools: it was undecided where they are not in one plane."""
    for spools in (RECTANGLE, [*RECTANGLE[:2], [45, 30, 31], RECTANGLE[3]]):
        for limits, flag in (
            ({"tension_max": 20.0}, Verdict.OVER_TENSION),
            ({"tension_min": 100.0}, Verdict.SLACK_CABLE),
            ({"cable_length_max": 20.0}, Verdict.CABLE_TOO_LONG),
            ({"floor": 5.0}, Verdict.BELOW_FLOOR),
        ):
            assert least(spools, [1, 20, 7], [15, 28, 3], **limits).verdict[0] == flag


@pytest.mark.parametrize("limits", [pytest.param({}, marks=pytest.mark.thorough), {"cable_acceleration_max": 5.0}])
def test_a_line_through_a_spool_is_singular(limits):
    spools = [*RECTANGLE, [20, 15, 10]]
    for start, end in (([15, 15, 9], [25, 15, 11]), ([20, 15, 5], [20, 15, 15]), ([20, 15, 5], [20, 15, 10])):
        found = least(spools, start, end, **limits)
        assert found.verdict[0] == Verdict.SINGULAR and np.isnan(found.duration[0])


# Of s'' T^2: the cubic's is 6 - 12 tau, the quintic's 60 tau - 180 tau^2 + 120 tau^3.
PEAKS = {"cubic": 6.0, "quintic": 10.0 / np.sqrt(3.0)}


@pytest.mark.quick("limits1-s-curve")
@pytest.mark.parametrize("law", ["quintic", "cubic", "s-curve"])
@pytest.mark.parametrize("limits", [{}, {"tension_min": 0.5, "cable_speed_max": 50.0}])
def test_no_motion_exceeds_the_largest_acceleration(law, limits):
    """Of spools out of one plane, where durations come from samples; peaks of laws in closed form."""
    rng, count = np.random.default_rng(12), 16
    base = np.c_[[10.0, -6.0, -5.0, 3.0], [1.0, 7.0, -6.0, -8.0], [12.0, 12.5, 11.4, 12.2]]
    problem, frame = problem_of(base, limits)
    starts, ends = (frame.inward(rng.uniform([-2, -2, 2], [2, 2, 6], (count, 3))) for _ in range(2))
    largest = 0.3
    answers = timed_lines(problem, starts, ends, law=law, max_acceleration=largest)
    assert (answers.verdict == 0).all()
    shorter = np.minimum(answers.acceleration_time, answers.duration - answers.acceleration_time)
    peak = PEAKS[law] if law in PEAKS else 4.0 * answers.duration / shorter
    fraction = np.linalg.norm(ends - starts, axis=1) * peak / answers.duration**2 / largest
    assert (fraction <= 1.0).all()
    assert (fraction > 1.0 - 1e-6).all()  # the limit binds


@pytest.mark.thorough
@pytest.mark.parametrize("law", ["quintic", "s-curve"])
def test_the_proof_covers_the_largest_acceleration(law):
    """A motion that is a little too fast is not feasible, whatever search it came from."""
    problem, frame = problem_of([[10, 1, 12], [-6, 7, 12], [-5, -6, 12], [3, -8, 12]], {"tension_min": 0.1})
    starts, ends = frame.inward(np.array([[0.0, 0.0, 4.0]])), frame.inward(np.array([[1.0, 0.5, 3.0]]))
    known = by_formula(problem.robot, starts, ends, law=law, rule="optimum", max_acceleration=0.3)
    for factor, verdict in ((1.0 - 1e-6, Verdict.UNDECIDED), (1.0, 0)):
        timed = dataclasses.replace(known, duration=known.duration * factor)
        result = verdicts(problem, starts, ends, timed, law=law, max_acceleration=0.3, sharp=False)
        assert result.verdict[0] == verdict
