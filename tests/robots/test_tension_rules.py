"""Rules that choose tensions: closed forms by pseudoinverses, p-norms by a general minimiser, lanes beside the rest."""

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog, minimize

from cspr_jax.errors import InputError
from cspr_jax.robots.tensions.tension_distribution_lanes import least_norms
from cspr_jax.robots.tensions.tension_rules import RULES, distributions

SHAPES = [(2, 4), pytest.param(3, 5, marks=pytest.mark.thorough), (6, 8)]
COUNT = 48  # poses of a shape: one batch
LOW, HIGH = 2.0, 40.0


def poses(dof, count, seed=0, number=COUNT):
    """Cables that mostly pull upwards; half of the wrenches are those of tensions within limits."""
    rng = np.random.default_rng([seed, dof, count])
    rays = rng.uniform([-3, -3, 2], [3, 3, 4], (number, count, 3)) - rng.uniform(
        [-2, -2, -3], [2, 2, 3], (number, 1, 3)
    )
    if dof == 2:
        rays = rays[:, :, [0, 2]]
    units = rays / np.linalg.norm(rays, axis=2, keepdims=True)
    if dof == 6:
        units = np.concatenate([units, np.cross(rng.uniform(-0.5, 0.5, (number, count, 3)), units)], 2)
    matrices = np.swapaxes(units, 1, 2)
    wrenches = np.einsum("nij,nj->ni", matrices, rng.uniform(LOW, HIGH, (number, count)))
    wrenches[::2] *= rng.uniform(0.5, 1.5, (number, 1))[::2]
    return matrices, wrenches


def is_feasible(matrix, wrench, low=LOW, high=HIGH) -> bool:
    """By HiGHS."""
    count = matrix.shape[1]
    return linprog(np.zeros(count), A_eq=matrix, b_eq=wrench, bounds=[(low, high)] * count, method="highs").status == 0


def pseudoinverse_rule(matrix, wrench, low, high, rounds):
    """The closed form, with pseudoinverses of ever fewer cables; None where limits are not kept."""
    free, held = np.arange(matrix.shape[1]), np.zeros(matrix.shape[1])
    for _ in range(rounds + 1):
        middle, left = np.full(len(free), 0.5 * (low + high)), wrench - matrix @ held
        own = matrix[:, free]
        tensions = middle + np.linalg.pinv(own) @ (left - own @ middle)
        excess = np.maximum(low - tensions, tensions - high)
        worst = np.argmax(excess)
        if excess[worst] <= 1e-9:
            found = held.copy()
            found[free] = tensions
            return found
        held[free[worst]] = low if tensions[worst] < low else high
        free = np.delete(free, worst)
        if len(free) < len(wrench):
            return None
    return None


@pytest.mark.quick("6-8")
@pytest.mark.parametrize(("dof", "count"), SHAPES)
def test_closed_forms(dof, count):
    """What robots' controllers compute: the same tensions, and the same poses without any."""
    matrices, wrenches = poses(dof, count)
    for rule, rounds in (("closed-form", 0), ("improved-closed-form", count - dof)):
        found = distributions(matrices, wrenches, LOW, HIGH, rule=rule)
        for i in range(COUNT):
            wanted = pseudoinverse_rule(matrices[i], wrenches[i], LOW, HIGH, rounds)
            assert found.is_within[i] == (wanted is not None)
            if wanted is not None:
                np.testing.assert_allclose(found.tensions[i], wanted, rtol=0, atol=1e-9 * HIGH)
        assert found.is_within.any() and not found.is_within.all()
        assert found.residual.max() < 1e-12


@pytest.mark.thorough
def test_what_closed_forms_miss():
    """Of feasible poses the closed form misses most and the improved one few; none of what they find is false."""
    number = 400
    matrices, wrenches = poses(6, 8, seed=3, number=number)
    wrenches[::2] *= 0.9
    exact = distributions(matrices, wrenches, LOW, HIGH)
    plain, improved = (
        distributions(matrices, wrenches, LOW, HIGH, rule=x) for x in ("closed-form", "improved-closed-form")
    )
    for i in range(0, number, 20):
        assert exact.is_within[i] == is_feasible(matrices[i], wrenches[i])
    assert not (plain.is_within & ~improved.is_within).any()
    assert not (improved.is_within & ~exact.is_within).any()
    assert plain.is_within.sum() < 0.8 * exact.is_within.sum()
    assert improved.is_within.sum() > 0.97 * exact.is_within.sum()


