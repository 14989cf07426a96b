"""Maps of throws from swings: releases thrown again in NumPy, other searches, plans, tiles, and lines of mistakes."""

import numpy as np
import pytest
from scipy.optimize import minimize
from support.commands import refuse_sweep, swept

import cspr_jax
from cspr_jax.errors import InputError
from cspr_jax.families.ellipses.swing_range import swing_range
from cspr_jax.families.ellipses.swing_range_map import SwingRangeMap
from cspr_jax.maps.release_box import ReleaseBox
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.sweep.definition import read_sweep

SWEEP = """schema = 1
map = "swing-range"
robot = "{robot}"
[axes]
x = {x}
y = {y}
z = {z}
[trajectory]
family = "{family}"
from = {{ position = {start} }}
{more}
"""
GIVEN = {"robot": "prototype", "family": "ellipse", "x": [-0.3, 2.5, 6.0], "y": [-4.0, 0.0, 4.0], "z": [-0.4, 3.0]}
GIVEN |= {"start": [0.02, 0.0, 2.0], "more": "[launch]\nrelease_x = [-1.5, 1.0]\nrelease_z = [1.2, 2.4]"}
GRAVITY, CENTRE, NATURAL = 9.81, np.array([0.02, 0.0, 2.0]), np.sqrt(9.81 / 2.0)
DOWN = np.array([0.0, 0.0, GRAVITY])


def text(**changes):
    return SWEEP.format(**(GIVEN | changes))


def mapped(folder, **changes):
    folder.mkdir()
    return swept(folder, text(**changes))


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    return mapped(tmp_path_factory.mktemp("swings") / "plain")


def throws_of(result):
    """Landing places, and every quantity, of the cells with a release."""
    places = np.stack(np.meshgrid(*(result.axes[name] for name in "xyz"), indexing="ij"), -1).reshape(-1, 3)
    data = {name: np.asarray(values).ravel() for name, values in result.data.items()}
    found = data["verdict"] == 0
    return places[found], {name: values[found] for name, values in data.items()}


def test_every_release_is_thrown_again(result):
    """Ballistics, and a balance of forces around the ellipse; its amplitude by samples."""
    spools = np.asarray(cspr_jax.load_robot("prototype").base_points)
    places, data = throws_of(result)
    assert len(places) == 9
    angle = np.linspace(0.0, 2.0 * np.pi, 3601)[:, None]
    for i, target in enumerate(places):
        release, time = np.array([data[f"release_{name}"][i] for name in "xyz"]), data["flight_time"][i]
        velocity = (target - release) / time - 0.5 * DOWN * time
        np.testing.assert_allclose(np.linalg.norm(velocity), data["release_speed"][i], rtol=1e-9, atol=1e-12)
        assert (release >= np.array([-1.5, -0.52, 1.2]) - 1e-12).all()
        assert (release <= np.array([1.0, 0.52, 2.4]) + 1e-12).all()
        outward = (release - CENTRE) * np.cos(angle) + velocity / NATURAL * np.sin(angle)
        place, force = CENTRE + outward, -(NATURAL**2) * outward - DOWN
        rays = spools - place[:, None]
        units = rays / np.linalg.norm(rays, axis=2, keepdims=True)
        pulls = np.linalg.solve(np.swapaxes(units, 1, 2), force[..., None])[..., 0]
        assert (pulls > 0.0).all() and (place[:, 2] > 0.0).all()
        size = np.linalg.norm(outward, axis=1).max()
        np.testing.assert_allclose(data["swing_amplitude"][i], size, rtol=1e-5)


def test_what_no_swing_reaches(result):
    """Above the spools nothing is: the parabola of no release comes there."""
    data = {name: np.asarray(values) for name, values in result.data.items()}
    lost = data["verdict"] != 0
    assert lost[..., 0].all() and not lost[..., 1].any()
    assert (data["verdict"][lost] == Verdict.ABOVE_SPOOLS.value).all()
    assert (data["largest_margin"][lost] < 0.0).all() and (data["largest_margin"][~lost] > 0.0).all()
    for name in ("release_speed", "flight_time", "swing_amplitude", "release_x", "release_y", "release_z"):
        assert np.array_equal(np.isnan(data[name]), lost), name


