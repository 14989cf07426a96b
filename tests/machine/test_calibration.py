"""Calibration against SciPy's least squares, exact robots, Monte Carlo and directions that change nothing."""

import dataclasses

import numpy as np
import pytest
from oracles import calibration as oracle
from oracles import pulleys as pulley_oracle
from scipy.spatial.transform import Rotation
from scipy.stats import chi2, f
from support import cable_robots
from support.calibration_cases import body_case, built, quaternions_of
from support.prism import PRISM, prism, prism_case, prism_positions

import cspr_jax
from cspr_jax.errors import InputError
from cspr_jax.machine.calibration.predictions import Linearised
from cspr_jax.machine.calibration.radii import radius_of


def test_a_prism_without_noise_is_found_exactly():
    spools, offsets, readings, seen, positions = prism_case(0, 0.0)
    result = cspr_jax.calibrate(prism(), readings, seen)
    np.testing.assert_allclose(result.robot.base_points, spools, atol=1e-12, rtol=0.0)
    np.testing.assert_allclose(result.offsets, offsets, atol=1e-12, rtol=0.0)
    np.testing.assert_allclose(result.positions, positions, atol=1e-12, rtol=0.0)
    assert result.not_identifiable == () and not result.is_mistaken.any()


def test_a_noisy_prism_is_that_of_scipy():
    _, _, readings, seen, _ = prism_case(1, 1e-4)
    result = cspr_jax.calibrate(prism(), readings, seen, sigma=1e-4)
    other_spools, other_offsets, other_positions, cost, inverse = oracle.point_mass_fit(PRISM, readings, seen)
    np.testing.assert_allclose(result.robot.base_points, other_spools, atol=1e-9, rtol=0.0)
    np.testing.assert_allclose(result.offsets, other_offsets, atol=1e-9, rtol=0.0)
    np.testing.assert_allclose(result.positions, other_positions, atol=1e-9, rtol=0.0)
    np.testing.assert_allclose(result.covariance, 1e-8 * inverse, rtol=1e-4, atol=1e-14)
    assert result.noise == pytest.approx(np.sqrt(cost / 168) / 1e-4, rel=1e-9)
    # Without standard deviations one factor is estimated.
    free = cspr_jax.calibrate(prism(), readings, seen)
    np.testing.assert_allclose(free.robot.base_points, other_spools, atol=1e-9, rtol=0.0)
    np.testing.assert_allclose(free.covariance, result.covariance * result.noise**2, rtol=1e-6, atol=1e-16)


def test_mistakes_are_left_out_and_change_nothing():
    _, _, readings, seen, _ = prism_case(2, 1e-4)
    clean = cspr_jax.calibrate(prism(), readings, seen, loss="squares")
    wrong, elsewhere = readings.copy(), seen.copy()
    for k, i, error in ((3, 1, 0.01), (20, 0, -0.002), (41, 2, 0.3)):
        wrong[k, i] += error
    elsewhere[30, 2] += 0.005
    for loss in ("cauchy", "huber"):
        result = cspr_jax.calibrate(prism(), wrong, elsewhere, loss=loss)
        assert np.argwhere(result.is_mistaken).tolist() == [[3, 1], [20, 0], [30, 5], [41, 2]]
        assert np.abs(result.robot.base_points - clean.robot.base_points).max() < 3e-4
    rows = result.to_dict()["mistakes"]
    assert [(row["row"], row["column"], row["cable"]) for row in rows] == [
        (41, "length_3", 2),
        (3, "length_2", 1),
        (30, "z", None),
        (20, "length_1", 0),
    ]
    gaps, holes = readings.copy(), seen.copy()
    gaps[[3, 20, 41], [1, 0, 2]] = np.nan
    holes[30, 2] = np.nan
    left = cspr_jax.calibrate(prism(), gaps, holes, loss="squares")
    np.testing.assert_allclose(result.robot.base_points, left.robot.base_points, atol=1e-10, rtol=0.0)
    spoilt = cspr_jax.calibrate(prism(), wrong, elsewhere, loss="squares")
    assert np.abs(spoilt.robot.base_points - clean.robot.base_points).max() > 3e-3


