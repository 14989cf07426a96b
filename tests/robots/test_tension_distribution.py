"""Tensions of more cables than needed: against linear programs, least distances by NNLS, and what must be so."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from conftest import equilateral
from oracles import lines as oracle
from scipy.optimize import linprog, minimize, nnls

from cspr_jax.errors import InputError
from cspr_jax.robots.model.point_mass import PointMassRobot
from cspr_jax.robots.model.state import State
from cspr_jax.robots.tensions import tension_distribution
from cspr_jax.robots.tensions.tension_couples import is_rectangle, tension_couples

# Redundant by 0, 1, 2, more. The soak compiles the others as well.
SHAPES = [
    (2, 2),
    (2, 4),
    pytest.param(3, 4, marks=pytest.mark.thorough),
    pytest.param(3, 8, marks=pytest.mark.thorough),
    (6, 8),
]
OTHERS = [(2, 3), (2, 5), (3, 3), (3, 5), (3, 6), (3, 7), (6, 6), (6, 7), (6, 9)]
CASES = 36  # of a shape, in one batch: nothing is compiled twice
RECTANGLE = oracle.BASE * [1.0, 1.0, -1.0]  # z down
ORDERS = [[0, 1, 2, 3], [1, 2, 3, 0], [3, 2, 1, 0], [2, 1, 0, 3]]


@jax.jit
@jax.vmap
def both(matrix, wrench, low, high):
    """Least and centred tensions, and how far these are from their limits."""
    least = tension_distribution.least_norm(matrix, wrench, low, high)
    return least, *tension_distribution.centred(matrix, wrench, low, high)


def found(*cases):
    """The same of NumPy, for up to CASES cases."""
    count = len(cases[0])
    padded = (np.concatenate([x, np.repeat(x[:1], CASES - count, axis=0)]) for x in cases)
    return jax.tree.map(lambda x: np.asarray(x)[:count], both(*padded))


def random_matrix(dof, count, rng):
    """Unit columns of cables that mostly pull upwards, z up."""
    rays = rng.uniform([-3, -3, 2], [3, 3, 4], (count, 3)) - rng.uniform([-2, -2, -3], [2, 2, 3])
    if dof == 2:
        rays = rays[:, [0, 2]]
    units = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    return units.T if dof < 6 else np.r_[units.T, np.cross(rng.uniform(-0.5, 0.5, (count, 3)), units).T]


def random_cases(dof, count, seed=0):
    """CASES poses, feasible ones and others; largest tensions of all cables, of some, of none."""
    rng, cases = np.random.default_rng([seed, dof, count]), []
    for i in range(CASES):
        matrix = random_matrix(dof, count, rng)
        low = rng.uniform(0, 3, count) * rng.integers(2)
        high = np.where(rng.random(count) < [0.0, 0.5, 1.0][i % 3], rng.uniform(15, 60, count), np.inf)
        wrench = np.r_[rng.normal(size=2), 20.0, rng.normal(size=3)][[0, 2] if dof == 2 else slice(dof)]
        if i % 2:
            wrench = matrix @ rng.uniform(low, np.minimum(high, 40.0))
        cases.append((matrix, wrench, low, high))
    return tuple(map(np.stack, zip(*cases, strict=True)))


def largest_room(matrix, wrench, low, high) -> float:
    """The largest distance from the limits, by HiGHS; inf where there is none."""
    (dof, count), finite = matrix.shape, np.isfinite(high)
    answer = linprog(
        np.r_[np.zeros(count), -1.0],
        A_ub=np.c_[np.r_[-np.eye(count), np.eye(count)[finite]], np.ones(count + finite.sum())],
        b_ub=np.r_[-low, high[finite]],
        A_eq=np.c_[matrix, np.zeros(dof)],
        b_eq=wrench,
        bounds=[(None, None)] * count + [(None, 1e6)],
        method="highs-ds",
        options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10, "presolve": False},
    )
    assert answer.status == 0
    return np.inf if answer.x[-1] > 1e5 else answer.x[-1]


def least_within(matrix, wrench, low, high):
    """The least tensions within limits: a least distance by NNLS (Lawson and Hanson); None where there are none."""
    start, finite = np.linalg.pinv(matrix) @ wrench, np.isfinite(high)
    size, kernel = np.abs(start).max(), np.linalg.svd(matrix)[2][matrix.shape[0] :]
    sides = np.c_[kernel, -kernel[:, finite]]
    if not len(kernel):
        return start if (start >= low).all() and (start <= high).all() else None
    system = np.r_[sides, [np.r_[low - start, (start - high)[finite]] / size]]
    aim = np.r_[np.zeros(len(kernel)), 1.0]
    weights, rest = nnls(system, aim)
    if rest < 1e-9:
        return None
    left = system @ weights - aim
    return start - size * left[:-1] / left[-1] @ kernel


def distance(tensions, low, high):
    """How far tensions are from their limits; negative beyond one."""
    return np.minimum(tensions - low, high - tensions).min(-1)


@pytest.mark.quick("2-4", "6-8")
@pytest.mark.parametrize(("dof", "count"), SHAPES + [pytest.param(*shape, marks=pytest.mark.soak) for shape in OTHERS])
def test_against_programs(dof, count):
    """Tensions that a controller takes: the least, the farthest from slack and overload, and a true verdict."""
    cases = random_cases(dof, count)
    least, central, room = found(*cases)
    verdicts = np.zeros(2, int)
    for i, case in enumerate(zip(*cases, strict=True)):
        size = max(np.abs(x.tensions[i]).max() for x in (least, central))
        wanted, shortest = largest_room(*case), least_within(*case)
        assert room[i] == pytest.approx(wanted, abs=1e-9 * size)
        assert least.is_within[i] == central.is_within[i] == (wanted > 0.0) == (shortest is not None)
        verdicts[int(wanted > 0.0)] += 1
        if shortest is None:  # whatever the limits
            shortest = np.linalg.pinv(case[0]) @ case[1]
            np.testing.assert_allclose(central.tensions[i], shortest, rtol=0, atol=1e-10 * size)
        elif np.isinf(wanted):
            assert np.array_equal(central.tensions[i], least.tensions[i])
        else:
            assert distance(central.tensions[i], *case[2:]) == pytest.approx(room[i], abs=1e-10 * size)
        np.testing.assert_allclose(least.tensions[i], shortest, rtol=0, atol=1e-10 * size)
    assert (verdicts > 3).all()
    for answer in (least, central):
        assert answer.residual.max() < 1e-12
        off = (cases[0] @ answer.tensions[:, :, None])[:, :, 0] - cases[1]
        wanted = np.linalg.norm(off, axis=1) / (1.0 + np.linalg.norm(cases[1], axis=1))
        np.testing.assert_allclose(answer.residual, wanted, rtol=0, atol=1e-13)


@pytest.mark.parametrize(("dof", "count"), [(2, 4), pytest.param(3, 8, marks=pytest.mark.thorough)])
def test_least_norm_against_a_general_minimiser(dof, count):
    """NNLS solves a dual; this one moves tensions within their limits, and knows nothing of duals."""
    cases = random_cases(dof, count, seed=1)
    least, _, _ = found(*cases)
    for i in np.flatnonzero(least.is_within)[:8]:
        matrix, wrench, low, high = (x[i] for x in cases)
        answer = minimize(
            lambda t: 0.5 * t @ t,
            np.clip(least.tensions[i] + 1.0, low, high),
            jac=lambda t: t,
            bounds=[(a, b if np.isfinite(b) else None) for a, b in zip(low, high, strict=True)],
            constraints={"type": "eq", "fun": lambda t, m=matrix, w=wrench: m @ t - w, "jac": lambda t, m=matrix: m},
            method="SLSQP",
            options={"ftol": 1e-14, "maxiter": 300},
        )
        assert answer.status in (0, 8)  # 8: on some machines its last digits do not get better
        np.testing.assert_allclose(least.tensions[i], answer.x, rtol=0, atol=1e-5 * np.abs(answer.x).max())


@pytest.mark.parametrize(("dof", "count"), [(2, 4), pytest.param(3, 8, marks=pytest.mark.thorough)])
def test_cables_with_other_labels_and_other_units(dof, count):
    """Neither the order of cables, nor newtons or kilonewtons, nor the axes may change a tension."""
    rng, (matrix, wrench, low, high) = np.random.default_rng(2), random_cases(dof, count, seed=2)
    before = found(matrix, wrench, low, high)
    order, turn = rng.permutation(count), np.linalg.qr(rng.normal(size=(dof, dof)))[0]
    changed = found(turn @ matrix[:, :, order], wrench @ turn.T, low[:, order], high[:, order])
    scaled = found(matrix, 1024.0 * wrench, 1024.0 * low, 1024.0 * high)
    for one, other, larger in zip(before[:2], changed[:2], scaled[:2], strict=True):
        size = np.abs(one.tensions).max()
        np.testing.assert_allclose(other.tensions, one.tensions[:, order], rtol=0, atol=1e-10 * size)
        assert np.array_equal(other.is_within, one.is_within)
        assert np.array_equal(larger.tensions, 1024.0 * one.tensions)
    np.testing.assert_allclose(changed[2], before[2], rtol=0, atol=1e-10 * size)
    assert np.array_equal(scaled[2], 1024.0 * before[2])


def test_an_easy_case():
    """Two cables straight up and two that pull level against each other: each pair shares, and needs not pull."""
    matrix = np.array([[0.0, 0.0, 1.0, -1.0], [1.0, 1.0, 0.0, 0.0]])[None]
    wrench, low = np.array([[0.0, 10.0]]), np.array([[0.0, 0.0, 2.0, 1.0]])
    least, central, room = found(matrix, wrench, low, np.array([[np.inf, np.inf, 30.0, np.inf]]))
    np.testing.assert_allclose(least.tensions, [[5.0, 5.0, 2.0, 2.0]], atol=1e-13)
    # The upright ones are the nearest to slack; of the level ones the least that keep so far from 2, 1 and 30.
    np.testing.assert_allclose(central.tensions, [[5.0, 5.0, 7.0, 7.0]], atol=1e-13)
    np.testing.assert_allclose(room, [5.0])
    # A cable with a narrow range is never farther from its limits than the middle.
    narrow = np.array([[np.inf, 4.0, 30.0, np.inf]])
    least, central, room = found(matrix, wrench, low, narrow)
    np.testing.assert_allclose(least.tensions, [[6.0, 4.0, 2.0, 2.0]], atol=1e-13)
    np.testing.assert_allclose(central.tensions, [[8.0, 2.0, 4.0, 4.0]], atol=1e-13)
    np.testing.assert_allclose(room, [2.0])
    # Neither gets along with limits that leave 8 N, and both say so.
    least, central, room = found(matrix, wrench, low, np.array([[4.0, 4.0, 30.0, np.inf]]))
    assert not least.is_within.any()
    assert not central.is_within.any()
    np.testing.assert_allclose(least.tensions, [[5.0, 5.0, 0.0, 0.0]], atol=1e-13)
    np.testing.assert_allclose(room, [-1.0])


@pytest.mark.parametrize(("dof", "count"), [(2, 2), (2, 4), (3, 4), pytest.param(3, 8, marks=pytest.mark.thorough)])
def test_degenerate_poses(dof, count):
    """In the spool plane, with cables side by side, on a symmetric robot, without a load: an answer, and no lie."""
    rng, cases = np.random.default_rng(4), []
    for i in range(CASES):
        spools = np.c_[rng.integers(-2, 3, (count, 2)), np.full(count, i % 3)] + [0.5, 0.0, 0.0]
        rays = spools[:, [0, 2] if dof == 2 else [0, 1, 2]]
        matrix = (rays / np.linalg.norm(rays, axis=1, keepdims=True)).T
        wrench = np.r_[np.zeros(dof - 1), 10.0] * (i % 4 > 0)
        cases.append((matrix, wrench, np.full(count, i % 2), np.full(count, 12.0 if i % 5 else np.inf)))
    cases = tuple(np.stack(x).astype(float) for x in zip(*cases, strict=True))
    least, central, room = found(*cases)
    is_regular = np.linalg.svd(cases[0])[1][:, -1] > 1e-9
    assert is_regular.any()
    assert not is_regular.all()
    assert not (least.is_within | central.is_within)[~is_regular].any()
    assert (room[~is_regular] == -np.inf).all()
    for i in np.flatnonzero(is_regular):
        case = tuple(x[i] for x in cases)
        wanted = largest_room(*case)
        assert room[i] == pytest.approx(wanted, abs=1e-8)
        assert np.isfinite(np.r_[least.tensions[i], central.tensions[i]]).all()
        if abs(wanted) > 1e-8:
            assert least.is_within[i] == central.is_within[i] == (wanted > 0.0)
        for answer in (x for x in (least, central) if x.is_within[i]):
            assert answer.residual[i] < 1e-12
            assert distance(answer.tensions[i], *case[2:]) > -1e-8


def test_fewer_cables_than_components():
    with pytest.raises(InputError, match="3 or more"):
        tension_distribution.least_norm(np.ones((3, 2)), np.ones(3), np.zeros(2), np.ones(2))


@pytest.mark.parametrize("count", [4, pytest.param(8, marks=pytest.mark.soak)])
def test_gradients(count):
    """What designs are improved by: of a sum of all answers, along a random change of all that is given."""
    rng, cases = np.random.default_rng(5), random_cases(3, count, seed=5)
    weights = rng.normal(size=count)

    @jax.jit
    def gradient(given):
        def answer(given):
            central, room = jax.vmap(tension_distribution.centred)(*given)
            return jnp.sum(central.tensions @ weights) + jnp.sum(jnp.where(jnp.isfinite(room), room, 0.0))

        return jax.grad(answer)(given)

    gradients = gradient(cases)
    assert all(np.isfinite(x).all() for x in gradients)
    change = [np.where(np.isfinite(x), rng.normal(size=x.shape), 0.0) for x in cases]
    value = sum((np.asarray(g) * v).reshape(CASES, -1).sum(1) for g, v in zip(gradients, change, strict=True))
    after, before = (found(*(x + h * v for x, v in zip(cases, change, strict=True))) for h in (1e-5, -1e-5))
    after, before = (x.tensions @ weights + np.where(np.isfinite(room), room, 0.0) for _, x, room in (after, before))
    wanted = (after - before) / 2e-5
    np.testing.assert_allclose(value, wanted, rtol=1e-4, atol=1e-4)


def motions(count, seed):
    """Places inside the rectangle's prism, z down, and accelerations."""
    rng = np.random.default_rng(seed)
    return rng.uniform([1.0, 1.0, -28.0], [44.0, 29.0, -2.0], (count, 3)), rng.normal(scale=2.0, size=(count, 3))


