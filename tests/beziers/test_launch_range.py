"""Maps of launches: every launch is thrown again in plain NumPy; symmetry, tiles, limits, plans, lines of mistakes."""

import json

import numpy as np
import pytest
from support.commands import cspr, swept

import cspr_jax
from cspr_jax.errors import InputError
from cspr_jax.families.beziers.launches.launch_range_map import LaunchRangeMap
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.sweep.definition import read_sweep

START = np.array([0.0, 0.0, -0.6])
SWEEP = """schema = 1
map = "launch-range"
robot = "{robot}"
[axes]
x = {x}
y = {y}
z = [{z}]
[trajectory]
family = "bezier"
from = {{ position = [0.0, 0.0, {start}] }}
[launch]
population = {population}
{more}
"""
TENSIONS = "[limits]\ntension_max = 2.8"
GIVEN = {"robot": "launch-robot", "x": [-0.3, 0.3, 1.5], "y": [-0.9, 0.0, 0.9], "z": -1.675, "start": -0.6}


def text(**changes):
    return SWEEP.format(**(GIVEN | {"population": 16, "more": ""} | changes))


def mapped(folder, **changes):
    folder.mkdir()
    return swept(folder, text(**changes))


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    return mapped(tmp_path_factory.mktemp("range") / "plain", population=32)


def launches_of(result):
    """Landing places, and every quantity, of the cells with a launch."""
    places = np.stack(np.meshgrid(*(result.axes[name] for name in "xyz"), indexing="ij"), -1).reshape(-1, 3)
    data = {name: np.asarray(values).ravel() for name, values in result.data.items()}
    found = data["verdict"] == 0
    return places[found], {name: values[found] for name, values in data.items()}


def segment_of(data, i, target, gravity, start=START):
    """Control points of the segment of a launch, z up, by two linear equations in each coordinate."""
    release = np.array([data[f"release_{name}"][i] for name in "xyz"])
    flight, duration, time = data["flight_time"][i], data["duration"][i], data["release_time"][i]
    velocity = (target - release) / flight + np.array([0.0, 0.0, 0.5 * gravity * flight])
    s, rate = 0.5 * (1.0 - np.cos(np.pi * time / duration)), 0.5 * np.pi / duration * np.sin(np.pi * time / duration)
    place = np.array([2.0 * s * (1.0 - s), s * s])
    slope = rate * np.array([2.0 - 4.0 * s, 2.0 * s])
    known = np.stack([release - (1.0 - s) ** 2 * start, velocity + 2.0 * rate * (1.0 - s) * start])
    middle, end = np.linalg.solve(np.stack([place, slope]), known)
    return (start, middle, end), release, velocity


def states_of(points, duration, times):
    """Places and accelerations along a segment, by the derivatives of s with respect to the time."""
    start, middle, end = points
    turn = np.pi / duration
    s, rate = 0.5 * (1.0 - np.cos(turn * times)), 0.5 * turn * np.sin(turn * times)
    second_derivative = 0.5 * turn**2 * np.cos(turn * times)
    first = 2.0 * ((1.0 - s)[:, None] * (middle - start) + s[:, None] * (end - middle))
    place = ((1.0 - s) ** 2)[:, None] * start + (2.0 * s * (1.0 - s))[:, None] * middle + (s**2)[:, None] * end
    return (
        place,
        rate[:, None] * first,
        second_derivative[:, None] * first + (2.0 * rate**2)[:, None] * (start - 2.0 * middle + end),
    )


