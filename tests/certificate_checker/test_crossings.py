"""Bodies that pass through each other between two times, of which only the interval is stated."""

import copy
from itertools import pairwise

import numpy as np
import pytest

from cspr_jax.certificate_checker.reading import NotACertificate
from tests.certificate_checker.cases import MASS, point_mass
from tests.certificate_checker.oracle import feasible, infeasible, piece, rotation, statement, text, verify

PLANAR = MASS | {"base_points": [[-2.0, 0.0, 0.0], [2.0, 0.0, 0.0]], "forces": [0, 2]}
CABLE = {"cable": 0, "radius": "0"}
HALFWAY = 1 / np.sqrt(2)


def rod(first, second):
    return {"points": [text(first), text(second)], "radius": "0"}


def across(x, z, start=-1.0, end=1.0):
    """A rod through the plane of the motion, at y = 0."""
    return rod([x, start, z], [x, end, z])


def sweep(*pair, cuts=(0, 1)):
    """A planar mass at (t^2, 0, 2), whose cable 0 leaves at (-2, 0, 0)."""
    pieces = []
    for start, end in pairwise(cuts):
        steps = [["poly", [start * start, 2.0 * start, 1.0]], ["poly", [0.0]], ["poly", [2.0]]]
        pieces.append(piece(start, end, steps, [0, 1, 2]))
    return statement(PLANAR, {}, pieces, scene={"pairs": [list(pair)]})


def between(time, until, **more):
    return {"criterion": "contact:0", "time": time, "until": until, **more}


@pytest.mark.parametrize(
    ("time", "until", "crosses"),
    [
        ("0", "1", True),
        ("0.7071", "0.7072", True),
        ("0.70710678118654752440", "0.70710678118654752441", True),
        ("0", "0.7071", False),
        ("0.7072", "1", False),
    ],
)
def test_crossing_at_an_irrational_time(time, until, crosses):
    """At x = -1 the cable has the height 2 / (2 + t^2), and the rod 4 / 5."""
    content = sweep(CABLE, rod(["-1", "-1", "4/5"], ["-1", "1", "4/5"]))
    turned = sweep(rod(["-1", "1", "4/5"], ["-1", "-1", "4/5"]), CABLE)
    assert verify(infeasible(content, between(time, until))) is crosses
    assert verify(infeasible(turned, between(time, until))) is crosses


def test_an_end_at_the_crossing_is_no_change_of_sign():
    content = sweep(CABLE, rod(["-1", "-1", "8/9"], ["-1", "1", "8/9"]))  # t = 1 / 2
    assert verify(infeasible(content, between("0.4", "0.6")))
    assert not verify(infeasible(content, between("0.4", "0.5")))
    assert not verify(infeasible(content, between("0.5", "0.6")))


@pytest.mark.parametrize(
    ("segment", "beside"),
    [
        (across(-1, 0.8), False),
        (across(-1, 0.8, 0.01, 1), True),
        (across(-1, 0.8, -1, -0.01), True),
        (across(-1.99, 0.008), False),
        (across(-2.01, -0.008), True),  # behind the spool
        (across(0.48, 1.984), False),
        (across(0.52, 2.016), True),  # beyond the mass, which then is at 0.5
    ],
)
def test_lines_that_meet_beside_the_segments(segment, beside):
    assert verify(infeasible(sweep(CABLE, segment), between("0.705", "0.71"))) is not beside
    assert verify(infeasible(sweep(segment, CABLE), between("0.705", "0.71"))) is not beside


def test_nearest_points_lie_within_the_segments_all_the_time():
    """With L = 2 + t^2 the rod at (0.3, 1.84) is beside the cable where 2.3 L + 3.68 < L^2 + 4: t > 0.389."""
    content = sweep(CABLE, across(0.3, 1.84))
    assert verify(infeasible(content, between("0.39", "0.8")))
    assert not verify(infeasible(content, between("0.388", "0.8")))
    assert not verify(infeasible(content, between("0", "1")))


@pytest.mark.parametrize(
    "segment",
    [
        rod([-1, 0, 0.8], [-1, 0, 0.8]),  # of no length, though the cable passes it
        rod([-1, 0, 0], [-1, 0, 1]),  # in the plane of the motion, always touched
        rod([-2, 0, 0], [2, 0, 0]),
        rod([-2, 1, 0], [0, 1, 2]),
    ],
)
def test_flat_or_parallel_segments_show_nothing(segment):
    content = sweep(CABLE, segment)
    assert not verify(infeasible(content, between("0", "1")))
    assert not verify(infeasible(content, between("0.7", "0.71")))


