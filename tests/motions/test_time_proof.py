"""Proofs over whole motions against dense samples: the same verdicts, margins and intervals of failure."""

import dataclasses
from functools import partial

import jax
import numpy as np
import pytest
from support.motions import states_along
from support.platforms import crossed_robot
from support.splines import random_spline

import cspr_jax
from cspr_jax.curves import interpolation
from cspr_jax.curves.spline import Spline, SplineBatch
from cspr_jax.numerics.tolerances import TOUCHED
from cspr_jax.robots import cables
from cspr_jax.robots.contacts import clearance, interference, interference_lanes
from cspr_jax.robots.model import shapes
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.platform import platform_robot
from cspr_jax.robots.model.point_mass import plane_normal, spool_radius
from cspr_jax.robots.model.pulleys import exits
from cspr_jax.robots.statics import wrench_balance
from cspr_jax.robots.statics.kernel_axes import centred
from cspr_jax.robots.statics.wrench_sets import tension_range
from cspr_jax.robots.tensions.tension_distribution import centred as most_central
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.verification.bounds.block_slacks import BlockSlacks, block_slacks
from cspr_jax.verification.criteria import Criterion, criteria
from cspr_jax.verification.time_proof import time_proof, time_proofs

# Robots, where they move and how far, m, their tilt, and limits that some motions break.
CASES = {
    "transition-planar": ((0.0, 0.0, 2.0), 0.5, 0.0, {"cable_speed_max": 0.5}),
    "prototype": ((0.0, 0.0, 1.0), 0.12, 0.0, {"cable_speed_max": 0.1, "tension_max": 1.0}),
    "boralugoda-rectangle": ((0.0, 0.0, 2.0), 1.0, 0.0, {"tension_max": 300.0, "cable_length_max": 4.0}),
    "laval-mssm": ((0.0, 0.0, 1.7), 0.3, 0.1, {"cable_speed_max": 0.4, "cable_acceleration_max": 0.6}),
    "cogiro": ((0.0, 0.0, 4.0), 2.0, 0.08, {"tension_min": 100.0, "tension_max": 1500.0, "cable_speed_max": 2.0}),
}
SAMPLES = 4001
CORNERS = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3), axis=-1).reshape(-1, 3)


def case(name: str, seed: int, wheels: float = 0.0):
    robot = cspr_jax.load_robot(name)
    if wheels:
        robot = cspr_jax.with_cables(robot, pulley_radius=np.linspace(0.0, wheels, robot.n_cables))
    robot = centred(robot)[0]
    middle, size, tilt, limits = CASES[name]
    numbers = {key: np.full(robot.n_cables, value) for key, value in limits.items()}
    spline, table = random_spline(seed, middle=middle, size=size, tilt=tilt)
    return robot, Limits(**numbers, floor=np.asarray(middle[2] + 0.9 * size)), spline, float(table.x[-1])


def of_pose(robot, state) -> list:
    """Slacks of a pose: determinant, depth below the spools, cables from each other and from the platform's face."""
    parts = []
    if robot.n_cables == robot.dof:
        if robot.pattern == "3R3T":
            size = wrench_balance.normalised_determinant(robot, state.position, state.rotation)
            parts.append(abs(size)[None] - wrench_balance.SINGULAR)
        parts.append((plane_normal(robot) @ state.position)[None])
    if robot.pattern == "3R3T":
        near = interference.contacts(robot)
        base, attached = robot.base_points, state.position[None] + robot.platform_points @ state.rotation.T
        if robot.pulleys is not None:
            base = exits(base, robot.pulleys.axes, robot.pulleys.radius, attached).point
        rays, (i, j) = attached - base, near.pairs.T
        apart = interference.between(base[i], rays[i], base[j], rays[j])
        parts.append(jax.numpy.sqrt((apart**2).sum(1)))
        if shapes.is_flat(np.asarray(robot.platform_points)):
            columns = [tuple(side.T) for side in (near.sides[:, 0], near.sides[:, 1], -(rays @ state.rotation))]
            left = interference_lanes.residual((columns[0], columns[1]), tuple(near.normal), columns[2])
            parts.append(jax.numpy.sqrt(sum(x * x for x in left)))
    return parts


