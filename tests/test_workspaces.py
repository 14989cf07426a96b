"""Workspaces of robots on any number of cables, beside linear programs and singular values."""

import dataclasses
import math

import h5py
import numpy as np
import pytest
from oracles import workspaces as oracle
from scipy.spatial.transform import Rotation
from support import cable_robots
from support.commands import cspr

import cspr_jax
from cspr_jax.errors import InputError
from cspr_jax.outputs.plots.reasons import REASONS
from cspr_jax.problem import centred
from cspr_jax.robots import point_mass
from cspr_jax.robots.cables import with_cables
from cspr_jax.robots.platform import platform_robot
from cspr_jax.robots.pulleys import exits
from cspr_jax.schema.verdicts import NO_REASON, Verdict
from cspr_jax.search.workspaces import apart

G = cable_robots.GRAVITY
ROUND = np.diag([0.05, 0.05, 0.05])


def made(drawn):
    """The package's robot of a drawn one, z up."""
    name = {"1T": "guided_robot", "2T": "planar_robot", "3T": "point_mass_robot"}
    common = {"mass": drawn.mass, "gravity": G, "z_axis": "up", "name": drawn.name}
    if drawn.pattern in name:
        return getattr(point_mass, name[drawn.pattern])(drawn.base, **common)
    more = {"inertia": ROUND, "centre_of_mass": drawn.arm, "pattern": drawn.pattern}
    return platform_robot(drawn.base, drawn.platform, **common, **more)


def poses(drawn, rng, count):
    found = [drawn.pose(rng) for _ in range(count)]
    turns = np.array([rotation for _, rotation in found])
    return np.array([place for place, _ in found]), turns


def asked(drawn, places, turns, condition, **limits):
    quaternions = None
    if drawn.pattern not in cable_robots.POINT_MASSES:
        quaternions = Rotation.from_matrix(turns).as_quat(scalar_first=True)
    return cspr_jax.workspace(made(drawn), places, quaternions, condition=condition, **limits)


def wanted(drawn, place, turn, condition):
    matrix = oracle.wrench_matrix(drawn.base, drawn.platform, place, turn, drawn.pattern)
    kept = oracle.rows(drawn.pattern, drawn.platform, turn)
    weight = oracle.weight(kept, drawn.mass, turn @ np.asarray(drawn.arm) if drawn.pattern == "3R" else (0, 0, 0))
    if condition == "wrench-closure":
        return oracle.is_closed(matrix), matrix
    low, high = (0.0, np.inf) if condition == "static" else (drawn.low, drawn.high)
    return oracle.tension_margin(matrix, weight, low, high), matrix


def compare(drawn, rng, count, condition):
    """Beside the oracle: how many inside, and how many poses."""
    places, turns = poses(drawn, rng, count)
    limits = {"tension_min": drawn.low, "tension_max": drawn.high} if condition == "wrench-feasible" else {}
    if condition == "wrench-feasible" and (drawn.low <= 0.0).all():
        limits["tension_min"] = None
    found = asked(drawn, places, turns, condition, **limits)
    inside = 0
    for i in range(count):
        value, matrix = wanted(drawn, places[i], turns[i], condition)
        if condition == "wrench-closure":
            if found.verdict[i] != Verdict.UNDECIDED:
                assert (found.verdict[i] == 0) == value, (drawn.name, i)
            inside += bool(value)
            continue
        scale = max(1.0, np.abs(drawn.high[np.isfinite(drawn.high)]).max(initial=0.0), drawn.mass * G)
        assert found.margin[i] == pytest.approx(value, abs=3e-8 * scale), (drawn.name, i, matrix)
        if abs(value) > 1e-8 * scale:
            assert (found.verdict[i] == 0) == (value > 0.0)
        inside += value > 0.0
    return inside, count


