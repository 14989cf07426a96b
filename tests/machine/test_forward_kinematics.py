"""Forward kinematics: brute force over all poses, lengths of known poses, symmetries, mistakes."""

import numpy as np
import pytest
from oracles import pulleys
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from support import cable_robots

import cspr_jax
from cspr_jax.errors import InputError
from cspr_jax.machine.forward_kinematics import solutions
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.numerics.linear import lanes
from cspr_jax.workspaces.poses import geometry

SPOOLS = [[0.3, -0.2, 0.1], [-0.25, -0.1, 0.0], [0.0, 0.3, -0.05]]
POINTS = ("1T", "2T", "3T")


def _built(given, **cables):
    """The robot of an oracle's arrays, z up, in the package."""
    if given.pattern in POINTS:
        robot = cspr_jax.point_mass(given.base, mass=given.mass, z_axis="up", pattern=given.pattern)
    else:
        settings = {"mass": given.mass, "inertia": np.eye(3), "z_axis": "up", "pattern": given.pattern}
        settings |= {"centre_of_mass": given.arm} if given.pattern == "3R" else {}
        robot = cspr_jax.platform(given.base, given.platform, **settings)
    return cspr_jax.with_cables(robot, **cables) if cables else robot


def _posed(given, rng, count):
    """Positions, quaternions (scalar first), attachment points and lengths of random poses."""
    positions, matrices = (np.array(x) for x in zip(*(given.pose(rng) for _ in range(count)), strict=True))
    if given.pattern in POINTS:
        matrices[:] = np.eye(3)
    targets = positions[:, None] + np.einsum("nij,mj->nmi", matrices, given.platform)
    lengths = np.linalg.norm(targets - given.base, axis=2)
    return positions, Rotation.from_matrix(matrices).as_quat(scalar_first=True), targets, lengths


def _targets(given, positions, quaternions):
    matrices = Rotation.from_quat(quaternions.reshape(-1, 4), scalar_first=True).as_matrix()
    targets = positions.reshape(-1, 1, 3) + np.einsum("nij,mj->nmi", matrices, given.platform)
    return targets.reshape(*positions.shape[:-1], -1, 3)


@pytest.mark.parametrize("z_axis", ["down", "up"])
def test_both_points_of_three_spheres(z_axis):
    robot = cspr_jax.point_mass(SPOOLS, mass=1.0, z_axis=z_axis)
    rng, sign = np.random.default_rng(1), 1.0 if z_axis == "down" else -1.0
    points = np.array([0.0, 0.0, sign]) * rng.uniform(0.3, 2.0, (500, 1)) + rng.uniform(-0.5, 0.5, (500, 3)) * [1, 1, 0]
    lengths = np.linalg.norm(points[:, None] - SPOOLS, axis=2)
    found = cspr_jax.forward(robot, lengths, all_solutions=True)
    assert found.is_complete and found.is_found.all() and (found.count == 2).all() and not found.steps.any()
    np.testing.assert_allclose(found.positions, points, atol=1e-12)
    normal = np.cross(*(np.array(SPOOLS[1:]) - SPOOLS[0]))
    normal /= np.linalg.norm(normal)
    mirrored = points - 2.0 * ((points - SPOOLS[0]) @ normal)[:, None] * normal
    np.testing.assert_allclose(found.all_positions[:, 1], mirrored, atol=1e-12)
    np.testing.assert_allclose(found.residuals, 0.0, atol=1e-12)
    above = cspr_jax.forward(robot, lengths, start=mirrored + 0.01)
    np.testing.assert_allclose(above.positions, mirrored, atol=1e-12)


def test_spheres_that_touch_and_spheres_that_do_not_meet():
    robot = cspr_jax.point_mass(SPOOLS, mass=1.0)
    foot = np.mean(SPOOLS, axis=0) + 0.1 * (np.array(SPOOLS[1]) - SPOOLS[0])
    touching = cspr_jax.forward(robot, np.linalg.norm(foot - SPOOLS, axis=1))
    assert touching.count.tolist() == [1] and touching.is_found.all()
    np.testing.assert_allclose(touching.positions[0], foot, atol=1e-7)
    apart = cspr_jax.forward(robot, [0.1, 0.12, 0.11], all_solutions=True)
    assert apart.count.tolist() == [0] and not apart.is_found.any() and np.isnan(apart.all_positions).all()
    # Least squares cannot do better anywhere around.
    best, rng = (apart.residuals**2).sum(), np.random.default_rng(2)
    others = apart.positions + rng.normal(size=(5000, 3)) * rng.choice([1e-3, 0.03, 0.3], (5000, 1))
    errors = np.linalg.norm(others[:, None] - SPOOLS, axis=2) - [0.1, 0.12, 0.11]
    assert (errors**2).sum(1).min() >= best * (1.0 - 1e-9)
    assert 0.05 < apart.residual[0] < 0.3


