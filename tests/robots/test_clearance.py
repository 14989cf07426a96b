"""Clearance of cables: against enumeration of features, what turns and moves with the room, and planted sign faults."""

import inspect
import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import clearance as oracle
from pydantic import Field
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from cspr_jax.config.keys.obstacles import Obstacles, PlatformShapeKeys
from cspr_jax.config.reading import Table, checked
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.numerics.linear.frames import Frame
from cspr_jax.robots.contacts import clearance, clearance_lanes
from cspr_jax.robots.model import shapes
from cspr_jax.robots.model.platform import platform_robot
from cspr_jax.robots.model.point_mass import point_mass_robot

MANY = pytest.mark.parametrize("count", [20_000, pytest.param(200_000, marks=pytest.mark.soak)])
EXACT = 1e-12  # m, of lengths of some metres
BATCH = 2_000  # of what is compiled here
SIDES = (-1.0, 1.0)


def lanes(function):
    """A function of lanes for arrays (n, 3), some at a time."""
    compiled = jax.jit(lambda *given: function(*(tuple(x[..., k] for k in range(3)) for x in given)))

    def of_arrays(*given):
        count = len(given[0])
        rows = -(-count // BATCH) * BATCH
        padded = [np.resize(x, (rows, 3)) for x in given]
        parts = [compiled(*(x[i : i + BATCH] for x in padded)) for i in range(0, rows, BATCH)]
        return np.concatenate([np.asarray(x) for x in parts])[:count]

    return of_arrays


SEGMENTS, POINT = lanes(clearance_lanes.segments), lanes(clearance_lanes.point_segment)
BOX = lanes(clearance_lanes.segment_box)


def random_segments(count, seed, size=5.0):
    """Pairs of segments: of any direction, nearly and quite parallel, crossing, on one line, without length."""
    rng = np.random.default_rng(seed)
    a, b, u, v = rng.uniform(-size, size, (4, count, 3))
    kind = np.arange(count) % 10
    angle = 10.0 ** rng.uniform(-16, -1, (count, 1))
    v = np.where(np.isin(kind, [1, 2])[:, None], rng.uniform(-2, 2, (count, 1)) * (u + angle * v), v)
    v = np.where((kind == 3)[:, None], rng.uniform(-2, 2, (count, 1)) * u, v)
    meet = a + rng.uniform(-0.2, 1.2, (count, 1)) * u - rng.uniform(-0.2, 1.2, (count, 1)) * v
    b = np.where(np.isin(kind, [2, 4, 5])[:, None], meet, b)
    b = np.where((kind == 6)[:, None], a + rng.integers(0, 2, (count, 1)) * u, b)
    u = np.where((kind == 7)[:, None] | ((kind == 8) & (rng.random(count) < 0.5))[:, None], 0.0, u)
    v = np.where((kind == 8)[:, None], 0.0, v)
    axis = rng.permuted(np.tile([[1.0, 0.0, 0.0]], (count, 1)), axis=1)
    return a, np.where((kind == 9)[:, None], axis * u, u), b, v


@MANY
def test_segments(count):
    """Two cables, nearly parallel ones above all: where differences of squares lose half of their digits."""
    given = random_segments(count, 1)
    found = SEGMENTS(*given)
    np.testing.assert_allclose(found, oracle.segments(*given).astype(float), rtol=0, atol=EXACT)
    np.testing.assert_allclose(SEGMENTS(*given[2:], *given[:2]), found, rtol=0, atol=EXACT)
    assert (found < 1e-9).mean() > 0.1
    point = POINT(given[0], *given[2:])
    np.testing.assert_allclose(point, SEGMENTS(given[0], 0.0 * given[1], *given[2:]), rtol=0, atol=EXACT)


def random_boxes(count, seed):
    """Segments beside boxes and in them: of any direction, along faces and edges, through corners, without length."""
    rng = np.random.default_rng(seed)
    half = rng.uniform(0.1, 2.0, (count, 3))
    a, u = rng.uniform(-4, 4, (2, count, 3))
    kind = np.arange(count) % 8
    # Through or past a place on the surface.
    on = rng.uniform(-1, 1, (count, 3)) * half
    on = np.where(rng.permuted(np.tile([True, False, False], (count, 1)), axis=1), np.sign(on) * half, on)
    corner = rng.choice(SIDES, (count, 3)) * half
    target = np.where((kind == 1)[:, None], on, corner)
    a = np.where(np.isin(kind, [1, 2])[:, None], target - rng.uniform(-0.5, 1.5, (count, 1)) * u, a)
    along = rng.permuted(np.tile([1.0, 0.0, 0.0], (count, 1)), axis=1)
    u = np.where((kind == 3)[:, None], along * u, np.where((kind == 4)[:, None], (1.0 - along) * u, u))
    u = np.where((kind == 5)[:, None], along * u + 10.0 ** rng.uniform(-16, -1, (count, 1)) * u[::-1], u)
    a = np.where((kind == 6)[:, None], rng.uniform(-1, 1, (count, 3)) * half * 1.3, a)
    return a, np.where((kind == 7)[:, None], 0.0, u), half


@MANY
def test_boxes(count):
    a, u, half = random_boxes(count, 2)
    found, wanted = BOX(a, u, half), oracle.outside_box(a, u, half).astype(float)
    np.testing.assert_allclose(np.maximum(found, 0.0), wanted, rtol=0, atol=EXACT)
    part = oracle.chord(a, u, half).astype(float)
    assert (found[part > 1e-6] < 0.0).all() and (found[part < -1e-9] > -1e-15).all()
    assert min((found > 0.01).mean(), (found < -0.01).mean()) > 0.1
    backwards = BOX(a + u, -u, half)
    np.testing.assert_allclose(backwards, found, rtol=0, atol=EXACT)


def test_depths_in_boxes_are_least_translations():
    """Of the origin out of the convex hull of all differences of points of both."""
    a, u, half = (x[:400] for x in random_boxes(400, 3))
    u[np.arange(400) % 8 == 7] = 1e-3  # qhull wants a volume of boxes alone too, which this leaves
    found = BOX(a, u, half)
    for i in np.flatnonzero(found < 0.0):
        both = np.r_[oracle.corners(half)[i] - a[i], oracle.corners(half)[i] - a[i] - u[i]]
        assert found[i] == pytest.approx(ConvexHull(both).equations[:, 3].max(), abs=1e-12)


def tables(solid):
    return clearance_lanes.Polyhedron(
        *map(jnp.asarray, (solid.normals, solid.offsets, solid.triangles, solid.edges, solid.sides))
    )


def test_hulls(count=2_000):
    rng = np.random.default_rng(4)
    half = np.array([0.4, 0.9, 0.6])
    block = shapes.hull(oracle.corners(half[None])[0])
    assert (len(block.edges), len(block.normals)) == (12, 12)
    odd = shapes.hull(rng.normal(size=(9, 3)))
    a, u, _ = random_boxes(count, 5)
    boxes = BOX(a, u, np.tile(half, (count, 1)))
    for solid in (block, odd):
        found = lanes(lambda a, u, s=solid: clearance_lanes.segment_hull(a, u, tables(s)))(a, u)
        far = oracle.outside_triangles(a, u, solid.triangles).astype(float)
        np.testing.assert_allclose(found[found > 0.0], far[found > 0.0], rtol=0, atol=EXACT)
        # The nearest of many points, seen from all faces.
        points = a[:, None] + np.linspace(0, 1, 401)[None, :, None] * u[:, None]
        depth = (np.einsum("fi,nsi->nsf", solid.normals, points) - solid.offsets).max(2).min(1)
        assert (depth[found > 0.0] > 0.0).all() and (found[depth < 0.0] < 0.0).all()
        is_in = depth < -0.02
        assert is_in.sum() > 100
        assert (found[is_in] >= depth[is_in] - 1e-2).all() and (found[is_in] <= 0.5 * depth[is_in] + 1e-9).all()
        if solid is block:
            np.testing.assert_allclose(np.maximum(found, 0), np.maximum(boxes, 0), rtol=0, atol=EXACT)


@settings(max_examples=100)
@given(st.lists(st.floats(-10, 10, width=16), min_size=12, max_size=12))
def test_properties(numbers):
    """Of any numbers, zeros above all: finite, symmetric, not above the distance of ends, the same for moved ones."""
    a, u, b, v = (np.array(numbers[i : i + 3])[None] for i in (0, 3, 6, 9))
    found = SEGMENTS(a, u, b, v)
    assert np.isfinite(found).all() and (found >= 0.0).all()
    assert found <= np.linalg.norm(a - b) + 1e-12
    np.testing.assert_allclose(SEGMENTS(b + v, -v, a, u), found, rtol=0, atol=4 * EXACT)
    box = BOX(a, u, np.abs(b))
    assert np.isfinite(box).all()
    # A box that contains another is no farther.
    assert BOX(a, u, np.abs(b) + np.abs(v)) <= box + EXACT


def platform():
    base = np.array([[x, y, z] for x in (-5, 5) for y in (-4, 4) for z in (0, 6.0)])[:6]
    points = np.array([[x, y, z] for x in (-0.4, 0.4) for y in (-0.3, 0.3) for z in (-0.2, 0.2)])[:6]
    # Two spools and two points in common.
    base[1], points[5] = base[0], points[4]
    return platform_robot(base, points, mass=1.0, inertia=np.eye(3))


def room():
    """Obstacles in its axes."""
    turn = np.array([0.6, 0.0, 0.8, 0.0])
    return (
        shapes.sphere([1.0, 1.0, 1.0], 0.3),
        shapes.cylinder([1.0, 2.0, 0.0], [2.0, 2.0, 5.0], 0.2),
        shapes.box([-2.0, 0.0, 0.0], [1.0, 0.5, 2.0], turn),
    )


def random_poses(count, seed):
    rng = np.random.default_rng(seed)
    turns = rng.normal(size=(count, 4))
    return rng.uniform(-3, 3, (count, 3)), turns / np.linalg.norm(turns, axis=1, keepdims=True)


def matrices(turns):
    w, x, y, z = turns.T
    skew = np.array([[0 * x, -z, y], [z, 0 * x, -x], [-y, x, 0 * x]]).transpose(2, 0, 1)
    return np.eye(3) + 2 * w[:, None, None] * skew + 2 * skew @ skew


def scene(robot, body=None, obstacles=None, **more):
    return clearance.scene(robot, obstacles=room() if obstacles is None else obstacles, body=body, **more)


def expected(robot, body, place, turns, diameters, leave):
    """Of every meeting in order, (n_meetings, n), by the oracle; not positive where bodies meet."""
    turn, found = matrices(turns), []
    ends = place[:, None] + np.einsum("nij,kj->nki", turn, robot.platform_points)
    base = np.broadcast_to(robot.base_points, ends.shape)
    rays, n = ends - base, len(base[0])
    for i in range(n):
        for j in range(i + 1, n):
            if (base[0, i] != base[0, j]).any() and (robot.platform_points[i] != robot.platform_points[j]).any():
                apart = oracle.segments(base[:, i], rays[:, i], base[:, j], rays[:, j])
                found.append(apart - 0.5 * (diameters[i] + diameters[j]))
    ball, rod, block = room()

    def wide(x):
        return np.broadcast_to(x, place.shape)

    def in_body(x):
        return np.einsum("nij,ni->nj", turn, x - place)

    for solid in (ball, rod, block):
        for i in range(n):
            if solid is block:
                inner = (base[:, i] - block.centre) @ block.rotation, rays[:, i] @ block.rotation
                apart = oracle.outside_box(*inner, wide(block.half))
            elif solid is ball:
                apart = oracle.point_to_segment(wide(ball.centre), base[:, i], rays[:, i]) - ball.radius
            else:
                apart = oracle.segments(base[:, i], rays[:, i], wide(rod.start), wide(rod.end - rod.start)) - rod.radius
            found.append(apart - 0.5 * diameters[i])
    for i in range(n):
        length = np.linalg.norm(rays[:, i], axis=1)[:, None]
        start = ends[:, i] - rays[:, i] * leave / length
        spool = in_body(base[:, i])
        apart = oracle.outside_box(in_body(start), spool - in_body(start), wide(body.half))
        found.append(apart - 0.5 * diameters[i])
    found.append(oracle.outside_box(in_body(ball.centre), 0.0 * place, wide(body.half)) - ball.radius)
    start = in_body(rod.start)
    found.append(oracle.outside_box(start, in_body(rod.end) - start, wide(body.half)) - rod.radius)
    return np.array(found, float)


@pytest.mark.thorough
def test_scenes():
    """All at once: which two bodies are the nearest, and of how far; a wrong index or a sign shows here."""
    robot, (place, turns) = platform(), random_poses(2_500, 6)
    body, diameters = shapes.box([0, 0, 0], [0.8, 0.6, 0.4]), np.linspace(0.01, 0.08, 6)
    known = scene(robot, body, diameter=diameters, leave=0.05)
    found = clearance.clearances(known, place, turns)
    wanted = expected(robot, body, place, turns, diameters, 0.05)
    # Two boxes are the last.
    assert [x.kind for x in known.contact_pairs[-3:]] == ["platform-obstacle"] * 3 and len(known.contact_pairs) == len(
        wanted
    ) + 1
    names = np.array([x.kind for x in known.contact_pairs[:-1]])
    for values, kinds in ((found.cables, ["cables"]), (found.platform, ["platform"])):
        least = wanted[np.isin(names, kinds)].min(0)
        clear = least > -0.004  # the oracle knows no depth
        np.testing.assert_allclose(values[clear], least[clear], rtol=0, atol=EXACT)
        assert (values[~clear] <= least[~clear] + EXACT).all()
    others = found.nearest < len(wanted)
    clear = others & (wanted.min(0) > -0.004)
    assert clear.sum() > 200
    np.testing.assert_allclose(found.clearance[clear], wanted.min(0)[clear], rtol=0, atol=EXACT)
    index = np.flatnonzero(clear)
    np.testing.assert_allclose(wanted[found.nearest[index], index], found.clearance[index], rtol=0, atol=EXACT)
    assert {known.contact_pairs[i].kind for i in np.unique(found.nearest)} >= {"obstacle", "platform"}
    assert not found.is_open.any()


@pytest.mark.soak
def test_float32_gives_the_same_verdicts():
    """A quick look, done again where it cannot tell."""
    place, turns = random_poses(4_000, 7)
    known = scene(platform(), shapes.box([0, 0, 0], [0.8, 0.6, 0.4]), diameter=0.01)
    exact = clearance.clearances(known, place, turns)
    threshold = float(np.sort(exact.clearance)[2_000])  # open in float32
    quick = clearance.clearances(known, place, turns, dtype="float32", threshold=threshold)
    np.testing.assert_allclose(quick.clearance, exact.clearance, rtol=0, atol=1e-5)
    assert np.array_equal(quick.clearance >= threshold, exact.clearance >= threshold)
    assert quick.is_open.sum() == 1 and (quick.clearance == exact.clearance).any()


@pytest.mark.thorough
def test_few_poses_and_many_are_computed_alike(monkeypatch):
    """Short batches on one thread, or several long ones on two."""
    place, turns = random_poses(50, 9)
    known = scene(platform(), None, diameter=0.01)
    few = clearance.clearances(known, place, turns)
    monkeypatch.setattr(clearance, "FEW", 0)
    monkeypatch.setattr(clearance, "BATCH", 16)
    for one, other in zip(few, clearance.clearances(known, place, turns), strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-15)


@pytest.mark.thorough
def test_a_room_that_is_turned_and_moved():
    robot, (place, turns) = platform(), random_poses(300, 8)
    body = clearance.attachment_hull(robot)
    before = clearance.clearances(scene(robot, body, diameter=0.02), place, turns)
    shift, quarter = np.array([3.0, -40.0, 7.0]), np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])

    def moved(x):
        return np.asarray(x) @ quarter.T + shift

    ball, rod, block = room()
    other = (
        shapes.sphere(moved(ball.centre), ball.radius),
        shapes.cylinder(moved(rod.end), moved(rod.start), rod.radius),
        shapes.Box(moved(block.centre), block.half, quarter @ block.rotation),
    )
    w, x, y, z = turns.T
    rotated = np.stack([w - z, x - y, x + y, w + z], 1) / np.sqrt(2.0)
    after_robot = platform_robot(moved(robot.base_points), robot.platform_points, mass=1.0, inertia=np.eye(3))
    after = clearance.clearances(scene(after_robot, body, other, diameter=0.02), moved(place), rotated)
    np.testing.assert_allclose(after.clearance, before.clearance, rtol=0, atol=1e-10)
    # Spools that move, as pulleys do: here they do not.
    ends = np.broadcast_to(robot.base_points, (300, 6, 3))
    alone = scene(robot, diameter=0.02, obstacles=[])
    still = clearance.clearances(alone, place, turns, ends=ends)
    np.testing.assert_allclose(still.cables, before.cables, rtol=0, atol=EXACT)
    away = clearance.clearances(alone, place, turns, ends=ends + np.array([0.5, 0.0, 0.0]))
    assert np.abs(away.cables - before.cables).max() > 0.05