COUPLES = jax.jit(jax.vmap(tension_couples, in_axes=(None, 0, 0)))
OF_STATES = jax.jit(
    jax.vmap(lambda robot, state: (robot.wrench_matrix(state), robot.inertial_wrench(state)), (None, 0))
)


def rectangle(order=ORDERS[0], shift=0.0):
    """The test case of Boralugoda's section 4, z down."""
    return PointMassRobot(RECTANGLE[order] + shift, np.asarray(10.0), np.asarray(oracle.GRAVITY))


def test_couples_are_those_of_the_thesis():
    """(30) to (33) as corrected; opposite couples, each over its length, add up to the same."""
    places, pushes = motions(50, 1)
    couples = np.asarray(COUPLES(rectangle(), places, pushes))
    up, sides = np.array([1.0, 1.0, -1.0]), {"x_max": 45.0, "y_max": 30.0, "z_max": 30.0}
    wanted = oracle.tension_couples(places * up, pushes * up, **sides, mass=10.0, gravity=oracle.GRAVITY)
    np.testing.assert_allclose(couples, wanted, rtol=0, atol=1e-11 * np.abs(wanted).max())
    (x, y, z), (t12, t23, t34, t41) = places.T, couples.T
    depth = z + 30.0
    one = t12 / np.hypot(y, depth) + t34 / np.hypot(30.0 - y, depth)
    other = t23 / np.hypot(45.0 - x, depth) + t41 / np.hypot(x, depth)
    np.testing.assert_allclose(one, other, rtol=1e-11)
    assert (couples < 0.0).any()