def mean_errors(trials, seed):
    """Mean errors of positions from lengths, m: of the nominal and the calibrated robot, and against measured ones."""
    errors = []
    for trial in range(trials):
        spools, offsets, readings, seen, positions = prism_case(seed + trial, 1e-4)
        result = cspr_jax.calibrate(prism(), readings, seen)
        fresh = prism_positions(np.random.default_rng(10_000 + trial), 200)
        there = np.linalg.norm(fresh[:, None] - spools, axis=2) - offsets
        row = [np.linalg.norm(located(PRISM, there) - fresh, axis=1).mean()]
        base = np.asarray(result.robot.base_points)
        row.append(np.linalg.norm(located(base, there + result.offsets) - fresh, axis=1).mean())
        row.append(np.linalg.norm(located(base, readings + result.offsets) - positions, axis=1).mean())
        errors.append(row)
    return np.array(errors)


def located(spools, lengths):
    """Positions below three spools: from the foot in their plane, by two spheres less a third."""
    first, second, third = spools
    across = (second - first) / np.linalg.norm(second - first)
    along = third - first - ((third - first) @ across) * across
    along /= np.linalg.norm(along)
    down = np.cross(across, along)
    down *= np.sign(down[2])
    d, i, j = (second - first) @ across, (third - first) @ across, (third - first) @ along
    a, b, c = (lengths**2).T
    x = (a - b + d**2) / (2.0 * d)
    y = (a - c + i**2 + j**2) / (2.0 * j) - i / j * x
    z = np.sqrt(np.maximum(a - x**2 - y**2, 0.0))
    return first + x[:, None] * across + y[:, None] * along + z[:, None] * down


@pytest.mark.parametrize("trials", [3, pytest.param(100, marks=pytest.mark.soak)])
def test_calibrated_prisms_are_better_than_published(trials):
    """0.6157 mm is what is published for this robot and noise."""
    errors = mean_errors(trials, 100)
    assert (errors[:, 0] > 0.6157e-3).all()
    assert (errors[:, 1:] < 0.6157e-3).all() and errors[:, 1].mean() < 0.25e-3


def test_uncertainty_shrinks_with_the_noise():
    _, _, readings, seen, _ = prism_case(7, 1e-4)
    radii = [cspr_jax.calibrate(prism(), readings, seen, sigma=sigma).spool_positions for sigma in (1e-4, 2e-4)]
    assert radii[1] == pytest.approx(2.0 * radii[0], rel=1e-6)


@pytest.mark.parametrize("trials", [12, pytest.param(2000, marks=pytest.mark.soak)])
def test_covariance_is_that_of_monte_carlo(trials):
    """Standard deviations of all parameters, whitened: errors over their predicted covariance have that of 1."""
    spools, offsets, readings, _, positions = prism_case(11, 0.0)
    rng, errors = np.random.default_rng(5), []
    for _ in range(trials):
        noisy = readings + 1e-4 * rng.normal(size=readings.shape), positions + 1e-4 * rng.normal(size=positions.shape)
        result = cspr_jax.calibrate(prism(), *noisy, sigma=1e-4, loss="squares")
        errors.append(np.r_[(result.robot.base_points - spools).ravel(), result.offsets - offsets])
    errors = np.array(errors)
    deviations = np.sqrt(np.diagonal(result.covariance))
    # 3.5 standard deviations of a standard deviation of so many trials, or 5 %.
    spread = max(0.05, 3.5 / np.sqrt(2.0 * trials))
    np.testing.assert_allclose(np.sqrt(np.mean(errors**2, axis=0)), deviations, rtol=spread)
    squares = np.einsum("ij,jk,ik->i", errors, np.linalg.inv(result.covariance), errors)
    assert np.mean(squares) == pytest.approx(12.0, rel=max(0.05, 5.0 * np.sqrt(2.0 / 12.0 / trials)))