@pytest.mark.thorough
def test_boxes_that_meet():
    """The platform and a box: apart, and as near as the shadows tell; touching, and in each other."""
    robot, body = platform(), shapes.box([0, 0, 0], [0.8, 0.6, 0.4])
    known = scene(robot, body, [shapes.box([0.0, 0.0, 3.0], [1.0, 1.0, 1.0], [1.0, 0.0, 0.0, 0.0])])
    place = np.array([[0.0, 0.0, 2.0], [0.0, 0.0, 2.3], [0.0, 0.0, 2.5], [1.0, 0.0, 3.0]])
    last = clearance.Scene(**{**vars(known), "pairs": ()})
    upright = np.tile([1.0, 0.0, 0.0, 0.0], (4, 1))  # given, as above: compiled once
    found = clearance.clearances(last, place, upright)
    of_body = [clearance._terms(last, np.zeros(3), np.dtype(float))]
    *_, (kind, _, term) = of_body[0]
    poses = clearance.kernels.PoseLanes(tuple(place.T), None, None)
    assert kind == "platform-obstacle"
    np.testing.assert_allclose(np.asarray(term(poses)).real, [0.3, 0.0, -0.2, 0.1], atol=1e-12)
    assert (found.clearance <= np.array([0.3, 0.0, -0.2, 0.1]) + 1e-12).all()


