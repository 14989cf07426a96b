"""Launches from ellipses: release, flight, what is left open, and scatter, by ballistics and balances in NumPy."""

import dataclasses

import jax
import numpy as np
import pytest
from scipy.optimize import least_squares
from support.commands import plan as command

import cspr_jax
from cspr_jax.families.ellipses.harmonics import Ellipse
from cspr_jax.families.ellipses.motion import turning
from cspr_jax.launch.landings import Throw, landing, state_at
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.robots.model.pulleys import Pulleys
from cspr_jax.robots.statics.force_balance import cable_motion
from cspr_jax.robots.statics.kernel_axes import prepared

# A triangle with a side of 1.8 m and two others, z up; the centre lies below its centroid.
SPOOLS = np.array([[1.0, 0.1, 3.0], [-0.6, 0.8, 3.0], [-0.4, -0.9, 3.0]])
CENTRE, GRAVITY, DEPTH = np.array([0.0, 0.0, 1.0]), 9.81, 2.0
NATURAL = np.sqrt(GRAVITY / DEPTH)
DOWN = np.array([0.0, 0.0, -GRAVITY])
ROBOT = {"name": "three", "mass": 0.5, "z_axis": "up", "base_points": SPOOLS.tolist()}
POINT, TARGET = np.array([1.4, 0.5, 0.8]), np.array([3.5, 1.8, 0.0])
LAUNCH = {"segment": 0, "point": POINT, "target": TARGET, "time": 0.6}


def content(launch=(), *, ellipse=(), more=(), last=()):
    """Of a plan from rest, through a release with a turn before it, to rest."""
    table = {name: value for name, value in (LAUNCH | dict(launch)).items() if value is not None}
    rest = {"rest": True, "position": CENTRE}
    released = {"ellipse": {"centre": CENTRE} | dict(ellipse), "turns": 0.25}
    after = [] if last is None else [rest | dict(last)]
    head = {"schema": 1, "robot": ROBOT, "family": "ellipse", "launch": table}
    return head | dict(more) | {"pose": [rest, released, *after]}


@pytest.fixture(scope="module")
def thrown():
    errors = {"release": 0.004, "throws": 400}
    return cspr_jax.plan(content({"errors": errors}, more={"samples": 1200}))


def aim(point, target, time):
    return (target - point) / time - 0.5 * DOWN * time


def tensions(place, acceleration):
    """Of each cable over the mass, by a balance of forces."""
    rays = SPOOLS - place[:, None]
    units = rays / np.linalg.norm(rays, axis=2, keepdims=True)
    return np.linalg.solve(np.swapaxes(units, 1, 2), (acceleration - DOWN)[..., None])[..., 0]


def turn(point, velocity, frequency, count=721):
    """Place and acceleration on the ellipse about the centre that passes a point with a velocity."""
    angle = np.linspace(0.0, 2.0 * np.pi, count)[:, None]
    outward = (point - CENTRE) * np.cos(angle) + velocity / frequency * np.sin(angle)
    return CENTRE + outward, -(frequency**2) * outward


def is_taut(point, velocity, frequency):
    place, acceleration = turn(point, velocity, frequency)
    return place[:, 2].max() < SPOOLS[0, 2] and tensions(place, acceleration).min() > 0.0


def test_the_object_lands_on_its_target(thrown):
    launch = thrown.to_dict()["launch"]
    place, velocity = (np.array(launch["release"][name]) for name in ("position", "velocity"))
    np.testing.assert_allclose(place, POINT, atol=1e-12)
    np.testing.assert_allclose(place + 0.6 * velocity + 0.18 * DOWN, TARGET, atol=1e-12)
    np.testing.assert_allclose(launch["landing"], TARGET, atol=1e-12)
    assert launch["flight_time"] == 0.6 and launch["control_points"] is None and launch["segment"] == 0
    np.testing.assert_allclose(launch["half_axes"], [POINT - CENTRE, aim(POINT, TARGET, 0.6) / NATURAL], atol=1e-12)
    flight = thrown.launch.columns()["flight_position"]
    np.testing.assert_allclose(flight[[0, -1]], [POINT, TARGET], atol=1e-12)