@pytest.mark.parametrize(
    "trials", [pytest.param(40, marks=pytest.mark.thorough), pytest.param(400, marks=pytest.mark.soak)]
)
def test_the_uncertainty_holds_all_spools(trials):
    """Over many trials, at least as often as it says."""
    inside = 0
    for seed in range(trials):
        spools, _, readings, seen, _ = prism_case(300 + seed, 1e-4)
        result = cspr_jax.calibrate(prism(), readings, seen)
        inside += np.linalg.norm(result.robot.base_points - spools, axis=1).max() <= result.spool_positions
    assert inside >= 0.95 * trials - 3.0 * np.sqrt(0.05 * 0.95 * trials)


def test_self_calibration_is_that_of_scipy():
    """Eight cables, readings alone: readings and cost agree, and the frame stays as near the nominal as it can."""
    robot, _, _, _, positions, rotations, readings = body_case(3, 36, 1e-4)
    result = cspr_jax.calibrate(built(robot), readings, loss="squares")
    predicted, cost = oracle.body_fit(robot.base, robot.platform, readings, positions, rotations)
    turns = Rotation.from_quat(result.quaternions, scalar_first=True).as_matrix()
    base, points = np.asarray(result.robot.base_points), np.asarray(result.robot.platform_points)
    own = oracle.lengths(base, points, result.positions, turns) - result.offsets
    np.testing.assert_allclose(own, predicted, atol=1e-8, rtol=0.0)
    assert np.sum((own - readings) ** 2) == pytest.approx(cost, rel=1e-9)
    assert result.noise == pytest.approx(np.sqrt(cost / (36 * 2 - 44)) / 1e-4, rel=1e-9)
    assert len(result.not_identifiable) == 12 and all("changes nothing" in text for text in result.not_identifiable)
    assert np.isfinite(result.spool_positions)
    moved, shifted = base - robot.base, points - robot.platform
    for axis in np.eye(3):
        for part, change in ((base, moved), (points, shifted)):
            assert abs((change @ axis).sum()) < 1e-9
            assert abs((change * np.cross(axis, part - (part.mean(0) if part is base else 0.0))).sum()) < 1e-9


@pytest.mark.quick("3T-5")
@pytest.mark.parametrize(
    ("pattern", "n"), [("1T", 2), ("2T", 2), ("2T", 3), ("3T", 5), ("1R2T", 4), ("2R3T", 6), ("3R", 4), ("3R3T", 6)]
)
def test_robots_of_every_pattern_are_found(pattern, n):
    """With positions and orientations: what the calibrated robot would read at fresh poses is right."""
    robot, spools, points, offsets, positions, rotations, readings = body_case(8, 40, 0.0, n=n, pattern=pattern)
    if (pattern, n) == ("2T", 2):
        spools[:, 2] = robot.base[:, 2] = spools[0, 2]
        readings = oracle.lengths(spools, points, positions, rotations) - offsets
    is_body = pattern not in cable_robots.POINT_MASSES
    quaternions = quaternions_of(rotations) if is_body else None
    result = cspr_jax.calibrate(built(robot), readings, positions, quaternions, loss="squares")
    assert result.is_converged
    base = np.asarray(result.robot.base_points)
    found = np.asarray(result.robot.platform_points) + (0.0 if pattern == "3R" else robot.arm) if is_body else points
    rng = np.random.default_rng(99)
    fresh, turns = zip(*(robot.pose(rng) for _ in range(20)), strict=True)
    own = oracle.lengths(base, found, np.array(fresh), np.array(turns)) - result.offsets
    right = oracle.lengths(spools, points, np.array(fresh), np.array(turns)) - offsets
    np.testing.assert_allclose(own, right, atol=1e-9, rtol=0.0)
    if not result.not_identifiable:
        np.testing.assert_allclose(base, spools, atol=1e-8, rtol=0.0)
        np.testing.assert_allclose(found, points, atol=1e-8, rtol=0.0)