def test_points_in_the_plane_and_on_a_guide():
    flat = cspr_jax.point_mass([[1.0, 0.0, 2.0], [-1.0, 0.0, 2.0]], mass=1.0, planar=True, z_axis="up")
    found = cspr_jax.forward(flat, np.hypot([0.7, 1.3], 1.5), all_solutions=True)
    np.testing.assert_allclose(found.all_positions[0], [[0.3, 0.0, 0.5], [0.3, 0.0, 3.5]], atol=1e-12)
    guided = cspr_jax.point_mass([[0.5, 0.2, 3.0]], mass=1.0, pattern="1T", z_axis="up")
    found = cspr_jax.forward(guided, [np.sqrt(0.4**2 + 0.2**2 + 4.0)], start=[0.1, 0.0, 9.0], all_solutions=True)
    np.testing.assert_allclose(found.all_positions[0], [[0.1, 0.0, 5.0], [0.1, 0.0, 1.0]], atol=1e-12)


def _branches(base, platform, lengths, angles):
    """Positions that the first two cables allow at given angles, (2, n, 2), and the error of the third cable."""
    c, s = np.cos(angles)[:, None], np.sin(angles)[:, None]
    arms = np.stack([c * platform[:, 0] + s * platform[:, 1], c * platform[:, 1] - s * platform[:, 0]], axis=-1)
    centres = base - arms  # the mass centre lies on circles about these
    across = centres[:, 1] - centres[:, 0]
    square = (across**2).sum(1)
    along = 0.5 * (1.0 + (lengths[0] ** 2 - lengths[1] ** 2) / square)
    height = lengths[0] ** 2 / square - along**2
    side = np.stack([-across[:, 1], across[:, 0]], axis=1) * np.sqrt(np.maximum(height, 0.0))[:, None]
    points = centres[:, 0] + along[:, None] * across + np.array([1.0, -1.0])[:, None, None] * side
    return points, np.linalg.norm(points - centres[:, 2], axis=2) - lengths[2], height


def _planar_poses(base, platform, lengths, count):
    """Poses (x, z, angle) at the sign changes of the third cable's error along both branches of the other two."""
    grid, found = np.linspace(0.0, 2.0 * np.pi, count + 1), []
    height = _branches(base, platform, lengths, grid)[2]
    edges = np.flatnonzero(height[:-1] * height[1:] < 0.0)
    args = base, platform, lengths
    ends = [brentq(lambda x: _branches(*args, np.array([x]))[2][0], *grid[i : i + 2], xtol=1e-15) for i in edges]
    knots = np.sort(np.concatenate([grid, ends]))
    errors = _branches(*args, knots)[1]
    is_inside = _branches(*args, 0.5 * (knots[:-1] + knots[1:]))[2] > 0.0
    for k in range(2):
        for i in np.flatnonzero((errors[k, :-1] * errors[k, 1:] < 0.0) & is_inside):
            angle = brentq(lambda x, k=k: _branches(*args, np.array([x]))[1][k, 0], *knots[i : i + 2], xtol=1e-14)
            found.append((*_branches(*args, np.array([angle]))[0][k, 0], angle))
    return np.array(found).reshape(-1, 3)