def test_every_launch_found_is_thrown_again(result):
    """A balance of forces at 2,001 instants, with numbers of the file alone: every pair of cables pulls."""
    spools = np.asarray(cspr_jax.three_cable_equivalent(cspr_jax.load_robot("launch-robot")).base_points)
    gravity = 9.80665
    places, data = launches_of(result)
    assert 4 <= len(places) < 9
    for i, target in enumerate(places):
        points, release, velocity = segment_of(data, i, target, gravity)
        times = np.linspace(0.0, data["duration"][i], 2001)
        place, _, acceleration = states_of(points, data["duration"][i], times)
        rays = spools[None] - place[:, None]
        rays /= np.linalg.norm(rays, axis=2, keepdims=True)
        force = acceleration + np.array([0.0, 0.0, gravity])
        tensions = np.linalg.solve(np.swapaxes(rays, 1, 2), force[..., None])[..., 0]
        assert (tensions > 0.0).all() and (place[:, 2] < 0.0).all()
        np.testing.assert_allclose(np.linalg.norm(velocity), data["release_speed"][i], rtol=1e-9, atol=1e-12)
        at, moving, _ = (x[0] for x in states_of(points, data["duration"][i], data["release_time"][i : i + 1]))
        np.testing.assert_allclose(at, release, atol=1e-9)
        np.testing.assert_allclose(moving, velocity, atol=1e-9)
        flight = data["flight_time"][i]
        landing = at + moving * flight - 0.5 * np.array([0.0, 0.0, gravity]) * flight**2
        np.testing.assert_allclose(landing, target, atol=1e-9)


def test_what_is_not_found_is_empty(result):
    data = {name: np.asarray(values).ravel() for name, values in result.data.items()}
    lost = data["verdict"] != 0
    assert lost.any() and (data["largest_margin"][lost] < 0.0).all() and (data["largest_margin"][~lost] > 0.0).all()
    assert (data["verdict"][lost] & Verdict.SLACK_CABLE.value).all()
    for name in ("release_speed", "duration", "release_time", "flight_time", "release_x", "release_y", "release_z"):
        assert np.array_equal(np.isnan(data[name]), lost), name
    assert result.units["release_speed"] == "m s-1" and result.units["release_z"] == "m"


def test_the_reach_has_the_symmetry_of_the_robot(result):
    """Mirrored at y = 0; the search is not, so nearly."""
    speed, margin = result.data["release_speed"][..., 0], result.data["largest_margin"][..., 0]
    assert np.array_equal(np.isnan(speed), np.isnan(speed[:, ::-1]))
    assert np.nanmax(np.abs(speed - speed[:, ::-1])) < 0.1 and np.abs(margin - margin[:, ::-1]).max() < 0.1
    assert np.nanmin(speed) < 0.3 < np.nanmax(speed)


def test_tiles_change_no_bit(result, tmp_path):
    other = mapped(tmp_path / "tiles", population=32, more="[run]\ntile = [2, 2, 1]")
    for name, values in result.data.items():
        assert np.array_equal(values, other.data[name], equal_nan=True), name


@pytest.mark.thorough
def test_limits_of_the_mass_centre_hold_along_every_segment(tmp_path):
    """Differences of places at 4,001 instants; without the limits launches exceed each of them."""
    where = {"x": [-0.6, 0.0, 0.9], "y": [0.1, 0.5]}
    free = mapped(tmp_path / "free", **where)
    bound = mapped(tmp_path / "bound", **where, more="[limits]\nspeed_max = 0.9\nacceleration_max = 2.5")
    exceeded, kept = [], []
    for found, most in ((free, exceeded), (bound, kept)):
        places, data = launches_of(found)
        for i, target in enumerate(places):
            times = np.linspace(0.0, data["duration"][i], 4001)
            points = segment_of(data, i, target, 9.80665)[0]
            place = states_of(points, data["duration"][i], times)[0]
            speed, acceleration = (np.diff(place, n=n, axis=0) / times[1] ** n for n in (1, 2))
            most.append([np.linalg.norm(x, axis=1).max() for x in (speed, acceleration)])
    assert len(kept) > 1 and (np.max(kept, axis=0) <= [0.9, 2.5]).all()
    assert (np.max(exceeded, axis=0) > [0.9, 2.5]).all()
    lost = (bound.data["verdict"] != 0) & (free.data["verdict"] == 0)
    assert (bound.data["verdict"][lost] & (Verdict.TOO_FAST | Verdict.OVER_ACCELERATION).value).all()


