"""Launches: the segment through a release, the choice of the flight, landings, and their scatter."""

import itertools
import json

import jax
import numpy as np
import pytest
from oracles import beziers as oracle
from scipy.interpolate import CubicSpline
from scipy.optimize import fsolve
from support.commands import cspr, plan, planned

import cspr_jax
from cspr_jax.families.beziers.launches.release import through
from cspr_jax.families.beziers.motion import Bezier
from cspr_jax.launch.landings import LaunchErrors, Throw, scatter

GRAVITY = 9.80665
PLACES = [[0, 0, -0.5], [-0.05, -0.05, -0.7], [0.1, 0.15, -0.8], [-0.1, -0.3, -1.2]]
SPOOLS = np.array([[0.35, 0.0, 0.0], [-0.175, 0.30310889132455354, 0.0], [-0.175, -0.30310889132455354, 0.0]])
STATE = jax.jit(lambda curve, fraction: curve.state(fraction))
LAUNCH = {"segment": "3", "point": "[0, -0.15, -0.8]", "target": "[0.15, 0.05, -1.675]", "time": "0.5"}


def text(launch, *, places=PLACES, duration="duration = 1.6\n", more=""):
    """Of a plan that launches from the last of some places."""
    poses = "".join(f"[[pose]]\nposition = {list(place)}\n" for place in places)
    table = "".join(f"{key} = {value}\n" for key, value in launch.items())
    head = f'schema = 1\nrobot = "launch-robot"\nfamily = "bezier"\n{more}'
    return f"{head}{poses}[[pose]]\n{duration}[launch]\n{table}"


def alone(launch, **more):
    """The same of one segment, whose start may have any acceleration."""
    return text(launch | {"segment": "0"}, places=PLACES[-1:], **more)


def test_the_end_point_of_the_text():
    """t5 of (34), which is printed with two digits: (0.23, 0.07, -1.16)."""
    start, place, velocity = np.array([-0.1, -0.3, -1.2]), np.array([0.0, -0.15, -0.8]), np.array([0.3, 0.4, 0.7])
    _, end = jax.jit(through)(start, place, velocity, 0.59 / 1.6, 1.6)
    np.testing.assert_allclose(end, [0.23324, 0.06992, -1.16643], atol=5e-6)


@pytest.mark.parametrize("seed", range(5))
def test_the_segment_passes_the_release_with_its_velocity(seed):
    rng = np.random.default_rng(seed)
    start, place, velocity = rng.normal(size=(3, 3))
    fraction, time = rng.uniform(0.05, 0.95), rng.uniform(0.3, 3.0)
    middle, end = jax.jit(through)(start, place, velocity, fraction, time)
    position, speed, _ = oracle.states([start, middle, end], time, 2)  # shape only
    state = STATE(Bezier(start, middle, end, time, 1.0), fraction)
    np.testing.assert_allclose(state.position, place, atol=1e-12)
    np.testing.assert_allclose(state.velocity, velocity, atol=1e-12)
    np.testing.assert_allclose(position[[0, 2]], [start, end], atol=1e-14)
    assert np.abs(speed[[0, 2]]).max() < 1e-12 * (1.0 + np.abs(end).max() / time)