def _check_planar(given, lengths, count):
    """All solutions of brute force are found, each is one, and none is found twice; their numbers."""
    found = cspr_jax.forward(_built(given), lengths, all_solutions=True)
    assert found.is_complete
    base, platform = given.base[:, [0, 2]], given.platform[:, [0, 2]]
    targets = _targets(given, np.nan_to_num(found.all_positions), np.nan_to_num(found.all_quaternions, nan=0.5))
    errors = np.linalg.norm(targets - given.base, axis=3) - lengths[:, None]
    for i, number in enumerate(found.count):
        assert np.abs(errors[i, :number]).max(initial=0.0) < 1e-8
        own = targets[i, :number].reshape(number, 9)
        apart = np.abs(own[:, None] - own[None]).max(2) + np.eye(number)
        assert apart.min(initial=1.0) > 1e-6
        for x, z, angle in _planar_poses(base, platform, lengths[i], count):
            quaternion = np.array([np.cos(0.5 * angle), 0.0, np.sin(0.5 * angle), 0.0])
            there = _targets(given, np.array([[x, 0.0, z]]), quaternion[None]).ravel()
            assert np.abs(own - there).max(1).min() < 5e-6, (i, x, z, angle)
    return found.count


def _random_lengths(given, rng, count):
    """Half of poses, and half random: these may have no solution."""
    lengths = _posed(given, rng, count)[3]
    lengths[count // 2 :] *= rng.uniform(0.7, 1.4, (count - count // 2, given.cables))
    return lengths


@pytest.mark.parametrize("seed", range(3))
def test_all_poses_of_planar_platforms(seed):
    rng = np.random.default_rng(seed)
    given = cable_robots.planar(rng, 3, suspended=seed == 1)
    numbers = _check_planar(given, _random_lengths(given, rng, 40), 720)
    assert (numbers % 2 == 0).all() and numbers.max() >= 2


@pytest.mark.soak
def test_all_poses_of_planar_platforms_for_ten_thousand_lengths():
    rng, numbers = np.random.default_rng(7), []
    for k in range(100):
        given = cable_robots.planar(rng, 3, suspended=k % 2 == 1)
        numbers.append(_check_planar(given, _random_lengths(given, rng, 100), 2000))
    assert np.bincount(np.concatenate(numbers), minlength=7)[6] > 0


def _level(base_x, platform_x, z=2.0):
    base = np.array([[x, 0.0, z] for x in base_x])
    platform = np.array([[x, 0.0, 0.3] for x in platform_x])
    ones = np.ones(3)
    return cable_robots.CableRobot("level", "1R2T", base, platform, 1.0, 0 * ones, ones, np.array([0.5, 0.0, 0.5]), 0.3)


@pytest.mark.parametrize("platform_x", [(-0.4, 0.1, 0.5), (-0.4, 0.0, 0.4), (-0.3, -0.3, 0.5)])
def test_points_on_two_lines(platform_x):
    """Where spools and attachment points lie on lines, det M vanishes at a level platform, or everywhere."""
    given, rng = _level((-1.5, 0.0, 1.5), platform_x), np.random.default_rng(4)
    lengths = _posed(given, rng, 30)[3]
    level = np.array([[0.1, 0.0, 0.2]]), np.array([[1.0, 0.0, 0.0, 0.0]])
    lengths[0] = np.linalg.norm(_targets(given, *level)[0] - given.base, axis=1)
    numbers = _check_planar(given, lengths, 720)
    assert numbers.min() >= 2


def test_six_poses_of_a_planar_platform():
    """A platform and lengths for which all six solutions are real, found by brute force over random ones."""
    rng = np.random.default_rng(3)
    base = np.array([[0.27, 0.0, -0.92], [-0.97, 0.0, 0.83], [0.21, 0.0, 0.09]])
    platform = np.array([[0.56, 0.0, -0.84], [0.4, 0.0, 0.61], [-0.96, 0.0, 0.23]])
    ones = np.ones(3)
    given = cable_robots.CableRobot("six", "1R2T", base, platform, 1.0, 0 * ones, ones, np.array([0.5, 0.0, 0.5]), 3.0)
    numbers = _check_planar(given, _posed(given, rng, 40)[3], 720)
    assert numbers.max() == 6


def test_chunks_of_lengths_change_nothing(monkeypatch):
    """All solutions of many sets are those of few at a time, in tables of one width."""
    rng = np.random.default_rng(31)
    for given in (cable_robots.any_robot(rng, "1R2T", 3), cable_robots.any_robot(rng, "1R2T", 4)):
        robot, lengths = _built(given), _random_lengths(given, rng, 23)
        at_once = cspr_jax.forward(robot, lengths, all_solutions=True), cspr_jax.forward(robot, lengths)
        monkeypatch.setattr(solutions, "CHUNK", 5)
        by_parts = cspr_jax.forward(robot, lengths, all_solutions=True), cspr_jax.forward(robot, lengths)
        monkeypatch.undo()
        for first, second in zip(at_once, by_parts, strict=True):
            for name in ("positions", "quaternions", "is_found", "count", "steps", "all_positions", "all_quaternions"):
                np.testing.assert_array_equal(getattr(first, name), getattr(second, name))


def test_products_of_quaternions_in_lanes_are_those_of_scipy():
    left, right = np.random.default_rng(33).normal(size=(2, 5, 4))
    left, right = (x / np.linalg.norm(x, axis=1, keepdims=True) for x in (left, right))
    both = Rotation.from_quat(left, scalar_first=True) * Rotation.from_quat(right, scalar_first=True)
    quick = np.stack(lanes.product(tuple(left.T), tuple(right.T)), axis=1)
    signs = np.sign((quick * both.as_quat(scalar_first=True)).sum(1, keepdims=True))
    np.testing.assert_allclose(quick, signs * both.as_quat(scalar_first=True), atol=1e-15)


def test_lengths_in_lanes_are_those_of_single_poses():
    """The fast form beside the readable one, with wheels on some cables and points for others."""
    rng = np.random.default_rng(32)
    for pattern, cables in (("3R3T", 8), ("3T", 4)):
        given = cable_robots.any_robot(rng, pattern, cables)
        for radius in (None, np.where(np.arange(cables) % 2, 0.08, 0.0)):
            robot = _built(
                given, **({} if radius is None else {"pulley_radius": radius, "pulley_axes": [0.1, -0.2, 1]})
            )
            positions, quaternions, *_ = _posed(given, rng, 12)
            with double_precision():
                quick = geometry.length_lanes(robot, tuple(positions.T), tuple(quaternions.T))
                plain = geometry.cable_lengths(robot, positions, quaternions)
            np.testing.assert_allclose(np.asarray(quick).T, plain, rtol=1e-14)


def _near(given, rng, positions, quaternions):
    """Starts near poses."""
    keep = {"2T": [1, 0, 1], "1R2T": [1, 0, 1]}.get(given.pattern, [1, 1, 1])
    start = {"start": positions + 0.01 * np.array(keep) * rng.normal(size=positions.shape)}
    start |= {"start": [0.0, 0.0, 0.0]} if given.pattern in ("1T", "3R") else {}
    if given.pattern not in POINTS:
        turn = 0.02 * rng.normal(size=positions.shape) * ([0, 1, 0] if given.pattern == "1R2T" else [1, 1, 1])
        near = Rotation.from_rotvec(turn) * Rotation.from_quat(quaternions, scalar_first=True)
        start["start_orientations"] = near.as_quat(scalar_first=True)
    return start


def _check_from_near(given, rng, count, *, radius=None):
    """Poses are found again from starts nearby, by lengths from NumPy or by a root finder around pulleys."""
    positions, quaternions, targets, lengths = _posed(given, rng, count)
    cables = {}
    if radius is not None:
        axes = np.array([0.1, -0.2, 1.0]) * ([1, 0, 1] if given.pattern in ("2T", "1R2T") else [1, 1, 1])
        axes /= np.linalg.norm(axes)
        cables = {"pulley_radius": radius, "pulley_axes": axes}
        rows = [[pulleys.length(b, axes, radius, t)[0] for b, t in zip(given.base, at, strict=True)] for at in targets]
        lengths = np.array(rows)
    start = _near(given, rng, positions, quaternions)
    found = cspr_jax.forward(_built(given, **cables), lengths, point="mass-centre", **start)
    regular = found.conditioning > 1e-3
    assert found.is_found.all() and (found.residual < 1e-9).mean() > 0.95 and regular.sum() > 0.5 * count
    again = _targets(given, found.positions, found.quaternions)
    # Two solutions may be as near as the start.
    right = np.abs(again - targets).max((1, 2)) < 1e-7
    assert right[regular].mean() > 0.9
    return found


QUICK = [("3T", 5), ("3R3T", 6), ("3R3T", 8)]
OTHERS = [("2T", 3), ("1T", 3), ("1R2T", 4), ("2R3T", 5), ("2R3T", 7), ("3R", 4), ("3R", 3)]


THOROUGH = [pytest.param(*case, marks=pytest.mark.thorough) for case in OTHERS]


@pytest.mark.parametrize(("pattern", "cables"), [*QUICK, *THOROUGH])
def test_poses_are_found_from_starts_nearby(pattern, cables):
    rng = np.random.default_rng(cables)
    _check_from_near(cable_robots.any_robot(rng, pattern, cables, suspended=True), rng, 100)


@pytest.mark.parametrize(
    ("pattern", "cables"), [("3T", 3), *(pytest.param(*x, marks=pytest.mark.thorough) for x in (*QUICK, ("1R2T", 3)))]
)
def test_poses_of_robots_with_pulleys(pattern, cables):
    rng = np.random.default_rng(10 + cables)
    _check_from_near(cable_robots.any_robot(rng, pattern, cables, suspended=True), rng, 30, radius=0.08)


def test_poses_are_found_without_a_start():
    """Eight cables determine the pose; six have several, of which one is the pose that was meant."""
    rng = np.random.default_rng(5)
    for cables in (6, 8):
        given = cable_robots.spatial(rng, cables)
        _, _, targets, lengths = _posed(given, rng, 20)
        robot = _built(given)
        one = cspr_jax.forward(robot, lengths)
        every = cspr_jax.forward(robot, lengths, all_solutions=True)
        assert one.is_found.all() and one.residual.max() < 1e-9 and not every.is_complete
        all_targets = _targets(given, np.nan_to_num(every.all_positions), np.nan_to_num(every.all_quaternions, nan=0.5))
        best = np.abs(all_targets - targets[:, None]).max((2, 3)).min(1)
        assert (best < 1e-6).mean() >= (0.9 if cables == 6 else 1.0)
        if cables == 8:
            np.testing.assert_allclose(_targets(given, one.positions, one.quaternions), targets, atol=1e-6)


def test_residuals_of_redundant_cables_are_least():
    """No pose nearby has smaller residuals, and weights take a cable out."""
    rng = np.random.default_rng(6)
    given = cable_robots.spatial(rng, 8)
    robot = _built(given)
    positions, quaternions, targets, lengths = _posed(given, rng, 20)
    off = lengths + 0.001 * rng.normal(size=lengths.shape)
    found = cspr_jax.forward(robot, off, start=positions, start_orientations=quaternions)
    assert found.is_found.all() and 1e-5 < found.residual.max() < 0.005
    best = (found.residuals**2).sum(1)
    for _ in range(20):
        shift = rng.choice([1e-5, 1e-4, 1e-3]) * rng.normal(size=(20, 3))
        turn = Rotation.from_rotvec(rng.choice([1e-5, 1e-4, 1e-3]) * rng.normal(size=(20, 3)))
        turned = (turn * Rotation.from_quat(found.quaternions, scalar_first=True)).as_quat(scalar_first=True)
        errors = np.linalg.norm(_targets(given, found.positions + shift, turned) - given.base, axis=2) - off
        assert ((errors**2).sum(1) >= best - 1e-14).all()
    wrong = lengths.copy()
    wrong[:, 3] += 0.02
    start = {"start": positions, "start_orientations": quaternions, "weights": [1, 1, 1, 0, 1, 1, 1, 1]}
    found = cspr_jax.forward(robot, wrong, **start)
    np.testing.assert_allclose(_targets(given, found.positions, found.quaternions), targets, atol=1e-7)
    np.testing.assert_allclose(found.residuals[:, 3], -0.02, atol=1e-7)
    assert (found.worst_cable == 3).all()


def test_origin_and_mass_centre_of_a_platform():
    given = cable_robots.spatial(np.random.default_rng(8), 8)
    centre = np.array([0.05, -0.1, 0.02])
    settings = {"mass": 1.0, "inertia": np.eye(3), "z_axis": "up", "centre_of_mass": centre}
    robot = cspr_jax.platform(given.base, given.platform, **settings)
    rng = np.random.default_rng(9)
    positions, quaternions, _, lengths = _posed(given, rng, 10)
    found = cspr_jax.forward(robot, lengths, start=positions, start_orientations=quaternions)
    np.testing.assert_allclose(found.positions, positions, atol=1e-8)
    centres = positions + Rotation.from_quat(quaternions, scalar_first=True).apply(centre)
    settings = {"start": centres, "start_orientations": quaternions, "point": "mass-centre"}
    np.testing.assert_allclose(cspr_jax.forward(robot, lengths, **settings).positions, centres, atol=1e-8)


@pytest.mark.parametrize("layers", [{}, {"layer_turns": 7.5, "cable_length": 9.0}])
def test_angles_of_motors(layers):
    winch = {"drum_radius": [0.02, 0.025, 0.03], "gear_ratio": 5.0, "zero_length": 1.0, "direction": [1.0, -1.0, 1.0]}
    robot = cspr_jax.with_cables(cspr_jax.point_mass(SPOOLS, mass=1.0), cable_diameter=0.002, winch=winch | layers)
    points = np.array([[0.0, 0.1, 0.9], [0.1, 0.0, 1.2]])
    lengths = np.linalg.norm(points[:, None] - SPOOLS, axis=2)
    if layers:
        from cspr_jax.robots.model import winches

        angles = np.array([winches.motor_angles(robot.winches, row) for row in lengths])
    else:
        angles = np.array([1.0, -1.0, 1.0]) * 5.0 * (lengths - 1.0) / winch["drum_radius"]
    np.testing.assert_allclose(cspr_jax.forward(robot, angles, angles=True).positions, points, atol=1e-9)


def test_steps_along_a_motion_are_continuous():
    """From pose to pose, from the pose before: Gauss-Newton stays on the branch of the motion."""
    given = cable_robots.spatial(np.random.default_rng(11), 6)
    robot, t = _built(given), np.linspace(0.0, 1.0, 60)
    positions = np.column_stack([0.4 * np.sin(3 * t), 0.3 * np.cos(3 * t) - 0.3, -0.4 * t])
    turns = Rotation.from_rotvec(np.column_stack([0.1 * np.sin(2 * t), 0.1 * t, 0.2 * t]))
    quaternions = turns.as_quat(scalar_first=True)
    lengths = np.linalg.norm(_targets(given, positions, quaternions) - given.base, axis=2)
    before = np.vstack([positions[:1], positions[:-1]]), np.vstack([quaternions[:1], quaternions[:-1]])
    found = cspr_jax.forward(robot, lengths, start=before[0], start_orientations=before[1])
    np.testing.assert_allclose(found.positions, positions, atol=1e-8)
    assert found.steps.max() <= 8


MISTAKES = {
    "shape": (([1.0, 1.0],), {}, r"^lengths: an array of shape \(2,\): must be \(3,\), one a cable, or \(n, 3\)$"),
    "shapes": (([[1.0, 1.0]],), {}, r"^lengths: an array of shape \(1, 2\): must be \(3,\), one a cable, or \(n, 3\)$"),
    "negative": (([1.0, -1.0, 1.0],), {}, r"^lengths\[0, 1\] = -1.0: must be a length > 0, at most 1e6 m$"),
    "slack": (
        ([1.0, 1.0, 1.0],),
        {"equilibrium": True, "weights": [1.0, 1.0, 1.0]},
        "^weights: given: must be absent beside equilibrium, which has none$",
    ),
    "loose": (
        ([1.0, 1.0, 1.0],),
        {"equilibrium": True, "tolerance": 0.1},
        "^tolerance: given: must be absent beside equilibrium, which has none$",
    ),
    "nan": (([1.0, np.nan, 1.0],), {}, r"^lengths = nan: must be finite numbers"),
    "winch": (([1.0, 1.0, 1.0],), {"angles": True}, r"^angles: given: must be absent: the robot has no \[winch\]"),
    "start": (([1.0, 1.0, 1.0],), {"start": np.zeros((2, 3))}, r"^start: an array of shape \(2, 3\): must be \(3,\)"),
    "turn": (
        ([1.0, 1.0, 1.0],),
        {"start": [0, 0, 1], "start_orientations": [1, 0, 0, 0]},
        "^start_orientations: a point mass has none: must be None$",
    ),
    "alone": (([1.0, 1.0, 1.0],), {"start_orientations": [1, 0, 0, 0]}, "^start_orientations: given: must be absent"),
    "weights": (([1.0, 1.0, 1.0],), {"weights": [1, 1, 0]}, r"^weights = \[1.0, 1.0, 0.0\]: must be 3 numbers >= 0"),
    "tolerance": (([1.0, 1.0, 1.0],), {"tolerance": 0.0}, "^tolerance = 0.0: must be a finite number > 0, or None$"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_mistakes_are_one_line(name):
    arguments, keywords, line = MISTAKES[name]
    with pytest.raises(InputError, match=line) as caught:
        cspr_jax.forward(cspr_jax.point_mass(SPOOLS, mass=1.0), *arguments, **keywords)
    assert "\n" not in str(caught.value)


def _energy_is_least(given, found, lengths, rng):
    """No pose nearby that the cables allow is lower, and tensions hold the weight."""
    for i in range(len(lengths)):
        shifts = rng.choice([1e-3, 1e-2, 0.1], (4000, 1)) * rng.normal(size=(4000, 3))
        positions, turns = found.positions[i] + shifts, np.tile(found.quaternions[i], (4000, 1))
        if given.pattern not in POINTS:
            turn = Rotation.from_rotvec(rng.choice([1e-3, 1e-2, 0.1], (4000, 1)) * rng.normal(size=(4000, 3)))
            turns = (turn * Rotation.from_quat(turns, scalar_first=True)).as_quat(scalar_first=True)
        reached = np.linalg.norm(_targets(given, positions, turns) - given.base, axis=2)
        is_allowed = (reached <= lengths[i]).all(1)
        higher = positions[is_allowed, 2] - found.positions[i, 2]
        assert (np.abs(shifts[is_allowed]).max(1) > 0.05)[higher < -1e-7].all()
        targets = _targets(given, found.positions[i : i + 1], found.quaternions[i : i + 1])[0]
        units = (given.base - targets) / np.linalg.norm(given.base - targets, axis=1, keepdims=True)
        force = found.tensions[i] @ units
        np.testing.assert_allclose(force, [0.0, 0.0, 9.81 * given.mass], atol=1e-4 * given.mass)
        moment = found.tensions[i] @ np.cross(targets - found.positions[i], units)
        np.testing.assert_allclose(moment, 0.0, atol=1e-4 * given.mass)
        assert (found.tensions[i] >= 0.0).all() and (found.tensions[i][found.slack[i]] == 0.0).all()
        assert (found.residuals[i] <= 1e-7).all() and found.residual[i] < 1e-6 * 5.0


def test_point_masses_at_equilibrium():
    """The lowest common point of balls: of one cable below its spool, of two in their plane, of three above all."""
    given = cable_robots.point_mass(np.random.default_rng(1), "3T", 3)
    robot, rng = _built(given), np.random.default_rng(2)
    lengths = _posed(given, rng, 10)[3] * rng.uniform(1.0, 1.6, (10, 3))
    found = cspr_jax.forward(robot, lengths, equilibrium=True)
    assert found.is_found.all() and found.slack.any() and not found.slack.all(1).any()
    _energy_is_least(given, found, lengths, rng)
    assert not cspr_jax.forward(robot, [1.0, 1.0, 1.0], equilibrium=True).is_found.any()
    alone = cspr_jax.forward(robot, [9.0, 1.0, 9.0], equilibrium=True)
    np.testing.assert_allclose(alone.positions[0], given.base[1] - [0.0, 0.0, 1.0], atol=1e-6)
    assert alone.slack[0].tolist() == [True, False, True]
    np.testing.assert_allclose(alone.tensions[0], [0.0, 9.81 * given.mass, 0.0], atol=1e-6)


@pytest.mark.thorough
def test_platforms_at_equilibrium():
    rng = np.random.default_rng(3)
    for cables in (6, 8):
        given = cable_robots.spatial(rng, cables)
        lengths = _posed(given, rng, 4)[3] * rng.uniform(1.0, 1.15, (4, cables))
        found = cspr_jax.forward(_built(given), lengths, equilibrium=True, all_solutions=True)
        assert found.is_found.all() and found.slack.any(1).all()
        _energy_is_least(given, found, lengths, rng)
        np.testing.assert_allclose(found.all_positions[:, 0], found.positions)
