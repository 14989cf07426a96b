"""Stops of random plans by an oracle apart: continuity, rest, and tensions at many samples; broken cables; mistakes."""

import dataclasses
import itertools
import json
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from oracles.stops import Hanging, least_stop
from support.commands import cspr, strict_json

import cspr_jax
from cspr_jax.machine.stops import braking, dying_swings, free_stops
from cspr_jax.machine.stops.fastest import begins_with
from cspr_jax.machine.stops.instants import RESTING, StateSamples
from cspr_jax.motion.motion import states_at
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.outputs.plots.motions.stops import stops_figure

SPOOLS = {
    "2": [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]],
    "3": [[1.0, 0.1, 0.0], [-0.6, 0.8, 0.05], [-0.5, -0.9, 0.0]],
    "4": [[1.1, 0.9, 0.0], [-1.0, 1.0, 0.1], [-0.9, -1.0, 0.0], [1.0, -1.1, 0.05]],
    "5": [[1.2, 0.0, 0.0], [0.4, 1.1, 0.05], [-1.0, 0.7, 0.0], [-0.9, -0.7, 0.0], [0.3, -1.2, 0.1]],
}
MASS, LOW, HIGH = 1.0, 0.2, 20.0
# What limits may be touched by, and what rounding leaves of continuity, over the weight, the gravity and so on.
TOUCHED, SAME = 1e-5, 1e-6


def hanging(kind, gone=()):
    base = np.array([spool for i, spool in enumerate(SPOOLS[kind]) if i not in gone])
    return Hanging(base, MASS, LOW, HIGH, (0, 2) if kind == "2" else (0, 1, 2))


def drawn_plan(kind, seed, poses=4):
    """A feasible plan of a spline through random places, as fast as it may be when it gets slower step by step."""
    rng, planar = np.random.default_rng([seed, int(kind)]), kind == "2"
    places = rng.uniform([-0.45, -0.4, 0.9], [0.45, 0.4, 1.7], (poses, 3)) * (1.0, not planar, 1.0)
    robot = {"name": f"r{kind}", "mass": MASS, "base_points": SPOOLS[kind], "tension_min": LOW, "tension_max": HIGH}
    robot |= {"planar": True} if planar else {}
    times = np.concatenate([[0.0], np.cumsum(rng.uniform(0.5, 0.8, poses - 1))])
    for _ in range(12):
        pose = [{"position": place, "time": time} for place, time in zip(places.tolist(), times.tolist(), strict=True)]
        spec = {"schema": 1, "family": "spline", "interpolation": "quintic", "robot": robot, "pose": pose}
        plan = cspr_jax.plan(spec)
        if plan.feasible:
            return plan
        times = 1.2 * times
    raise AssertionError("no plan is feasible")


def state_of_plan(plan, time):
    starts = np.concatenate([[0.0], np.cumsum(plan.answers.duration)])
    i = min(int(np.searchsorted(starts, time, side="right")) - 1, len(plan.motions) - 1)
    with double_precision():
        state = states_at(plan.motions[i], np.array([(time - starts[i]) / plan.answers.duration[i]]))
    return [np.asarray(part)[0] for part in state[:3]]


def check_stop(plan, stop, robot, broken=False, samples=400):
    """All that a stop promises, but for its proof."""
    with double_precision():
        states = [np.asarray(part) for part in states_at(stop.motion, np.linspace(0.0, 1.0, samples))[:3]]
    weight, duration = robot.mass * robot.gravity, float(stop.motion.duration())
    start = state_of_plan(plan, stop.time)
    # After a break the acceleration may jump; a robot that rests already stays where it is.
    for order, (mine, theirs) in enumerate(zip(states[: 2 if broken else 3], start, strict=False)):
        np.testing.assert_allclose(mine[0], theirs, atol=SAME * 10.0**order)
    # Velocities and accelerations are the derivatives of the positions.
    if stop.kind != "rest":
        assert stop.duration == pytest.approx(duration)
        step = duration / (samples - 1)
        for lower, upper in itertools.pairwise(states):
            middle = (lower[2:] - lower[:-2]) / (2.0 * step)
            np.testing.assert_allclose(middle, upper[1:-1], atol=0.02 * max(1.0, np.abs(upper).max()))
    assert np.abs(states[1][-1]).max() < SAME and np.abs(states[2][-1]).max() < 1e-5
    np.testing.assert_allclose(states[0][-1], stop.position, atol=1e-9)
    if len(robot.base) == len(robot.axes):
        forces = robot.tensions(states[0], states[2])
        assert forces.min() > robot.low - TOUCHED * weight and forces.max() < robot.high + TOUCHED * weight
        assert forces.min() > 0.0
    else:
        chosen = np.linspace(0, samples - 1, 60).astype(int)
        assert all(robot.supplies(states[0][k], states[2][k], TOUCHED * weight) for k in chosen)


