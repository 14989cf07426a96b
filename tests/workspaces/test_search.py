"""Workspaces of robots on any number of cables, beside linear programs and singular values."""

import dataclasses

import jax
import numpy as np
import pytest
from oracles import workspaces as oracle
from scipy.spatial.transform import Rotation
from support import cable_robots
from support.workspaces import ROUND, made

import cspr_jax
from cspr_jax.build.scenes import robot_scene
from cspr_jax.errors import InputError
from cspr_jax.numerics.linear.frames import frame_of
from cspr_jax.outputs.plots.style.word_ticks import REASONS
from cspr_jax.robots.cables import with_cables
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.platform import platform_robot
from cspr_jax.robots.model.pulleys import exits
from cspr_jax.robots.statics.kernel_axes import centred
from cspr_jax.schema.verdicts import NO_REASON, Verdict
from cspr_jax.workspaces.clearances import at_rest
from cspr_jax.workspaces.requirements import requirement
from cspr_jax.workspaces.search import Poses, WorkspaceSearch

G = cable_robots.GRAVITY


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


THOROUGH = {("static", False), ("wrench-closure", False)}
COUNTS = {"1T": (1, 2, 3), "2T": (3, 5), "3T": (3, 4, 6), "1R2T": (3, 4, 5), "3R": (4, 5), "2R3T": (6, 7)}
COUNTS["3R3T"] = (6, 7, 8)
# Each robot is compiled once more; test_cogiro has eight cables in space.
SOME = [("1T", 3), ("2T", 3), ("3T", 4), ("1R2T", 4), ("3R", 4), ("2R3T", 6)]
# Of the others one condition is quick.
ALL_QUICK = [("3T", 4), ("1R2T", 4)]
EVERY = [(pattern, n) for pattern, counts in COUNTS.items() for n in counts] + [("3R3T", 9), ("3R3T", 10)]


def marks_of(one, condition):
    if one not in SOME:
        return pytest.mark.soak
    return () if one in ALL_QUICK or condition == "wrench-feasible" else pytest.mark.thorough


def drawn_robots(pattern, n, rng):
    yield cable_robots.any_robot(rng, pattern, n, suspended=False, bounds="mixed")
    yield cable_robots.any_robot(rng, pattern, n, suspended=pattern != "1T", bounds="equal")