def test_the_highest_target():
    """By hand: from the depth D of the centre an object comes D / 2 higher."""
    spools = np.array([[0.3, 0.1, 0.0], [-0.2, 0.3, 0.0], [-0.1, -0.4, 0.0]])
    robot = cspr_jax.make_problem(cspr_jax.point_mass(spools, mass=1.0)).robot
    box = ReleaseBox(np.array([-9.0, -9.0, 2.0]), np.array([9.0, 9.0, 2.0]))
    heights = np.array([1.01, 0.99])
    targets = np.stack([heights * 0.0, heights * 0.0, heights], axis=1)
    found = swing_range(robot, np.tile([0.0, 0.0, 2.0], (2, 1)), targets, box)
    assert found.verdict.tolist() == [0, Verdict.ABOVE_SPOOLS.value]
    np.testing.assert_allclose(found.release_speed[0], np.sqrt(2.0 * GRAVITY * 0.99), rtol=1e-5)


def slowest(centre, normal, floor, target, box, seed):
    """Another search: the best of random releases, improved by sequential quadratic programming."""
    depth = normal @ centre
    rate, rng = np.sqrt(GRAVITY / depth), np.random.default_rng(seed)

    def velocity(place, time):
        return (target - place) / time - 0.5 * DOWN * time

    def rooms(x):
        place, pace = x[:3], velocity(x[:3], x[3])
        rise = [normal @ (place - centre), normal @ pace / rate]
        lift = [place[2] - centre[2], pace[2] / rate]
        return np.array([1.0 - np.sum(np.square(rise)) / depth**2, (floor - centre[2]) ** 2 - np.sum(np.square(lift))])

    best = np.inf
    starts = np.c_[rng.uniform(*box, (4000, 3)), np.exp(rng.uniform(-3.0, 1.5, 4000)) / rate]
    speeds = [np.linalg.norm(velocity(x[:3], x[3])) if (rooms(x) > 0.0).all() else np.inf for x in starts]
    bounds = [*zip(*box, strict=True), (1e-3, 20.0)]
    for k in np.argsort(speeds)[:3]:
        if np.isinf(speeds[k]):
            break
        best = min(best, speeds[k])
        own = minimize(
            lambda x: np.sum(velocity(x[:3], x[3]) ** 2),
            starts[k],
            constraints=[{"type": "ineq", "fun": rooms}],
            bounds=bounds,
            method="SLSQP",
            options={"ftol": 1e-12},
        )
        if (rooms(own.x) > -1e-9).all():
            best = min(best, np.sqrt(own.fun))
    return best


@pytest.mark.parametrize("seed", [0, 1, pytest.param(2, marks=pytest.mark.thorough)])
def test_no_other_search_is_slower(seed):
    """Tilted spools, with a floor: nothing that it finds is beaten, and what it does not reach nobody reaches."""
    rng = np.random.default_rng(seed)
    angle, tilt = np.array([0.2, 2.3, 4.1]) + 0.2 * rng.normal(size=3), 0.3 * rng.normal(size=2)
    level = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    level -= level.mean(0)
    robot = cspr_jax.make_problem(cspr_jax.point_mass(np.c_[level, -level @ tilt], mass=1.0)).robot
    centre, normal = np.array([0.05, -0.03, rng.uniform(1.0, 3.0)]), np.array([*tilt, 1.0])
    box = ReleaseBox(centre + rng.uniform(-2.0, -0.2, 3) * [1, 1, 0.3], centre + rng.uniform(0.2, 2, 3) * [1, 1, 0.3])
    targets = np.c_[rng.uniform(-8.0, 8.0, (8, 2)), centre[2] + rng.uniform(-1.3, 2.0, 8)]
    floor = centre[2] + 1.0
    found = swing_range(robot, np.tile(centre, (8, 1)), targets, box, floor)
    for i, target in enumerate(targets):
        other = slowest(centre, normal, floor, target, box, seed)
        if np.isinf(other):
            continue
        assert found.verdict[i] == 0 and found.release_speed[i] <= other * (1.0 + 1e-5) + 1e-6
    assert (found.verdict == 0).sum() >= 4