@pytest.fixture(scope="module")
def planar():
    return drawn_plan("2", 1, 3)


def test_stops_of_a_planar_robot(planar, tmp_path):
    length = float(planar.answers.duration.sum())
    found = cspr_jax.stops(planar, times=np.array([0.0, 0.3, 0.6]) * length)
    assert found.all_found and next(stop.kind for stop in found.stops) == "rest"
    for stop in found.stops:
        check_stop(planar, stop, hanging("2"))
        # The plan itself goes on to rest: no stop is slower.
        assert stop.duration <= length - stop.time + 1e-9
    text = json.dumps(found.to_dict(), allow_nan=False)
    assert json.loads(text)["stops"][0] == found.stops[0].to_dict()
    assert found.intervals_without == [] and "proved stop" in found.lines()[-1]
    found.plot(output=tmp_path / "s.png")
    assert (tmp_path / "s.png").stat().st_size > 10_000


def test_too_few_cables_say_what_is_left(planar):
    found = cspr_jax.stops(planar, instants=2, without=[0])
    assert not found.all_found and found.lines() == [found.left] and "swings below one spool" in found.left
    assert found.to_dict()["none_found"] == [[found.times[0], found.times[1]]] and found.to_dict()["longest"] is None
    assert all(stop.to_dict()["kind"] is None for stop in found.stops)


def test_pictures_show_a_plane_or_both_views(planar):
    """A robot in space that moves in the plane y = 0 is drawn from above too."""
    robot = {"name": "s", "mass": MASS, "base_points": SPOOLS["3"]}
    pose = [{"position": [x, 0.0, 1.2], "time": time} for x, time in ((0.0, 0.0), (0.1, 2.0))]
    spatial = cspr_jax.plan({"schema": 1, "family": "spline", "robot": robot, "pose": pose})
    for plan, labels in ((planar, {"z (m)"}), (spatial, {"y (m)", "z (m)"})):
        panels = stops_figure(cspr_jax.stops(plan, instants=1, without=[0])).axes
        assert {panel.get_ylabel() for panel in panels} == labels | {"time to rest (s)"}


def test_stops_load_no_pictures():
    code = "import sys, cspr_jax; cspr_jax.stops, cspr_jax.size; print('matplotlib' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"


def _states(rng, turning=False):
    vectors = rng.normal(size=(5, 1, 3))
    place = vectors[0] * 0.3 + np.array([0.0, 0.0, 1.5])
    if not turning:
        return StateSamples(np.zeros(1), place, vectors[1], vectors[2])
    q = rng.normal(size=(1, 4))
    return StateSamples(np.zeros(1), place, vectors[1], vectors[2], q / np.linalg.norm(q), vectors[3], vectors[4])


def _ends(motion):
    with double_precision():
        return [
            [np.asarray(part)[k] for part in states_at(motion, np.array([0.0, 1.0])) if part is not None]
            for k in (0, 1)
        ]


@pytest.mark.parametrize("turning", [False, True])
def test_dying_swings_begin_with_the_state_and_end_at_rest(turning):
    instants = _states(np.random.default_rng(5), turning)
    for one in dying_swings.dying_swings(instants, 9.81, jumps=False)[::7]:
        first, last = _ends(one.motion)
        expected = [instants.position, instants.velocity, instants.acceleration]
        if turning:
            expected += [None, instants.angular_velocity, instants.angular_acceleration]
        for mine, theirs in zip(first, expected, strict=False):
            if theirs is not None:
                np.testing.assert_allclose(mine, theirs[0], atol=1e-8)
        np.testing.assert_allclose(last[0][:2], 0.0, atol=1e-9)
        for rate in [*last[1:3], *(last[4:6] if turning else [])]:
            np.testing.assert_allclose(rate, 0.0, atol=1e-7)