def test_hulls_and_boxes_that_meet(count=240):
    """Against the facets of the convex hull of all differences of corners; turned, along the axes, nearly so."""
    rng = np.random.default_rng(8)
    odd = shapes.hull(rng.normal(size=(9, 3)))
    block = shapes.hull(oracle.corners(np.array([[0.4, 0.9, 0.6]]))[0])
    half, centre = np.array([0.3, 0.5, 0.8]), rng.uniform(-1.9, 1.9, (count, 3))
    angle = np.where(np.arange(count) % 3 == 0, 1.0, np.where(np.arange(count) % 3 == 1, 0.0, 1e-7))
    turns = Rotation.from_rotvec(angle[:, None] * rng.normal(size=(count, 3))).as_matrix()
    for solid in (odd, block):
        found = lanes(
            lambda c, x, y, z, s=solid: clearance_lanes.hull_box(
                tables(s), c, [x, y, z], [jnp.asarray(h) for h in half]
            )
        )(centre, *(turns[:, :, k] for k in range(3)))
        corners = np.einsum("nij,kj->nki", turns, oracle.corners(half[None])[0]) + centre[:, None]
        own = np.unique(solid.triangles.reshape(-1, 3), axis=0)
        wanted = [ConvexHull((x[:, None] - own[None]).reshape(-1, 3)).equations[:, 3].max() for x in corners]
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-9)
        assert min((found > 0.05).sum(), (found < -0.05).sum()) > 30