def test_floors_and_centres():
    """A floor takes away rises; a centre beside the hull has no swing, one above it neither."""
    spools = np.array([[0.3, 0.1, 0.0], [-0.2, 0.3, 0.0], [-0.1, -0.4, 0.0]])
    robot = cspr_jax.make_problem(cspr_jax.point_mass(spools, mass=1.0)).robot
    box = ReleaseBox(np.array([-1.0, -1.0, 1.2]), np.array([1.0, 1.0, 2.6]))
    centres = np.array([[0.0, 0.0, 2.0], [0.5, 0.0, 2.0], [0.0, 0.0, -1.0], [0.0, 0.0, 2.0]])
    targets = np.array([[3.0, 0.0, 2.2], [3.0, 0.0, 2.2], [3.0, 0.0, 2.2], [9.0, 0.0, 1.5]])
    free, over = (swing_range(robot, centres, targets, box, floor) for floor in (None, 2.3))
    assert free.verdict.tolist() == [0, Verdict.SLACK_CABLE.value, Verdict.ABOVE_SPOOLS.value, 0]
    assert over.verdict[0] == 0 and over.release_speed[0] > free.release_speed[0] * 1.01
    lift = np.array([over.release_z[0] - 2.0, 0.0])
    velocity = (targets[0] - over.releases[0]) / over.flight_time[0] - 0.5 * DOWN * over.flight_time[0]
    lift[1] = velocity[2] / NATURAL
    assert np.linalg.norm(lift) == pytest.approx(0.3, rel=1e-12)
    low = swing_range(robot, centres[:1], targets[:1], box, 1.9)
    assert low.verdict[0] == Verdict.BELOW_FLOOR.value and low.largest_margin[0] <= 0.0
    deep = ReleaseBox(np.array([-1.0, -1.0, 2.4]), np.array([1.0, 1.0, 2.6]))
    assert swing_range(robot, centres[:1], np.array([[3.0, 0.0, 3.2]]), deep, 2.3).verdict[0] != 0


@pytest.mark.parametrize(("fraction", "feasible"), [(-1e-6, True), (0.0, True), (1e-6, False)])
def test_swings_on_the_floor(fraction, feasible):
    """By hand: a level swing on the floor throws level, from the side of the box, and falls 0.2 m."""
    spools = np.array([[0.3, 0.1, 0.0], [-0.2, 0.3, 0.0], [-0.1, -0.4, 0.0]])
    box = ReleaseBox(np.array([-1.0, -1.0, 1.2]), np.array([1.0, 1.0, 2.6]))
    robot = cspr_jax.make_problem(cspr_jax.point_mass(spools, mass=1.0)).robot
    floor = 2.0 - fraction * np.linalg.norm(spools, axis=1).max()
    found = swing_range(robot, np.array([[0.0, 0.0, 2.0]]), np.array([[3.0, 0.0, 2.2]]), box, floor)
    assert found.feasible[0] == feasible
    if feasible:
        np.testing.assert_allclose(found.releases[0], [1.0, 0.0, 2.0], atol=1e-6)
        np.testing.assert_allclose(found.release_speed[0], 2.0 / np.sqrt(0.4 / GRAVITY), rtol=1e-5)


