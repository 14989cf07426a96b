"""Parts of the search for free motions against finite differences and dense matrices."""

import dataclasses

import numpy as np
import pytest
from oracles import least_time_forms
from support.free_motions import problem_of

from cspr_jax.families.free.poses import FreePoses, tasks_of
from cspr_jax.families.free.search.basis import basis
from cspr_jax.families.free.search.condensation import Softness, condensed, repaired_values, times, transposed
from cspr_jax.families.free.search.equations import ValueBounds, bounds
from cspr_jax.families.free.search.interior_point import started
from cspr_jax.families.free.search.newton import assembled_gradient, newton_step
from cspr_jax.families.free.search.objectives import OBJECTIVES
from cspr_jax.families.free.search.starts import starts
from cspr_jax.families.free.search.tasks import ClearancePlanes, Unknowns
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.verification.criteria import criteria

RING = least_time_forms.ring_robot(3, 1.0, 2.0)
LIMITS = {"tension_min": np.full(3, 0.4), "tension_max": np.full(3, 16.0)}
STEP = 1e-5
# Lower bound of planes.
PLANE = -50.0


@pytest.fixture(scope="module", params=["limits", "planes"])
def searched(request):
    """A task of two segments with velocities at its ends, and unknowns with random multipliers."""
    rng = np.random.default_rng(0)
    with double_precision():
        problem = problem_of(RING, LIMITS)[0]
        limits = bounds(problem.robot, problem.limits, criteria(problem.robot, problem.limits))
        places = np.array([[0.3, 0.1, 1.0], [-0.2, 0.3, 1.4], [0.1, -0.3, 1.2]])
        poses = FreePoses(places, None, rng.normal(size=(3, 3)), np.full((3, 3), np.nan), 1.2)
        tasks = tasks_of(problem, basis(6, 3), limits, OBJECTIVES["time"](limits, 3)[0], poses, None)
        line = np.linspace(places[:-1], places[1:], tasks.basis.controls, axis=1)[None]
        unknowns = started(tasks, line + 0.02 * rng.normal(size=line.shape), np.array([[0.7, 0.9]]))
    if request.param == "planes":
        shape = *tasks.low.shape[:-1], 2
        planes = ClearancePlanes(rng.normal(size=(*shape, 3)), rng.normal(size=shape), ((0, 0.1), (3, 0.2)))
        unknowns = tasks.beside(unknowns, rng.normal(size=shape))
        tasks = tasks.within(planes, np.full(shape, PLANE))
    return tasks, unknowns._replace(multipliers=rng.normal(size=unknowns.multipliers.shape))


def moved(unknowns, step, size):
    """Unknowns with durations and accelerations a step further."""
    duration, acceleration = step
    return unknowns._replace(
        duration=unknowns.duration + size * duration, acceleration=unknowns.acceleration + size * acceleration
    )


def test_splines_have_the_derivatives_and_the_pieces_of_their_control_points():
    table, rng = basis(5, 4), np.random.default_rng(1)
    controls = rng.normal(size=(table.controls, 2))
    places = table.evaluate(controls)
    assert table.tau[0, 0] == 0.0
    assert table.tau[-1, -1] == 1.0
    pieces = np.einsum("mbk,mkd->mbd", table.pieces, table.in_intervals(controls))
    np.testing.assert_allclose(pieces[1:, 0], pieces[:-1, -1], atol=1e-12)
    np.testing.assert_allclose(pieces[[0, -1], [0, -1]], controls[[0, -1]], atol=1e-12)
    np.testing.assert_allclose(places[0, 0, 1], (controls[1] - controls[0]) / table.velocity_step, atol=1e-9)
    still = controls.copy()
    still[1] = still[0]
    np.testing.assert_allclose(
        table.evaluate(still)[0, 0, 2], (still[2] - still[0]) / table.acceleration_step, atol=1e-9
    )
    # Cubics are integrated exactly.
    assert np.sum(table.weights * (5.0 * table.tau**3 - table.tau)) == pytest.approx(0.75, abs=1e-12)
    fitted = table.fit @ np.sin(table.averages)
    np.testing.assert_allclose(table.evaluate(fitted[:, None])[..., 0, 0], np.sin(table.tau), atol=1e-6)
    np.testing.assert_allclose(table.evaluate(fitted[:, None])[..., 1, 0], np.cos(table.tau), atol=1e-4)