def test_parallel_lines_show_nothing():
    """The mass moves along its cable; a rod stands still beside it, or two do."""
    steps = [["poly", [-1.0, 1.0]], ["poly", [0.0]], ["poly", [1.0, 1.0]]]
    for y in (0, 0.1):
        pair = [CABLE, rod([-2, y, 0], [1, y, 3])]
        content = statement(PLANAR, {}, [piece(0, 1, steps, [0, 1, 2])], scene={"pairs": [pair]})
        assert not verify(infeasible(content, between("0", "1")))
    content["scene"]["pairs"] = [[rod([-1, 0, 0], [1, 0, 0]), rod([0, -1, 0], [0, 1, 0])]]
    assert not verify(infeasible(content, between("0", "1")))


def test_pieces_that_share_an_end():
    content = sweep(CABLE, across(-1, 0.8), cuts=(0, 0.6875, 0.75, 1))
    assert verify(infeasible(content, between("0.6875", "0.75")))
    assert not verify(infeasible(content, between("0", "0.6875")))
    assert not verify(infeasible(content, between("0.75", "1")))
    for time, until in (("0", "1"), ("0.68", "0.75"), ("0.6875", "0.751"), ("0.6875", "1")):
        with pytest.raises(NotACertificate, match="piece"):
            verify(infeasible(content, between(time, until)))


@pytest.mark.parametrize(
    ("failure", "message"),
    [
        (between("0.7", "0.71", points=[["1/2", "1/2"]] * 2), "points"),
        ({"criterion": "contact:0", "time": "0.7"}, "points"),
        (between("0.7", "0.7"), "until"),
        (between("0.71", "0.7"), "piece"),
        (between("0.7", "1.01"), "piece"),
        (between("-0.1", "0.71"), "piece"),
        (between("0.7", 1), "until"),
        (between("0.7", None), "until"),
        (between("0.7", "0.71") | {"criterion": "slack_cable:0"}, "until"),
        (between("0.7", "0.71") | {"criterion": "above_spools"}, "until"),
    ],
)
def test_mistakes_of_form(failure, message):
    content = sweep(CABLE, across(-1, 0.8))
    assert verify(infeasible(content, between("0.7", "0.71")))
    with pytest.raises(NotACertificate, match=message):
        verify(infeasible(content, failure))


def platform(*pair):
    """A platform that turns about the z axis, by half a turn at 1 / sqrt(2) s, and hangs on two cables."""
    robot = MASS | {"base_points": [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]], "forces": [2], "moments": [2]}
    robot |= {"platform_points": [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]], "inertia": np.eye(3).tolist()}
    steps = [["poly", [0.0]], ["poly", [2.0]], ["poly", [0.5, 0.0, -1.0]], ["poly", [1.0]]]
    scene = {"pairs": [list(pair)], "body": {"corners": text([[0, 0, 0], [0, 0, 1]])}}
    return statement(robot, {}, [piece(0, 1, steps, [0, 0, 1], [2, 0, 0, 3])], scene=scene)


def test_cables_of_a_platform_cross():
    content = platform(CABLE, CABLE | {"cable": 1})
    assert verify(infeasible(content, between("0", "1")))
    assert verify(infeasible(content, between("0.707", "0.708")))
    assert not verify(infeasible(content, between("0", "0.707")))
    assert not verify(infeasible(content, between("0.708", "1")))
    content["robot"]["pulleys"] = {"radius": ["0.3", "0"], "axes": [["0", "1", "1"]] * 2}
    assert verify(infeasible(content, between("0", "1")))
    assert not verify(infeasible(content, between("0.707", "0.708")))  # one leaves elsewhere
    assert not verify(infeasible(platform(CABLE, CABLE), between("0", "1")))


def test_cables_that_jump_do_not_cross():
    """The mass passes above its pulley, which turns by half a turn: the cable is on the one side, then on the other."""
    steps = [["poly", [-0.05, 0.0, 0.1]], ["poly", [0.0]], ["poly", [-1.0]]]
    scene = {"pairs": [[CABLE, across(0, -0.5)]]}
    for radius in (0.1, 0.0):
        robot = PLANAR | {"base_points": [[0.0, 0.0, 0.0]] * 2}
        robot["pulleys"] = {"radius": [radius, 0.0], "axes": [[0.0, 0.0, 1.0]] * 2}
        content = statement(robot, {}, [piece(0, 1, steps, [0, 1, 2])], scene=scene)
        assert verify(infeasible(content, between("0", "1"))) is (radius == 0)


SECTOR = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
SPOOL_BODY = {"spool": 0, "radius": "0"}