QUICK = {("static", False), ("wrench-closure", False)}
COUNTS = {"1T": (1, 2, 3), "2T": (3, 5), "3T": (3, 4, 6), "1R2T": (3, 4, 5), "3R": (4, 5), "2R3T": (6, 7)}
COUNTS["3R3T"] = (6, 7, 8)
# Each robot is compiled once more; test_cogiro has eight cables in space.
SOME = [("1T", 3), ("2T", 3), ("3T", 4), ("1R2T", 4), ("3R", 4), ("2R3T", 6)]
EVERY = [(pattern, n) for pattern, counts in COUNTS.items() for n in counts] + [("3R3T", 9), ("3R3T", 10)]


def drawn_robots(pattern, n, rng):
    yield cable_robots.any_robot(rng, pattern, n, suspended=False, bounds="mixed")
    yield cable_robots.any_robot(rng, pattern, n, suspended=pattern != "1T", bounds="equal")


@pytest.mark.parametrize(
    ("pattern", "n", "condition"),
    [
        pytest.param(*one, condition, marks=() if one in SOME else pytest.mark.soak)
        for one in EVERY
        for condition in ("static", "wrench-feasible", "wrench-closure")
    ],
)
def test_margins_are_those_of_linear_programs(pattern, n, condition):
    rng, inside = np.random.default_rng(n), []
    for drawn in drawn_robots(pattern, n, rng):
        inside.append(compare(drawn, rng, 25, condition)[0])
    if condition == "static":
        assert sum(inside) > 0


@pytest.mark.parametrize(
    ("condition", "in_space"),
    [
        pytest.param(condition, in_space, marks=() if (condition, in_space) in QUICK else pytest.mark.soak)
        for condition in ("static", "wrench-feasible", "wrench-closure")
        for in_space in (False, True)
    ],
)
def test_degenerate_robots(condition, in_space):
    """Symmetric poses: coplanar cables, points in common, loss of rank, poses level with the spools."""
    rng = np.random.default_rng(3)
    for drawn in cable_robots.degenerate():
        if (drawn.pattern in ("2R3T", "3R3T")) != in_space:
            continue
        try:
            robot = made(drawn)
        except InputError as error:  # what no file may hold either
            assert len(str(error).splitlines()) == 1
            continue
        assert robot.n_cables == drawn.cables
        compare(drawn, rng, 2, condition)


def test_every_verdict_has_a_colour():
    """Without one a cell would be drawn as feasible."""
    assert set(REASONS) == set(Verdict) - set(NO_REASON) - {Verdict.FEASIBLE}


SWEEP = """
schema = 1
map = "workspace"
robot = "{robot}"
[axes]
x = {{ start = -1.5, stop = 1.5, count = 7 }}
y = [0]
z = {{ start = -1.2, stop = 1.2, count = 5 }}
[workspace]
conditions = {conditions}
{more}
"""


def swept(folder, robot="kntu-planar", conditions='["wrench-feasible", "wrench-closure"]', more=""):
    (folder / "w.toml").write_text(SWEEP.format(robot=robot, conditions=conditions, more=more))
    return cspr("run", folder / "w.toml", "-o", folder / "run")


def test_a_map_is_what_python_says(tmp_path):
    """Every cell, both conditions, a turned platform; and its picture."""
    turn = [math.cos(0.1), 0.0, math.sin(0.1), 0.0]
    code, out, error = swept(tmp_path, more=f"orientation = {turn}")
    assert (code, error) == (0, "")
    robot, places = (
        cspr_jax.load_robot("kntu-planar"),
        grid(np.linspace(-1.5, 1.5, 7), [0.0], np.linspace(-1.2, 1.2, 5)),
    )
    turns = np.tile(turn, (len(places), 1))
    held = cspr_jax.workspace(robot, places, turns)
    closed = cspr_jax.workspace(robot, places, turns, condition="wrench-closure")
    with h5py.File(out.strip()) as file:
        np.testing.assert_allclose(file["wrench_margin"][...].ravel(), held.margin, atol=1e-9)
        np.testing.assert_allclose(file["closure_margin"][...].ravel(), closed.margin, atol=1e-9)
        assert (file["verdict"][...].ravel() == held.verdict | closed.verdict).all()
        assert 0 < (file["verdict"][...] == 0).sum() < len(places)
    assert cspr("plot", out.strip(), "-o", tmp_path / "w.png")[0] == 0
    assert cspr("plot", out.strip(), "--quantity", "verdict", "-o", tmp_path / "v.png")[0] == 0


