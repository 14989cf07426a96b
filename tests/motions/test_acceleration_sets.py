"""Feasible accelerations of point masses on any number of cables: faces, verdicts, workspaces, against linear programs.

A linear program asks for the tensions themselves and knows of no face.
"""

import jax
import numpy as np
import pytest
from scipy.optimize import linprog
from support.commands import cspr, refuse_sweep

import cspr_jax
from cspr_jax.errors import InputError
from cspr_jax.robots.statics.wrench_sets import normals_to, spanning, wrench_faces
from cspr_jax.schema.map_kinds import MAP_KINDS
from cspr_jax.schema.verdicts import Verdict

GRAVITY = 9.81
RECTANGLE = [[0, 0, 30], [45, 0, 30], [45, 30, 30], [0, 30, 30]]  # Boralugoda, section 4


def robot_of(count, planar, rng):
    """A robot with spools anywhere above and around, z up; in a plane two of them are not on a vertical."""
    points = rng.uniform([-3, -3, 2], [3, 3, 4], (count, 3))
    if planar:
        points[:, 1] = 0.0
        points[0, [0, 2]], points[1, [0, 2]] = [-3.0, 3.0], [3.0, 3.0]
    return cspr_jax.point_mass(points, mass=2.0, z_axis="up", planar=planar)


def room_of(robot, position, acceleration, low, high) -> float:
    """Largest r such that all tensions keep so far from their limits, N; -inf where no tensions give the force."""
    axes = [0, 2] if robot.dof == 2 else [0, 1, 2]
    rays = (np.asarray(robot.base_points) - position)[:, axes]
    units = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    force = 2.0 * (acceleration + np.array([0, 0, GRAVITY]))[axes]
    count = len(units)
    above = np.c_[-np.eye(count), np.ones(count)], -low
    below = np.c_[np.eye(count), np.ones(count)], high
    finite = np.isfinite(high)
    answer = linprog(
        np.r_[np.zeros(count), -1.0],
        A_ub=np.concatenate([above[0], below[0][finite]]),
        b_ub=np.concatenate([above[1], below[1][finite]]),
        A_eq=np.c_[units.T, np.zeros(len(axes))],
        b_eq=force,
        bounds=[(None, None)] * count + [(None, 1e6)],
        method="highs",
    )
    return -answer.fun if answer.status == 0 else -np.inf


def check_against_programs(count, seed, shapes):
    """Verdicts of random accelerations at random places, inside the footprint and outside, below and above."""
    rng, kinds = np.random.default_rng(seed), []
    for i in range(count):
        planar, n, endless = shapes[i % len(shapes)]
        robot = robot_of(n, planar, rng)
        low, high = rng.uniform(0, 3, n) * rng.integers(2), np.full(n, np.inf) if endless else rng.uniform(15, 60, n)
        place = rng.uniform([-4, -4, -4], [4, 4, 5])
        acceleration = rng.normal(size=3) * rng.choice([0.0, 2.0, 8.0])
        if planar:
            place[1] = acceleration[1] = 0.0
        if np.isfinite(high[0]):
            set_of = cspr_jax.available_accelerations(robot, [place], tension_min=low, tension_max=high)
        else:
            set_of = cspr_jax.available_accelerations(robot, [place], tension_min=low)
        margin, verdict = set_of.margin(acceleration)[0], set_of.verdict(acceleration)[0]
        if abs(margin) <= 1e-9 * GRAVITY:
            continue
        room = room_of(robot, place, acceleration, low, high)
        assert (margin > 0.0) == (room > 0.0), (i, margin, room)
        assert (verdict == 0) == (room > 0.0)
        # A face moves at most so fast as tensions do.
        if margin > 0.0 and np.isfinite(margin):
            assert margin <= n * room / 2.0 * (1.0 + 1e-9)
        kinds.append((n, verdict))
    return kinds


def test_verdicts_are_those_of_linear_programs():
    shapes = [(True, 2, True), (True, 3, False), (False, 4, True), (False, 5, False), (False, 8, True)]
    kinds = check_against_programs(200, 3, shapes)
    assert {n for n, _ in kinds} == {2, 3, 4, 5, 8}
    flags = np.array([verdict for _, verdict in kinds])
    assert (flags == 0).sum() > 20 and (flags & Verdict.SLACK_CABLE > 0).sum() > 20
    assert (flags & Verdict.OVER_TENSION > 0).sum() > 5 and (flags & Verdict.ABOVE_SPOOLS > 0).sum() > 5


@pytest.mark.soak
def test_verdicts_are_those_of_linear_programs_all():
    shapes = [(planar, n, e) for planar in (True, False) for n in range(2 + (not planar), 9) for e in (True, False)]
    kinds = check_against_programs(5000, 4, shapes)
    print(len(kinds), "of 5000 accelerations are farther than 1e-9 of gravity from every face")
    assert len(kinds) > 4900