def test_outer_control_points_have_their_derivatives(searched):
    tasks, unknowns = searched
    rng = np.random.default_rng(2)
    step = rng.normal(size=(1, 2)), rng.normal(size=(1, 3, 3))
    by = np.concatenate([step[0][..., None], step[1][:, :-1], step[1][:, 1:]], axis=-1)
    push = rng.normal(size=(1, 2, 12))
    sides = [moved(unknowns, step, size) for size in (-STEP, STEP)]
    before, after = (tasks.controls(one).reshape(1, 2, -1)[..., tasks.border] for one in sides)
    np.testing.assert_allclose(times(tasks.border_jacobians(unknowns), by), (after - before) / (2 * STEP), atol=1e-7)
    before, after = (times(transposed(tasks.border_jacobians(one)), push) for one in sides)
    bends = times(tasks.border_hessians(unknowns, push), by)
    np.testing.assert_allclose(bends, (after - before) / (2 * STEP), atol=1e-7)


def test_equations_have_their_derivatives(searched):
    """Gathered gradients of the residuals times multipliers, and second derivatives at instants."""
    tasks, unknowns = searched
    rng = np.random.default_rng(3)
    inner, step = rng.normal(size=unknowns.inner.shape), (rng.normal(size=(1, 2)), np.zeros((1, 3, 3)))

    def at(size):
        with double_precision():
            there = moved(unknowns, step, size)._replace(inner=unknowns.inner + size * inner)
            return tasks.controls(there), *tasks.equations(there)

    (first, before, less), (last, after, more) = at(-STEP), at(STEP)
    with double_precision():
        equations, _ = tasks.equations(unknowns)
    lagrangian = times(transposed(equations.jacobian), unknowns.multipliers)
    change = ((last - first) / (2 * STEP)).reshape(1, 2, -1)
    slope = assembled_gradient(tasks.basis, lagrangian)
    along = np.sum(slope[..., :-2] * change, axis=-1) + slope[..., -2] * step[0]
    values = (np.sum(residual * unknowns.multipliers, axis=(2, 3, 4)) for residual in (less, more))
    low, high = values
    np.testing.assert_allclose(along, (high - low) / (2 * STEP), rtol=1e-6)
    places = tasks.basis.evaluate((last - first) / (2 * STEP)).reshape(1, 2, 6, 3, -1)
    scalars = (step[0][:, :, None, None, None], np.full((1, 2, 1, 1, 1), 7.0))
    state = np.concatenate([places, *(np.broadcast_to(one, (1, 2, 6, 3, 1)) for one in scalars)], axis=-1)
    slopes = (times(transposed(one.jacobian), unknowns.multipliers) for one in (before, after))
    low, high = slopes
    np.testing.assert_allclose(times(equations.hessian, state), (high - low) / (2 * STEP), rtol=1e-4, atol=1e-4)
    balances = (times(transposed(one.matrix), unknowns.multipliers[..., :3]) for one in (before, after))
    low, high = balances
    np.testing.assert_allclose(times(equations.mixed, state), (high - low) / (2 * STEP), rtol=1e-4, atol=1e-5)


def test_residuals_alone_are_those_of_the_equations(searched):
    tasks, unknowns = searched
    with double_precision():
        np.testing.assert_allclose(tasks.residual(unknowns), tasks.equations(unknowns)[1], atol=1e-14)


def test_what_is_eliminated_is_that_of_the_whole_matrix(searched):
    tasks, unknowns = searched
    rng = np.random.default_rng(4)
    with double_precision():
        equations, residual = tasks.equations(unknowns)
    shape, values = residual.shape[:-1], unknowns.values.shape[-1]
    weights, push = rng.uniform(0.1, 2.0, (*shape, values)), rng.normal(size=(*shape, values))
    factor = rng.normal(size=(*shape, 3, 3))
    soft = Softness(np.array([0.3]), np.eye(3) + factor @ transposed(factor), unknowns.multipliers)
    np.testing.assert_allclose(soft.paid(soft.missed(residual)), residual, atol=1e-12)
    local = condensed(equations, weights, push, residual, soft)
    step = rng.normal(size=(*shape, 11))
    change, multipliers = local.changes(step, 3, 3)
    # The wrenches of tensions, and the identity of other values.
    by_values = np.zeros((*shape, residual.shape[-1], values))
    by_values[..., :3, :3] = equations.matrix
    by_values[..., range(3, values), range(3, values)] = 1.0
    mixed = np.zeros((*shape, values, 11))
    mixed[..., :3, :] = equations.mixed
    first = weights * change + times(mixed, step) + times(transposed(by_values), multipliers)
    np.testing.assert_allclose(first, push, atol=1e-9)
    second = times(by_values, change) + times(equations.jacobian, step) - soft.missed(multipliers)
    np.testing.assert_allclose(second, residual, atol=1e-9)
    whole = times(equations.hessian, step) + times(transposed(mixed), change)
    whole = whole + times(transposed(equations.jacobian), multipliers)
    np.testing.assert_allclose(times(local.hessian, step) + local.gradient, whole, atol=1e-8)