@pytest.mark.thorough
@pytest.mark.parametrize(("fraction", "verdict"), [(-1e-6, "feasible"), (0.0, "feasible"), (1e-6, "below_floor")])
def test_a_plan_touches_the_floor_that_the_map_touches(fraction, verdict):
    """The release found above a floor, planned above one that is as high, a millionth lower and higher."""
    start, target, spools = [0.02, 0.0, 2.0], [1.5, 0.3, 2.2], [[1.0, 0.1, 0.0], [-0.6, 0.8, 0.0], [-0.4, -0.9, 0.0]]
    ranges = {"release_x": [-0.5, 0.5], "release_y": [-0.5, 0.5], "release_z": [1.2, 2.6]}
    limits = cspr_jax.Limits(floor=np.array(2.3))
    found = cspr_jax.swing_range(cspr_jax.point_mass(spools, mass=1.0), [target], start=start, limits=limits, **ranges)
    launch = {"segment": 0, "point": found.releases[0].tolist(), "target": target, "time": float(found.flight_time[0])}
    # A turn before the release comes by the lowest point.
    poses = [{"rest": True, "position": start}, {"ellipse": {"centre": start}, "turns": 1, "arcs": 20}]
    head = {"schema": 1, "robot": {"name": "three", "mass": 1.0, "base_points": spools}, "family": "ellipse"}
    plan = head | {"limits": {"floor": 2.3 - fraction}, "pose": poses, "launch": launch}
    (segment,) = cspr_jax.plan(plan).to_dict()["segments"]
    assert segment["verdict"] == verdict


def test_a_centre_on_the_edge_of_the_hull():
    """Within rounding nothing is said."""
    spools = np.array([[1.0, 0.0, 0.0], [-0.5, 0.7, 0.0], [-0.5, -0.7, 0.0]])
    robot = cspr_jax.make_problem(cspr_jax.point_mass(spools, mass=1.0)).robot
    box = ReleaseBox(np.array([-1.0, -1.0, 1.2]), np.array([1.0, 1.0, 2.6]))
    centres = np.array([[-0.5, 0.1, 2.0], [-0.499999, 0.1, 2.0]])
    found = swing_range(robot, centres, np.tile([3.0, 0.0, 2.2], (2, 1)), box)
    assert found.verdict.tolist() == [Verdict.UNDECIDED.value, 0] and np.isnan(found.release_speed[0])


def test_a_plan_says_the_same(result, tmp_path):
    """Of the swing with the smallest amplitude that throws aside: the keys of [launch] are quantities of the map."""
    places, data = throws_of(result)
    i = int(np.where(data["release_speed"] > 0.5, data["swing_amplitude"], np.inf).argmin())
    point = [float(data[f"release_{name}"][i]) for name in "xyz"]
    rest = {"rest": True, "position": CENTRE.tolist()}
    launch = {"segment": 0, "point": point, "target": places[i].tolist(), "time": float(data["flight_time"][i])}
    poses = [rest, {"ellipse": {"centre": CENTRE.tolist()}}]
    plan = cspr_jax.plan({"schema": 1, "robot": "prototype", "family": "ellipse", "pose": poses, "launch": launch})
    assert plan.feasible
    speed = np.linalg.norm(plan.to_dict()["launch"]["release"]["velocity"])
    np.testing.assert_allclose(speed, data["release_speed"][i], rtol=1e-9)


def test_python_says_what_the_map_says(result):
    places, data = throws_of(result)
    own = {"start": CENTRE, "release_x": [-1.5, 1.0], "release_z": [1.2, 2.4]}
    found = cspr_jax.swing_range(cspr_jax.load_robot("prototype"), places, **own)
    assert found.feasible.all()
    for name in ("release_speed", "flight_time", "swing_amplitude", "release_x"):
        np.testing.assert_allclose(getattr(found, name), data[name], rtol=1e-12, atol=1e-15)
    table = found.to_xarray({"target": np.arange(len(places))})
    assert table["swing_amplitude"].attrs["units"] == "m"


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"targets": [[0.0, 0.0]]}, "targets"),
        ({"start": np.zeros((3, 3))}, "start"),
        ({"release_y": [0.2, 0.1]}, "release_y"),
        ({"limits": cspr_jax.Limits(tension_max=5.0)}, 'limits = "tension_max": must be a floor alone'),
        ({"robot": "launch-robot"}, "a point mass"),
    ],
)
def test_bad_arguments(given, words):
    robot = cspr_jax.load_robot(given.get("robot", "prototype"))
    asked = {"targets": [[0.0, 0.0, 3.0]], "start": [0.0, 0.0, 1.0]} | given | {"robot": robot}
    with pytest.raises(InputError, match=words):
        cspr_jax.swing_range(asked.pop("robot"), asked.pop("targets"), **asked)