@pytest.mark.soak
def test_a_limit_shrinks_the_range(tmp_path):
    """Of the six cables each, half of what a pair pulls."""
    where = {"x": [0.0, 0.9], "y": [0.4, 0.8]}
    free, bound = mapped(tmp_path / "free", **where), mapped(tmp_path / "bound", **where, more=TENSIONS)
    reached, still = (found.data["verdict"] == 0 for found in (free, bound))
    assert still.any() and (reached & ~still).any() and not (still & ~reached).any()
    assert (bound.data["verdict"][~still] & (Verdict.OVER_TENSION | Verdict.SLACK_CABLE).value).all()


@pytest.mark.soak
def test_a_floor_takes_away_margin(tmp_path):
    where = {"x": [0.0, 0.7], "y": [0.4, 0.9]}
    free = mapped(tmp_path / "free", **where)
    bound = mapped(tmp_path / "bound", **where, more="[limits]\nfloor = -0.65")
    assert (bound.data["largest_margin"] < free.data["largest_margin"]).all()
    # The start is 0.05 m above it, 0.05 / 0.6 of the depth at which slacks are normalised.
    assert (bound.data["largest_margin"] <= 0.05 / 0.6 + 1e-12).all() and (bound.data["verdict"] == 0).any()


def test_a_plan_says_the_same_of_a_launch(result, tmp_path):
    """The keys of a plan's [launch] are quantities of the map."""
    places, data = launches_of(result)
    release = [float(data[f"release_{name}"][-1]) for name in "xyz"]
    flight, time, duration = (float(data[name][-1]) for name in ("flight_time", "release_time", "duration"))
    (tmp_path / "p.toml").write_text(
        'schema = 1\nrobot = "launch-robot"\nfamily = "bezier"\n[[pose]]\nposition = [0.0, 0.0, -0.6]\n'
        f"[[pose]]\nduration = {duration!r}\n[launch]\nsegment = 0\npoint = {release}\ntarget = {places[-1].tolist()}\n"
        f"time = {flight!r}\nrelease = {time!r}\n"
    )
    code, out, err = cspr("plan", tmp_path / "p.toml", "--json")
    assert (code, err) == (0, ""), err
    thrown = json.loads(out)["launch"]
    np.testing.assert_allclose(np.linalg.norm(thrown["release"]["velocity"]), data["release_speed"][-1], rtol=1e-9)
    np.testing.assert_allclose(thrown["landing"], places[-1], atol=1e-9)


def test_python_says_what_the_map_says(result):
    robot = cspr_jax.three_cable_equivalent(cspr_jax.load_robot("launch-robot"))
    places, data = launches_of(result)
    found = cspr_jax.launch_range(robot, places, start=START, population=32)
    assert found.feasible.all()
    np.testing.assert_allclose(found.release_speed, data["release_speed"], rtol=1e-9)
    np.testing.assert_allclose(found.releases[:, 2], data["release_z"], rtol=1e-9)
    table = found.to_xarray({"target": np.arange(len(places))})
    assert table["flight_time"].attrs["units"] == "s" and table["release_speed"].dims == ("target",)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"targets": [[0.0, 0.0]]}, "targets"),
        ({"start": np.zeros((3, 3))}, "start"),
        ({"release_y": [0.2, 0.1]}, "release_y"),
        ({"release_z": [0.2]}, "release_z"),
        ({"max_duration": -1.0}, "max_duration"),
        ({"max_duration": 1e-3}, "max_duration = 0.001: must be above"),
        ({"population": 4}, "population"),
        ({"robot": "launch-robot"}, "a point mass"),
    ],
)
def test_bad_arguments(given, words):
    robot = cspr_jax.load_robot("prototype")
    asked = {"robot": robot, "targets": [[0.0, 0.0, 3.0]], "start": [0.0, 0.0, 1.0]} | given
    with pytest.raises(InputError, match=words):
        cspr_jax.launch_range(asked.pop("robot"), asked.pop("targets"), **asked)


@pytest.mark.thorough
def test_two_cables_in_a_plane(tmp_path):
    found = mapped(tmp_path / "planar", robot="transition-planar", x=[0.2, 0.9], y=[0.0], z=2.0, start=0.8)
    assert found.data["verdict"].ravel()[0] == 0 and not np.nanmax(np.abs(found.data["release_y"]))