def test_what_has_nothing_to_meet():
    """A point mass: its cables meet where it is, and nowhere else."""
    robot = point_mass_robot([[1.0, 0.0, 0.0], [-1.0, 0.5, 0.0], [0.0, -1.0, 0.0]], mass=1.0)
    place = np.array([[0.1, 0.1, 2.0], [np.nan, 0.0, 1.0]])
    found = clearance.clearances(clearance.scene(robot), place[:1])
    assert found.clearance == np.inf and found.nearest == -1 and not found.is_open
    found = clearance.clearances(clearance.scene(robot, obstacles=[shapes.sphere([0.0, 0.0, 5.0], 1.0)]), place)
    assert found.clearance[0] == pytest.approx(np.linalg.norm([0.1, 0.1, 3.0]) - 1.0, abs=EXACT)
    assert np.isnan(found.clearance[1]) and found.is_open.tolist() == [False, True]
    assert not len(clearance.clearances(clearance.scene(robot), np.zeros((0, 3))).clearance)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: shapes.sphere([0, 0], 1.0), "centre"),
        (lambda: shapes.sphere([0, 0, 0], -1.0), "radius"),
        (lambda: shapes.box([0, 0, 0], [1, -1, 1]), "none negative"),
        (lambda: shapes.box([0, 0, 0], [1, 1, 1], [1, 1, 0, 0]), "unit quaternion"),
        (lambda: shapes.box_between([0, 0, 2], [1, 1, 1]), "nowhere above"),
        (lambda: shapes.hull([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]), "not all in a plane"),
        (lambda: clearance.scene(platform(), diameter=[0.1, 0.1]), "6, not negative"),
        (lambda: clearance.scene(platform(), leave=np.inf), "leave"),
        (lambda: clearance.clearances(clearance.scene(platform()), np.zeros((2, 3)), np.ones((3, 4))), "quaternions"),
    ],
)
def test_what_is_refused(make, words):
    with pytest.raises(InputError, match=words):
        make()


