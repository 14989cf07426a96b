"""Workspaces of robots on pulleys: identities of the margin, and linear programs; poses of trial lie within pulleys."""

import dataclasses

import numpy as np
import pytest
from oracles import workspaces as oracle
from scipy.spatial.transform import Rotation
from support import cable_robots
from support.workspaces import made

import cspr_jax
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.workspaces.poses.facet_normals import base_order, choices_of

G = cable_robots.GRAVITY
UP = np.array([0.0, 0.0, 1.0])
# Radii over the half width of the frame: with the largest ones most poses of trial lie within a pulley.
SHARES = (0.02, 0.1, 0.3)
SIZES = [("1T", 2), ("2T", 3), ("3T", 4), ("1R2T", 7), ("3R", 4), ("2R3T", 6), ("3R3T", 8)]
MORE = [("1T", 1), ("2T", 5), ("3T", 3), ("3T", 8), ("1R2T", 3), ("3R", 6), ("2R3T", 8), ("3R3T", 6), ("3R3T", 9)]


def limited_robot(rng, pattern, n):
    """A robot with other limits for each cable, all finite; spools beside a guide, where a pulley's side is unique."""
    drawn = cable_robots.any_robot(rng, pattern, n, suspended=pattern != "3R")
    if pattern == "1T":
        drawn = dataclasses.replace(drawn, base=drawn.base + np.array([0.4, 0.2, 0.0]))
    force = drawn.mass * G
    return drawn.with_bounds(force * rng.uniform(0.0, 0.1, drawn.cables), force * rng.uniform(1.0, 3.0, drawn.cables))


def margins(drawn, poses, radius, **changes):
    """Margins in newtons at poses of the file, and the verdicts."""
    drawn = dataclasses.replace(drawn, **changes)
    places, turns = poses
    quaternions = None
    if drawn.pattern not in cable_robots.POINT_MASSES:
        quaternions = Rotation.from_matrix(turns).as_quat(scalar_first=True)
    robot = cspr_jax.with_cables(made(drawn), pulley_radius=radius)
    return cspr_jax.workspace(robot, places, quaternions, tension_min=drawn.low, tension_max=drawn.high)


def poses_of(drawn, rng, count):
    drawn_poses = [drawn.pose(rng) for _ in range(count)]
    return np.array([place for place, _ in drawn_poses]), np.array([turn for _, turn in drawn_poses])


@pytest.mark.quick("3T-4-0.1", "3R3T-8-0.1")
@pytest.mark.parametrize("fraction", [pytest.param(SHARES[0], marks=pytest.mark.thorough), *SHARES[1:]])
@pytest.mark.parametrize(("pattern", "n"), [*SIZES, *(pytest.param(*size, marks=pytest.mark.soak) for size in MORE)])
def test_identities_of_the_margin(pattern, n, fraction):
    """Narrower limits shift it, other units scale it, another order of the cables changes nothing."""
    rng = np.random.default_rng([n, int(100 * fraction)])
    drawn = limited_robot(rng, pattern, n)
    radius = fraction * cable_robots.HALF[0] * rng.uniform(0.5, 1.0, n)
    poses, force = poses_of(drawn, rng, 64), drawn.mass * G
    reference = margins(drawn, poses, radius)
    finite = np.isfinite(reference.margin)
    assert finite.sum() >= 8
    # A place within a pulley has no tensions.
    assert (reference.verdict[np.isnan(reference.margin)] == Verdict.NOT_FINITE).all()

    def check(answers, expected):
        np.testing.assert_array_equal(np.isfinite(answers.margin), finite)
        np.testing.assert_allclose(answers.margin[finite], expected[finite], atol=1e-8 * drawn.high.max())

    narrower = 0.02 * force
    low, high = drawn.low + narrower, drawn.high - narrower
    check(margins(drawn, poses, radius, low=low, high=high), reference.margin - narrower)
    heavier = {"mass": 3.0 * drawn.mass, "low": 3.0 * drawn.low, "high": 3.0 * drawn.high}
    check(margins(drawn, poses, radius, **heavier), 3.0 * reference.margin)
    order = rng.permutation(n)
    relabelled = {name: getattr(drawn, name)[order] for name in ("base", "platform", "low", "high")}
    check(margins(drawn, poses, radius[order], **relabelled), reference.margin)
    larger = {"base": 2.0 * drawn.base, "platform": 2.0 * drawn.platform, "arm": tuple(2.0 * np.array(drawn.arm))}
    check(margins(drawn, (2.0 * poses[0], poses[1]), 2.0 * radius, **larger), reference.margin)