def sampler(robot, limits: Limits):
    """Slacks of splines at equidistant instants, from the readable formulas."""
    low, high = tension_range(robot, limits)
    unit = cables.wrench_units(robot)

    def one(spline, tau):
        state = spline.state(tau)
        length, rate, second_derivative = cables.cable_motion(robot, state)
        if robot.n_cables > robot.dof:
            matrix, wrench = robot.wrench_matrix(state) / unit[:, None], robot.inertial_wrench(state) / unit
            parts = [most_central(matrix, wrench, low, high)[1][None]]
        else:
            tension = cables.tensions(robot, state)
            parts = [tension - low] + ([] if limits.tension_max is None else [high - tension])
        parts.append((limits.floor - state.position[2])[None])
        for value, limit in (
            (length, limits.cable_length_max),
            (abs(rate), limits.cable_speed_max),
            (abs(second_derivative), limits.cable_acceleration_max),
        ):
            parts += [] if limit is None else [limit - value]
        parts += of_pose(robot, state)
        if hasattr(robot, "platform_points"):  # the lowest attachment point
            parts.append((limits.floor - state.position[2] - (robot.platform_points @ state.rotation[2]).max())[None])
        return jax.numpy.concatenate(parts)

    slacks = jax.jit(jax.vmap(one, (None, 0)))
    return lambda spline: np.asarray(slacks(spline, np.linspace(0.0, 1.0, SAMPLES)))


# Each robot compiles kernels of its own: one point mass, and one on more cables than it needs, are quick enough.
QUICK = ("prototype", "boralugoda-rectangle")


@pytest.mark.ci("laval-mssm-0.05")
@pytest.mark.quick("prototype-0.05")
@pytest.mark.parametrize(
    ("name", "wheels"),
    [(name, 0.0) if name in QUICK else pytest.param(name, 0.0, marks=pytest.mark.thorough) for name in CASES]
    + [pytest.param(name, 0.05, marks=[] if name == QUICK[0] else [pytest.mark.thorough]) for name in CASES],
)
def test_proofs_agree_with_samples(name, wheels):
    """The largest pulleys have a radius of `wheels`, m."""
    failures, slacks_of = 0, sampler(*case(name, 0, wheels)[:2])
    for seed in range(3):
        robot, limits, spline, duration = case(name, seed, wheels)
        proof = time_proof(partial(block_slacks, robot, limits, spline.bounds), duration)
        slacks, times = slacks_of(spline), np.linspace(0.0, duration, SAMPLES)
        rows = criteria(robot, limits)
        assert slacks.shape[1] == len(rows) == len(proof.low)
        least, size = slacks.min(0), np.abs(slacks).max(0)
        # No sample lies below what is proved; and the bounds of the smallest slack are close.
        assert (least >= proof.low - 1e-9 * size).all()
        close = 0.02 * np.abs(least) + 2e-3 * size
        assert (np.abs(proof.high - least) <= close).all() and (np.abs(proof.low - least) <= close).all()
        nowhere = np.zeros(SAMPLES, bool)
        for i in range(len(rows)):
            inside = [(a <= times) & (times <= b) for a, b in proof.failing[i]]
            fails = np.logical_or.reduce([nowhere, *inside])
            near = [(a - 1e-6 <= times) & (times <= b + 1e-6) for a, b in proof.open[i]]
            unknown = np.logical_or.reduce([nowhere, *near])
            np.testing.assert_array_equal(fails[~unknown], slacks[~unknown, i] < 0.0)
            assert all(b - a <= 3e-6 for a, b in proof.open[i])
            failures += len(proof.failing[i])
    assert failures > 0


def test_intervals_of_failure_are_exact():
    """Of a slack whose roots are known."""
    roots = np.array([0.7, 2.2, 5.9])

    def slacks(start, end):
        middle, half = 0.5 * (start + end), 0.5 * (end - start)
        value = -np.prod(middle[:, None] - roots, axis=1) / 10.0
        reach = half * 12.0  # no slope is steeper
        return BlockSlacks((value - reach)[:, None], (value + reach)[:, None])

    proof = time_proof(slacks, 7.0, resolution=1e-7)
    np.testing.assert_allclose(proof.failing[0], [[0.7, 2.2], [5.9, 7.0]], atol=2e-6)
    assert len(proof.open[0]) == 3 and all(b - a < 5e-6 for a, b in proof.open[0])


@pytest.mark.thorough
@pytest.mark.parametrize("name", QUICK)
def test_several_motions_have_the_proofs_of_each(name):
    splines = [random_spline(seed, middle=CASES[name][0], size=CASES[name][1], count=4 + seed)[0] for seed in range(3)]
    splines = [Spline(s.knots, s.position, None, s.z0) for s in splines]
    robot, limits = case(name, 0)[:2]
    several = SplineBatch(splines)
    together = time_proofs(
        lambda motion, start, end: block_slacks(robot, limits, partial(several.bounds, motion), start, end),
        several.durations,
    )
    assert len({proof.blocks for proof in together}) > 1 and any(len(x) for x in together[1].failing)
    for spline, proof in zip(splines, together, strict=True):
        alone = time_proof(partial(block_slacks, robot, limits, spline.bounds), float(spline.knots[-1]))
        jax.tree.map(np.testing.assert_array_equal, dataclasses.asdict(proof), dataclasses.asdict(alone))