def test_the_launch_of_the_text(tmp_path):
    """Its release, its flight, and a landing within 1e-9 m, from the forces of the cables in the motion file."""
    body = text(LAUNCH | {"release": "0.59"}, more="samples = 1500\n")
    answer = planned(tmp_path, body)
    launch = answer["launch"]
    assert launch["segment"] == 3 and launch["control_points"] == answer["segments"][3]["control_points"]
    np.testing.assert_allclose(launch["release"]["position"], [0.0, -0.15, -0.8], atol=1e-12)
    np.testing.assert_allclose(launch["release"]["velocity"], [0.3, 0.4, (-0.875 + GRAVITY / 8.0) / 0.5], atol=1e-12)
    before = sum(segment["duration"] for segment in answer["segments"][:3])
    assert launch["release"]["time"] == pytest.approx(before + 0.59, abs=1e-12)
    assert launch["tension_min"] == answer["segments"][3]["tension_min"] > 0.4
    np.testing.assert_allclose(launch["landing"], [0.15, 0.05, -1.675], atol=1e-9)
    assert "scatter" not in launch
    file = tmp_path / "motion.h5"
    assert cspr("plan", tmp_path / "plan.toml", "-o", file)[0] == 0 and cspr("verify", file)[0] == 0
    motion = cspr_jax.open_result(file)
    position, velocity = thrown(motion, launch["release"]["time"])
    flight = np.linspace(0.0, launch["flight_time"], 101)[:, None]
    path = position + velocity * flight - 0.5 * GRAVITY * np.array([0.0, 0.0, 1.0]) * flight**2
    np.testing.assert_allclose(path[-1], [0.15, 0.05, -1.675], atol=1e-9)
    np.testing.assert_allclose(motion.data["flight_position"], path, atol=1e-9)
    np.testing.assert_allclose(motion.data["flight_t"], launch["release"]["time"] + flight[:, 0], atol=1e-12)


def thrown(motion, release):
    """Position and velocity at the release of a mass that the file's tensions pull, by splines of the forces."""
    t, where = motion.axes["t"], motion.data["position"][0]
    rays = SPOOLS[None] * [1.0, 1.0, -1.0] - motion.data["position"][:, None]
    units = rays / np.linalg.norm(rays, axis=2, keepdims=True)
    force = (units * motion.data["tension"][..., None]).sum(1) - [0.0, 0.0, GRAVITY]  # of 1 kg
    speed, starts = np.zeros(3), [0.0, *motion.data["segment_end"]]
    for first, last in itertools.pairwise(starts):
        rows = np.flatnonzero((t >= first - 1e-12) & (t <= last + 1e-12))
        rows = rows[np.concatenate([np.diff(t[rows]) > 1e-12, [True]])]
        spline = CubicSpline(t[rows], force[rows])
        end = min(last, release)
        rate = spline.antiderivative()
        way = rate.antiderivative()
        where = where + way(end) - way(t[rows[0]]) + (speed - rate(t[rows[0]])) * (end - t[rows[0]])
        speed = speed + rate(end) - rate(t[rows[0]])
        if end == release:
            return where, speed
    raise ValueError(release)


@pytest.mark.thorough
def test_the_least_energy(tmp_path):
    """By hand: of all flights over d the slowest release takes sqrt(2 |d| / g), where a segment can do it."""
    launch = {key: value for key, value in LAUNCH.items() if key != "time"} | {"choose": '"energy"'}
    slow = planned(tmp_path, alone(launch))["launch"]
    assert slow["flight_time"] == pytest.approx(np.sqrt(2.0 * np.linalg.norm([0.15, 0.2, -0.875]) / GRAVITY), rel=1e-6)
    np.testing.assert_allclose(slow["landing"], [0.15, 0.05, -1.675], atol=1e-9)