@pytest.mark.thorough
def test_a_prior_weighs_what_is_known():
    """From readings alone, errors of the robot drawn as the prior says are as large as the covariance says."""
    squares, nominal, best = [], [], []
    for seed in range(5):
        robot, spools, points, offsets, _, _, readings = body_case(50 + seed, 30, 2e-4, error=1e-3)
        result = cspr_jax.calibrate(built(robot), readings, loss="squares", sigma=2e-4, prior=1e-3)
        moved = [np.asarray(result.robot.base_points) - spools, result.robot.platform_points - points]
        errors = np.concatenate([moved[0].ravel(), moved[1].ravel(), result.offsets - offsets])
        squares.append(errors @ np.linalg.solve(result.covariance, errors))
        nominal.append(np.linalg.norm(robot.base - spools))
        best.append(np.linalg.norm(moved[0]))
    assert np.mean(squares) == pytest.approx(56.0, abs=5.0 * np.sqrt(2.0 * 56.0 / 5.0))
    assert np.mean(best) < np.mean(nominal) and np.isfinite(result.spool_positions)
    assert len(result.not_identifiable) == 12


def test_directions_change_nothing():
    """Each, applied to the robot, leaves the cost where it was, once the poses have followed."""
    robot, _, _, _, _, _, readings = body_case(5, 24, 1e-4)
    result = cspr_jax.calibrate(built(robot), readings, loss="squares")
    rows, size = result._result.parameters, 1e-4
    inner = result._result
    for direction in inner.directions:
        step = direction.vector / np.array([row.sign * row.per_metre for row in rows.rows])
        problem = inner.estimate.reduced
        outside = step - problem.null_space.T @ (problem.null_space @ step)
        assert np.linalg.norm(outside) < 1e-6 * np.linalg.norm(step)
        moved = rows.moved(inner.estimate.setup, size * step)
        before, after = (_best_cost(inner, setup) for setup in (inner.estimate.setup, moved))
        assert after == pytest.approx(before, rel=1e-3)


def _best_cost(inner, setup):
    """Cost of the best poses for a setup."""
    from cspr_jax.machine.calibration.starting_poses import moved_poses

    poses = inner.estimate.poses
    for _ in range(6):
        there: Linearised = inner.predictor(setup, poses)
        steps = [
            -np.linalg.lstsq(by_pose, r, rcond=None)[0]
            for by_pose, r in zip(there.by_pose, there.residuals, strict=True)
        ]
        poses = moved_poses(poses, inner.predictor.axes, np.array(steps))
    return np.sum(inner.predictor(setup, poses).residuals ** 2)


def test_derivatives_are_those_of_differences():
    """By every parameter and every coordinate of the poses, of angles behind pulleys with a tracker of its own."""
    from cspr_jax.machine.calibration.starting_poses import moved_poses

    case = winch_case(4, 12)
    kinds = ["spools", "attachments", "offsets", "drums", "pulleys", "tracker", "target"]
    result = cspr_jax.calibrate(case.robot, case.angles, case.seen, case.turned, angles=True, free=kinds)._result
    setup, poses, predictor = result.estimate.setup, result.estimate.poses, result.predictor
    there, step = predictor(setup, poses), 1e-6
    for i in range(result.parameters.count):
        move = step * np.eye(result.parameters.count)[i]
        ahead, behind = (predictor(result.parameters.moved(setup, s * move), poses).residuals for s in (1.0, -1.0))
        np.testing.assert_allclose((ahead - behind) / (2.0 * step), there.by_parameters[:, :, i], rtol=1e-5, atol=2e-3)
    for i in range(predictor.axes.shape[1]):
        moves = np.tile(step * np.eye(predictor.axes.shape[1])[i], (len(poses.positions), 1))
        ahead, behind = (predictor(setup, moved_poses(poses, predictor.axes, s * moves)).residuals for s in (1, -1))
        np.testing.assert_allclose((ahead - behind) / (2.0 * step), there.by_pose[:, :, i], rtol=1e-5, atol=2e-3)
    # Redundancies add up to the degrees of freedom.
    assert result.estimate.redundancies[result.estimate.is_used].sum() == pytest.approx(result.estimate.degrees)


@dataclasses.dataclass
class Winched:
    """A robot behind pulleys and drums, the true one, and what is measured of that."""

    robot: object
    true: dict
    angles: np.ndarray
    seen: np.ndarray
    turned: np.ndarray
    positions: np.ndarray


WINCH = {"drum_radius": [0.05, 0.06, 0.055, 0.05, 0.05, 0.06, 0.05], "gear_ratio": 8.0, "zero_length": 1.0}
WINCH |= {"direction": [1.0, -1.0, 1.0, 1.0, -1.0, 1.0, 1.0]}