def test_a_level_swing_at_its_natural_frequency_obeys_its_equation():
    """Without a change of amplitude, acceleration is that of the pendulum: -g / z0 times the displacement."""
    state = StateSamples(
        np.zeros(1), np.array([[0.3, 0.0, 1.5]]), np.zeros((1, 3)), np.array([[-0.3 * 9.81 / 1.5, 0.0, 0.0]])
    )
    slow = dying_swings.dying_swings(state, 9.81, jumps=False)[len(dying_swings.HALVES) - 1].motion
    with double_precision():
        states = states_at(slow, np.linspace(0.0, 0.02, 5))
    np.testing.assert_allclose(
        np.asarray(states.acceleration)[:, 0], -9.81 / 1.5 * np.asarray(states.position)[:, 0], atol=2e-3
    )


def test_brakes_stay_on_the_path_and_begin_with_its_state():
    """Along a circle run at constant speed, until half of the time has gone by."""

    def states_at_times(times):
        c, s = np.cos(2.0 * times), np.sin(2.0 * times)
        zero = np.zeros_like(times)
        places = np.stack([0.4 * c, 0.4 * s, 1.5 + zero], axis=1)
        rates = np.stack([-0.8 * s, 0.8 * c, zero], axis=1)
        return StateSamples(times, places, rates, np.stack([-1.6 * c, -1.6 * s, zero], axis=1))

    instants = states_at_times(np.array([0.7]))
    found = braking.brakes(states_at_times, instants, np.array([9.0]), 9.0, 1.5, 9.81)
    assert len(found) == braking.TRIED
    for one in found:
        first, last = _ends(one.motion)
        for mine, theirs in zip(first, (instants.position, instants.velocity, instants.acceleration), strict=True):
            np.testing.assert_allclose(mine, theirs[0], atol=1e-9)
        ahead = states_at_times(np.array([0.7 + 0.5 * one.duration])).position[0]
        np.testing.assert_allclose(last[0], ahead, atol=1e-9)
        np.testing.assert_allclose(last[1:], 0.0, atol=1e-9)
        with double_precision():
            states = states_at(one.motion, np.linspace(0.0, 1.0, 51))
        path, rates, pulls = (np.asarray(part)[:, :2] for part in states[:3])
        np.testing.assert_allclose(np.hypot(*path.T), 0.4, atol=1e-4)
        # Half of the speed is left in the middle, where it falls by 15 / 8 of it in the time of the stop.
        np.testing.assert_allclose(np.hypot(*rates[25]), 0.4, atol=1e-3)
        slowing = pulls[25] @ rates[25] / np.hypot(*rates[25])
        np.testing.assert_allclose(slowing, -0.8 * 1.875 / one.duration, rtol=1e-2)


def test_the_motion_itself_goes_on_to_its_next_rest():
    """From two instants to rest in a line, all states asked for at once."""
    asked = []

    def states_at_times(times):
        asked.append(len(times))
        zero = np.zeros_like(times)
        columns = [np.stack([part, zero, zero], axis=1) for part in (np.cos(times), -np.sin(times), -np.cos(times))]
        return StateSamples(times, columns[0] + [0.0, 0.0, 1.5], *columns[1:])

    instants = states_at_times(np.array([0.5, 4.0, 6.0]))
    found = braking.rests_ahead(states_at_times, instants, np.array([0.0, np.pi, 5.0]), 1.5, 9.81)
    assert [one.sample for one in found] == [0, 1] and len(asked) == 2
    for one, (start, end) in zip(found, ((0.5, np.pi), (4.0, 5.0)), strict=True):
        assert one.duration == pytest.approx(end - start)
        with double_precision():
            states = states_at(one.motion, np.linspace(0.0, 1.0, 7))
        expected = states_at_times(np.linspace(start, end, 7))
        np.testing.assert_allclose(states.position, expected.position, atol=1e-9)
        np.testing.assert_allclose(states.acceleration, expected.acceleration, atol=1e-5)