def test_the_effector_moves_as_the_object_leaves(thrown):
    """At the end of the first segment, whose last quarter turns on the ellipse; without a jump into the next one."""
    data = thrown.to_dict()
    release = data["launch"]["release"]
    assert thrown.feasible and release["time"] == pytest.approx(data["segments"][0]["duration"], abs=1e-12)
    assert data["launch"]["tension_min"] == data["segments"][0]["tension_min"] > 0.0
    assert data["segments"][0]["frequency"] == pytest.approx(NATURAL, abs=1e-12)
    for motion, tau in zip(thrown.motions, (1.0, 0.0), strict=True):
        state = motion.state(np.float64(tau))
        np.testing.assert_allclose(state.position, release["position"], atol=1e-11)
        np.testing.assert_allclose(state.velocity, release["velocity"], atol=1e-11)
        np.testing.assert_allclose(state.acceleration, -(NATURAL**2) * (POINT - CENTRE), atol=1e-10)
    rows = thrown.rows()
    until = data["segments"][0]["duration"]
    on_ellipse = (rows["t"] < until) & (rows["t"] > until - 0.249 * 2.0 * np.pi / NATURAL)
    assert on_ellipse.sum() > 10
    angle = NATURAL * (rows["t"][on_ellipse] - until)[:, None]
    velocity = aim(POINT, TARGET, 0.6)
    path = CENTRE + (POINT - CENTRE) * np.cos(angle) + velocity / NATURAL * np.sin(angle)
    np.testing.assert_allclose(rows["position"][on_ellipse], path, atol=1e-10)


def test_all_cables_pull_beyond_the_static_workspace(thrown):
    """A balance of forces at every row; the place of the release lies outside of the triangle of the spools."""
    rows = thrown.rows()
    pulls = tensions(rows["position"], rows["acceleration"])
    assert (pulls > 0.0).all()
    np.testing.assert_allclose(0.5 * pulls, rows["tension"], rtol=1e-9)
    assert tensions(POINT[None], np.zeros((1, 3))).min() < 0.0
    standing = tensions(rows["position"], np.zeros_like(rows["position"])).min(1)
    assert (standing < 0.0).mean() > 0.2


def test_scatter_of_late_releases_to_first_order(thrown):
    """The slope of the landing over the instant, from the formula of the ellipse."""
    velocity = aim(POINT, TARGET, 0.6)

    def landing(late):
        angle = NATURAL * late
        place = CENTRE + (POINT - CENTRE) * np.cos(angle) + velocity / NATURAL * np.sin(angle)
        pace = velocity * np.cos(angle) - NATURAL * (POINT - CENTRE) * np.sin(angle)
        fall = np.roots([0.5 * DOWN[2], pace[2], place[2] - TARGET[2]]).max()
        return (place + pace * fall)[:2]

    slope = (landing(1e-5) - landing(-1e-5)) / 2e-5
    scatter = thrown.to_dict()["launch"]["scatter"]
    np.testing.assert_allclose(scatter["covariance_first_order"], 1.6e-5 * np.outer(slope, slope), rtol=1e-6)
    # The object is on the next segment when it leaves late, whose start is that of the ellipse.
    landings = thrown.launch.scatter.landings
    instants = np.random.default_rng(0).normal(size=400) * 0.004
    own = np.array([landing(late) for late in instants]) - TARGET[:2]
    assert np.abs(landings - own).max() < 1e-5 and scatter["missed"] == 0