def winch_case(seed, count=40):
    """Angles by an oracle of pulleys, positions and orientations in a tracker's own axes."""
    rng = np.random.default_rng(seed)
    robot = cable_robots.any_robot(rng, "3R3T", 7)
    radius = np.full(7, 0.04)
    given = cspr_jax.with_cables(built(robot), pulley_radius=radius, winch=WINCH)
    spools, points = robot.base + 1e-3 * rng.normal(size=(7, 3)), robot.platform + 1e-3 * rng.normal(size=(7, 3))
    radii, drums = radius + 5e-4 * rng.normal(size=7), np.array(WINCH["drum_radius"]) + 1e-4 * rng.normal(size=7)
    zero = 1.0 + 2e-3 * rng.normal(size=7)
    poses = [robot.pose(rng) for _ in range(count)]
    positions, rotations = np.array([pose[0] for pose in poses]), np.array([pose[1] for pose in poses])
    ends = positions[:, None] + np.einsum("kij,nj->kni", rotations, points)
    up = np.array([0.0, 0.0, 1.0])
    lengths = [[pulley_oracle.length(*row)[0] for row in zip(spools, [up] * 7, radii, e, strict=True)] for e in ends]
    angles = np.array(WINCH["direction"]) * 8.0 * (np.array(lengths) - zero) / drums
    tracker, shift, target = Rotation.from_rotvec([0.4, -1.0, 2.0]), np.array([3.0, -5.0, 1.0]), [2e-3, -1e-3, 3e-3]
    seen = tracker.apply(positions + np.einsum("kij,j->ki", rotations, target)) + shift
    turned = (tracker * Rotation.from_matrix(rotations)).as_quat(scalar_first=True)
    true = {"spools": spools, "points": points, "radii": radii, "drums": drums, "zero": zero}
    true |= {"tracker": tracker, "shift": shift, "target": np.array(target)}
    return Winched(given, true, angles, seen, turned, positions)


def test_winches_pulleys_and_a_tracker_of_its_own():
    """The tracker has its own axes, so that the frame is the nominal one's; all else that matters is exact."""
    case = winch_case(2)
    kinds = ["attachments", "offsets", "drums", "pulleys", "tracker"]
    fixed = dataclasses.replace(case.robot, base_points=case.true["spools"])
    # The target is that of the tracker's axes: with the attachment points free, their common shift says the same.
    result = cspr_jax.calibrate(fixed, case.angles, case.seen, case.turned, angles=True, free=kinds, loss="squares")
    assert result.is_converged and result.not_identifiable == ()
    winches, pulleys = result.robot.winches, result.robot.pulleys
    np.testing.assert_allclose(winches.drum_radius, case.true["drums"], atol=1e-10, rtol=0.0)
    np.testing.assert_allclose(winches.zero_length, case.true["zero"], atol=1e-9, rtol=0.0)
    np.testing.assert_allclose(pulleys.radius, case.true["radii"], atol=1e-9, rtol=0.0)
    np.testing.assert_allclose(result.robot.platform_points, case.true["points"] - case.true["target"], atol=1e-9)
    tracker = result.to_dict()["tracker"]
    turn = Rotation.from_quat(tracker["quaternion"], scalar_first=True)
    assert (turn.inv() * case.true["tracker"]).magnitude() < 1e-9
    np.testing.assert_allclose(tracker["shift"], case.true["shift"], atol=1e-9)


def test_scale_is_seen_by_a_ruler_alone():
    """From angles alone, everything may be larger, drums too; a distance between two spools tells."""
    robot, spools, _, offsets, positions, rotations, _ = body_case(6, 40, 0.0, n=6, pattern="3T")
    drums = 0.05 * np.array([1.0, 1.01, 0.99, 1.005, 1.0, 0.995])
    angles = (oracle.lengths(spools, np.zeros((6, 3)), positions, rotations) - 1.0 - offsets) / drums
    nominal = cspr_jax.with_cables(built(robot), winch={"drum_radius": 0.05, "zero_length": 1.0})
    options = {"angles": True, "free": ["spools", "offsets", "drums"], "loss": "squares"}
    result = cspr_jax.calibrate(nominal, angles, **options)
    assert any("one factor on the robot" in text for text in result.not_identifiable)
    apart = np.linalg.norm(spools[0] - spools[3])
    ruled = cspr_jax.calibrate(nominal, angles, distances=[[1, 4, apart, 1e-5]], **options)
    assert not any("one factor" in text for text in ruled.not_identifiable)
    np.testing.assert_allclose(ruled.robot.winches.drum_radius, drums, atol=1e-9)
    assert (len(result.not_identifiable), len(ruled.not_identifiable)) == (7, 6)