@pytest.mark.parametrize(
    ("exponent", "dof"),
    [
        *((exponent, 2) for exponent in (1.5, 4.0)),
        *(pytest.param(exponent, 2, marks=pytest.mark.thorough) for exponent in (2.0, 12.0)),
        *(pytest.param(exponent, 6, marks=pytest.mark.thorough) for exponent in (1.5, 2.0, 4.0, 12.0)),
    ],
)
def test_p_norms(dof, exponent):
    """Against a minimiser that knows nothing of barriers, and where no step along the kernel makes it less."""
    count = dof + 2
    matrices, wrenches = poses(dof, count, seed=4)
    reference = 5.0
    found = distributions(matrices, wrenches, LOW, HIGH, rule="p-norm", reference=reference, exponent=exponent)
    exact = distributions(matrices, wrenches, LOW, HIGH)
    assert np.array_equal(found.is_within, exact.is_within)
    assert found.residual.max() < 1e-12

    def value(tensions):
        return np.sum(np.abs((tensions - reference) / HIGH) ** exponent)

    for i in np.flatnonzero(found.is_within)[:12]:
        answer = minimize(
            lambda t: 1e3 * value(t),
            np.clip(exact.tensions[i], LOW, HIGH),
            bounds=[(LOW, HIGH)] * count,
            constraints={
                "type": "eq",
                "fun": lambda t, i=i: matrices[i] @ t - wrenches[i],
                "jac": lambda t, i=i: matrices[i],
            },
            method="SLSQP",
            options={"ftol": 1e-15, "maxiter": 1000},
        )
        off = np.abs(matrices[i] @ answer.x - wrenches[i]).max()
        if off < 1e-9:
            assert value(found.tensions[i]) <= value(answer.x) * (1.0 + 1e-6) + 1e-15
        if answer.success and off < 1e-9 and exponent < 5.0:
            np.testing.assert_allclose(found.tensions[i], answer.x, rtol=0, atol=1e-3 * HIGH)


@pytest.mark.thorough
def test_the_two_norm_about_zero_is_the_least_norm():
    matrices, wrenches = poses(6, 8, seed=5)
    exact = distributions(matrices, wrenches, LOW, HIGH)
    found = distributions(matrices, wrenches, LOW, HIGH, rule="p-norm", reference=0.0, exponent=2.0)
    assert np.array_equal(found.is_within, exact.is_within)
    np.testing.assert_allclose(found.tensions, exact.tensions, rtol=0, atol=1e-6 * HIGH)
    # Without largest tensions too.
    exact = distributions(matrices, wrenches, LOW, np.inf)
    found = distributions(matrices, wrenches, LOW, np.inf, rule="p-norm", reference=0.0, exponent=2.0)
    assert np.array_equal(found.is_within, exact.is_within)
    np.testing.assert_allclose(found.tensions, exact.tensions, rtol=0, atol=1e-6 * np.abs(exact.tensions).max())


@pytest.mark.thorough
def test_a_large_p_is_nearly_the_largest_distance():
    """p to infinity: the least largest distance from the reference, a linear program."""
    matrices, wrenches = poses(3, 5, seed=6)
    found = distributions(matrices, wrenches, LOW, HIGH, rule="p-norm", reference=20.0, exponent=60.0)
    for i in np.flatnonzero(found.is_within)[:10]:
        ones = np.ones((5, 1))
        answer = linprog(
            np.r_[np.zeros(5), 1.0],
            A_ub=np.r_[np.c_[np.eye(5), -ones], np.c_[-np.eye(5), -ones]],
            b_ub=np.r_[np.full(5, 20.0), np.full(5, -20.0)],
            A_eq=np.c_[matrices[i], np.zeros(3)],
            b_eq=wrenches[i],
            bounds=[(LOW, HIGH)] * 5 + [(0, None)],
        )
        largest = np.abs(found.tensions[i] - 20.0).max()
        assert answer.x[-1] - 1e-6 <= largest <= answer.x[-1] * 5.0 ** (1.0 / 60.0) + 1e-6