@pytest.mark.soak
def test_the_least_energy_and_the_earliest_landing(tmp_path):
    """By hand: of all flights over d the slowest release takes sqrt(2 |d| / g), where a segment can do it."""
    found = {}
    for choose in ("energy", "time"):
        launch = LAUNCH | {"choose": f'"{choose}"'}
        del launch["time"]
        found[choose] = planned(tmp_path, alone(launch, duration=""))
    slow = found["energy"]["launch"]
    assert slow["flight_time"] == pytest.approx(np.sqrt(2.0 * np.linalg.norm([0.15, 0.2, -0.875]) / GRAVITY), rel=1e-6)
    landing = {
        name: answer["launch"]["release"]["time"] + answer["launch"]["flight_time"] for name, answer in found.items()
    }
    assert landing["time"] < landing["energy"]
    for answer in found.values():
        np.testing.assert_allclose(answer["launch"]["landing"], [0.15, 0.05, -1.675], atol=1e-9)
    # No launch near the earliest is earlier and feasible.
    own, rng = found["time"], np.random.default_rng(0)
    fraction = own["launch"]["release"]["time"] / own["segments"][0]["duration"]
    size = rng.normal(size=(3, 3000)) * np.repeat([0.1, 0.01, 0.001], 1000)
    flight, time = (own["launch"]["flight_time"] * np.exp(size[0]), own["segments"][0]["duration"] * np.exp(size[1]))
    at = np.clip(fraction * np.exp(size[2]), 0.0, 1.0)
    start, place, target = (np.array(x, float) for x in (PLACES[-1], [0, -0.15, -0.8], [0.15, 0.05, -1.675]))
    velocity = (target - place) / flight[:, None] + 0.5 * GRAVITY * np.array([0, 0, 1.0]) * flight[:, None]
    middle, end = jax.jit(jax.vmap(through, (None, None, 0, 0, 0)))(start, place, velocity, at, time)
    robot = cspr_jax.three_cable_equivalent(cspr_jax.load_robot("launch-robot"))
    same = np.broadcast_to(start, middle.shape)
    feasible = cspr_jax.bezier_verdicts(robot, same, np.asarray(middle), np.asarray(end), durations=time).feasible
    assert feasible.sum() > 200 and (at * time + flight)[feasible].min() > landing["time"] * (1.0 - 1e-6)


@pytest.mark.thorough
def test_a_launch_before_the_last_segment(tmp_path):
    """The motion goes on to another place, with the acceleration with which the launching segment ends."""
    body = text(LAUNCH | {"segment": "1"}, places=PLACES[:2], duration="")
    body = body.replace("[launch]", "[[pose]]\nposition = [0.05, 0.0, -0.7]\n[launch]")
    answer = planned(tmp_path, body)
    control = np.array([segment["control_points"] for segment in answer["segments"]])
    times = np.array([segment["duration"] for segment in answer["segments"]])
    for i in range(2):
        wanted = control[i, 2] + (control[i, 1] - control[i, 2]) * (times[i + 1] / times[i]) ** 2
        np.testing.assert_allclose(control[i + 1, 1], wanted, atol=1e-11)
    np.testing.assert_allclose(control[2, 2], [0.05, 0.0, -0.7], atol=1e-15)
    np.testing.assert_allclose(answer["launch"]["landing"], [0.15, 0.05, -1.675], atol=1e-9)
    assert answer["launch"]["control_points"] == answer["segments"][1]["control_points"] and answer["feasible"]


@pytest.mark.thorough
def test_a_velocity_at_the_target(tmp_path):
    launch = {"segment": "3", "target": "[0.15, 0.05, -1.675]", "velocity": "[0.3, 0.4, -4.2]", "time": "0.45"}
    answer = planned(tmp_path, alone(launch, duration="duration = 1.5\n"))["launch"]
    arrival = np.array(answer["release"]["velocity"]) - [0.0, 0.0, GRAVITY * 0.45]
    np.testing.assert_allclose(arrival, [0.3, 0.4, -4.2], atol=1e-12)
    np.testing.assert_allclose(answer["landing"], [0.15, 0.05, -1.675], atol=1e-9)
    # The same by its place on the parabola.
    del launch["time"]
    launch["point"] = str(answer["release"]["position"])
    again = planned(tmp_path, alone(launch | {"release": str(answer["release"]["time"])}, duration="duration = 1.5\n"))
    assert again["launch"]["flight_time"] == pytest.approx(0.45, abs=1e-9)
    np.testing.assert_allclose(again["launch"]["control_points"], answer["control_points"], atol=1e-8)