def rise(rays, *, turn=(1.0, 0.0, 0.0, 1.0), drift=0.0, flip=False):
    """A platform that is turned by a right angle, at z = t^2 - 1/2; its spool 0 is at v = (2, 1) of the cone then."""
    robot = MASS | {"base_points": [[1.0, 0.0, 0.0], [-1.0, 0.0, -9.0]], "forces": [2], "moments": [2]}
    robot |= {"platform_points": [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]], "inertia": np.eye(3).tolist()}
    cone = {"cone": text(rays), "corner": text([-2, -2, 0])}
    steps = [["poly", [0.0]], ["poly", [0.0, drift]], ["poly", [-0.5, 0.0, 1.0]], *(["poly", [c]] for c in turn)]
    pair = [SPOOL_BODY, cone] if flip else [cone, SPOOL_BODY]
    return statement(robot, {}, [piece(0, 1, steps, [0, 1, 2], [3, 4, 5, 6])], scene={"pairs": [pair]})


@pytest.mark.parametrize(
    ("rays", "crosses"),
    [
        (SECTOR, True),
        (SECTOR[::-1], True),
        ([[1, 0, 0], [2, 1.01, 0]], True),
        ([[1, 0, 0], [2, 0.99, 0]], False),
        ([[0, 1, 0], [2, 0.99, 0]], True),
        ([[0, 1, 0], [2, 1.01, 0]], False),
        ([[1, 0, 0], [0, -1, 0]], False),
        ([[-1, 0, 0], [0, 1, 0]], False),
        ([[-1, 0, 0], [0, -1, 0]], False),
        ([[1, 0, 0], [0, -1, 0], [0, 1, 0]], True),  # between the first and the last
        ([[0, -1, 0], [1, 0, 0], [2, 0.99, 0]], False),
        ([[2, 1, 0]], False),
        ([[2, 1, 0], [4, 2, 0]], False),
        ([[2, 1, 0], [-2, -1, 0]], False),
    ],
)
def test_spool_that_passes_a_cone(rays, crosses):
    for flip in (False, True):
        content = rise(rays, flip=flip)
        assert verify(infeasible(content, between("0.7", "0.71"))) is crosses
        assert verify(infeasible(content, between("0", "1"))) is crosses
        assert not verify(infeasible(content, between("0", "0.7")))
        assert not verify(infeasible(content, between("0.71", "1")))


def test_spool_that_leaves_a_cone():
    """The platform drifts along the x axis of its own until the spool is beside the cone, at 0.8 s."""
    content = rise(SECTOR, drift=2.5)
    assert verify(infeasible(content, between("0.1", "0.79")))
    assert not verify(infeasible(content, between("0.1", "0.81")))


def test_spool_that_passes_a_tilted_cone():
    """The height is that above the tilted plane, not z."""
    q = np.array([1.0, 0.05, -0.04, 0.1])
    content = rise(SECTOR, turn=q.tolist())
    r, corner = rotation(q), np.array([-2.0, -2.0, 0.0])
    v = r.T @ [1, 0, 0.5] - corner, r.T @ [1, 0, -0.5] - corner
    start = v[0][2] / (v[0][2] - v[1][2])  # of t^2
    assert 0.1 < start < 0.9
    for factor, crosses in ((0.999, True), (1.001, False)):
        assert verify(infeasible(content, between(text(np.sqrt(start) * factor), "1"))) is crosses
        assert verify(infeasible(content, between("0", text(np.sqrt(start) * factor)))) is not crosses


@pytest.mark.parametrize(
    "body",
    [
        CABLE | {"leave": "0"},
        CABLE | {"leave": "0.5"},
        {"spool": 0, "radius": "0"},
        {"body": True, "radius": "0"},  # though it has two corners
        {"cone": [["0", "0", "1"]], "corner": ["0", "0", "0"]},
        {"points": text([[0, 0, 0]]), "radius": "0"},
        {"points": text([[0, 0, 0], [0, 0, 1], [0, 1, 0]]), "radius": "0"},
    ],
)
def test_bodies_that_are_no_segments(body):
    """But for a cone with a spool."""
    others = [CABLE | {"cable": 1}, body, {"spool": 1, "radius": "0"}]
    for other in others[: 2 if "cone" in body else 3]:
        pair = [body, other]
        for order in (pair, pair[::-1]):
            with pytest.raises(NotACertificate, match="bodies"):
                verify(infeasible(platform(*order), between("0", "1")))