def test_interference_and_the_floor_of_a_map(tmp_path):
    """Cables of the platform on seven meet nowhere at these places; below the floor is no workspace."""
    text = SWEEP.format(robot="caspr-seven", conditions='["interference-free"]', more="[limits]\nfloor = 0.0\n")
    (tmp_path / "w.toml").write_text(text)
    code, out, error = cspr("run", tmp_path / "w.toml", "-o", tmp_path / "run")
    assert (code, error) == (0, "")
    with h5py.File(out.strip()) as file:
        clearance, verdict, z = file["clearance"][...], file["verdict"][...], file["z"][...]
    assert (((verdict & Verdict.CABLE_CABLE) != 0) == (clearance <= 0.0)).all()
    below = np.broadcast_to((z < 0.0)[None, None], verdict.shape)
    assert (((verdict & Verdict.BELOW_FLOOR) != 0) == below).all()


def test_cables_that_leave_pulleys_are_kept_apart_from_there():
    """Of a planar platform on three cables, pose by pose: the same as of spools where the cables leave."""
    base = np.array([[-2.0, 0.0, -1.0], [2.0, 0.0, -1.0], [-1.9, 0.0, -1.2]])
    platform = np.array([[-0.3, 0.0, 0.1], [0.3, 0.0, 0.1], [0.0, 0.0, -0.1]])
    plain = platform_robot(base, platform, mass=1.0, inertia=ROUND, pattern="1R2T", z_axis="down", gravity=G)
    wound = with_cables(plain, pulley_radius=0.1)
    places, turns = np.array([[0.0, 0.0, 0.0], [0.4, 0.0, 0.3]]), np.tile([1.0, 0.0, 0.0, 0.0], (2, 1))
    found = apart(centred(wound)[0], places - base.mean(0), turns)[0]
    for place, value in zip(places, found, strict=True):
        ends = np.asarray(exits(base, wound.pulleys.axes, wound.pulleys.radius, place + platform).point)
        moved = dataclasses.replace(plain, base_points=ends)
        assert value == pytest.approx(apart(moved, place[None], turns[:1])[0][0], abs=1e-9)
        assert value != pytest.approx(apart(plain, place[None], turns[:1])[0][0], abs=1e-3)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"conditions": '["dexterous"]'}, "workspace.conditions"),
        ({"conditions": '["static", "static"]'}, "workspace.conditions"),
        ({"conditions": "[]"}, "workspace.conditions"),
        ({"more": "wrenches = [[1, 2]]"}, "workspace.wrenches"),
        ({"more": "wrenches = [[1, 2], [1, 2, 3]]"}, "workspace.wrenches"),
        ({"more": "orientation = [1, 1, 0, 0]"}, "workspace.orientation"),
        ({"more": "orientation = [0.8, 0.6, 0, 0]"}, "workspace.orientation"),
        ({"more": "obstacle = 1"}, "workspace.obstacle"),
        ({"conditions": '["static"]', "more": "wrenches = [[0, 0, 0]]"}, "workspace.wrenches"),
        ({"conditions": '["static"]', "more": "[limits]\ntension_max = 9"}, "limits.tension_max"),
        ({"more": "[limits]\ncable_speed_max = 1"}, "limits.cable_speed_max"),
        ({"more": "[limits]\ntension_min = 100"}, "tension_min"),
        ({"robot": "prototype", "more": "orientation = [1, 0, 0, 0]"}, "workspace.orientation"),
        ({"robot": "nothing"}, "robot"),
    ],
)
def test_mistakes_are_one_line(tmp_path, changes, words):
    code, out, error = swept(tmp_path, **changes)
    assert (code, out) == (2, "") and words in error and len(error.splitlines()) == 1
    assert not (tmp_path / "run").exists()


