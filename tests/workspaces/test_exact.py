"""Workspaces at their edges: robots that span too little, spools in a plane, poses beside spools, odd units."""

import numpy as np
import pytest
from oracles import workspaces as oracle
from scipy.spatial.transform import Rotation
from support import cable_robots
from support.workspaces import ROUND, made

import cspr_jax
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.platform import platform_robot
from cspr_jax.robots.statics.kernel_axes import centred
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.workspaces.poses.exact import wrench_margin
from cspr_jax.workspaces.required_wrenches import RequiredWrenches
from cspr_jax.workspaces.requirements import required_wrenches, requirement
from cspr_jax.workspaces.search import Poses, WorkspaceSearch

G = cable_robots.GRAVITY
CORNERS = np.array([[x, y, z] for x in (-2.0, 2.0) for y in (-1.5, 1.5) for z in (0.5, 3.0)])


@pytest.mark.quick("7-5-float64", "7-5-float32")
@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize(("count", "together"), [(6, 4), (7, 5), (8, 6)])
def test_cables_that_never_span_all_components(count, together, precision):
    """All but two at one point: five components at most; what they span is answered, and nothing else."""
    ends = np.zeros((count, 3))
    ends[together:] = [[0.3, 0.1, 0.0], [-0.2, 0.3, 0.1]]
    robot = platform_robot(CORNERS[:count], ends, mass=2.0, gravity=G, z_axis="up", inertia=ROUND)
    places, held = np.array([[0.1, 0.2, 1.0], [-0.4, 0.1, 0.7]]), oracle.weight(np.eye(6), 2.0)
    loads = np.stack([held, held + np.array([0.0, 0.0, 0.0, 1.0, 2.0, 3.0])])
    closed = cspr_jax.workspace(robot, places, condition="wrench-closure", precision=precision)
    assert (closed.verdict == Verdict.SINGULAR).all() and (closed.margin == -1.0).all()
    for given, high in ((loads[:1], np.inf), (loads[:1], 500.0), (loads, 500.0)):
        found = cspr_jax.workspace(robot, places, tension_max=high, wrenches=given, precision=precision)
        for place, verdict, margin in zip(places, found.verdict, found.margin, strict=True):
            matrix = oracle.wrench_matrix(CORNERS[:count], ends, place, np.eye(3), "3R3T")
            wanted = oracle.tension_margin(matrix, given, 0.0, high)
            assert margin == pytest.approx(wanted, abs=1e-6) and (verdict == 0) == (wanted > 0.0)
            assert (verdict == Verdict.SINGULAR) == np.isneginf(wanted) == (len(given) == 2)


def wall(shift):
    """Spools on one wall, three of eight cables at the mass centre."""
    rng = np.random.default_rng(3)
    base = np.c_[np.zeros(8), rng.uniform(-2.0, 2.0, 8), rng.uniform(0.0, 3.0, 8)]
    base[::2, 0] += shift
    ends = 0.3 * rng.normal(size=(8, 3))
    ends[:3] = 0.0
    return platform_robot(base, ends, mass=2.0, gravity=G, z_axis="up", inertia=ROUND)


def test_spools_in_a_plane_hide_no_facet_normals():
    """What vanishes in the plane of the spools does not vanish elsewhere: the same choices as of spools beside it."""
    found = []
    for shift in (0.0, 1e-3):
        own = centred(wall(shift))[0]
        found.append(WorkspaceSearch(own, requirement(own, "static", Limits()))._choices)
    np.testing.assert_array_equal(found[0].table, found[1].table)
    assert found[0].counts is None and found[1].counts is None


def test_a_planar_platform_on_a_vertical_line_of_spools():
    """Margins are those of linear programs there, too."""
    rng = np.random.default_rng(7)
    base = np.c_[np.zeros(4), np.zeros(4), [-2.0, -1.0, 1.0, 2.0]]
    drawn = cable_robots.CableRobot(
        "line",
        "1R2T",
        base,
        np.c_[0.3 * rng.normal(size=4), np.zeros(4), 0.3 * rng.normal(size=4)],
        2.0,
        np.full(4, 1.0),
        np.full(4, 80.0),
        np.zeros(3),
    )
    places = np.c_[rng.uniform(0.3, 1.5, 12), np.zeros(12), rng.uniform(-1.0, 1.0, 12)]
    found = cspr_jax.workspace(made(drawn), places, tension_min=1.0, tension_max=80.0)
    held = oracle.weight(oracle.rows("1R2T", drawn.platform, np.eye(3)), drawn.mass)
    for place, margin in zip(places, found.margin, strict=True):
        matrix = oracle.wrench_matrix(drawn.base, drawn.platform, place, np.eye(3), "1R2T")
        assert margin == pytest.approx(oracle.tension_margin(matrix, held, drawn.low, drawn.high), abs=1e-6)


