"""Free motions of platforms on six cables stay on one side of singular poses."""

import jax
import numpy as np
import pytest
from oracles import platform as oracle
from support.commands import plan
from support.motions import states_along
from support.platforms import general, ours, random_pose

from cspr_jax.arithmetic.elementary import double_precision, leaf
from cspr_jax.free.free_motion import free_motion
from cspr_jax.free.instants import determinant, instant_values, residuals
from cspr_jax.free.poses import FreePoses, determinants, divided
from cspr_jax.free.question import FreeQuestion, FreeSettings
from cspr_jax.motions.amplitudes import named
from cspr_jax.motions.problem import Problem
from cspr_jax.robots.limits import Limits
from cspr_jax.robots.wrench_balance import at_rest

FREE = np.full((2, 6), np.nan)
GREENLINE = """
schema = 1
robot = "greenline"
family = "free"
z0 = 2.0
tension_max = 10.0
[[pose]]
rest = true
[[pose]]
position = [0.3, 0.2, 2.2]
"""


def poses(positions, quaternions):
    return FreePoses(np.array(positions), np.array(quaternions), np.zeros((2, 3)), FREE, 1.4)


def problem_of(robot, tension=60.0):
    return Problem(ours(robot), Limits(tension_max=leaf(np.full(6, tension))), named("A1"))


def expected(robot, position, rotation):
    """Determinant of unit pulls and their moments over the size of the platform."""
    arms = robot.platform @ rotation.T
    pulls = robot.base - position - arms
    pulls /= np.linalg.norm(pulls, axis=1, keepdims=True)
    size = np.sqrt(np.mean(np.sum(robot.platform**2, axis=1)))
    return np.linalg.det(np.concatenate([pulls, np.cross(arms, pulls) / size], axis=1))


def test_determinant_is_that_of_the_oracle():
    rng, robot = np.random.default_rng(0), general()
    with double_precision():
        prepared = ours(robot)
        for _ in range(20):
            position = rng.uniform([-0.4, -0.4, 0.8], [0.4, 0.4, 1.8])
            turn = oracle.matrix(rng.normal(size=4))
            turn, _ = np.linalg.qr(turn)
            here = float(determinant(prepared, at_rest(leaf(position), leaf(turn))))
            assert here == pytest.approx(expected(robot, position, turn), rel=1e-9)


def test_second_derivatives_at_a_singular_pose_are_numbers():
    """All cables are vertical: the matrix has rank 3."""
    robot, still = general(), leaf(np.eye(3))
    robot = oracle.Robot(robot.platform * [1.0, 1.0, 0.0], robot.platform, robot.mass, robot.inertia)
    with double_precision():
        prepared = ours(robot)
        value, bend = (
            f(leaf(np.array([0.0, 0.0, 1.4])))
            for f in (
                lambda p: determinant(prepared, at_rest(p, still)),
                jax.hessian(lambda p: determinant(prepared, at_rest(p, still))),
            )
        )
    assert abs(float(value)) < 1e-12
    assert np.isfinite(bend).all()


def test_derivatives_are_finite_differences():
    """By coordinates and their derivatives; the determinant is the last value, and changes with coordinates alone."""
    rng, robot, step = np.random.default_rng(4), general(), 1e-5
    place = np.zeros((1, 3, 6))
    place[0] = np.array([0.2, -0.1, 1.3, 0.1, -0.2, 0.15]) + 0.1 * rng.normal(size=(3, 6))
    tensions, reference, duration = rng.uniform(0.1, 0.5, (1, 6)), np.array([[1.0, 0.0, 0.0, 0.0]]), np.array([0.8])
    # Of the wrench, the depth below the spools, and the determinant.
    multipliers = rng.normal(size=(1, 8))

    with double_precision():
        problem = problem_of(robot)

        def at(change):
            moved = place + change.reshape(1, 3, 6)
            fixed = problem.robot, problem.limits, None, reference, moved, duration, tensions
            return instant_values(*fixed, multipliers), residuals(*fixed)

        here, missed = at(np.zeros(18))
        sides = [[at(sign * step * row) for sign in (-1.0, 1.0)] for row in np.eye(18)]
    np.testing.assert_allclose(here.residual, missed, atol=1e-13)
    slopes = np.stack([(after[1] - before[1])[0] / (2.0 * step) for before, after in sides], axis=-1)
    np.testing.assert_allclose(here.slope[0, :, :18], slopes, atol=1e-6)
    bends = [multipliers[0] @ (after[0].slope - before[0].slope)[0, :, :18] / (2.0 * step) for before, after in sides]
    np.testing.assert_allclose(here.bend[0, :18, :18], bends, atol=1e-5)
    assert here.slope[0, -1, :6].any()
    assert not here.slope[0, -1, 6:].any()
    assert here.residual[0, -1] == pytest.approx(-at_place(problem, place[0, 0]), rel=1e-12)


def at_place(problem, place):
    """The determinant at coordinates, of which the last three are a Rodrigues vector."""
    quaternion = np.array([1.0, *place[3:]])
    turn = oracle.matrix(quaternion / np.linalg.norm(quaternion))
    with double_precision():
        return float(determinant(problem.robot, at_rest(leaf(place[:3]), leaf(turn))))


@pytest.mark.parametrize("seed", range(3))
def test_bounds_are_on_the_side_of_both_ends(seed):
    rng = np.random.default_rng(seed)
    with double_precision():
        problem = problem_of(oracle.mssm())
        ends = [random_pose(rng) for _ in range(2)]
        asked = poses(*([end[k] for end in ends] for k in (0, 1)))
        values = determinants(problem, asked)
        question = FreeQuestion.of(problem, None, asked, FreeSettings())
        tasks, place = question.tasks(4, 3), question.limits.determinant
        low, high = tasks.low[..., place], tasks.high[..., place]
        rows = divided(problem, asked)
    if values[0] * values[1] < 0.0:
        np.testing.assert_allclose(rows, [[0.0, *values]])
        assert np.isneginf(low).all()
        assert np.isposinf(high).all()
    else:
        assert not len(rows)
        assert ((low <= values.min()) & (values.max() <= high)).all()
        assert ((low > 0.0) | (high < 0.0)).all()


def test_nothing_is_sought_across_singular_poses(tmp_path):
    """Below and above the spools."""
    code, out, err = plan(tmp_path, GREENLINE)
    assert code == 1
    line = " ".join((out + err).split())
    assert "pose[0] and pose[1] lie on opposite sides of singular poses (determinants -6.31e-06 and 4.45e-06)" in line
    assert "the search found no motion" not in line


@pytest.mark.thorough
def test_a_motion_goes_round_singular_poses():
    """Without the bound its determinant changes sign on the way, in all starts that converge."""
    ends = poses([[-0.3, 0.1, 1.8], [0.3, -0.2, 2.2]], [[1.0, 0.0, 0.0, 0.0]] * 2)
    with double_precision():
        problem = problem_of(oracle.mssm(), 40.0)
        motion = free_motion(problem, None, ends, FreeSettings(intervals=24, instants=3, starts=4))
        (spline,) = motion.motions
        states = states_along(spline, np.linspace(0.0, 1.0, 201))
        values = jax.vmap(lambda p, r: determinant(problem.robot, at_rest(p, r)))(states.position, states.rotation)
    assert motion.is_optimal
    assert len({*np.sign(values).tolist()}) == 1