def test_errors_of_cables(thrown):
    """Landings of lengths and rates with errors, small ones; derivatives by differences of solutions in NumPy."""
    velocity = aim(POINT, TARGET, 0.6)
    units = (POINT - SPOOLS) / np.linalg.norm(POINT - SPOOLS, axis=1, keepdims=True)
    rates, size = units @ velocity, 1e-6

    def landing(lengths, faster):
        place = POINT.copy()
        for _ in range(20):
            rays = place - SPOOLS
            here = np.linalg.norm(rays, axis=1)
            place = place + np.linalg.solve(rays / here[:, None], lengths - here)
        rays = place - SPOOLS
        pace = np.linalg.solve(rays / np.linalg.norm(rays, axis=1, keepdims=True), rates + faster)
        fall = np.roots([0.5 * DOWN[2], pace[2], place[2] - TARGET[2]]).max()
        return (place + pace * fall)[:2]

    known, none = np.linalg.norm(POINT - SPOOLS, axis=1), np.zeros(3)
    steps = size * np.eye(3)
    of_lengths = [(landing(known + step, none) - landing(known - step, none)) / (2.0 * size) for step in steps]
    of_rates = [(landing(known, step) - landing(known, -step)) / (2.0 * size) for step in steps]
    wanted = 4e-6 * np.transpose(of_lengths) @ of_lengths + 9e-6 * np.transpose(of_rates) @ of_rates
    found = thrown.scatter(cspr_jax.LaunchErrors(cable_length=0.002, cable_speed=0.003, throws=50))
    np.testing.assert_allclose(found.first_order, wanted, rtol=1e-6)


def test_a_late_object_is_on_what_follows(thrown):
    throw = thrown.launch.throw
    for late in (-0.2, 0.2):
        state = state_at(throw, np.float64(late))
        motion, time = throw.motions[late > 0.0], float(throw.motions[0].duration()) + late if late < 0.0 else late
        np.testing.assert_allclose(
            state.position, motion.state(np.float64(time / float(motion.duration()))).position, atol=1e-12
        )


@pytest.mark.thorough
@pytest.mark.parametrize("radius", [0.0, 0.08])
def test_errors_of_redundant_cables_and_over_pulleys(radius):
    """Derivatives are those of differences; the place has the least sum of squares of what lengths miss."""
    spools = np.array([[1.0, 0.1, 0.0], [-0.6, 0.8, 0.0], [-0.4, -0.9, 0.0], [0.8, 0.9, 0.0]])
    robot, _ = prepared(cspr_jax.point_mass(spools if radius == 0.0 else spools[:3], mass=1.0))
    if radius:
        axes = np.tile([0.0, 0.0, 1.0], (3, 1))
        robot = dataclasses.replace(robot, pulleys=Pulleys(np.full(3, radius), axes))
    ellipse = Ellipse(np.array([0.0, 0.0, 2.0]), np.array([1.2, 0.2, 0.1]), np.array([0.3, 0.9, -0.2]))
    with double_precision():
        motion = turning(ellipse, np.asarray(NATURAL), np.asarray(0.0), 1.0)
        throw = Throw((motion, motion), motion.duration(), np.array([1.5, 2.5, 3.0]))
        one = jax.jit(lambda errors: landing(robot, throw, errors))
        none = np.zeros(1 + 2 * robot.n_cables)
        slopes = np.asarray(jax.jacfwd(one)(none))
        steps = 1e-5 * np.eye(len(none))
        differences = np.stack([(one(step) - one(-step)) / 2e-5 for step in steps], axis=1)
        np.testing.assert_allclose(slopes, differences, atol=1e-6 * np.abs(slopes).max())
        state = state_at(throw, np.float64(0.0))

        def lengths(place):
            return cable_motion(robot, place, place * 0.0, place * 0.0)[0]

        wanted = lengths(state.position) + np.linspace(-0.02, 0.03, robot.n_cables)
        own = least_squares(lambda x: np.asarray(lengths(x)) - wanted, state.position, xtol=1e-15, ftol=1e-15)
        velocity = np.linalg.lstsq(np.asarray(jax.jacfwd(lengths)(own.x)), rates(robot, state), rcond=None)[0]
        fall = np.roots([0.5 * GRAVITY, velocity[2], own.x[2] - 3.0]).max()
        found = one(np.concatenate([[0.0], np.linspace(-0.02, 0.03, robot.n_cables), none[1 + robot.n_cables :]]))
        np.testing.assert_allclose(found, own.x[:2] + velocity[:2] * fall - [1.5, 2.5], atol=1e-6)


def rates(robot, state):
    """Of the cables, as planned."""
    return np.asarray(cable_motion(robot, *state[:3])[1])