def test_values_make_up_for_what_equations_miss(searched):
    """At the least of a convex function its slope vanishes."""
    tasks, unknowns = searched
    rng = np.random.default_rng(5)
    with double_precision():
        matrix, residual = tasks.equations(unknowns)[0].matrix, tasks.residual(unknowns)
    weights = rng.uniform(0.1, 2.0, unknowns.values.shape)
    factor = rng.normal(size=(*residual.shape[:-1], 3, 3))
    soft = Softness(np.array([0.3]), np.eye(3) + factor @ transposed(factor), unknowns.multipliers)
    missed = rng.normal(size=residual.shape)
    change = repaired_values(matrix, weights, missed, soft)
    left = missed.copy()
    left[..., :3] += times(matrix, change[..., :3])
    left[..., 3:] += change[..., 3:]
    price = soft.paid(left)
    slope = weights * change
    slope[..., :3] += times(transposed(matrix), price[..., :3])
    slope[..., 3:] += price[..., 3:]
    np.testing.assert_allclose(slope, 0.0, atol=1e-9)


def test_wrenches_of_fewer_dimensions_give_numbers():
    """Beside light tensions what softness adds is less than rounding, so that a matrix is singular."""
    matrix = np.array([[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 1.0]])[None, None, None, None]
    weights = np.array([1e-7, 1e-7, 1.0, 1.0])[None, None, None, None]
    soft = Softness(np.array([1e-6]), 1e-6 * np.eye(3)[None, None, None, None], np.zeros((1, 1, 1, 1, 4)))
    change = repaired_values(matrix, weights, np.array([1.0, 1.0, 0.5, 0.2])[None, None, None, None], soft)
    np.testing.assert_allclose(change.ravel(), [-0.5, -0.5, -0.5, -0.2], rtol=1e-5)


def merit(tasks, name, unknowns, barrier, soft):
    """Time, energy, largest tension over its limit (16 N), or margin, with barriers, and equations that are missed."""
    _, residual = tasks.equations(unknowns)
    tensions, time, level = unknowns.values, unknowns.duration / tasks.scale[0], unknowns.level
    weight = RING["mass"] * RING["gravity"]
    low, high = np.full(2, 0.4 / weight), np.full(2, 16.0 / weight)
    shares = np.array([9, 28, 23, *[24] * 12, 23, 28, 9]) / 24.0 / 17.0
    squares = np.sum(tensions[..., :3] ** 2, axis=-1).reshape(2, 18)
    costs = {
        "time": time.sum(),
        "energy": np.sum(time[0] * np.sum(shares * squares, axis=1)),
        "tension": 1e-4 * time.sum() + level.sum(),
        "margin": 1e-4 * time.sum() + level.sum(),
    }
    if name == "tension":
        high = high * level[0]
    if name == "margin":
        low, high = low - level[0], high + level[0]
    low, high = (one.reshape(1, 2, 1, 1, 1) for one in (low, high))
    # Depths keep a distance from the spools, too, and planes theirs.
    sides = [tensions[..., :3] - low, high - tensions[..., :3], tensions[..., 3:4] - 0.02, tensions[..., 4:] - PLANE]
    price = np.sum((soft.level + 0.5 * soft.paid(residual)) * residual)
    return costs[name] + price - barrier * sum(np.sum(np.log(side)) for side in sides)