@pytest.mark.thorough
def test_bounds_of_the_release_are_kept(tmp_path):
    box = "release_x = [-0.1, 0.0]\nrelease_y = [0.05, 0.05]\nrelease_z = [-0.9, -0.7]\nmax_duration = 1.4"
    places, data = launches_of(mapped(tmp_path / "box", x=[0.2], y=[0.1, 0.3], more=box))
    assert len(places) and (data["duration"] <= 1.4 * (1 + 1e-12)).all()
    for name, low, high in (("x", -0.1, 0.0), ("y", 0.05, 0.05), ("z", -0.9, -0.7)):
        values = data[f"release_{name}"]
        assert (values >= low - 1e-12).all() and (values <= high + 1e-12).all()


@pytest.mark.thorough
def test_its_picture(tmp_path, figures):
    mapped(tmp_path / "one", x=[0.0, 0.3], y=[0.0, 0.5])
    path = tmp_path / "one" / "run" / "s.h5"
    assert cspr("plot", path, "-o", tmp_path / "s.png")[0] == 0
    assert figures[0].get_suptitle().startswith("launch-robot: least speed at the release\nfrom (0, 0, −0.6) m")
    assert figures[0].axes[-1].get_ylabel() == "least speed at the release (m/s)"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"population": 8}, "launch.population = 8: must be at least 16"),
        ({"more": "release_x = [0.2, 0.1]"}, "launch.release_x = [0.2, 0.1]: must be [least, largest]"),
        ({"more": "release_q = 1"}, "did you mean release_z?"),
        ({"more": "max_duration = 0.001"}, "launch.max_duration = 0.001: must be above 0.0188"),
        ({"start": 0.1}, "trajectory.from: every point is above the spool plane"),
        ({"robot": "laval-mssm"}, "must be a point mass in this map; nor do three parallel pairs"),
        ({"robot": "transition-planar", "start": 0.8}, "axes.y: must be [0] for a planar robot"),
        (
            {"robot": "transition-planar", "start": 0.8, "y": [0.0], "more": "release_y = [0, 1]"},
            "launch.release_y = [0.0, 1.0]: must be [0, 0], or absent: a planar robot",
        ),
    ],
)
def test_one_line_says_what_is_wrong(tmp_path, changes, words):
    (tmp_path / "s.toml").write_text(text(**changes))
    code, out, err = cspr("run", tmp_path / "s.toml", "-o", tmp_path / "run")
    assert (code, out, err.count("\n")) == (2, "", 1) and words in err, err


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (('family = "bezier"', ""), 'trajectory.family = "hypocycloid-standard": must be "bezier" in this map'),
        (("{ position = [0.0, 0.0, -0.6] }", "{ rest = true }"), "trajectory.from: must be { position = [x, y, z] }"),
        (("launch-range", "least-time"), 'launch: must be absent in this map; it is for map = "launch-range"'),
    ],
)
def test_keys_that_do_not_fit(tmp_path, change, words):
    body = text().replace(*change).replace('"bezier"', '"bezier"' if change[0] != "launch-range" else '"s-curve"')
    (tmp_path / "s.toml").write_text(body)
    code, out, err = cspr("run", tmp_path / "s.toml", "-o", tmp_path / "run")
    assert (code, out, err.count("\n")) == (2, "", 1) and words in err, err


def test_numbers_that_contradict_each_other_are_noticed(tmp_path):
    (tmp_path / "s.toml").write_text(text())
    sweep = read_sweep(tmp_path / "s.toml")
    own = LaunchRangeMap(sweep.robot, sweep.spec, sweep.file)
    good = dict.fromkeys(("release_speed", "duration", "flight_time", "release_x", "release_y", "release_z"), 1.0)
    good |= {"release_time": 0.5, "largest_margin": 0.2}
    answers = {name: np.full(5, value) for name, value in good.items()} | {"verdict": np.array([0, 0, 0, 0, 1])}
    answers["largest_margin"][1], answers["flight_time"][2], answers["release_time"][3] = -0.1, np.nan, 1.5
    noticed = [list(cells) for cells in own.contradictions(answers).values()]
    assert noticed == [[False] * i + [True] + [False] * (4 - i) for i in (1, 2, 3, 4)]