def test_the_inequalities_of_the_text():
    """(2) to (6) inside the footprint, where the text divides by what is positive."""
    robot = cspr_jax.point_mass(RECTANGLE, mass=10.0, z_axis="up")
    rng = np.random.default_rng(0)
    places, accelerations = rng.uniform([1, 1, 1], [44, 29, 29], (300, 3)), rng.normal(size=(300, 3)) * 6.0
    (x, y, z), (ax, ay, az) = places.T, accelerations.T
    depth = 30.0 - z
    text = [depth / -y * ay, depth / (45.0 - x) * ax, depth / (30.0 - y) * ay, depth / -x * ax]
    slack = np.min([az + GRAVITY - term for term in text], axis=0)
    margin = cspr_jax.available_accelerations(robot, places).margin(accelerations)
    assert ((slack > 0.0) == (margin > 0.0)).all() and (slack > 0.0).any() and (slack < 0.0).any()
    flat = cspr_jax.point_mass([[0, 0, 5], [2, 0, 5], [8, 0, 5]], mass=1.0, z_axis="up", planar=True)
    places[:, 1] = accelerations[:, 1] = 0.0
    places[:, [0, 2]] = rng.uniform([0.1, 0.1], [7.9, 4.9], (300, 2))
    slack = np.min([az + GRAVITY - (5.0 - places[:, 2]) / (p - places[:, 0]) * ax for p in (0.0, 8.0)], axis=0)
    margin = cspr_jax.available_accelerations(flat, places).margin(accelerations)
    assert ((slack > 0.0) == (margin > 0.0)).all() and (slack > 0.0).any() and (slack < 0.0).any()


def test_normals_are_determinants():
    rng = np.random.default_rng(1)
    for dof, count in ((2, 3), (3, 5), (6, 8)):
        matrix = rng.normal(size=(dof, count))
        for normal, chosen in zip(np.asarray(normals_to(matrix)), spanning(count, dof), strict=True):
            for k in range(count):
                wanted = np.linalg.det(np.c_[matrix[:, chosen], matrix[:, k]])
                assert normal @ matrix[:, k] == pytest.approx(wanted, abs=1e-13)


@jax.jit
def FACES_AND_MARGIN(matrix, low, high, wrench):
    faces = wrench_faces(matrix, low, high)
    return faces, faces.margin(wrench)


@pytest.mark.quick("7")
@pytest.mark.parametrize("count", [6, 7, 8])
def test_wrenches_of_six_components(count):
    """The same faces serve platforms: against linear programs, and the wrenches of the corners lie on them."""
    rng = np.random.default_rng(count)
    for i in range(12):
        matrix = rng.normal(size=(6, count))
        matrix /= np.linalg.norm(matrix, axis=0)
        low, high = np.zeros(count), np.full(count, np.inf if i % 2 else 2.0)
        wrench = matrix @ rng.uniform(-0.4, 1.5, count)
        faces, margin = FACES_AND_MARGIN(matrix, low, high, wrench)
        status = linprog(
            np.zeros(count), A_eq=matrix, b_eq=wrench, bounds=[(0.0, None if i % 2 else 2.0)] * count, method="highs"
        ).status
        assert abs(float(margin)) > 1e-6 and (float(margin) > 0.0) == (status == 0)
        if not i % 2:
            corners = np.asarray(matrix) @ rng.choice([0.0, 2.0], (count, 40))
            slack = np.array([faces.slacks(corner) for corner in corners.T])
            assert slack.min() > -1e-12
            # The set is its own mirror image about its middle, and so are its faces.
            middle = matrix @ np.full(count, 1.0)
            half = len(faces.offsets) // 2
            heights = np.asarray(faces.slacks(middle))
            assert heights[:half] == pytest.approx(heights[half:], rel=1e-12)


def test_a_margin_is_a_distance():
    """No acceleration nearer than the margin is infeasible, and one a little farther is."""
    rng = np.random.default_rng(7)
    robot = robot_of(5, False, rng)
    places = rng.uniform([-1, -1, -3], [1, 1, 1], (40, 3))
    set_of = cspr_jax.available_accelerations(robot, places, tension_max=80.0)
    margin = set_of.margin([0, 0, 0])
    inside = margin > 1e-3
    assert inside.sum() > 10
    nearest = np.argmin(-set_of.offsets, axis=1)
    normal = np.take_along_axis(set_of.normals, nearest[:, None, None], 1)[:, 0]
    assert set_of.margin(-normal * (margin * 0.999)[:, None])[inside].min() > 0.0
    assert set_of.margin(-normal * (margin * 1.001)[:, None])[inside].max() < 0.0
    for _ in range(20):
        way = rng.normal(size=(40, 3))
        way *= (0.999 * margin / np.linalg.norm(way, axis=1))[:, None]
        assert set_of.margin(way)[inside].min() > 0.0