def test_forces_of_a_rod_have_the_axes_of_the_file():
    rod = cable_robots.any_robot(np.random.default_rng(1), "2R3T", 6)
    own, frame = centred(made(rod))
    given = required_wrenches(own, frame, points=[[1.0, 2.0, 3.0, 0.0, 0.0]])
    np.testing.assert_array_equal(given.points, [[1.0, -2.0, -3.0, 0.0, 0.0]])
    weight = required_wrenches(own, frame, points=[[0.0, 0.0, rod.mass * G, 0.0, 0.0]])
    np.testing.assert_allclose(weight.points, required_wrenches(own, frame).points)


@pytest.mark.quick("float64")
@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_any_length_may_be_the_unit_of_moments(precision):
    """Verdicts do not depend on it; the capacity margin is the distance from the facets in that unit."""
    rng = np.random.default_rng(9)
    drawn = cable_robots.any_robot(rng, "1R2T", 4, bounds="equal")
    pose = [drawn.pose(rng) for _ in range(8)]
    places, turns = np.array([p for p, _ in pose]), np.array([r for _, r in pose])
    quaternions = Rotation.from_matrix(turns).as_quat(scalar_first=True)
    limits = {"tension_min": drawn.low, "tension_max": drawn.high, "precision": precision}
    plain = cspr_jax.workspace(made(drawn), places, quaternions, **limits)
    for length in (1e-4, 0.5, 1e3, 1e6):
        found = cspr_jax.workspace(made(drawn), places, quaternions, capacity_length=length, **limits)
        assert (found.verdict == plain.verdict).all()
        unit = np.array([1.0, 1.0, length])
        for i in range(8):
            matrix = oracle.wrench_matrix(drawn.base, drawn.platform, places[i], turns[i], "1R2T") / unit[:, None]
            held = oracle.weight(oracle.rows("1R2T", drawn.platform, turns[i]), drawn.mass) / unit
            normals, rows = oracle.facet_normals(matrix)
            reach = np.where(rows > 0.0, rows * drawn.high, rows * drawn.low).sum(1) - normals @ held
            wanted = (reach / np.linalg.norm(normals, axis=1)).min()
            tolerance = (1e-3 if precision == "float32" else 1e-8) * drawn.high.max()
            assert length > 1e3 or found.margin[i] == pytest.approx(wanted, abs=tolerance)


def test_poses_beside_a_spool():
    """Differences of coordinates lose digits there: the bounds of float32 grow, and float64 answers in its place."""
    spools = np.array([[-2.0, -1.0, 3.0], [2.0, -1.0, 3.0], [2.0, 1.0, 3.0], [-2.0, 1.0, 3.0]])
    robot = cspr_jax.point_mass(spools, mass=2.0, z_axis="up")
    own, frame = centred(robot)
    search = WorkspaceSearch(own, requirement(own, "static", Limits()), precision="float32")
    (look, _), *_ = search._stages()
    rng = np.random.default_rng(5)
    for distance in (1e-2, 1e-4, 1e-5):
        beside = spools[rng.integers(0, 4, 400)] + distance * rng.normal(size=(400, 3))
        slow = cspr_jax.workspace(robot, beside, condition="static")
        fast = cspr_jax.workspace(robot, beside, condition="static", precision="float32")
        assert (slow.verdict == fast.verdict).all() and {0, Verdict.WRENCH_INFEASIBLE} <= set(slow.verdict.tolist())
        found = look(Poses(np.asarray(frame.inward(beside)), np.repeat([[1.0, 0.0, 0.0, 0.0]], 400, 0), None))
        assert (found.real <= slow.margin).all() and (slow.margin <= found.imag).all()


def test_cables_at_one_point_are_never_closed():
    """Outside, and not on the boundary: a component that is always zero has no other sign."""
    rng = np.random.default_rng(2)
    base = np.array([[-2.0, 0.0, -1.0], [2.0, 0.0, -1.0], [2.0, 0.0, 1.0], [-2.0, 0.0, 1.0]])
    ends = np.array([[0.2, 0.0, 0.1]] * 3 + [[-0.3, 0.0, 0.0]])
    robot = platform_robot(base, ends, mass=2.0, gravity=G, z_axis="up", inertia=ROUND, pattern="1R2T")
    places = np.c_[rng.uniform(-1.0, 1.0, 20), np.zeros(20), rng.uniform(-0.5, 0.5, 20)]
    found = cspr_jax.workspace(robot, places, condition="wrench-closure")
    assert (found.verdict == Verdict.WRENCH_INFEASIBLE).all()


def test_ellipsoids_of_wrenches():
    rng = np.random.default_rng(3)
    for _ in range(20):
        matrix, axes = rng.normal(size=(3, 5)), rng.uniform(0.0, 2.0, 3)
        low, high = rng.uniform(0.0, 1.0, 5), rng.uniform(5.0, 9.0, 5)
        held = matrix @ rng.uniform(low, high)
        found = wrench_margin(matrix, RequiredWrenches(held[None], ellipsoids=(axes,)), low, high)
        assert found == pytest.approx(oracle.ellipsoid_margin(matrix, held, np.diag(axes), low, high), abs=1e-9)