def test_no_motions():
    assert time_proofs(lambda motion, start, end: BlockSlacks(start, end), np.zeros(0)) == []


def test_roots_take_few_blocks():
    """Lines leave a part that shrinks with the square of its length."""
    calls = []

    def slacks(start, end):
        calls.append(len(start))
        middle, half = 0.5 * (start + end), 0.5 * (end - start)
        value, slope = np.sin(middle), np.cos(middle) * half
        low, high = ((value + side * 0.5 * half**2)[:, None] for side in (-1.0, 1.0))
        rise = 2.0 * slope[:, None]
        reach = np.abs(slope)[:, None]
        return BlockSlacks(low - reach, high + reach, rise, rise)

    proof = time_proof(slacks, 9.0)
    np.testing.assert_allclose(proof.failing[0], [[np.pi, 2.0 * np.pi]], atol=1e-6)
    assert len(calls) < 14 and proof.blocks < 70
    assert proof.low[0] <= -1.0 <= proof.high[0] and proof.high[0] - proof.low[0] < 0.02


def test_what_stays_open_is_told():
    """Bounds that never close leave the whole motion open, and end."""
    proof = time_proof(lambda a, b: BlockSlacks(np.full((len(a), 1), -1.0), np.full((len(a), 1), 1.0)), 1.0)
    np.testing.assert_array_equal(proof.open[0], [[0.0, 1.0]])
    assert proof.failing[0].size == 0 and (proof.low, proof.high) == (-1.0, 1.0)


def test_criteria_name_cables():
    robot, limits, _, _ = case("prototype", 0)
    rows = criteria(robot, limits)
    assert [row.flag for row in rows[:3]] == [Verdict.SLACK_CABLE] * 3 and [row.cables for row in rows[:3]] == [
        (0,),
        (1,),
        (2,),
    ]
    assert (rows[6].flag, rows[6].cables, rows[6].unit) == (Verdict.BELOW_FLOOR, (), "m")


def test_which_poses_a_robot_may_have():
    """The determinant of bodies, and the depth of what hangs below its spools, where the motion determines tensions."""
    both = {Verdict.SINGULAR, Verdict.ABOVE_SPOOLS}
    wanted = {
        "transition-planar": {Verdict.ABOVE_SPOOLS},
        "prototype": {Verdict.ABOVE_SPOOLS},
        "laval-mssm": both,
        "boralugoda-planar-three": set(),
        "cogiro": set(),
    }
    for name, flags in wanted.items():
        assert {row.flag for row in criteria(cspr_jax.load_robot(name), Limits())} & both == flags, name


def tilting(times, angles, heights) -> interpolation.Spline:
    """A platform that tilts about x."""
    half = 0.5 * np.asarray(angles)
    zero = np.zeros_like(half)
    quaternions = np.stack([np.cos(half), np.sin(half), zero, zero], axis=1)
    return interpolation.interpolated(times, np.stack([zero, zero, np.asarray(heights)], axis=1), quaternions)


@pytest.mark.thorough
@pytest.mark.parametrize("shift", [0.0, 0.0137])
def test_instants_at_which_cables_pass_each_other(shift):
    """They count, also at the border of two blocks; the cables are apart at all other times."""
    robot, times = crossed_robot(), np.array([0.0, 1.0, 2.0])
    spline = tilting(times, [-0.02 + shift, shift, 0.02 + shift], [0.5, 0.5, 0.5])
    proof = time_proof(partial(block_slacks, robot, Limits(), spline.bounds), 2.0)
    at = criteria(robot, Limits()).index(Criterion(Verdict.CABLE_CABLE, (0, 1), "m"))
    fine = np.linspace(0.0, 2.0, 200_001)
    tilt = states_along(spline, fine / 2.0).quaternion[:, 1]
    instant = fine[np.argmin(np.abs(tilt))]
    assert proof.failing[at].shape == (1, 2) and abs(proof.failing[at] - instant).max() < 1.1e-5
    assert np.diff(proof.failing[at])[0, 0] < 2e-6
    assert all(np.abs(interval - instant).max() < 1.1e-5 for interval in proof.open[at])