class File(Table):
    """As a sweep file would hold them."""

    obstacles: Obstacles = Field(description="[[obstacles]]")
    platform: PlatformShapeKeys = Field(default_factory=PlatformShapeKeys, description="[platform]")


def test_tables_of_obstacles():
    """Of a robot file with z up, seen by the kernels from the centroid of its spools, z down."""
    tables = [
        {"kind": "sphere", "centre": [1.0, 2.0, 3.0], "radius": 0.5, "name": "lamp"},
        {"kind": "cylinder", "start": [0.0, 0.0, 0.0], "end": [0.0, 1.0, 3.0], "radius": 0.1},
        {"kind": "box", "corners": [[0.0, 0.0, 0.0], [1.0, 2.0, 3.0]]},
        {"kind": "box", "centre": [1.0, 2.0, 3.0], "size": [1.0, 1.0, 2.0], "quaternion": [0.6, 0.8, 0.0, 0.0]},
    ]
    keys = {"platform_box": [[-1.0, -1.0, 0.0], [1.0, 1.0, 0.5]]}
    file = checked(File, {"obstacles": tables, "platform": keys}, "file")
    given = [table.shape() for table in file.obstacles]
    assert [shape.name for shape in given] == ["lamp", "cylinder", "box", "box"]
    frame = Frame(np.array([1.0, -1.0, -1.0]), np.array([4.0, 5.0, 6.0]), np.zeros(3))
    ball, rod, _, block = (shapes.inward(shape, frame) for shape in given)
    np.testing.assert_allclose(ball.centre, [-3.0, 3.0, 3.0])
    np.testing.assert_allclose([rod.start, rod.end], [[-4.0, 5.0, 6.0], [-4.0, 4.0, 3.0]])
    # A corner goes where the point goes.
    corner = given[3].centre + given[3].rotation @ given[3].half
    np.testing.assert_allclose(frame.inward(corner), block.centre + block.rotation @ block.half)
    np.testing.assert_allclose(given[3].rotation[:, 1], [0.0, -0.28, 0.96])
    body = file.platform.body([0.0, 0.0, 0.1])
    np.testing.assert_allclose(body.centre, [0.0, 0.0, 0.15])
    np.testing.assert_allclose(shapes.in_kernel_axes(body, frame).centre, [0.0, 0.0, -0.15])
    corners = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    solid = PlatformShapeKeys(platform_hull=corners).body()
    upside = shapes.in_kernel_axes(solid, frame)
    np.testing.assert_allclose(np.einsum("fi,fci->fc", upside.normals, upside.triangles).T, [upside.offsets] * 3)
    assert PlatformShapeKeys().body() is None


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"kind": "ball"}, 'obstacles[0].kind = "ball": must be "sphere", "cylinder" or "box"'),
        ({"kind": "sphere", "centre": [0.0, 0.0, 0.0]}, "obstacles[0].radius is missing: a sphere needs it"),
        ({"kind": "sphere", "center": [0.0, 0.0, 0.0]}, "did you mean centre?"),
        ({"kind": "box", "centre": [0.0, 0.0, 0.0]}, "size is missing: a box needs centre and size, or corners"),
        ({"kind": "box", "corners": [[0.0, 0.0, 1.0], [1.0, 1.0, 0.0]]}, "[least, largest]"),
        ({"kind": "box", "corners": [[0.0] * 3] * 2, "size": [1.0] * 3}, "cannot be combined with corners"),
        ({"kind": "box", "centre": [0.0] * 3, "size": [1.0] * 3, "quaternion": [1.0] * 4}, "a unit quaternion"),
        ({"kind": "cylinder", "start": [0.0] * 3, "end": [1.0] * 3, "radius": 1.0, "size": [1.0] * 3}, "has none"),
    ],
)
def test_obstacles_that_are_refused(table, words):
    with pytest.raises(ConfigError, match=re.escape(words)) as found:
        checked(File, {"obstacles": [table]}, "file")
    assert len(str(found.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"platform_hull": [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]]}, "not all in a plane"),
        ({"platform_box": [[1.0] * 3, [0.0] * 3]}, "[least, largest]"),
        (
            {"platform_box": [[0.0] * 3, [1.0] * 3], "platform_hull": [[0.0] * 3] * 4},
            "cannot be combined with platform_box",
        ),
    ],
)
def test_platform_shapes_that_are_refused(keys, words):
    with pytest.raises(ConfigError, match=re.escape(words)):
        checked(File, {"obstacles": [], "platform": keys}, "file")