@pytest.mark.quick("2-4")
@pytest.mark.parametrize(
    ("dof", "count"),
    [(6, 8), pytest.param(6, 7, marks=pytest.mark.soak), (2, 4), pytest.param(3, 4, marks=pytest.mark.thorough)],
)
def test_lanes_find_the_same(dof, count):
    """The fast form beside the readable one: bounded cables, unbounded ones, one of both kinds, a narrow range."""
    matrices, wrenches = poses(dof, count, seed=7)
    rng = np.random.default_rng(8)
    low = rng.uniform(0.0, 3.0, (COUNT, count))
    high = np.where(rng.random((COUNT, count)) < 0.3, np.inf, rng.uniform(15.0, 60.0, (COUNT, count)))
    high[:5, 0] = low[:5, 0]
    matrices[1, :, 1] = matrices[1, :, 0]  # two cables side by side
    fast, is_open = least_norms(matrices, wrenches, low, high)
    slow = distributions(matrices, wrenches, low, high, rule="p-norm", reference=0.0, exponent=2.0)
    exact = RULES["least-norm"].function
    for i in range(COUNT):
        one = exact(*map(jnp.asarray, (matrices[i], wrenches[i], low[i], high[i])))
        size = np.abs(one.tensions).max()
        assert fast.is_within[i] == bool(one.is_within) == slow.is_within[i]
        np.testing.assert_allclose(fast.tensions[i], one.tensions, rtol=0, atol=1e-9 * size)
    assert fast.residual.max() < 1e-12 and not is_open.any()
    assert fast.is_within.any() and not fast.is_within.all()


def test_lanes_leave_singular_poses_open():
    matrices, wrenches = poses(2, 4, seed=9)
    matrices[3, 1] = matrices[3, 0]
    matrices[4, 1] = matrices[4, 0] + 1e-9 * matrices[4, 1]
    matrices[5] = np.nan
    _, is_open = least_norms(matrices, wrenches, *np.broadcast_to([[[LOW]], [[HIGH]]], (2, COUNT, 4)))
    assert np.flatnonzero(is_open).tolist() == [3, 4, 5]
    assert not distributions(matrices, wrenches, LOW, HIGH).is_within[[3, 5]].any()


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1), st.sampled_from(list(RULES)), st.floats(0.25, 4.0))
def test_properties(seed, rule, factor):
    """In any units and any order of cables the same tensions; within limits, they are, and give the wrench."""
    matrices, wrenches = poses(2, 4, seed=seed)
    found = distributions(matrices, wrenches, LOW, HIGH, rule=rule)
    off = np.einsum("nij,nj->ni", matrices, found.tensions) - wrenches
    assert np.abs(off).max() < 1e-10 * np.abs(found.tensions).max()
    kept = found.tensions[found.is_within]
    assert (kept >= LOW - 1e-7).all() and (kept <= HIGH + 1e-7).all()
    order = np.random.default_rng(seed).permutation(4)
    rotated = distributions(matrices[:, :, order], factor * wrenches, factor * LOW, factor * HIGH, rule=rule)
    assert np.array_equal(rotated.is_within, found.is_within)
    size = np.abs(found.tensions).max(1, keepdims=True)
    assert (np.abs(rotated.tensions / factor - found.tensions[:, order]) <= 1e-5 * size).all()


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"rule": "best"}, "least-norm, centred, closed-form"),
        ({"rule": "closed-form", "tension_max": np.inf}, "finite with rule closed-form"),
        ({"rule": "p-norm", "exponent": 1.0}, "from 1.01 to 100"),
        ({"tension_min": [1.0, 2.0]}, "tension_min"),
        ({"wrenches": np.zeros((2, 2))}, "wrenches"),
        ({"matrices": np.zeros((2, 3, 2)), "tension_max": 1.0}, "3 or more"),
    ],
)
def test_what_is_refused(given, words):
    keys = {"matrices": np.zeros((2, 3, 5)), "wrenches": np.zeros((2, 3)), "tension_min": 0.0, "tension_max": 1.0}
    with pytest.raises(InputError, match=words):
        distributions(**keys | given)