@pytest.mark.quick("2T-3-0.02", "3T-4-0.1", "1R2T-7-0.1")
@pytest.mark.parametrize("fraction", SHARES)
@pytest.mark.parametrize(
    ("pattern", "n"),
    [
        *(pytest.param(*size, marks=() if size in SIZES[:4] else pytest.mark.thorough) for size in SIZES),
        *(pytest.param(*size, marks=pytest.mark.soak) for size in MORE),
    ],
)
def test_margins_are_those_of_linear_programs(pattern, n, fraction):
    rng = np.random.default_rng([n, int(100 * fraction)])
    drawn = limited_robot(rng, pattern, n)
    radius, axes = fraction * cable_robots.HALF[0] * rng.uniform(0.5, 1.0, n), np.tile(UP, (n, 1))
    places, turns = poses_of(drawn, rng, 40)
    answers = margins(drawn, (places, turns), radius)
    checked = 0
    for i, (place, turn) in enumerate(zip(places, turns, strict=True)):
        wheels = {"pulley_radii": radius, "pulley_axes": axes}
        try:
            matrix = oracle.wrench_matrix(drawn.base, drawn.platform, place, turn, drawn.pattern, **wheels)
        except ValueError:  # a cable ends within its pulley
            assert answers.verdict[i] == Verdict.NOT_FINITE and np.isnan(answers.margin[i])
            continue
        rows = oracle.rows(drawn.pattern, drawn.platform, turn)
        arm = turn @ np.asarray(drawn.arm) if drawn.pattern == "3R" else (0, 0, 0)
        expected = oracle.tension_margin(matrix, oracle.weight(rows, drawn.mass, arm), drawn.low, drawn.high)
        assert answers.margin[i] == pytest.approx(expected, abs=3e-8 * drawn.high.max()), (place, turn)
        checked += 1
    assert checked >= 8


def test_a_middle_cable_whose_pulley_holds_poses_of_trial():
    """Planar mass on three cables in a line: each smallest tension counts, and all together shift the margin."""
    plain = cspr_jax.point_mass([[-2, 0, 0], [0.1, 0, 0], [2, 0, 0]], mass=1.0, planar=True, z_axis="up")
    robot = cspr_jax.with_cables(plain, pulley_radius=0.2)
    places = [[0.05, 0, -1.5], [0.5, 0, -1.5], [-0.7, 0, -2.0]]
    free, middle, equal = (
        cspr_jax.workspace(robot, places, tension_min=np.array(low)).margin
        for low in ([0.0, 0.0, 0.0], [0.0, 0.5, 0.0], [0.5, 0.5, 0.5])
    )
    np.testing.assert_allclose(free - equal, 0.5, atol=1e-12)
    assert (middle < free - 0.1).all() and (middle > equal).all()


def test_one_cable_on_a_guide():
    """Its only spool is a box without width, where no cable has a direction."""
    robot = cspr_jax.point_mass([[0, 0, 1.0]], mass=2.0, pattern="1T", z_axis="up")
    answers = cspr_jax.workspace(robot, [[0, 0, -1.0], [0, 0, 2.0]], tension_min=1.0, tension_max=100.0)
    np.testing.assert_allclose(answers.margin, [2.0 * 9.81 - 1.0, -2.0 * 9.81 - 1.0])


def test_pulleys_that_fill_the_frame():
    """No pose among the spools is regular: structure comes from poses around them."""
    plain = cspr_jax.point_mass([[-0.1, 0, 0], [0.1, 0, 0], [0.0, 0.15, 0]], mass=1.0, z_axis="up")
    places, radius = np.array([[0.0, 0.05, -4.0], [0.3, 0.2, -6.0]]), np.full(3, 1.5)
    answers = cspr_jax.workspace(cspr_jax.with_cables(plain, pulley_radius=radius), places, tension_min=0.5)
    for place, margin in zip(places, answers.margin, strict=True):
        wheels = {"pulley_radii": radius, "pulley_axes": np.tile(UP, (3, 1))}
        matrix = oracle.wrench_matrix(plain.base_points, np.zeros((3, 3)), place, np.eye(3), "3T", **wheels)
        assert margin == pytest.approx(oracle.tension_margin(matrix, [0, 0, 9.81], 0.5, np.inf), abs=1e-9)


@pytest.mark.parametrize("structure", [choices_of, base_order])
def test_structure_refuses_what_is_no_number(structure):
    matrices = np.random.default_rng(0).normal(size=(4, 6, 8))
    matrices[1, 2, 3] = np.nan
    for refused in (matrices, matrices[:0]):
        with pytest.raises(ValueError, match="finite"):
            structure(refused)