@pytest.mark.parametrize("size", [1e-2, 1.0, 1e2])
def test_rest_does_not_depend_on_the_size_of_the_robot(size):
    """Speeds in units of sqrt(g r), angular ones of sqrt(g / r), accelerations of g and g / r."""
    speed, gravity, unit = np.sqrt(9.81 * size), 9.81, np.ones((1, 3))
    for moved in range(4):
        for factor, expected in ((0.5, True), (2.0, False)):
            level = RESTING * np.where(np.arange(4) == moved, factor, 0.0)
            rates = (level[0] * speed, level[1] * gravity, level[2] * speed / size, level[3] * gravity / size)
            velocity, acceleration, omega, alpha = (rate * unit for rate in rates)
            start = np.array([[1.0, 0.0, 0.0, 0.0]])
            samples = StateSamples(np.zeros(1), 0.0 * unit, velocity, acceleration, start, omega, alpha)
            assert samples.rests(size, gravity).tolist() == [expected]
            assert samples.is_still(size, gravity).tolist() == [expected or moved in (1, 3)]


def test_a_stop_begins_with_the_orientation_of_its_instant():
    instants = _states(np.random.default_rng(8), True)
    motion = free_stops.short_stops(instants, 1.5, 9.81, jumps=False)[-1].motion
    robot = cspr_jax.point_mass(SPOOLS["3"], mass=MASS)
    emergency = SimpleNamespace(problem=SimpleNamespace(robot=robot), jumps=False)
    turned = instants.quaternion[:, [1, 0, 3, 2]] * [-1.0, 1.0, 1.0, -1.0]
    with double_precision():
        for quaternion, expected in ((1.0, True), (-2.0, True), (None, False)):
            start = turned if quaternion is None else quaternion * instants.quaternion
            one = dataclasses.replace(instants, quaternion=start)
            assert begins_with(one, 0, motion, emergency) is expected


@pytest.mark.parametrize("turning", [False, True])
def test_short_stops_begin_with_the_state(turning):
    instants = _states(np.random.default_rng(6), turning)
    for one in free_stops.short_stops(instants, 1.5, 9.81, jumps=False):
        first, last = _ends(one.motion)
        for mine, theirs in zip(first, (instants.position, instants.velocity, instants.acceleration), strict=False):
            np.testing.assert_allclose(mine, theirs[0], atol=1e-8)
        if turning:
            np.testing.assert_allclose(first[4], instants.angular_velocity[0], atol=1e-8)
            np.testing.assert_allclose(first[5], instants.angular_acceleration[0], atol=1e-7)
        for rate in [*last[1:3], *(last[4:6] if turning else [])]:
            np.testing.assert_allclose(rate, 0.0, atol=1e-6)


PLAN = """
schema = 1
family = "spline"
robot = { name = "p", mass = 1.0, planar = true, base_points = [[-1, 0, 0], [1, 0, 0]], tension_max = 20.0 }
pose = [{ position = [0, 0, 1.2], time = 0 }, { position = [0.1, 0, 1.1], time = 2 }]
"""


@pytest.mark.parametrize(
    ("words", "error"),
    [
        (("--instants", "0"), "--instants: 0: must be a whole number from 1 to 10000"),
        (("-o", "picture"), "must end in .png"),
        (("-o", "picture.xyz"), "must end in .png"),
        (("--without", "7"), "without = [7]: must be cables of p, from 0 to 1"),
        (("--without", "1", "1"), "each once"),
    ],
)
def test_mistakes_have_one_line(tmp_path, words, error):
    (tmp_path / "p.toml").write_text(PLAN)
    code, out, err = cspr("stops", tmp_path / "p.toml", *words)
    assert (code, out) == (2, "") and error in err and err.count("\n") == 1


def test_a_command_says_that_none_is_left(tmp_path):
    (tmp_path / "p.toml").write_text(PLAN)
    code, out, err = cspr("stops", tmp_path / "p.toml", "--without", "0", "--instants", "3", "--json")
    found = strict_json(out)
    assert (code, err) == (1, "") and found["without"] == [0] and len(found["stops"]) == 3
    assert "1 cable is left for 2 degrees of freedom" in found["left"] and not found["all_found"]


