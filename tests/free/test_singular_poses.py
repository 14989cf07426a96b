"""Free motions of platforms on six cables stay on one side of singular poses."""

from functools import partial

import jax
import numpy as np
import pytest
from oracles import platform as oracle
from support.commands import plan
from support.motions import states_along
from support.platforms import general, ours, random_pose

import cspr_jax
from cspr_jax.families.free.free_motion import free_motion
from cspr_jax.families.free.poses import FreePoses, determinants, divided
from cspr_jax.families.free.problem import FreeQuestion, FreeSettings
from cspr_jax.families.free.search.derivatives import equation_values, residuals
from cspr_jax.families.free.search.determinants import determinant, unit_wrenches, with_derivatives
from cspr_jax.motion.amplitudes import named
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.elementary import as_float64, double_precision
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.statics.wrench_balance import at_rest

FREE = np.full((2, 6), np.nan)
# Spools and attachment points of a planar platform on three cables, m.
PLANAR = (
    np.array([[-1.0, 0.0, 0.0], [0.8, 0.0, 0.1], [1.1, 0.0, -0.1]]),
    np.array([[-0.2, 0.0, -0.1], [0.25, 0.0, -0.1], [0.1, 0.0, 0.2]]),
)
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


def robot_of(robot, pattern="3R3T"):
    if pattern == "3R3T":
        return ours(robot)
    return cspr_jax.platform(
        robot.base, robot.platform, mass=robot.mass, inertia=robot.inertia, pattern=pattern, z_axis="down"
    )


def problem_of(robot, tension=60.0):
    return Problem(ours(robot), Limits(tension_max=as_float64(np.full(6, tension))), named("A1"))


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
        found = jax.jit(lambda position, turn: determinant(prepared, at_rest(position, turn)))
        for _ in range(20):
            position = rng.uniform([-0.4, -0.4, 0.8], [0.4, 0.4, 1.8])
            turn = oracle.matrix(rng.normal(size=4))
            turn, _ = np.linalg.qr(turn)
            here = float(found(as_float64(position), as_float64(turn)))
            assert here == pytest.approx(expected(robot, position, turn), rel=1e-9)


def test_second_derivatives_at_a_singular_pose_are_numbers():
    """All cables are vertical: the matrix has rank 3, and cofactors of the whole vanish."""
    robot, still = general(), as_float64(np.eye(3))
    robot = oracle.Robot(robot.platform * [1.0, 1.0, 0.0], robot.platform, robot.mass, robot.inertia)
    with double_precision():
        prepared = ours(robot)
        wrenches = partial(with_derivatives, lambda p: unit_wrenches(prepared, at_rest(p, still)))
        regular = jax.jit(wrenches)(as_float64(np.array([0.0, 0.0, 1.4])))
    assert abs(float(regular.value)) < 1e-12
    assert all(np.isfinite(part).all() for part in regular)
    np.testing.assert_allclose(regular.cofactors, 0.0, atol=1e-12)


@pytest.mark.ci("3R3T-None")
@pytest.mark.thorough
@pytest.mark.parametrize(("pattern", "longest"), [("3R3T", None), ("3R3T", np.array(3.0)), ("1R2T", np.array(3.0))])
def test_derivatives_are_finite_differences(pattern, longest):
    """By coordinates, their derivatives and the duration. The determinant is last, and changes with coordinates."""
    rng, step, robot = np.random.default_rng(4), 1e-5, general()
    if pattern == "1R2T":
        base, platform = PLANAR
        robot = oracle.Robot(base, platform, robot.mass, robot.inertia)
    d = robot_of(robot, pattern).dof
    place = np.array([0.2, -0.1, 1.3, 0.1, -0.2, 0.15] if d == 6 else [0.2, 1.3, 0.1]) + 0.1 * rng.normal(
        size=(1, 3, d)
    )
    tensions, reference = rng.uniform(0.1, 0.5, (1, d)), np.array([[1.0, 0.0, 0.0, 0.0]])

    with double_precision():
        problem = Problem(robot_of(robot, pattern), Limits(tension_max=as_float64(np.full(d, 60.0))), named("A1"))
        count = residuals(problem.robot, problem.limits, longest, reference, place, np.array([0.8]), tensions).shape[1]
        multipliers = rng.normal(size=(1, count))

        def at(change):
            moved, duration = place + change[:-1].reshape(place.shape), np.array([0.8]) + change[-1]
            fixed = problem.robot, problem.limits, longest, reference, moved, duration, tensions
            return equation_values(*fixed, multipliers), residuals(*fixed)

        here, missed = at(np.zeros(3 * d + 1))
        sides = [[at(sign * step * row) for sign in (-1.0, 1.0)] for row in np.eye(3 * d + 1)]
    np.testing.assert_allclose(here.residual, missed, atol=1e-13)
    slopes = np.stack([(after[1] - before[1])[0] / (2.0 * step) for before, after in sides], axis=-1)
    np.testing.assert_allclose(here.jacobian[0, :, :-1], slopes, atol=1e-6)
    bends = [
        multipliers[0] @ (after[0].jacobian - before[0].jacobian)[0, :, :-1] / (2.0 * step) for before, after in sides
    ]
    np.testing.assert_allclose(here.hessian[0, :-1, :-1], bends, atol=1e-5)
    assert here.jacobian[0, -1, :d].any()
    assert not here.jacobian[0, -1, d:].any()
    assert here.residual[0, -1] == pytest.approx(-at_place(problem, place[0, 0]), rel=1e-12)


def at_place(problem, place):
    """The determinant at coordinates, of which the last are a Rodrigues vector."""
    quaternion, position = np.array([1.0, *place[3:]]), place[:3]
    if len(place) == 3:
        quaternion, position = np.array([1.0, 0.0, place[2], 0.0]), np.array([place[0], 0.0, place[1]])
    turn = oracle.matrix(quaternion / np.linalg.norm(quaternion))
    with double_precision():
        return float(determinant(problem.robot, at_rest(as_float64(position), as_float64(turn))))


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


@pytest.mark.thorough
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
        motion = free_motion(problem, None, ends, FreeSettings(intervals=24, samples=3, starts=4))
        (spline,) = motion.motions
        states = states_along(spline, np.linspace(0.0, 1.0, 201))
        values = jax.vmap(lambda p, r: determinant(problem.robot, at_rest(p, r)))(states.position, states.rotation)
    assert motion.is_optimal
    assert len({*np.sign(values).tolist()}) == 1