FAULTS = [
    ("segments", "s * uv - dot(offset, v)", "s * uv + dot(offset, v)"),
    ("segments", "dot(cross(offset, v), normal)", "dot(cross(v, offset), normal)"),
    ("segments", "dot(offset, u) + t * uv", "dot(offset, u) - t * uv"),
    ("_outside_box", "start - at_start *", "start + at_start *"),
    ("_parting", "c[i] * w[j] - c[j] * w[i]", "c[i] * w[j] + c[j] * w[i]"),
    ("_parting", "half[i] * extent[j] + half[j] * extent[i]", "half[i] * extent[j] - half[j] * extent[i]"),
]


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [pytest.param(*one, marks=() if k % 2 else pytest.mark.thorough) for k, one in enumerate(FAULTS)],
)
def test_a_planted_sign_is_found(monkeypatch, name, old, new):
    source = inspect.getsource(getattr(clearance_lanes, name))
    assert source.count(old) == 1
    room = dict(vars(clearance_lanes))
    exec("from __future__ import annotations\n" + source.replace(old, new), room)
    monkeypatch.setattr(clearance_lanes, name, room[name])
    if name == "segments":
        pairs = random_segments(4_000, 9)
        assert np.abs(lanes(clearance_lanes.segments)(*pairs) - oracle.segments(*pairs)).max() > 1e-3
        return
    a, u, half = random_boxes(4_000, 9)
    boxes = lanes(clearance_lanes.segment_box)(a, u, half)
    wrong = np.abs(np.maximum(boxes, 0.0) - oracle.outside_box(a, u, half)).max()
    part = oracle.chord(a, u, half)
    assert wrong > 1e-3 or (boxes[part > 1e-6] >= 0.0).any() or (boxes[part < -1e-6] < 0.0).any()