def grid(*axes):
    return np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)


def test_cogiro():
    """Ours, 10 x 10 x 10; no source prints them. Largest margin 951.366 N."""
    robot = cspr_jax.load_robot("cogiro")
    places = grid(np.linspace(-6.0, 6.0, 10), np.linspace(-4.0, 4.0, 10), np.linspace(0.0, 4.0, 10))
    bounded = cspr_jax.workspace(robot, places)  # 100 to 5000 N in its file
    assert (bounded.verdict == 0).sum() == 807 and bounded.margin.max() == pytest.approx(951.366, abs=1e-3)
    middles = places + np.asarray(robot.centre_of_mass)
    for i in np.random.default_rng(0).choice(len(places), 25, replace=False):
        matrix = oracle.wrench_matrix(robot.base_points, robot.platform_points, middles[i], np.eye(3), "3R3T")
        value = oracle.tension_margin(matrix, oracle.weight(np.eye(6), float(robot.mass)), 100.0, 5000.0)
        assert bounded.margin[i] == pytest.approx(value, abs=1e-4), i


@pytest.mark.soak
def test_cogiro_hangs_still_everywhere():
    robot = cspr_jax.load_robot("cogiro")
    places = grid(np.linspace(-6.0, 6.0, 10), np.linspace(-4.0, 4.0, 10), np.linspace(0.0, 4.0, 10))
    assert (cspr_jax.workspace(robot, places, condition="static").verdict == 0).all()


@pytest.mark.parametrize(("name", "counts"), [("ipanema-2", (2297, 2956, 1148)), ("ipanema-2-iros", None)])
def test_the_grid_of_caspr_s_first_table(name, counts):
    """14,823 poses at one orientation; the counts are ours."""
    turn = Rotation.from_euler("XYZ", [30.0, -30.0, 5.0], degrees=True).as_quat(scalar_first=True)
    places = grid(np.linspace(-4.0, 4.0, 81), np.linspace(-3.0, 3.0, 61), [2.0, 3.0, 4.0])
    turns = np.tile(turn, (len(places), 1))
    found = cspr_jax.workspace(cspr_jax.load_robot(name), places, turns, condition="wrench-closure")
    inside = found.verdict == 0
    if counts is None:
        assert inside.sum() == 3305
    else:
        assert tuple(inside[places[:, 2] == z].sum() for z in (2.0, 3.0, 4.0)) == counts
    assert found.is_exact.sum() < 20


def test_a_finite_set_of_wrenches_is_its_worst():
    rng = np.random.default_rng(5)
    drawn = cable_robots.any_robot(rng, "1R2T", 4, suspended=False, bounds="equal")
    places, turns = poses(drawn, rng, 10)
    loads = rng.normal(size=(3, 3)) * 0.1 * drawn.mass * G
    limits = {"tension_min": drawn.low, "tension_max": drawn.high}
    all_three = asked(drawn, places, turns, "wrench-feasible", wrenches=loads, **limits)
    each = [asked(drawn, places, turns, "wrench-feasible", wrenches=load[None], **limits).margin for load in loads]
    np.testing.assert_allclose(all_three.margin, np.min(each, axis=0), atol=1e-9 * drawn.high.max())
    for i in range(len(places)):
        matrix = oracle.wrench_matrix(drawn.base, drawn.platform, places[i], turns[i], "1R2T")
        value = oracle.tension_margin(matrix, loads, drawn.low, drawn.high)
        assert all_three.margin[i] == pytest.approx(value, abs=1e-8 * drawn.high.max())