def test_labels_mass_and_axes_do_not_matter():
    rng = np.random.default_rng(9)
    points, places = rng.uniform([-3, -3, 2], [3, 3, 4], (5, 3)), rng.uniform(-2, 2, (30, 3))
    accelerations, order = rng.normal(size=(30, 3)) * 3.0, rng.permutation(5)
    high = rng.uniform(30, 60, 5)

    def margin(points, places, accelerations, high, mass=2.0, z_axis="up"):
        robot = cspr_jax.point_mass(points, mass=mass, z_axis=z_axis)
        return cspr_jax.available_accelerations(robot, places, tension_max=high).margin(accelerations)

    wanted = margin(points, places, accelerations, high)
    rotated, down = np.array([[0.6, 0.8, 0], [-0.8, 0.6, 0], [0, 0, 1.0]]), np.array([1.0, -1.0, -1.0])
    shift = np.array([3.0, -2.0, 0.7])
    assert margin(points[order], places, accelerations, high[order]) == pytest.approx(wanted, abs=1e-10)
    assert margin(points, places, accelerations, 3.0 * high, mass=6.0) == pytest.approx(wanted, abs=1e-10)
    assert margin(points + shift, places + shift, accelerations, high) == pytest.approx(wanted, abs=1e-9)
    assert margin(points @ rotated, places @ rotated, accelerations @ rotated, high) == pytest.approx(wanted, abs=1e-10)
    flipped = margin(points * down, places * down, accelerations * down, high, z_axis="down")
    assert flipped == pytest.approx(wanted, abs=1e-10)


@pytest.mark.thorough
def test_more_cables_never_take_an_acceleration_away():
    rng = np.random.default_rng(11)
    points, places = rng.uniform([-3, -3, 2], [3, 3, 4], (8, 3)), rng.uniform(-2, 1.5, (50, 3))
    margins = [
        cspr_jax.available_accelerations(cspr_jax.point_mass(points[:n], mass=1.0, z_axis="up"), places).margin(
            [0, 0, 0]
        )
        for n in range(3, 9)
    ]
    fewer, more = np.array(margins[:-1]), np.array(margins[1:])
    assert (more >= fewer - 1e-11)[fewer > 0.0].all() and (fewer > 0.0).sum() > 50


def test_degenerate_places_have_verdicts():
    """In the plane of the spools, at a spool's height beside them, above them: never NaN."""
    robot = cspr_jax.point_mass(RECTANGLE, mass=10.0, z_axis="up")
    places = np.array([[20, 10, 30], [20, 0, 30], [60, 10, 30], [20, 10, 31], [20, 0, 10], [50, 10, 10.0]])
    set_of = cspr_jax.available_accelerations(robot, places)
    margin, verdict = set_of.margin([0, 0, 0]), set_of.verdict([0, 0, 0])
    assert np.isfinite(margin).all() and (margin <= 1e-12).all()
    singular, above = (verdict & Verdict.SINGULAR) > 0, (verdict & Verdict.ABOVE_SPOOLS) > 0
    assert singular.tolist() == [True, True, True, False, False, False]
    assert above.tolist() == [True, True, True, True, False, False]
    assert verdict[4] == Verdict.UNDECIDED and verdict[5] == Verdict.SLACK_CABLE
    line = cspr_jax.point_mass([[-1, 0, 0], [1, 0, 0], [0.3, 0, 0]], mass=1.0, planar=True)
    assert cspr_jax.available_accelerations(line, [[0.1, 0, 0]]).verdict([0, 0, 0])[0] & Verdict.SINGULAR


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"positions": [[0, 0]]}, "positions"),
        ({"positions": [[0, 0, np.nan]]}, "positions"),
        ({"tension_min": -1.0}, "tension_min"),
        ({"tension_min": 5.0, "tension_max": 4.0}, "tension_min"),
        ({"tension_max": [1.0, 2.0]}, "tension_max"),
    ],
)
def test_bad_arguments(arguments, words):
    robot = cspr_jax.point_mass(RECTANGLE, mass=10.0, z_axis="up")
    with pytest.raises(InputError, match=words):
        cspr_jax.available_accelerations(robot, **{"positions": [[1, 1, 1]]} | arguments)
    with pytest.raises(InputError, match="accelerations"):
        cspr_jax.available_accelerations(robot, [[1, 1, 1]]).margin([0, 0])
    with pytest.raises(InputError, match="point mass"):
        cspr_jax.available_accelerations(cspr_jax.load_robot("laval-mssm"), [[1, 1, 1]])