@pytest.mark.thorough
def test_thick_cables_obstacles_and_floors():
    """Criteria of a scene: their order and cables, and intervals of failure at samples."""
    robot = centred(cspr_jax.load_robot("cogiro"))[0]
    bodies = [shapes.box([2.0, -2.0, 5.0], [1.0, 1.0, 3.0]), shapes.sphere([1.0, 1.0, 3.0], 0.3)]
    around = clearance.scene(robot, diameter=0.01, obstacles=bodies, body=shapes.box([0.0, 0.0, 0.0], [0.6] * 3))
    limits = Limits(floor=np.asarray(4.9))
    rows = criteria(robot, limits, around)
    touched = TOUCHED * float(spool_radius(robot))
    floor = Criterion(Verdict.BELOW_FLOOR, (), "m", allowed=4.9, sense="most", allowance=touched)
    assert rows[1:3] == [floor, Criterion(Verdict.CABLE_CABLE, (0, 1), "m")]
    assert rows[-1] == rows[1] and rows[-2] == Criterion(Verdict.OBSTACLE, (), "m", 1)
    assert Criterion(Verdict.OBSTACLE, (3,), "m", 1) in rows and Criterion(Verdict.CABLE_PLATFORM, (3,), "m") in rows
    failures = 0
    for seed in range(2):
        spline, table = random_spline(seed, middle=(0.0, 0.0, 4.0), size=1.0, tilt=0.05)
        duration = float(table.x[-1])
        slacks = partial(block_slacks, robot, limits, spline.bounds, scene=around)
        proof, times = time_proof(slacks, duration), np.linspace(0.0, duration, SAMPLES)
        state = states_along(spline, times / duration)
        exact = clearance.clearances(around, np.asarray(state.position), np.asarray(state.quaternion))
        for kinds, values in (
            ((Verdict.OBSTACLE,), exact.obstacles),
            ((Verdict.CABLE_CABLE,), exact.cables),
            ((Verdict.CABLE_PLATFORM,), exact.platform),
        ):
            fails, unknown = np.zeros(SAMPLES, bool), np.zeros(SAMPLES, bool)
            for i in [i for i, row in enumerate(rows) if row.flag in kinds]:
                fails |= np.any([(a <= times) & (times <= b) for a, b in proof.failing[i]] or [fails], axis=0)
                unknown |= np.any(
                    [(a - 1e-6 <= times) & (times <= b + 1e-6) for a, b in proof.open[i]] or [fails & False], axis=0
                )
            np.testing.assert_array_equal(fails[~unknown], values[~unknown] < 0.0)
            assert unknown.sum() < 20
            failures += fails.any()
        corners = np.asarray(state.position)[:, None] + 0.3 * CORNERS @ np.asarray(state.rotation).swapaxes(1, 2)
        assert proof.low[-1] == pytest.approx(4.9 - corners[..., 2].max(), abs=5e-3)
    assert failures > 0


@pytest.mark.thorough
def test_planar_cables_that_cross():
    """Cables of a planar platform cross while it is turned far."""
    base = [[-2.0, 0.0, -2.0], [2.0, 0.0, -2.0], [2.0, 0.0, 2.0]]
    points = [[-0.2, 0.0, 0.0], [0.2, 0.0, 0.0], [0.2, 0.0, 0.1]]
    robot = platform_robot(base, points, mass=1.0, inertia=np.eye(3), pattern="1R2T")
    half = 0.5 * np.array([0.0, 1.5, 3.0])
    quaternions = np.stack([np.cos(half), 0.0 * half, np.sin(half), 0.0 * half], axis=1)
    spline = interpolation.interpolated(np.array([0.0, 1.0, 2.0]), np.zeros((3, 3)), quaternions)
    proof = time_proof(partial(block_slacks, robot, Limits(), spline.bounds), 2.0)
    rows = criteria(robot, Limits())
    assert all(row.flag != Verdict.ABOVE_SPOOLS for row in rows)
    at = rows.index(Criterion(Verdict.CABLE_CABLE, (0, 1), "m"))
    state = states_along(spline, np.linspace(0.0, 1.0, 2001))
    ends = np.asarray(state.rotation) @ np.asarray(robot.platform_points)[:2].T
    (ax, az), (bx, bz) = (ends[:, ::2, k].T for k in range(2))

    def side(px, pz, qx, qz, rx, rz):
        return (qx - px) * (rz - pz) - (qz - pz) * (rx - px)

    crossed = (side(-2.0, -2.0, ax, az, 2.0, -2.0) * side(-2.0, -2.0, ax, az, bx, bz) < 0.0) & (
        side(2.0, -2.0, bx, bz, -2.0, -2.0) * side(2.0, -2.0, bx, bz, ax, az) < 0.0
    )
    times = np.linspace(0.0, 2.0, 2001)
    fails = np.any([(a <= times) & (times <= b) for a, b in proof.failing[at]], axis=0)
    assert 100 < crossed.sum() < 1900 and (fails != crossed).sum() <= 2