def test_no_largest_tension_goes_before_the_robot_s_own():
    """Of the KNTU platform, 0.001 to 60 N in its file."""
    robot, place = cspr_jax.load_robot("kntu-planar"), [[0.0, 0.0, 0.0]]
    assert cspr_jax.workspace(robot, place, tension_min=100.0, tension_max=np.inf).verdict[0] == 0
    with pytest.raises(InputError, match="tension_min"):
        cspr_jax.workspace(robot, place, tension_min=100.0)


def test_the_prism_below_the_spools():
    """A point mass hangs still below the rectangle of its spools, and nowhere else."""
    spools = [[-2.0, -1.0, 0.0], [2.0, -1.0, 0.0], [2.0, 1.0, 0.0], [-2.0, 1.0, 0.0]]
    robot = cspr_jax.point_mass(spools, mass=2.0)
    rng = np.random.default_rng(1)
    places = np.array([3.0, 2.0, 0.0]) * rng.uniform(-1.0, 1.0, (500, 3)) + np.array([0.0, 0.0, 1.5])
    found = cspr_jax.workspace(robot, places, condition="static")
    inside = (np.abs(places[:, 0]) < 2.0) & (np.abs(places[:, 1]) < 1.0)
    assert ((found.verdict == 0) == inside).all()
    edge = cspr_jax.workspace(robot, [[2.0, 0.3, 1.0]], condition="static")
    assert edge.verdict[0] == Verdict.UNDECIDED and abs(edge.margin[0]) < 1e-6


def test_the_origin_of_the_frame_and_the_axis_do_not_matter():
    """Positions are of the platform frame's origin; z up or down, far away or near, one answer."""
    rng = np.random.default_rng(8)
    drawn = cable_robots.any_robot(rng, "3R3T", 6, suspended=True, bounds="equal")
    places, turns = poses(drawn, rng, 12)
    quaternions = Rotation.from_matrix(turns).as_quat(scalar_first=True)
    limits = {"tension_min": drawn.low, "tension_max": drawn.high}
    first = asked(drawn, places, turns, "wrench-feasible", **limits)
    shift, far = np.array([0.1, -0.2, 0.05]), np.array([300.0, -200.0, 40.0])
    flip = np.array([1.0, -1.0, -1.0])
    common = {"mass": drawn.mass, "gravity": G, "inertia": ROUND}
    moved = platform_robot(drawn.base + far, drawn.platform + shift, centre_of_mass=shift, z_axis="up", **common)
    origins = places + far - np.einsum("nij,j->ni", turns, shift)
    second = cspr_jax.workspace(moved, origins, quaternions, **limits)
    np.testing.assert_allclose(second.margin, first.margin, atol=1e-7 * drawn.high.max())
    down = platform_robot(drawn.base * flip, drawn.platform * flip, z_axis="down", **common)
    turned = quaternions * np.array([1.0, 1.0, -1.0, -1.0])
    third = cspr_jax.workspace(down, places * flip, turned, **limits)
    np.testing.assert_allclose(third.margin, first.margin, atol=1e-9 * drawn.high.max())


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"condition": "dexterous"}, "condition"),
        ({"positions": [[0.0, 0.0]]}, "positions"),
        ({"positions": [[0.0, 0.0, np.nan]]}, "positions"),
        ({"condition": "static", "tension_max": 5.0}, "tension_max"),
        ({"condition": "wrench-closure", "wrenches": [[0.0] * 6]}, "wrenches"),
        ({"wrenches": [[0.0] * 3]}, "wrenches"),
        ({"orientations": [[1.0, 1.0, 0.0, 0.0]]}, "orientations"),
        ({"tension_min": 9000.0}, "tension_min"),
        ({"tension_max": [1.0, 2.0]}, "tension_max"),
        ({"tension_max": np.nan}, "tension_max"),
    ],
)
def test_what_cannot_be_asked_is_refused(options, words):
    given = {"positions": [[0.0, 0.0, 1.0]]} | options
    places = given.pop("positions")
    with pytest.raises(InputError, match=words) as raised:
        cspr_jax.workspace(cspr_jax.load_robot("cogiro"), places, **given)
    assert len(str(raised.value).splitlines()) == 1
