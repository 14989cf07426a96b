"""Calibration with a tracker of its own axes, on joints and guides, and with what is known beforehand."""

import numpy as np
import pytest
from oracles import calibration as oracle
from scipy.spatial.transform import Rotation
from support.calibration_cases import body_case, built, quaternions_of
from support.prism import prism, prism_case

import cspr_jax
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.machine.calibration.elimination import UNSEEN, toward_nominal

TURN, SHIFT = Rotation.from_rotvec([0.4, -1.0, 2.0]), np.array([3.0, -5.0, 1.0])
FREE = ["spools", "offsets", "tracker"]


def tracked_prism(rng, noise=1e-4):
    """A calibrated prism that a tracker with axes of its own has seen."""
    _, _, readings, _, positions = prism_case(11, 0.0)
    seen = TURN.apply(positions) + SHIFT + noise * rng.normal(size=positions.shape)
    readings = readings + noise * rng.normal(size=readings.shape)
    return cspr_jax.calibrate(prism(), readings, seen, sigma=1e-4, loss="squares", free=FREE)


def test_covariance_beside_a_tracker_is_that_of_constrained_least_squares():
    """Bordered normal equations of all unknowns: along motions of everything, spools stay as near as they can."""
    result = tracked_prism(np.random.default_rng(0))
    base, positions = np.asarray(result.robot.base_points), result.positions
    expected = oracle.tracked_covariance(base, positions)
    np.testing.assert_allclose(result.covariance, 1e-8 * expected, rtol=1e-3, atol=1e-5 * 1e-8 * expected.max())
    # Three level spools can take any heights by a motion of all of them: these stay as they were.
    assert np.sqrt(np.diagonal(result.covariance)[[2, 5, 8]]).max() < 1e-3 * np.sqrt(result.covariance.max())


@pytest.mark.parametrize(
    "trials", [pytest.param(40, marks=pytest.mark.thorough), pytest.param(400, marks=pytest.mark.soak)]
)
def test_covariance_beside_a_tracker_is_that_of_monte_carlo(trials):
    rng = np.random.default_rng(5)
    results = [tracked_prism(rng) for _ in range(trials)]
    found = np.array([np.r_[np.asarray(one.robot.base_points).ravel(), one.offsets] for one in results])
    level = np.delete(np.arange(12), [2, 5, 8])
    deviations = np.sqrt(np.diagonal(results[0].covariance))[level]
    np.testing.assert_allclose(found[:, level].std(0, ddof=1), deviations, rtol=4.0 / np.sqrt(2.0 * trials))


def test_steps_toward_the_nominal_robot():
    """The machine's part becomes least along the null space; directions of the tracker alone stay."""
    rng = np.random.default_rng(1)
    is_of_machine = np.arange(8) < 5
    alone = np.eye(8)[6]
    others = rng.normal(size=(2, 8)) * (np.arange(8) != 6)
    null_space = np.linalg.qr(np.vstack([alone, others]).T)[0].T
    change = rng.normal(size=8)
    moved = change + toward_nominal(null_space, is_of_machine) @ change
    best = np.linalg.lstsq(others[:, :5].T, change[:5], rcond=None)[0]
    np.testing.assert_allclose(moved[:5], (change - best @ others)[:5], atol=1e-12)
    assert moved[6] == pytest.approx(change[6], abs=1e-12)
    # With nothing but the tracker's own directions nothing moves, whatever rounding leaves of them in the machine.
    rounded = alone + 1e-17 * rng.normal(size=8)
    np.testing.assert_allclose(toward_nominal(rounded[None], is_of_machine) @ change, 0.0, atol=1e-9)


def test_what_is_unseen_does_not_depend_on_the_basis():
    """Parts of parameters in the null space, for its basis and a rotated one: each vector alone has less."""
    _, _, readings, seen, _ = prism_case(13, 1e-4, 20)
    readings[:, 2] = np.nan
    problem = cspr_jax.calibrate(prism(), readings, seen, loss="squares")._result.estimate.measured
    assert np.flatnonzero(problem.unseen_parts > UNSEEN).tolist() == [6, 7, 8, 11]
    np.testing.assert_allclose(problem.unseen_parts[[6, 7, 8, 11]], 1.0, atol=1e-12)
    basis = np.linalg.qr(np.random.default_rng(0).normal(size=(4, 4)))[0]
    vectors = problem.vectors.copy()
    vectors[~problem.is_seen] = basis @ problem.null_space
    np.testing.assert_allclose(problem._replace(vectors=vectors).unseen_parts, problem.unseen_parts, atol=1e-12)