@pytest.mark.thorough
def test_the_quintic_of_the_text_is_no_match(tmp_path):
    """(35), (36): without acceleration at its ends no duration is feasible outside the footprint."""
    code, out, err = cspr("plan", "sweeps/launch_baseline.toml")
    assert (code, err) == (1, "") and out.count("slack_cable") == 3


@pytest.fixture(scope="module")
def throw():
    robot = cspr_jax.make_problem(cspr_jax.point_mass(SPOOLS, mass=1.0, gravity=GRAVITY)).robot
    start, place, velocity = np.array([-0.1, -0.3, 1.2]), np.array([0.0, -0.15, 0.8]), np.array([0.3, 0.4, -0.7])
    middle, end = (np.asarray(x) for x in jax.jit(through)(start, place, velocity, 0.59 / 1.6, 1.6))
    motion = Bezier(start, middle, end, np.asarray(1.6), np.asarray(1.0))
    return robot, Throw((motion,), np.asarray(0.59), np.array([0.15, 0.05, 1.675]))


def test_landings_are_those_of_another_solver(throw):
    """Lengths and rates with errors, places by fsolve, the flight by its formula."""
    robot, planned_throw = throw
    errors = LaunchErrors(release=0.02, cable_length=0.01, cable_speed=0.05, throws=20, seed=3)
    found = scatter(robot, planned_throw, errors).landings
    random = np.random.default_rng(3)
    instants = random.normal(size=(20, 1)) * 0.02
    lengths, rates = random.normal(size=(20, 3)) * 0.01, random.normal(size=(20, 3)) * 0.05
    (motion,) = planned_throw.motions
    for own, (late,), more, faster in zip(found, instants, lengths, rates, strict=True):
        fraction = 0.59 + late
        p, v, a = (x[-1] for x in halfway([motion.start, motion.middle, motion.end], 1.6, fraction))
        length, rate, _ = (x[0] for x in oracle.cable_states(SPOOLS, p[None], v[None], a[None]))
        place = fsolve(lambda x, want=length + more: np.linalg.norm(x - SPOOLS, axis=1) - want, p, xtol=1e-13)
        units = (place - SPOOLS) / np.linalg.norm(place - SPOOLS, axis=1, keepdims=True)
        speed = np.linalg.solve(units, rate + faster)
        fall = np.roots([0.5 * GRAVITY, speed[2], place[2] - 1.675]).max()
        np.testing.assert_allclose(own, place[:2] + speed[:2] * fall - [0.15, 0.05], atol=1e-9)


def halfway(points, time, until):
    """States from the start to an instant, by the oracle's formulas."""
    t = np.array([[0.0], [until]])
    s, s1 = 0.5 - 0.5 * np.cos(np.pi * t / time), np.pi / (2 * time) * np.sin(np.pi * t / time)
    start, middle, end = points
    position = (1 - s) ** 2 * start + 2 * s * (1 - s) * middle + s**2 * end
    return position, 2.0 * ((s - 1.0) * start + (1.0 - 2.0 * s) * middle + s * end) * s1, 0.0 * position


@pytest.mark.thorough
def test_scatter_to_first_order(throw):
    """Small errors scatter as derivatives say; errors add up in squares; twice the error is twice the scatter."""
    robot, own = throw
    each = {"release": 1e-4, "cable_length": 1e-4, "cable_speed": 1e-3, "encoder": 1e-4}
    total = np.zeros((2, 2))
    for name, size in each.items():
        found = scatter(robot, own, LaunchErrors(**{name: size}, throws=20_000))
        spread = np.sqrt(np.trace(found.first_order))
        np.testing.assert_allclose(found.covariance, found.first_order, atol=0.03 * spread**2)
        double = scatter(robot, own, LaunchErrors(**{name: 2.0 * size}, throws=2000)).first_order
        np.testing.assert_allclose(double, 4.0 * found.first_order, rtol=1e-12)
        total += found.first_order
    both = scatter(robot, own, LaunchErrors(**each, throws=20_000))
    np.testing.assert_allclose(both.first_order, total, rtol=1e-12)
    again = scatter(robot, own, LaunchErrors(**each, throws=20_000))
    np.testing.assert_array_equal(both.landings, again.landings)
    assert np.abs(scatter(robot, own, LaunchErrors(throws=2)).landings).max() < 1e-3  # (34) is rounded
    # A jitter of half the segment is none of the derivatives' business.
    wild = scatter(robot, own, LaunchErrors(release=0.3, throws=2000))
    assert np.abs(wild.covariance / wild.first_order - 1.0).max() > 0.1