@pytest.mark.parametrize(
    ("pattern", "n", "condition"),
    [
        pytest.param(*one, condition, marks=marks_of(one, condition))
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
        pytest.param(
            condition, in_space, marks=pytest.mark.thorough if (condition, in_space) in THOROUGH else pytest.mark.soak
        )
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


def grid(*axes):
    return np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)


def test_cables_that_leave_pulleys_are_kept_apart_from_there():
    """Of a planar platform on three cables, pose by pose: the same as of spools where the cables leave."""
    base = np.array([[-2.0, 0.0, -1.0], [2.0, 0.0, -1.0], [-1.9, 0.0, -1.2]])
    platform = np.array([[-0.3, 0.0, 0.1], [0.3, 0.0, 0.1], [0.0, 0.0, -0.1]])
    plain = platform_robot(base, platform, mass=1.0, inertia=ROUND, pattern="1R2T", z_axis="down", gravity=G)
    wound = with_cables(plain, pulley_radius=0.1)
    places, turns = np.array([[0.0, 0.0, 0.0], [0.4, 0.0, 0.3]]), np.tile([1.0, 0.0, 0.0, 0.0], (2, 1))

    def apart(robot, positions, quaternions):
        here = robot_scene(robot, frame_of(np.zeros((1, 3)), "down"))
        return at_rest(robot, here, positions, quaternions).clearance

    found = apart(centred(wound)[0], places - base.mean(0), turns)
    for place, value in zip(places, found, strict=True):
        ends = np.asarray(jax.jit(exits)(base, wound.pulleys.axes, wound.pulleys.radius, place + platform).point)
        moved = dataclasses.replace(plain, base_points=ends)
        assert value == pytest.approx(apart(moved, place[None], turns[:1])[0], abs=1e-9)
        assert value != pytest.approx(apart(plain, place[None], turns[:1])[0], abs=1e-3)


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
    assert found.is_exact.sum() < 100


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


SETS = {
    "box": {"wrench_box": 1.0},
    "ellipsoid": {"wrench_ellipsoid": 1.0},
    "ball": {"acceleration": 1.0},
    "all": {"wrenches": 2.0, "wrench_box": 0.3, "wrench_ellipsoid": 0.5, "acceleration": 0.4},
}


@pytest.mark.parametrize(
    ("pattern", "n", "name"),
    [
        ("3T", 4, "all"),
        ("1R2T", 4, "all"),
        ("3R3T", 8, "all"),
        *(
            pytest.param(pattern, n, name, marks=pytest.mark.soak)
            for pattern, n in (("2T", 3), ("3T", 4), ("3R", 5), ("2R3T", 6), ("3R3T", 7), ("3R3T", 9))
            for name in SETS
            if (pattern, name) != ("3R", "ball")
        ),
    ],
)
def test_sets_of_wrenches(pattern, n, name):
    """Margins are those of the facets, at wrenches of every corner; those of tensions, and of capacity."""
    rng = np.random.default_rng(6)
    drawn = cable_robots.any_robot(rng, pattern, n, suspended=pattern != "3R", bounds="equal")
    places, turns = poses(drawn, rng, 8)
    dof, load = cable_robots.DEGREES[pattern], 0.05 * drawn.mass * G
    sizes = np.where(np.arange(dof) < {"2R3T": 3}.get(pattern, 6), rng.uniform(0.2, 1.0, dof), 0.0)
    given = {}
    for key, fraction in SETS[name].items():
        if key == "acceleration" and pattern != "3R":
            given[key] = 0.05 * G * fraction
        elif key != "acceleration":
            given[key] = load * fraction * (rng.normal(size=(2, dof)) * (sizes > 0.0) if key == "wrenches" else sizes)
    limits = {"tension_min": drawn.low, "tension_max": drawn.high}
    found = asked(drawn, places, turns, "wrench-feasible", **limits, **given)
    capacity = asked(drawn, places, turns, "wrench-feasible", capacity_length=0.7, **limits, **given)
    for i in range(len(places)):
        wrenches, kept, matrix = points_and_rows(drawn, places[i], turns[i], given)
        wanted = facets(drawn, matrix, wrenches, kept, given, np.ones(dof), facet_margin)
        assert found.margin[i] == pytest.approx(wanted, abs=3e-8 * drawn.high.max())
        unit = np.where(np.arange(dof) >= np.linalg.matrix_rank(kept[:, :3]), 0.7, 1.0)
        wanted = facets(drawn, matrix, wrenches, kept, given, unit, distance_to_facets)
        assert capacity.margin[i] == pytest.approx(wanted, abs=3e-8 * drawn.high.max())


def points_and_rows(drawn, place, turn, given):
    """The finite set, the rows of the pattern, and the wrench matrix."""
    kept = oracle.rows(drawn.pattern, drawn.platform, turn)
    matrix = oracle.wrench_matrix(drawn.base, drawn.platform, place, turn, drawn.pattern)
    arm = turn @ np.asarray(drawn.arm) if drawn.pattern == "3R" else (0, 0, 0)
    return given.get("wrenches", oracle.weight(kept, drawn.mass, arm)[None]), kept, matrix


def facets(drawn, matrix, wrenches, kept, given, unit, margin):
    """The least margin over the corners of the box, of the sum of all ellipsoids at the worst wrench of each facet."""
    half = given.get("wrench_box", np.zeros(len(unit)))
    points = np.concatenate([oracle.corners(point, half) for point in np.atleast_2d(wrenches)]) / unit
    ball = drawn.mass * given.get("acceleration", 0.0) * kept[:, :3]
    shapes = [np.diag(given.get("wrench_ellipsoid", np.zeros(len(unit)))) / unit[:, None], ball / unit[:, None]]
    return margin(matrix / unit[:, None], points, drawn.low, drawn.high, shapes)


def facet_margin(matrix, points, low, high, shapes):
    slack, found = slacks(matrix, points, low, high, shapes)
    return min((slack / np.abs(found[1]).sum(1)).min(), 0.5 * (high - low).min())


def distance_to_facets(matrix, points, low, high, shapes):
    slack, found = slacks(matrix, points, low, high, shapes)
    return (slack / np.linalg.norm(found[0], axis=1)).min()


def slacks(matrix, points, low, high, shapes):
    normals, rows = oracle.facet_normals(matrix)
    reach = np.where(rows > 0.0, rows * high, rows * low).sum(1) - (points @ normals.T).max(0)
    return reach - sum(np.linalg.norm(normals @ shape, axis=1) for shape in shapes), (normals, rows)


def test_float32_looks_and_float64_decides():
    """Every verdict is that of float64, at poses of which float32 cannot tell all."""
    robot = cspr_jax.load_robot("kntu-planar")
    places = grid(np.linspace(-1.3, 1.3, 41), [0.0], np.linspace(-1.2, 1.2, 41))
    for condition in ("wrench-feasible", "wrench-closure"):
        slow = cspr_jax.workspace(robot, places, condition=condition)
        fast = cspr_jax.workspace(robot, places, condition=condition, precision="float32")
        assert (fast.verdict == slow.verdict).all()
        assert np.abs(fast.margin - slow.margin).max() < 1e-3 * 60.0
        assert (fast.margin != slow.margin).any()


@pytest.mark.parametrize("precision", ["float32", "float64"])
@pytest.mark.parametrize(("pattern", "n"), [("3T", 5), ("3R3T", 8), pytest.param("3R3T", 7, marks=pytest.mark.soak)])
def test_every_margin_lies_between_its_bounds(pattern, n, precision):
    """Of each stage, beside singular values."""
    rng = np.random.default_rng(11)
    drawn = cable_robots.any_robot(rng, pattern, n, suspended=True, bounds="equal")
    places, turns = poses(drawn, rng, 200)
    own, frame = centred(made(drawn))
    inner, quaternions = np.asarray(frame.inward(places)), np.tile([1.0, 0.0, 0.0, 0.0], (200, 1))
    if pattern == "3R3T":
        quaternions = frame.rotated_quaternions(Rotation.from_matrix(turns).as_quat(scalar_first=True))
    limits = Limits(tension_min=drawn.low, tension_max=drawn.high)
    search = WorkspaceSearch(own, requirement(own, "wrench-feasible", limits), precision=precision)
    every = Poses(inner, quaternions, None)
    exact = search._exactly(every)[0]
    stages = list(search._stages())
    assert len(stages) == (1 + (pattern == "3R3T") + (precision == "float32"))
    for stage, _ in stages:
        found = stage(every)
        tiny = 1e-13 * drawn.high.max()  # of singular values
        assert (found.real <= exact + tiny).all() and (exact <= found.imag + tiny).all()


def test_cables_at_one_point_do_not_slow_the_others():
    """Choices of cables that never span a face are left out, so that poses need no singular values."""
    rng = np.random.default_rng(2)
    ends = np.array([[0.3, 0.0, 0.1], [-0.2, 0.3, -0.1], [-0.1, -0.3, 0.1]])[[0, 0, 0, 0, 1, 1, 2, 2]]
    drawn = cable_robots.any_robot(rng, "3R3T", 8, suspended=True, bounds="equal")
    robot = platform_robot(drawn.base, ends, mass=2.0, gravity=G, z_axis="up", inertia=ROUND)
    places, _ = poses(drawn, rng, 50)
    found = cspr_jax.workspace(robot, places, condition="static")
    assert found.is_exact.sum() < 5
    for place, margin in zip(places[:5], found.margin, strict=False):
        matrix = oracle.wrench_matrix(drawn.base, robot.platform_points, place, np.eye(3), "3R3T")
        held = oracle.weight(np.eye(6), 2.0)
        assert margin == pytest.approx(oracle.tension_margin(matrix, held, 0.0, np.inf), abs=1e-6)


def test_cables_without_end_are_refused():
    """What would take more memory than there is, in one line."""
    angles = np.linspace(0.0, 6.0, 40)
    spools = np.c_[np.cos(angles), np.sin(angles), 0.1 * angles]
    robot = platform_robot(spools, 0.1 * spools[::-1] + 0.05 * spools**2, mass=1.0, inertia=ROUND)
    with pytest.raises(InputError, match="40 cables: must have at most 28"):
        cspr_jax.workspace(robot, [[0.0, 0.0, 1.0]])


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
    rotated = quaternions * np.array([1.0, 1.0, -1.0, -1.0])
    third = cspr_jax.workspace(down, places * flip, rotated, **limits)
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
        ({"tension_max": "abc"}, "tension_max"),
        ({"tension_min": [[1.0], [1.0, 2.0]]}, "tension_min"),
        ({"positions": "abc"}, "positions"),
        ({"positions": np.zeros((0, 3))}, "positions"),
        ({"wrenches": {}}, "wrenches"),
        ({"wrenches": [[1.0], [1.0, 2.0]]}, "wrenches"),
        ({"wrench_box": "a"}, "wrench_box"),
        ({"wrench_box": [-1.0] * 6}, "wrench_box"),
        ({"acceleration": "a"}, "acceleration"),
        ({"acceleration": [1.0, 2.0, 3.0]}, "acceleration"),
        ({"capacity_length": "a"}, "capacity_length"),
        ({"capacity_length": [1.0]}, "capacity_length"),
        ({"capacity_length": 0.0}, "capacity_length"),
        ({"precision": "float16"}, "precision"),
    ],
)
def test_what_cannot_be_asked_is_refused(options, words):
    given = {"positions": [[0.0, 0.0, 1.0]]} | options
    places = given.pop("positions")
    with pytest.raises(InputError, match=words) as raised:
        cspr_jax.workspace(cspr_jax.load_robot("cogiro"), places, **given)
    assert len(str(raised.value).splitlines()) == 1