def test_the_least_energy():
    """In closed form where its ellipse is feasible, sqrt(2 |d| / g); else at the edge of what is feasible."""
    slowest = np.sqrt(2.0 * np.linalg.norm(TARGET - POINT) / GRAVITY)
    assert is_taut(POINT, aim(POINT, TARGET, slowest), NATURAL)
    launch = cspr_jax.plan(content({"time": None, "choose": "energy"}, last=None)).to_dict()["launch"]
    assert launch["flight_time"] == pytest.approx(slowest, rel=1e-12)
    np.testing.assert_allclose(launch["landing"], TARGET, atol=1e-9)


@pytest.mark.thorough
def test_the_least_energy_under_a_low_ceiling():
    """A target so far that the slowest release would rise above the spools: no feasible one is slower."""
    far = np.array([16.0, 3.0, 0.6])
    slowest = np.sqrt(2.0 * np.linalg.norm(far - POINT) / GRAVITY)
    assert not is_taut(POINT, aim(POINT, far, slowest), NATURAL)
    answer = cspr_jax.plan(content({"time": None, "choose": "energy", "target": far}, more={"max_arcs": 2}, last=None))
    time = answer.to_dict()["launch"]["flight_time"]
    times = np.linspace(0.5, 1.02, 521) * slowest
    feasible = np.array([is_taut(POINT, aim(POINT, far, t), NATURAL) for t in times])
    speeds = np.array([np.linalg.norm(aim(POINT, far, t)) for t in times])
    assert is_taut(POINT, aim(POINT, far, time), NATURAL) and feasible.any() and not feasible.all()
    least = speeds[feasible].min()
    assert np.linalg.norm(aim(POINT, far, time)) == pytest.approx(least, rel=2e-3)
    # By hand: on level spools the rise of the ellipse bounds the vertical velocity.
    upward = NATURAL * np.sqrt(DEPTH**2 - (POINT - CENTRE)[2] ** 2)
    edge = np.roots([0.5 * GRAVITY, -upward, far[2] - POINT[2]]).real.max()
    assert edge * (1.0 - 2e-3) < time < edge


@pytest.mark.thorough
def test_the_least_energy_above_a_floor():
    """By hand: 0.6 m below the centre, a floor bounds the vertical velocity as a ceiling does; it may be touched."""
    change = {"time": None, "choose": "energy"}
    answer = cspr_jax.plan(content(change, more={"max_arcs": 8, "floor": 0.4}, last=None))
    upward = NATURAL * np.sqrt(0.6**2 - (POINT - CENTRE)[2] ** 2)
    edge = np.roots([0.5 * GRAVITY, -upward, (TARGET - POINT)[2]]).real.max()
    assert answer.to_dict()["launch"]["flight_time"] == pytest.approx(edge, rel=1e-8)
    assert answer.feasible and abs(answer.to_dict()["segments"][0]["limit_margin"]) < 1e-8


@pytest.mark.thorough
@pytest.mark.parametrize(("fraction", "feasible"), [(-1e-6, True), (0.0, True), (1e-6, False)])
@pytest.mark.parametrize("choose", ["energy", "time"])
def test_a_level_swing_on_the_floor(fraction, feasible, choose):
    """By hand: only a level release, at one time of flight, leaves an ellipse that does not go through the floor."""
    size = np.linalg.norm(SPOOLS - SPOOLS.mean(0), axis=1).max()
    change = {"time": None, "choose": choose, "point": [1.4, 0.5, 1.0], "target": [3.5, 1.8, 0.2]}
    answer = cspr_jax.plan(content(change, more={"max_arcs": 8, "floor": 1.0 + fraction * size}, last=None))
    assert answer.feasible == feasible
    if feasible:
        time = np.sqrt(2.0 * 0.8 / GRAVITY)
        assert answer.to_dict()["launch"]["flight_time"] == pytest.approx(time, abs=1e-6 if fraction else 1e-8)