def test_scatter_in_files_and_pictures(tmp_path):
    errors = "[launch.errors]\nrelease = 0.01\nthrows = 300\n"
    body = alone(LAUNCH | {"release": "0.59"}) + errors
    answer = planned(tmp_path, body)["launch"]["scatter"]
    assert answer["throws"] == 300 and answer["missed"] == 0 and len(answer["covariance"]) == 2
    assert 0.001 < answer["standard_deviation"] < answer["mean_error"] < answer["largest_error"] < 0.1
    file = tmp_path / "motion.h5"
    assert cspr("plan", tmp_path / "plan.toml", "-o", file)[0] == 0 and cspr("verify", file)[0] == 0
    landings = cspr_jax.open_result(file).data["landing"]
    assert np.linalg.norm(landings, axis=1).mean() == pytest.approx(answer["mean_error"])
    data = cspr_jax.open_result(file).to_xarray()
    assert data.landing.dims == ("throw", "level") and data.flight_position.dims == ("flight_t", "axis")
    assert cspr("plot", file, "--quantity", "landing", "-o", tmp_path / "p.png")[0] == 0
    assert cspr_jax.plan(tmp_path / "plan.toml").to_dict()["launch"]["scatter"] == answer


def test_scatter_is_in_the_axes_of_the_file(tmp_path):
    """The same robot and launch with z up and z down; along a jitter alone landings lie along their slope in time."""
    up = alone(LAUNCH | {"release": "0.59"}) + "[launch.errors]\nrelease = 1e-4\nthrows = 200\nseed = 3\n"
    robot = f'[robot]\nname = "three"\nmass = 1.0\ngravity = 9.80665\nbase_points = {SPOOLS.tolist()}\n'
    down = up.replace('robot = "launch-robot"\n', "").replace("-1.2", "1.2").replace("-0.8", "0.8")
    down = down.replace("-1.675", "1.675") + robot
    first, second = (planned(tmp_path, body)["launch"]["scatter"] for body in (up, down))
    for name in ("covariance", "covariance_first_order", "mean"):
        np.testing.assert_allclose(first[name], second[name], rtol=1e-9, atol=1e-16)
    start, middle, end = (np.array(x) for x in planned(tmp_path, up)["launch"]["control_points"])

    def landing(late):
        position, velocity, _ = (x[-1] for x in halfway([start, middle, end], 1.6, 0.59 + late))
        fall = np.roots([-0.5 * GRAVITY, velocity[2], position[2] + 1.675]).max()
        return (position + velocity * fall)[:2]

    slope = (landing(1e-6) - landing(-1e-6)) / 2e-6
    np.testing.assert_allclose(first["covariance_first_order"], 1e-8 * np.outer(slope, slope), rtol=1e-5)


def test_a_launch_from_p0(tmp_path):
    """The pose that follows from the launch is no rest in P0."""
    launch = {"segment": "0", "point": "[0, 0, -0.6]", "target": "[0.1, 0.05, -1.6]", "time": "0.5"}
    launch["release"] = "0.5"
    own = {"places": PLACES[:1], "duration": "duration = 1.2\n"}
    both = [json.loads(plan(tmp_path, text(launch, more=more, **own), "--json")[1]) for more in ("", "z0 = 0.5\n")]
    assert both[0]["launch"]["control_points"] == both[1]["launch"]["control_points"]