@pytest.mark.parametrize("name", OBJECTIVES)
def test_steps_go_down_the_merit_of_each_objective(searched, name):
    """The slope that a step tells is that of the merit, written out here; without multipliers errors are no less."""
    tasks, unknowns = searched
    limits = ValueBounds(tasks.low[0, 0, 0, 0], tasks.high[0, 0, 0, 0], *np.zeros((3, 0)))
    objective, moved_limits = OBJECTIVES[name](limits, 3)
    with double_precision():
        tasks = dataclasses.replace(
            tasks, objective=objective, high=np.broadcast_to(moved_limits.high, tasks.high.shape)
        )
        line = tasks.controls(unknowns)
        unknowns = started(tasks, line, unknowns.duration)._replace(multipliers=unknowns.multipliers)
        unknowns = unknowns._replace(level=unknowns.level + np.array([0.1, 0.2]))
        equations, residual = tasks.equations(unknowns)
        soft = Softness(np.array([0.3]), np.tile(np.eye(3), (*residual.shape[:-1], 1, 1)), unknowns.multipliers)
        step = newton_step(tasks, unknowns, equations, residual, np.array([0.05]), soft, np.zeros(1))
        sizes = [
            merit(
                tasks, name, Unknowns(*(x + size * dx for x, dx in zip(unknowns, step.change, strict=True))), 0.05, soft
            )
            for size in (-STEP, STEP)
        ]
    assert step.merit_derivative[0] < 0.0
    assert (step.change.level != 0.0).all() == (name in ("tension", "margin"))
    assert step.merit_derivative[0] == pytest.approx((sizes[1] - sizes[0]) / (2 * STEP), rel=1e-5)


def test_starts_are_the_same_for_each_task_and_join_its_poses(searched):
    tasks, _ = searched
    single = dataclasses.replace(
        tasks,
        ends=np.moveaxis(tasks.ends, 1, 0),
        references=np.moveaxis(tasks.references, 1, 0),
    )
    begun = starts(single, 1.2)
    assert [len(starts(single, 1.2, most).task) for most in (1, 5, 12)] == [2, 10, 24]
    assert (np.bincount(begun.task) == len(begun.task) // 2).all()
    for side, end in ((0, 0), (1, -1)):
        np.testing.assert_allclose(begun.controls[:, 0, end], single.ends[begun.task, 0, side], atol=1e-9)


def test_a_motion_that_rests_anywhere_shifts_its_last_pose():
    rng = np.random.default_rng(3)
    with double_precision():
        problem = problem_of(RING, LIMITS)[0]
        limits = bounds(problem.robot, problem.limits, criteria(problem.robot, problem.limits))
        places, rates = np.array([[0.3, 0.1, 1.0], [-0.2, 0.3, 1.4]]), np.array([[0.5, -1.0, 0.2], [0.0, 0.0, 0.0]])
        accelerations = np.array([[1.0, 2.0, -1.0], [0.0, 0.0, 0.0]])
        poses = FreePoses(places, None, rates, accelerations, 1.2, rests_anywhere=True)
        tasks = tasks_of(problem, basis(6, 3), limits, OBJECTIVES["time"](limits, 3)[0], poses, None)
        line = np.linspace(places[0], places[1], tasks.basis.controls)[None, None]
        unknowns = started(tasks, line + 0.02 * rng.normal(size=line.shape), np.array([[0.7]]))
    assert tasks.is_free.tolist() == [[False, True]]
    np.testing.assert_allclose(unknowns.acceleration[0, 0], accelerations[0])
    shift = unknowns.acceleration[:, 1:]
    ends = tasks.basis.evaluate(tasks.controls(unknowns))[0, 0, [0, -1], [0, -1]]
    time = unknowns.duration[0, 0]
    np.testing.assert_allclose(ends[:, 0], [places[0], places[1] + shift[0, 0]], atol=1e-12)
    np.testing.assert_allclose(ends[0, 1:] / [[time], [time**2]], [rates[0], accelerations[0]], atol=1e-9)
    np.testing.assert_allclose(ends[1, 1:], 0.0, atol=1e-9)
    # The outer control points have their derivatives, first and second.
    step = np.array([[0.3]]), np.concatenate([np.zeros((1, 1, 3)), rng.normal(size=(1, 1, 3))], axis=1)
    by = np.concatenate([step[0][..., None], step[1][:, :1], step[1][:, 1:]], axis=-1)

    def outer(size):
        return tasks.controls(moved(unknowns, step, size)).reshape(1, 1, -1)[..., tasks.border]

    slopes = times(tasks.border_jacobians(unknowns), by)
    np.testing.assert_allclose(slopes, (outer(STEP) - outer(-STEP)) / (2.0 * STEP), atol=1e-8)
    multipliers = rng.normal(size=outer(0.0).shape)
    bent = np.sum(multipliers * (outer(1.0) - 2.0 * outer(0.0) + outer(-1.0)))
    hessians = tasks.border_hessians(unknowns, multipliers)
    np.testing.assert_allclose(np.sum(by * times(hessians, by)), bent, atol=1e-9)