def test_axes_and_origin_do_not_matter():
    """Up and far away: the same changes in the other axes."""
    _, _, readings, seen, _ = prism_case(9, 1e-4)
    result = cspr_jax.calibrate(prism(), readings, seen)
    signs, away = np.array([1.0, -1.0, -1.0]), np.array([300.0, -200.0, 50.0])
    other = cspr_jax.point_mass(PRISM * signs + away, mass=1.0, z_axis="up")
    flipped = cspr_jax.calibrate(other, readings, seen * signs + away)
    expected = np.asarray(result.robot.base_points) * signs + away
    np.testing.assert_allclose(flipped.robot.base_points, expected, atol=1e-10, rtol=0.0)
    matrix = np.diag([*np.tile(signs, 3), 1.0, 1.0, 1.0])
    np.testing.assert_allclose(flipped.covariance, matrix @ result.covariance @ matrix, rtol=1e-5, atol=1e-15)


def test_offset_and_height_alone_cannot_be_told_apart():
    """On a vertical guide straight below a spool, its height and the offset are one number."""
    robot = cspr_jax.point_mass([[0.0, 0.0, 0.0], [0.5, 0.0, 0.1]], mass=1.0, pattern="1T")
    heights = np.linspace(0.5, 3.0, 20)
    seen = np.c_[np.zeros((20, 2)), heights]
    readings = np.linalg.norm(seen[:, None] - np.asarray(robot.base_points), axis=2)
    result = cspr_jax.calibrate(robot, readings, seen)
    together = [text for text in result.not_identifiable if "spool 1 z" in text]
    assert together == [
        "offset 1 by +1 m, spool 1 z by -1 m together: their sum changes nothing that was measured"
    ] or (together == ["spool 1 z by +1 m, offset 1 by -1 m together: their sum changes nothing that was measured"])
    assert result.spool_positions == np.inf and result.to_dict()["uncertainty"]["spool_positions"] is None


@pytest.mark.parametrize("degrees", [np.inf, 7.0])
def test_radii_hold_what_they_say(degrees):
    one = chi2(1).ppf(0.95) if np.isinf(degrees) else f(1, degrees).ppf(0.95)
    assert radius_of(np.diag([0.0, 0.0, 4.0]), 0.95, degrees) == pytest.approx(2.0 * np.sqrt(one), rel=5e-3)
    three = chi2(3).ppf(0.9) if np.isinf(degrees) else 3.0 * f(3, degrees).ppf(0.9)
    assert radius_of(9.0 * np.eye(3), 0.9, degrees) == pytest.approx(3.0 * np.sqrt(three), rel=1e-9)
    rng = np.random.default_rng(0)
    root = rng.normal(size=(3, 3))
    vectors = rng.normal(size=(200_000, 3)) @ root.T
    if np.isfinite(degrees):
        vectors /= np.sqrt(rng.chisquare(degrees, (200_000, 1)) / degrees)
    inside = np.linalg.norm(vectors, axis=1) <= radius_of(root @ root.T, 0.95, degrees)
    assert inside.mean() == pytest.approx(0.95, abs=4.0 * np.sqrt(0.95 * 0.05 / 200_000))
    assert radius_of(np.zeros((3, 3)), 0.95, degrees) == 0.0


