"""Proofs over whole motions against dense samples: the same verdicts, margins and intervals of failure."""

from functools import partial

import jax
import numpy as np
import pytest
from support.splines import random_spline

import cspr_jax
from cspr_jax.motions.block_slacks import BlockSlacks, block_slacks, criteria
from cspr_jax.motions.time_proof import time_proof
from cspr_jax.robots import cables
from cspr_jax.robots.kernel_axes import centred
from cspr_jax.robots.limits import Limits
from cspr_jax.robots.tension_distribution import centred as most_central
from cspr_jax.robots.wrench_sets import tension_range
from cspr_jax.schema.verdicts import Verdict

# Robots, where they move and how far, m, their tilt, and limits that some motions break.
CASES = {
    "transition-planar": ((0.0, 0.0, 2.0), 0.5, 0.0, {"cable_speed_max": 0.5}),
    "prototype": ((0.0, 0.0, 1.0), 0.12, 0.0, {"cable_speed_max": 0.1, "tension_max": 1.0}),
    "boralugoda-rectangle": ((0.0, 0.0, 2.0), 1.0, 0.0, {"tension_max": 300.0, "cable_length_max": 4.0}),
    "laval-mssm": ((0.0, 0.0, 1.7), 0.3, 0.1, {"cable_speed_max": 0.4, "cable_acceleration_max": 0.6}),
    "cogiro": ((0.0, 0.0, 4.0), 2.0, 0.08, {"tension_min": 100.0, "tension_max": 1500.0, "cable_speed_max": 2.0}),
}
SAMPLES = 4001


@pytest.fixture(autouse=True)
def float64():
    with jax.enable_x64(True):
        yield


def case(name: str, seed: int, wheels: float = 0.0):
    robot = cspr_jax.load_robot(name)
    if wheels:
        robot = cspr_jax.with_cables(robot, pulley_radius=np.linspace(0.0, wheels, robot.n_cables))
    robot = centred(robot)[0]
    middle, size, tilt, limits = CASES[name]
    numbers = {key: np.full(robot.n_cables, value) for key, value in limits.items()}
    spline, table = random_spline(seed, middle=middle, size=size, tilt=tilt)
    return robot, Limits(**numbers, floor=np.asarray(middle[2] + 0.9 * size)), spline, float(table.x[-1])


def sampled(robot, limits: Limits, spline) -> np.ndarray:
    """Slacks at equidistant instants, from the readable formulas."""
    low, high = tension_range(robot, limits)
    unit = cables.wrench_units(robot)

    def one(tau):
        state = spline.state(tau)
        length, rate, bend = cables.cable_motion(robot, state)
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
            (abs(bend), limits.cable_acceleration_max),
        ):
            parts += [] if limit is None else [limit - value]
        return jax.numpy.concatenate(parts)

    return np.asarray(jax.jit(jax.vmap(one))(np.linspace(0.0, 1.0, SAMPLES)))


# Each robot compiles kernels of its own: one point mass, and one on more cables than it needs, are quick enough.
QUICK = ("prototype", "boralugoda-rectangle")


@pytest.mark.parametrize(
    ("name", "wheels"),
    [(name, 0.0) if name in QUICK else pytest.param(name, 0.0, marks=pytest.mark.thorough) for name in CASES]
    + [pytest.param(name, 0.05, marks=[] if name == QUICK[0] else [pytest.mark.thorough]) for name in CASES],
)
def test_proofs_agree_with_samples(name, wheels):
    """The largest pulleys have a radius of `wheels`, m."""
    failures = 0
    for seed in range(3):
        robot, limits, spline, duration = case(name, seed, wheels)
        proof = time_proof(partial(block_slacks, robot, limits, spline.bounds), duration)
        slacks, times = sampled(robot, limits, spline), np.linspace(0.0, duration, SAMPLES)
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