SWEEP = """schema = 1
map = "feasible-acceleration"
[robot]
name = "rectangle"
base_points = [[0, 0, 30], [45, 0, 30], [45, 30, 30], [0, 30, 30]]
z_axis = "up"
mass = 10
[axes]
x = [-5, 5, 22.5, 40]
y = [-3, 2, 15]
z = [3, 25, 31]
"""


def reach_by_samples(robot, place, direction, low, high) -> float:
    """How far from rest a direction leads, by bisection on the verdicts of linear programs."""
    near, far = 0.0, 1000.0
    if room_of(robot, place, np.zeros(3), low, high) < 0.0:
        return 0.0
    if room_of(robot, place, far * direction, low, high) > 0.0:
        return np.inf
    for _ in range(30):
        middle = 0.5 * (near + far)
        near, far = (middle, far) if room_of(robot, place, middle * direction, low, high) > 0.0 else (near, middle)
    return near


@pytest.mark.thorough
@pytest.mark.parametrize(
    "limits", [pytest.param("", marks=pytest.mark.thorough), "[limits]\ntension_min = 0.5\ntension_max = 60\n"]
)
def test_the_map(tmp_path, limits):
    path = tmp_path / "s.toml"
    path.write_text(SWEEP.replace("mass = 10", "mass = 2") + limits, "utf-8")
    code, out, err = cspr("run", path, "-o", tmp_path / "out")
    assert (code, err) == (0, "")
    data = cspr_jax.open_result(out.strip()).to_xarray()
    robot = cspr_jax.point_mass(RECTANGLE, mass=2.0, z_axis="up")
    low, high = (np.full(4, 0.5), np.full(4, 60.0)) if limits else (np.zeros(4), np.full(4, np.inf))
    values = {name: data[name].values for name in MAP_KINDS["feasible-acceleration"].quantities}
    ring = [np.array([np.cos(a), np.sin(a), 0.0]) for a in np.linspace(0.0, 2.0 * np.pi, 9)[:-1]]
    for i, x in enumerate([-5, 5, 22.5, 40]):
        for j, y in enumerate([-3, 2, 15]):
            for k, z in enumerate([3, 25, 31]):
                here, place = {name: one[i, j, k] for name, one in values.items()}, np.array([x, y, z], float)
                assert (here["verdict"] == 0) == (room_of(robot, place, np.zeros(3), low, high) > 0.0)
                assert (here["static_margin"] > 0.0) == (x > 0 and y > 0 and z < 30)
                assert here["closure_margin"] < 0.0
                if (i, j, k) != (1, 1, 0):
                    continue
                for name, sign in (("upward_acceleration", 1.0), ("downward_acceleration", -1.0)):
                    wanted = reach_by_samples(robot, place, np.array([0, 0, sign]), low, high)
                    assert here[name] == pytest.approx(wanted, rel=1e-6)
                level = [reach_by_samples(robot, place, way, low, high) for way in ring]
                assert min(level) >= here["level_acceleration"] * (1.0 - 1e-4)
                assert min(level) <= here["level_acceleration"] * 1.05  # towards the next edge
                assert max(level) <= here["level_acceleration_max"] * (1.0 + 1e-4)
                assert max(level) >= here["level_acceleration_max"] * 0.7
    code, out, err = cspr("plot", out.strip(), "-o", tmp_path / "a.png", "--at", "z=3")
    assert (code, err) == (0, "") and (tmp_path / "a.png").stat().st_size > 5000


def test_wrench_closure():
    """Eight spools around a mass close every force; four above do not, three in a plane around it do."""
    corners = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    cube = (corners / np.sqrt(3.0)).T, np.zeros(8), np.full(8, np.inf)
    closed, margin = jax.tree.map(np.asarray, FACES_AND_MARGIN(*cube, np.array([1.0, 2.0, 3.0])))
    assert closed.closure > 0.3 and closed.is_regular and not np.isfinite(closed.offsets).any()
    assert np.isinf(margin)
    above = corners[corners[:, 2] > 0.0] / np.sqrt(3.0)
    assert float(wrench_faces(above.T, np.zeros(4), np.full(4, np.inf)).closure) < 0.0
    triangle = np.array([[np.cos(a), np.sin(a)] for a in (0.1, 2.2, 4.3)])
    assert float(wrench_faces(triangle.T, np.zeros(3), np.full(3, np.inf)).closure) > 0.0


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("[axes]", '[trajectory]\nfamily = "transition"\n[axes]', "trajectory.family: must be absent"),
        ("mass = 10", "mass = 10\nplanar = true", "axes.y: must be [0] for a planar robot"),
        ("z = [3, 25, 31]", "z = [3, 25, 31]\nz0 = [1]", "axes.z0: must be absent"),
        ("map = ", "rob = 1\nmap = ", "rob"),
    ],
)
def test_bad_sweeps(tmp_path, old, new, words):
    refuse_sweep(tmp_path, SWEEP.replace(old, new, 1), words)