@pytest.mark.thorough
def test_the_slowest_release_touches_the_floor():
    """The one of least energy of all, by its closed form, above a floor that is as low as its ellipse."""
    time = np.sqrt(2.0 * np.linalg.norm(TARGET - POINT) / GRAVITY)
    depth = np.hypot((POINT - CENTRE)[2], aim(POINT, TARGET, time)[2] / NATURAL)
    size = np.linalg.norm(SPOOLS - SPOOLS.mean(0), axis=1).max()
    for fraction in (-1e-6, 0.0, 1e-6):
        limits = {"max_arcs": 8, "floor": CENTRE[2] - depth + fraction * size}
        answer = cspr_jax.plan(content({"time": None, "choose": "energy"}, more=limits, last=None))
        found = answer.to_dict()["launch"]["flight_time"]
        assert answer.feasible and (abs(found - time) < 1e-12) == (fraction <= 0.0)


@pytest.mark.thorough
def test_the_earliest_landing_touches_a_limit():
    """On eight arcs a largest tension decides: it is reached, and none that lands earlier keeps to it."""
    more = {"tension_max": 4.2}
    asked = content({"time": None, "choose": "time"}, more=more, last=None)
    asked["pose"][1]["arcs"] = 8
    found = cspr_jax.plan(asked).to_dict()
    assert found["feasible"] and found["segments"][0]["tension_max"] == pytest.approx(4.2, rel=1e-8)
    earlier = content({"time": found["launch"]["flight_time"] * (1.0 - 1e-6)}, more=more, last=None)
    earlier["pose"][1]["arcs"] = 8
    assert not cspr_jax.plan(earlier).feasible


@pytest.mark.soak
def test_the_earliest_landing():
    """No other number of arcs, and no shorter flight with the same number, lands earlier."""
    found = cspr_jax.plan(content({"time": None, "choose": "time"}, last=None)).to_dict()
    (segment,), launch = found["segments"], found["launch"]
    assert found["feasible"]
    landing = launch["release"]["time"] + launch["flight_time"]
    assert segment["arcs"] > 1
    for arcs in (segment["arcs"] - 1, segment["arcs"]):
        for time in launch["flight_time"] * np.array([0.5, 0.8, 0.95, 0.99]):
            more = content({"time": float(time)}, last=None)
            more["pose"][1] |= {"arcs": arcs}
            assert not cspr_jax.plan(more).feasible, (arcs, time)
    slow = cspr_jax.plan(content({"time": None, "choose": "energy"}, last=None)).to_dict()["launch"]
    assert landing <= slow["release"]["time"] + slow["flight_time"]


@pytest.mark.quick("best")
@pytest.mark.parametrize("rule", ["fastest", "slowest", "best"])
def test_frequencies_by_rules(rule):
    """The ellipse changes with the frequency: samples say where it stays taut, and which has the most room."""
    answer = cspr_jax.plan(content(ellipse={"frequency": rule}, more={"max_arcs": 1}, last=None))
    frequency, velocity = answer.to_dict()["segments"][0]["frequency"], aim(POINT, TARGET, 0.6)
    if rule == "best":
        room = [margin(velocity, w) for w in (frequency, *(frequency * np.array([0.9, 0.99, 1.01, 1.1])))]
        assert room[0] > 0.0 and max(room[1:]) < room[0]
        return
    outward = 1.0 if rule == "fastest" else -1.0
    assert is_taut(POINT, velocity, frequency * (1.0 - 1e-4 * outward))
    assert not is_taut(POINT, velocity, frequency * (1.0 + 1e-3 * outward))


def margin(velocity, frequency):
    """Smallest pseudotension over its value at rest below the centroid, by samples and determinants."""
    place, acceleration = turn(POINT, velocity, frequency)
    rays, force = SPOOLS - place[:, None], acceleration - DOWN

    def pseudotensions(rays, force):
        return np.stack([np.sum(np.cross(rays[:, k - 2], rays[:, k - 1]) * force, axis=1) for k in range(3)], axis=1)

    centroid = SPOOLS.mean(0) - [0.0, 0.0, DEPTH]
    ones = pseudotensions((SPOOLS - centroid)[None], -DOWN[None])
    kappa = pseudotensions(rays, force) / ones
    depth = (SPOOLS[0, 2] - place[:, 2]) / DEPTH
    return min(kappa.min(), depth.min())


