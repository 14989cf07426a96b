"""Verdicts and margins of catalogue robots at random poses, beside linear programs (HiGHS) of the largest s."""

import numpy as np
import pytest
from oracles import workspaces as oracle
from scipy.spatial.transform import Rotation

import cspr_jax
from cspr_jax.robots.model.limits import Limits

SQUARE = [[-2.0, -1.0, 3.0], [2.0, -1.0, 3.0], [2.0, 1.0, 3.0], [-2.0, 1.0, 3.0]]
# Half sizes of where poses are drawn, their middle, and the largest turn.
REACH = {
    "cogiro": ([7.0, 5.0, 2.5], [0.0, 0.0, 2.0], 0.3),
    "ipanema-1": ([2.0, 1.5, 1.0], [0.0, 0.0, 1.0], 0.4),
    "ipanema-2": ([4.0, 3.0, 1.5], [0.0, 0.0, 2.5], 0.4),
    "caspr-seven": ([0.8, 0.8, 0.8], [0.0, 0.0, 0.0], 0.4),
    "kntu-planar": ([1.3, 0.0, 1.2], [0.0, 0.0, 0.0], 0.8),
    "four cables": ([2.5, 1.5, 1.5], [0.0, 0.0, 1.6], 0.0),
}
SOAK, QUICK = 20_000, 400


def robot_of(name):
    if name == "four cables":
        limits = Limits(tension_min=np.full(4, 1.0), tension_max=np.full(4, 60.0))
        return cspr_jax.point_mass(SQUARE, mass=2.0, z_axis="up", limits=limits)
    return cspr_jax.load_robot(name)


def drawn(name, count, rng):
    half, middle, turn = REACH[name]
    places = np.array(middle) + np.array(half) * rng.uniform(-1.0, 1.0, (count, 3))
    axis = rng.normal(size=(count, 3)) * ([0.0, 1.0, 0.0] if name == "kntu-planar" else 1.0)
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    return places, Rotation.from_rotvec(axis * turn * rng.uniform(-1.0, 1.0, (count, 1)))


def compare(name, count, **limits):
    robot, rng = robot_of(name), np.random.default_rng(4)
    places, turns = drawn(name, count, rng)
    quaternions = None if name == "four cables" else turns.as_quat(scalar_first=True)
    found = cspr_jax.workspace(robot, places, quaternions, **limits)
    low = np.broadcast_to(np.zeros(1) if robot.limits.tension_min is None else robot.limits.tension_min, robot.n_cables)
    high = np.broadcast_to(np.inf if robot.limits.tension_max is None else robot.limits.tension_max, robot.n_cables)
    low, high = (
        np.asarray(limits.get(key, value), float) for key, value in (("tension_min", low), ("tension_max", high))
    )
    points, centre, gravity = np.zeros((robot.n_cables, 3)), np.zeros(3), float(robot.gravity)
    if quaternions is not None:
        points = np.asarray(robot.platform_points)
        centre = centre if robot.centre_of_mass is None else np.asarray(robot.centre_of_mass)
    scale = max(np.abs(high[np.isfinite(high)]).max(initial=0.0), low.max(), float(robot.mass) * gravity)
    inside = 0
    for i in range(count):
        turn = turns[i].as_matrix()
        matrix = oracle.wrench_matrix(robot.base_points, points, places[i] + turn @ centre, turn, robot.pattern)
        kept = oracle.rows(robot.pattern, points, turn)
        held = oracle.weight(kept, float(robot.mass), acceleration=(0.0, 0.0, -gravity))
        value = oracle.tension_margin(matrix, held, low, high)
        assert (value > 0.0) == (found.verdict[i] == 0) or abs(value) < 1e-8 * scale, (name, i)
        assert found.margin[i] == pytest.approx(value, abs=1e-8 * scale), (name, i)
        if i % 20 == 0:  # by the facets, exact to rounding
            exact = oracle.margin_by_facets(matrix, held, low, high)
            assert found.margin[i] == pytest.approx(exact, abs=1e-9 * scale), (name, i)
        inside += value > 0.0
    assert 0 < inside < count
    return found


@pytest.mark.parametrize("name", ["four cables", pytest.param("kntu-planar", marks=pytest.mark.thorough)])
def test_some_poses(name):
    compare(name, QUICK)


@pytest.mark.soak
@pytest.mark.parametrize("name", REACH)
def test_twenty_thousand_poses(name):
    found = compare(name, SOAK)
    assert found.is_exact.mean() < 0.01


@pytest.mark.soak
@pytest.mark.parametrize("name", ["cogiro", "four cables"])
def test_without_largest_tensions(name):
    compare(name, 2_000, tension_max=np.inf, tension_min=0.0)


@pytest.mark.soak
@pytest.mark.parametrize("condition", ["wrench-feasible", "wrench-closure"])
@pytest.mark.parametrize("name", REACH)
def test_float32_looks_at_a_million_poses(name, condition):
    """And float64 decides: verdicts are those of float64 at every pose."""
    robot, rng = robot_of(name), np.random.default_rng(5)
    places, turns = drawn(name, 1_000_000, rng)
    quaternions = None if name == "four cables" else turns.as_quat(scalar_first=True)
    slow = cspr_jax.workspace(robot, places, quaternions, condition=condition)
    fast = cspr_jax.workspace(robot, places, quaternions, condition=condition, precision="float32")
    assert (fast.verdict == slow.verdict).all()


@pytest.mark.soak
@pytest.mark.parametrize("condition", ["static", "wrench-feasible", "wrench-closure"])
@pytest.mark.parametrize("name", REACH)
def test_symmetric_grids_are_answered(name, condition):
    """Planes and axes of symmetry: every pose gets a margin or a reason, none is NaN."""
    half, middle, _ = REACH[name]
    axes = [m + np.linspace(-h, h, 10 if h else 1) for m, h in zip(middle, half, strict=True)]
    places = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    found = cspr_jax.workspace(robot_of(name), places, condition=condition)
    assert not np.isnan(found.margin).any()


def test_positions_of_the_mass_centre():
    """A pose named by either point; the mass centre lies aside of the origin of the platform's axes."""
    robot = cspr_jax.load_robot("cogiro")
    places, turns = drawn("cogiro", QUICK, np.random.default_rng(5))
    quaternions = turns.as_quat(scalar_first=True)
    of_origin = cspr_jax.workspace(robot, places, quaternions)
    centres = places + turns.apply(np.asarray(robot.centre_of_mass))
    of_centre = cspr_jax.workspace(robot, centres, quaternions, point="mass-centre")
    np.testing.assert_allclose(of_centre.margin, of_origin.margin, atol=1e-7)
    assert np.abs(cspr_jax.workspace(robot, centres, quaternions).margin - of_origin.margin).max() > 1.0