def test_next_poses_beside_a_tracker_know_spools_no_worse():
    """Further poses lower every standard deviation, in the axes that stay near the nominal robot."""
    _, _, readings, _, positions = prism_case(12, 1e-4, 14)
    seen = TURN.apply(positions) + SHIFT
    limits = {"floor": 0.6, "tension_max": 50.0}
    result = cspr_jax.calibrate(prism(), readings, seen, sigma=1e-4, loss="squares", free=FREE, next=4, limits=limits)
    planned = result._next.covariance
    before, after = (np.sqrt(np.diagonal(x))[:12] for x in (result._result.covariance, planned))
    assert (after <= before * (1.0 + 1e-9) + 1e-12).all() and after.max() < 0.9 * before.max()
    together = np.vstack([positions, [pose["position"] for pose in result.next_poses]])
    expected = 1e-8 * oracle.tracked_covariance(np.asarray(result.robot.base_points), together)
    np.testing.assert_allclose(np.sqrt(np.diagonal(expected)[:2]), after[:2], rtol=0.02)


def test_most_poses_say_what_is_measured_next():
    """One pose with a position among fifty without: the next ones are planned for lengths alone."""
    robot, _, _, _, positions, _, readings = body_case(3, 30, 1e-4, n=5, pattern="3T")
    seen = np.full((30, 3), np.nan)
    seen[4] = positions[4]
    result = cspr_jax.calibrate(built(robot), readings, seen, loss="squares", sigma=1e-4, next=1)
    alone = cspr_jax.calibrate(built(robot), readings, loss="squares", sigma=1e-4, next=1)
    np.testing.assert_allclose(result.next_poses[0]["position"], alone.next_poses[0]["position"], atol=0.02)


def test_a_prior_is_that_of_the_numbers_themselves():
    """Drums that nothing measures keep the standard deviation that was said, in metres of their radius."""
    _, _, readings, seen, _ = prism_case(13, 1e-4, 20)
    winch = {"drum_radius": 0.05, "zero_length": 1.0}
    robot = cspr_jax.with_cables(prism(), winch=winch)
    angles = (readings - 1.0) / 0.05
    angles[:, 2] = np.nan
    free = ["spools", "offsets", "drums"]
    result = cspr_jax.calibrate(robot, angles, seen, angles=True, free=free, sigma=1e-4, prior=1e-4, loss="squares")
    deviations = dict(zip(result.names, np.sqrt(np.diagonal(result.covariance)), strict=True))
    for name in ("spool 3 x", "offset 3", "drum radius 3"):
        assert deviations[name] == pytest.approx(1e-4, rel=1e-9), name
    assert deviations["drum radius 1"] < 1e-4


def test_a_prior_counts_among_what_finds_mistakes():
    """Few measurements beside a prior: a wrong one stands out against what is known of the robot."""
    _, _, readings, seen, _ = prism_case(14, 1e-4, 5)
    readings[2, 1] += 0.5
    result = cspr_jax.calibrate(prism(), readings, seen, sigma=1e-4, prior=1e-3)
    assert np.argwhere(result.is_mistaken).tolist() == [[2, 1]]


def test_robots_on_joints_and_guides_say_what_a_tracker_must_see():
    robot, *_, positions, rotations, readings = body_case(8, 12, 0.0, n=4, pattern="3R")
    given = {"positions": positions, "quaternions": quaternions_of(rotations)}
    with pytest.raises(InputError, match=r'^point = "mass-centre": must be origin for a robot on a joint'):
        cspr_jax.calibrate(built(robot), readings, **given, point="mass-centre")
    for name in ("tracker", "target"):
        with pytest.raises(InputError, match=rf'^free = "{name}": must be absent for a robot on a joint'):
            cspr_jax.calibrate(built(robot), readings, **given, free=["spools", name])
    robot, *_, positions, _, readings = body_case(8, 12, 0.0, n=2, pattern="1T")
    with pytest.raises(InputError, match=r'^free = "tracker": must be absent for a robot on a guide'):
        cspr_jax.calibrate(built(robot), readings, positions, free=["spools", "tracker"])


def test_unknown_limits_are_one_line():
    _, _, readings, seen, _ = prism_case(1, 0.0)
    for limits in ({"flor": 0.6}, {"limits": {"flor": 0.6}}):
        with pytest.raises(ConfigError, match=r"^limits: unknown key flor = 0.6: did you mean floor") as caught:
            cspr_jax.calibrate(prism(), readings, seen, next=1, limits=limits)
        assert "\n" not in str(caught.value)