def test_a_planar_robot_stays_in_its_plane(tmp_path):
    robot = '[robot]\nname = "two"\nmass = 1.0\nplanar = true\nbase_points = [[-1.0, 0, 0], [1.0, 0, 0]]\n'
    head = 'schema = 1\nfamily = "bezier"\n'
    launch = (
        "[[pose]]\nposition = [0, 0, 1]\n[[pose]]\nduration = 1.5\n[launch]\nsegment = 0\ntarget = [0.5, {y}, 3.0]\n"
    )
    launch += "time = 0.6\npoint = [0.1, 0.0, 1.2]\n"
    code, _, err = plan(tmp_path, head + launch.format(y="0.4") + robot)
    assert code == 2 and "launch.target = [0.5, 0.4, 3.0]: must have y = 0" in err
    poses = (
        "first_control_point = [0.0, 0.1, 1.0]\n[[pose]]\nposition = [0, 0, 1]\n[[pose]]\nposition = [0.3, 0, 1.2]\n"
    )
    code, _, err = plan(tmp_path, head + poses + robot)
    assert code == 2 and "first_control_point = [0.0, 0.1, 1.0]: must have y = 0" in err


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"time": "1e-300"}, "launch.time"),
        ({"release": "1e-12"}, "launch.release"),
        ({"segment": "4"}, "launch.segment = 4"),
        ({"segment": "-1"}, "launch.segment"),
        ({"target": "[0, 1]"}, "launch.target"),
        ({"target": None}, "launch.target"),
        ({"point": None}, "launch.point"),
        ({"time": None}, "launch.time"),
        ({"time": "0"}, "launch.time"),
        ({"time": "-1.0"}, "launch.time"),
        ({"choose": '"energy"'}, "launch.time"),
        ({"choose": '"speed"', "time": None}, "launch.choose"),
        ({"release": "0"}, "launch.release"),
        ({"release": "1.6"}, "launch.release = 1.6"),
        ({"release": "1.7"}, "launch.release = 1.7"),
        ({"velocity": "[0.3, 0.4, -4.2]", "time": None}, "launch.point = [0.0, -0.15, -0.8]: must lie on the parabola"),
        ({"velocity": "[0.3, 0.4, -4.2]"}, "launch.time"),
        ({"errors": "{ release = -1.0 }"}, "launch.errors.release"),
        ({"errors": "{ throws = 1 }"}, "launch.errors.throws"),
        ({"errors": "{ jitter = 1 }"}, "launch.errors.jitter"),
    ],
)
def test_one_line_says_what_is_wrong(tmp_path, change, line):
    launch = {key: value for key, value in (LAUNCH | change).items() if value is not None}
    code, out, err = plan(tmp_path, text(launch), "-o", tmp_path / "m.h5")
    assert code == 2 and out == "" and line in err and err.count("\n") == 1, err
    assert not (tmp_path / "m.h5").exists()


@pytest.mark.parametrize(
    ("body", "line"),
    [
        (text(LAUNCH, duration="position = [0, 0, -1]\n"), "pose[4].position"),
        (text(LAUNCH, duration="rest = true\n"), "pose[4].rest"),
        (text(LAUNCH, more="first_control_point = [0, 0, -0.4]\n"), "first_control_point"),
        (text(LAUNCH, more='least = "each"\n'), "least"),
        (text(LAUNCH).replace('"bezier"', '"quintic"'), "launch.segment"),
        (text(LAUNCH | {"segment": "2"}), "pose[3].position"),
        (text(LAUNCH).replace("[launch]", "[lunch]"), "did you mean launch"),
        (text(LAUNCH).replace("[launch]", "[[pose]]\nrest = true\nfamily = 'quintic'\n[launch]"), "pose[5].family"),
    ],
)
def test_what_does_not_go_with_a_launch(tmp_path, body, line):
    code, _, err = plan(tmp_path, body)
    assert code == 2 and line in err and err.count("\n") == 1, err