@pytest.mark.parametrize("order", ORDERS)
def test_couples_are_those_of_any_tensions(order):
    """Whatever the distribution: the two cables' pulls, added up in the plane across the side between their spools."""
    shift = np.array([3.0, -7.0, 11.0])
    robot, (places, pushes) = rectangle(order, shift), motions(CASES, 2)
    places = places + shift
    matrix, wrench = map(np.asarray, OF_STATES(robot, State(places, 0.0 * places, pushes)))
    least, central, _ = found(matrix, wrench, np.zeros((CASES, 4)), np.full((CASES, 4), np.inf))
    couples = np.asarray(COUPLES(robot, places, pushes))
    for answer in (least, central):
        pulls = np.swapaxes(matrix * answer.tensions[:, None], 1, 2)
        pairs = pulls + np.roll(pulls, -1, axis=1)
        side = np.roll(robot.base_points, -1, axis=0) - robot.base_points
        across = np.where(np.abs(side) > 1.0, 0.0, 1.0) * pairs
        wanted = -np.sign(across[..., 2]) * np.linalg.norm(across, axis=-1)
        np.testing.assert_allclose(couples, wanted, rtol=0, atol=1e-10 * np.abs(wanted).max())


def test_rectangles():
    """Elsewhere the couples mean nothing: other quadrilaterals, another order, sides that are neither x nor y."""
    assert all(is_rectangle(RECTANGLE[order] + 5.0) for order in ORDERS)
    turn = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
    tilted, moved, flat = RECTANGLE.copy(), RECTANGLE.copy(), RECTANGLE * [1.0, 0.0, 1.0]
    tilted[0, 2] += 1e-3
    moved[2, 0] += 1e-3
    others = [RECTANGLE @ turn, RECTANGLE[[0, 2, 1, 3]], tilted, moved, flat, np.zeros((4, 3)), RECTANGLE[[0, 1, 1, 0]]]
    assert not any(map(is_rectangle, [*others, RECTANGLE[:3], equilateral(1.0)]))


@pytest.mark.parametrize("count", [8])
def test_what_is_not_finite_ends_the_search(count):
    """Of a plan without a motion; one such instant among many once kept the search from ending."""
    rng = np.random.default_rng(count)
    matrices, wrenches = rng.normal(size=(512, 3, count)), rng.normal(size=(512, 3))
    matrices[0] = np.nan
    none, endless = np.zeros(count), np.full(count, np.inf)
    found = jax.jit(jax.vmap(tension_distribution.least_norm, (0, 0, None, None)))(matrices, wrenches, none, endless)
    tensions = np.asarray(found.tensions)
    assert not np.isfinite(tensions[0]).any() and np.isfinite(tensions[1:]).all()