def test_next_poses_tell_more_than_others():
    """The first one has the largest determinant of all unknowns' information; five beat random ones."""
    _, _, readings, seen, _ = prism_case(12, 1e-4, 12)
    limits = {"floor": 0.6, "tension_max": 50.0}
    result = cspr_jax.calibrate(prism(), readings, seen, loss="squares", next=5, limits=limits)
    poses = result.next_poses
    assert len(poses) == 5 and poses[0]["quaternion"] is None
    base = np.asarray(result.robot.base_points)

    def information(positions):
        rays = np.asarray(positions)[:, None] - base
        units = rays / np.linalg.norm(rays, axis=2, keepdims=True)
        total = np.zeros((12, 12))
        for unit in units:
            of_robot = np.zeros((3, 12))
            for i in range(3):
                of_robot[i, 3 * i : 3 * i + 3], of_robot[i, 9 + i] = -unit[i], -1.0
            # Of three lengths and a position with equal errors, with an unknown pose.
            total += of_robot.T @ np.linalg.inv(np.eye(3) + unit @ unit.T) @ of_robot
        return total * 1e8

    before = information(result.positions) + np.eye(12) / np.linalg.norm(base - base.mean(0), axis=1).max() ** 2
    chosen = [pose["position"] for pose in poses]
    gain = np.linalg.slogdet(before + information(chosen))[1]
    rng = np.random.default_rng(0)
    others = [np.linalg.slogdet(before + information(prism_positions(rng, 5)))[1] for _ in range(200)]
    assert gain > max(others)
    first = np.linalg.slogdet(before + information(chosen[:1]))[1]
    assert all(np.linalg.slogdet(before + information([p]))[1] < first + 1e-6 for p in chosen[1:])
    for pose in poses:
        rays = base - pose["position"]
        tensions = np.linalg.solve((rays / np.linalg.norm(rays, axis=1, keepdims=True)).T, [0.0, 0.0, -9.81])
        assert (tensions > 0.0).all() and (tensions < 50.0).all() and pose["position"][2] <= 0.6
        np.testing.assert_allclose(pose["lengths"], np.linalg.norm(rays, axis=1) - result.offsets, rtol=1e-12)
    with pytest.raises(InputError, match=r"next: .* poses at rest are within the limits: must be fewer than 5"):
        cspr_jax.calibrate(prism(), readings, seen, next=5, limits={"tension_max": 1.0})


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"free": ["spool"]}, 'free = "spool": did you mean spools?'),
        ({"free": ["attachments"]}, 'free = "attachments": must be absent: a point mass has none'),
        ({"free": ["drums"]}, 'free = "drums": must be absent where lengths are measured'),
        ({"free": ["pulleys"]}, 'free = "pulleys": must be absent: the robot has no pulleys'),
        ({"free": ["tracker"]}, 'free = ["tracker"]: must be at least one of spools'),
        ({"angles": True}, "winch: missing: given in the robot file where angles are measured"),
        ({"sigma": [1e-4] * 4}, "sigma: 4 numbers: must be one to three"),
        ({"sigma": -1.0}, "sigma = -1.0: must be one to three numbers > 0"),
        ({"lengths": np.ones((4, 2))}, "lengths: an array of shape (4, 2): must be (k, 3)"),
        ({"lengths": np.full((4, 3), np.nan), "positions": None}, "lengths"),
        ({"positions": np.ones((3, 3))}, "positions: 3 rows: must have 60 rows"),
        ({"quaternions": np.tile([1.0, 0.0, 0.0, 0.0], (60, 1))}, "quaternions: given: must be absent: a point mass"),
        ({"positions": None}, "measurements: 3 at most at a pose: must be more than 3 at some poses"),
        ({"distances": [[1, 4, 0.5, 1e-3]]}, "distances = [[1.0, 4.0, 0.5, 0.001]]: must be two cables from 1 to 3"),
        ({"prior": 1e-3}, "sigma: missing: must be given beside prior"),
        ({"loss": "absolute"}, 'loss = "absolute": must be'),
        ({"next": -1}, "next = -1: must be an integer from 0"),
    ],
)
def test_what_does_not_fit_is_refused(changes, words):
    _, _, readings, seen, _ = prism_case(1, 0.0)
    arguments = {"lengths": readings, "positions": seen, **changes}
    with pytest.raises(InputError) as caught:
        cspr_jax.calibrate(prism(), **arguments)
    assert str(caught.value).startswith(words) and "\n" not in str(caught.value)