def test_times_and_plans_are_checked(planar):
    with pytest.raises(cspr_jax.errors.InputError, match=r"between 0 and .*, the duration of the plan"):
        cspr_jax.stops(planar, times=[1e3])
    robot = planar.keys.robot | {"winch": {"drum_radius": 0.02}}
    spec = {"schema": 1, "family": "spline", "interpolation": "quintic", "robot": robot, "motor_torque_rms_max": 50.0}
    pose = [{"position": [x, 0.0, 1.2], "time": time} for x, time in ((0.0, 0.0), (0.1, 2.0))]
    bounded = cspr_jax.plan(spec | {"pose": pose})
    assert bounded.feasible
    with pytest.raises(
        cspr_jax.errors.InputError, match=r"^plan: motor_torque_rms_max = 50.0: must be absent, in \[winch\]"
    ):
        cspr_jax.stops(bounded)


@pytest.mark.thorough
def test_the_plan_of_the_documents_has_stops():
    path = Path(__file__).parents[2] / "docs" / "examples" / "camera_plan.toml"
    assert cspr_jax.stops(cspr_jax.plan(path), instants=1).all_found


def test_a_robot_that_is_of_no_use_without_a_cable_has_no_stop(tmp_path):
    """Without one cable of four the spools that are left lie on one line: no stop, but no mistake of the caller."""
    robot = 'robot = { name = "q", mass = 1, base_points = [[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [0, 0, 0]] }'
    motion = "pose = [{ position = [-0.2, 0.3, 1.2], time = 0 }, { position = [-0.3, 0.4, 1.2], time = 2 }]"
    (tmp_path / "p.toml").write_text(f'schema = 1\nfamily = "spline"\n{robot}\n{motion}\ntension_max = 30\n')
    code, out, err = cspr("stops", tmp_path / "p.toml", "--without", "1", "--instants", "2", "--json")
    found = strict_json(out)
    assert (code, err, found["longest"]) == (1, "", None) and [row["kind"] for row in found["stops"]] == [None, None]
    assert found["left"].startswith("robot.base_points = ") and "not on one line" in found["left"]


@pytest.mark.thorough
@pytest.mark.parametrize("gone", [(), (1,)])
def test_stops_of_a_robot_on_four_cables(gone):
    plan = drawn_plan("4", 3, 3)
    found = cspr_jax.stops(plan, instants=4, without=gone or None)
    assert any(stop.is_found for stop in found.stops)
    for stop in found.stops:
        if stop.is_found:
            check_stop(plan, stop, hanging("4", gone), broken=bool(gone))


@pytest.mark.soak
@pytest.mark.parametrize(
    ("kind", "seed"),
    [(kind, seed) for kind in ("2", "3") for seed in range(3)] + [("4", 0), ("4", 1), ("5", 0), ("5", 1)],
)
def test_two_hundred_random_instants_of_ten_plans(kind, seed, capsys):
    plan, rng = drawn_plan(kind, 100 + seed), np.random.default_rng(seed)
    times = np.sort(rng.uniform(0.0, float(plan.answers.duration.sum()), 20))
    found = cspr_jax.stops(plan, times=times)
    for stop in found.stops:
        if stop.is_found:
            check_stop(plan, stop, hanging(kind))
    with capsys.disabled():
        kinds = [stop.kind or "none" for stop in found.stops]
        print(f"\n{kind} {seed}: { {name: kinds.count(name) for name in sorted(set(kinds))} }")
    assert found.all_found


@pytest.mark.soak
@pytest.mark.parametrize("kind", ["2", "3"])
def test_no_stop_is_later_than_that_of_a_second_optimiser(kind, capsys):
    plan, rng = drawn_plan(kind, 100), np.random.default_rng(7)
    times = np.sort(rng.uniform(0.05, 0.95, 12)) * float(plan.answers.duration.sum())
    found, ratios = cspr_jax.stops(plan, times=times), []
    for stop in found.stops:
        other = least_stop(hanging(kind), *state_of_plan(plan, stop.time))
        assert np.isfinite(other) and stop.is_found
        ratios.append(stop.duration / other)
    with capsys.disabled():
        print(f"\n{kind}: duration over the other's {np.round(ratios, 4).tolist()}")
    assert max(ratios) <= 1.01