def flat(*pair, forces=(0, 2), moments=(1,)):
    """A platform at rest on three cables, of which two cross as seen along y, and pass at a distance in y."""
    robot = MASS | {"base_points": [[-1.0, 0.3, 0.0], [1.0, -0.3, 0.0], [0.0, 0.0, 0.0]]}
    robot |= {"forces": list(forces), "moments": list(moments), "inertia": np.eye(3).tolist()}
    robot["platform_points"] = [[0.5, 0.2, 0.0], [-0.5, 0.0, 0.0], [1.0, 0.0, 0.0]]
    steps = [["poly", [c]] for c in (0.0, 0.1, 2.0, 1.0)]
    return statement(robot, {}, [piece(0, 1, steps, [0, 1, 2], [3, 0, 0, 0])], scene={"pairs": [list(pair)]})


def test_cables_of_planar_robots_cross_in_their_plane():
    """All y count as 0 there, for two cables and no other bodies."""
    pair = [CABLE, CABLE | {"cable": 1}]
    assert verify(infeasible(flat(*pair), between("0", "1")))
    assert verify(infeasible(flat(*pair[::-1]), between("0.5", "0.6")))
    assert not verify(infeasible(flat(CABLE, CABLE | {"cable": 2}), between("0", "1")))
    assert not verify(infeasible(flat(*pair, forces=[2]), between("0", "1")))
    assert not verify(infeasible(flat(*pair, forces=[0, 1]), between("0", "1")))
    assert not verify(infeasible(flat(CABLE, rod([1, -0.3, 0], [-0.5, 0.1, 2])), between("0", "1")))
    assert not verify(infeasible(flat(CABLE, rod([1, 0.3, 0], [-0.5, 0.3, 2])), between("0", "1")))
    # They cross at the fraction 2 / 3 of both.
    thick = [body | {"radius": "1e-9"} for body in pair]
    for spots, touches in (("1/3", "2/3"), True), (("1/2", "1/2"), False):
        failure = {"criterion": "contact:0", "time": "0", "points": [list(spots)] * 2}
        assert verify(infeasible(flat(*thick), failure)) is touches
        assert not verify(infeasible(flat(*thick, forces=[0, 1]), failure))
        assert not verify(infeasible(flat(*pair), failure))


def test_cables_of_planar_robots_are_apart_in_their_plane():
    content = sweep(*(CABLE | {"cable": i, "leave": "0.5"} for i in (0, 1)))
    for i, y in enumerate(("-1", "1")):
        content["robot"]["base_points"][i][1] = y
    content["motion"]["pieces"][0]["program"][0] = ["poly", ["0.1"]]
    bounds = {"slack_cable:0": 0, "slack_cable:1": 0, "above_spools": 0, "contact:0": 0.1}
    for direction, apart in (([1, 0, 0], True), ([1, 0.2, 0], True), ([0, 1, 0], False), ([-1, 0, 0], False)):
        blocks = [{"start": "0", "end": "1", "directions": [text(direction)]}]
        assert verify(feasible(content, bounds, blocks)) is apart, direction


SPOOL = point_mass()[1].base[0]


@pytest.mark.parametrize("seed", range(3))
def test_random_rods(seed):
    """What the checker shows is what an oracle sees on samples, and near to all of it."""
    draw, outcomes = np.random.default_rng(seed), []
    content, oracle, _ = point_mass()
    content["limits"] = {}
    content["robot"]["base_points"][0] = text(SPOOL)
    for _ in range(20):
        centre = SPOOL + draw.uniform(0.2, 1.1) * (oracle.x(draw.uniform(0.2, 0.8)) - SPOOL)
        side = draw.normal(size=3)
        ends = np.round([centre - side * draw.uniform(-0.2, 1), centre + side * draw.uniform(0.1, 1)], 3)
        start, end = np.sort(draw.uniform(0, 1, 2)).round(3)
        pair = [{"cable": 0, "radius": "0"}, {"points": ends.tolist(), "radius": "0"}]
        samples = []
        for t in np.linspace(start, end, 101):
            p, a, q, b = SPOOL, oracle.x(t) - SPOOL, ends[0], ends[1] - ends[0]
            normal = np.cross(a, b)
            spots = np.linalg.solve(np.c_[a, -b, normal], q - p)[:2]
            samples.append(((q - p) @ normal, min(*spots, *(1 - spots))))
        volumes, within = np.array(samples).T
        crosses = volumes[0] * volumes[-1] < 0 and within.min() > 0
        case = copy.deepcopy(content)
        case["scene"] = {"pairs": [[pair[0], pair[1] | {"points": text(ends)}]]}
        assert verify(infeasible(case, between(text(start), text(end)))) is bool(crosses)
        outcomes.append(crosses)
    assert 3 <= sum(outcomes) <= 17