def test_a_velocity_at_the_target():
    """With a time of flight, or with a place on its parabola, which says the same."""
    arrival = aim(POINT, TARGET, 0.6) + 0.6 * DOWN
    for change in ({"point": None}, {"time": None}):
        launch = cspr_jax.plan(content({"velocity": arrival} | change, last=None)).to_dict()["launch"]
        np.testing.assert_allclose(launch["release"]["position"], POINT, atol=1e-9)
        np.testing.assert_allclose(launch["release"]["velocity"], aim(POINT, TARGET, 0.6), atol=1e-8)
        assert launch["flight_time"] == pytest.approx(0.6, abs=1e-9)


def test_a_release_too_high_is_no_launch():
    """A rise above the spools is the verdict of the segment, not an error."""
    answer = cspr_jax.plan(content({"time": 2.5}, more={"max_arcs": 2}, last=None)).to_dict()
    (segment,) = answer["segments"]
    assert not answer["feasible"] and segment["pseudotension_margin"] < 0.0 and segment["cause"]


TEXT = """schema = 1
family = "ellipse"
{more}
[robot]
name = "three"
mass = 0.5
z_axis = "up"
base_points = [[1.0, 0.1, 3.0], [-0.6, 0.8, 3.0], [-0.4, -0.9, 3.0]]
[[pose]]
rest = true
position = [0, 0, 1.0]
[[pose]]
{ellipse}
[[pose]]
rest = true
position = [0, 0, 1.0]
[launch]
segment = {segment}
target = [3.5, 1.8, 0.0]
{launch}
"""
OF_TEXT = {"more": "", "ellipse": "ellipse = { centre = [0, 0, 1.0] }", "segment": "0"}
OF_TEXT["launch"] = "point = [1.4, 0.5, 0.8]\ntime = 0.6"


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"ellipse": "ellipse = { centre = [0, 0, 1], radius = 1 }"}, "pose[1].ellipse.radius = 1.0: must be absent"),
        ({"ellipse": "ellipse = { centre = [0, 0, 1], half_axes = [[1, 0, 0]] }"}, "pose[1].ellipse.half_axes"),
        ({"ellipse": "ellipse = { centre = [0, 0, 1], normal = [1, 0, 0] }"}, "pose[1].ellipse.normal"),
        ({"ellipse": "ellipse = { centre = [0, 0, 1], phase = 0.0 }"}, "pose[1].ellipse.phase"),
        ({"ellipse": "turns = 2"}, "pose[1].ellipse is missing: { centre = [x, y, z] }"),
        ({"ellipse": "rest = true"}, "pose[1].rest = true: must be absent"),
        ({"ellipse": "ellipse = { centre = [0, 0, 4.0] }"}, "the centre is not below the spools"),
        ({"segment": "1"}, "pose[2].position = [0.0, 0.0, 1.0]: must be absent"),
        ({"segment": "2"}, "launch.segment = 2: must be from 0 to 1"),
        ({"launch": "time = 0.6"}, "launch.point is missing"),
        ({"launch": "point = [1.4, 0.5, 0.8]"}, "launch.time is missing"),
        ({"launch": "point = [1.4, 0.5, 0.8]\ntime = 0.6\nrelease = 0.5"}, "launch.release = 0.5: must be absent"),
        ({"launch": "point = [1.4, 0.5, 0.8]\nvelocity = [1, 0, 0]"}, "must lie on the parabola"),
        ({"more": "max_arcs = 0"}, "max_arcs = 0"),
    ],
)
def test_one_line_says_what_is_wrong(tmp_path, change, line):
    code, out, err = command(tmp_path, TEXT.format(**(OF_TEXT | change)))
    assert code == 2 and out == "" and err.count("\n") == 1 and line in err, err


def test_an_ellipse_without_axes_needs_a_launch(tmp_path):
    text = TEXT.format(**OF_TEXT)
    code, _, err = command(tmp_path, text[: text.index("[launch]")])
    assert code == 2 and "pose[1].ellipse.radius is missing: half_axes, or the radius of a circle" in err