@pytest.mark.thorough
def test_a_map_of_swings_on_the_floor(tmp_path):
    """Level ones: every release is as high as the centre."""
    data = mapped(tmp_path / "floor", more=GIVEN["more"] + "\n[limits]\nfloor = 2.0").data
    assert (data["verdict"][..., 1] == 0).all() and (data["verdict"][..., 0] != 0).all()
    np.testing.assert_allclose(data["release_z"][..., 1], 2.0, atol=1e-8)


def test_tiles_change_no_bit(result, tmp_path):
    other = mapped(tmp_path / "tiles", more=GIVEN["more"] + "\n[run]\ntile = [2, 1, 1]")
    for name, values in result.data.items():
        assert np.array_equal(values, other.data[name], equal_nan=True), name


def test_two_cables_in_a_plane_and_four_in_space(tmp_path):
    plane = mapped(tmp_path / "plane", robot="transition-planar", y=[0.0], start=[0.0, 0.0, 1.0], more="")
    assert (plane.data["verdict"][1:, 0, 1] == 0).all() and not np.nanmax(np.abs(plane.data["release_y"]))
    places = {"start": [20.0, 12.0, 15.0], "x": [-60.0, 20.0, 90.0], "z": [0.0, 30.5], "more": ""}
    four = mapped(tmp_path / "four", robot="boralugoda-rectangle", **places)
    assert (four.data["verdict"][..., 0] == 0).all() and (four.data["verdict"][..., 1] != 0).all()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"more": "[launch]\npopulation = 32"}, "launch.population: must be absent in this map"),
        ({"more": "[launch]\nmax_duration = 3.0"}, "launch.max_duration: must be absent in this map"),
        ({"more": "[launch]\nrelease_x = [0.2, 0.1]"}, "launch.release_x = [0.2, 0.1]: must be [least, largest]"),
        ({"more": "[limits]\ntension_max = 9.0"}, "limits.tension_max: must be absent in this map"),
        ({"family": "bezier"}, 'trajectory.family = "bezier": must be "ellipse" in this map'),
        ({"start": [0.0, 0.0, -1.0]}, "trajectory.from: every point is above the spool plane"),
        ({"robot": "laval-mssm"}, "must be a point mass in this map"),
        ({"robot": "transition-planar"}, "axes.y: must be [0] for a planar robot"),
    ],
)
def test_one_line_says_what_is_wrong(tmp_path, changes, words):
    refuse_sweep(tmp_path, text(**changes), words)


def test_numbers_that_contradict_each_other_are_noticed(tmp_path):
    (tmp_path / "s.toml").write_text(text())
    sweep = read_sweep(tmp_path / "s.toml")
    own = SwingRangeMap(sweep.robot, sweep.spec, sweep.file)
    names = ("release_speed", "flight_time", "swing_amplitude", "release_x", "release_y", "release_z")
    answers = {name: np.full(4, 1.0) for name in (*names, "largest_margin")} | {"verdict": np.array([0, 0, 0, 1])}
    answers["largest_margin"][1], answers["flight_time"][2] = -0.1, np.nan
    noticed = [list(cells) for cells in own.contradictions(answers).values()]
    assert noticed == [[False] * i + [True] + [False] * (3 - i) for i in (1, 2, 3)]
