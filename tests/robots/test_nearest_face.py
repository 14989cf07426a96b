"""Nearest faces against the exact most central tensions of random balances."""

from functools import partial

import jax
import numpy as np
import pytest

from cspr_jax.robots.tensions.nearest_face import nearest_face
from cspr_jax.robots.tensions.tension_distribution import centred

COUNT = 60


def balances(dof: int, count: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unit columns, some of which pull against others, wrenches, and tensions that give them."""
    rng = np.random.default_rng(seed)
    matrices = rng.normal(size=(COUNT, dof, count))
    matrices /= np.linalg.norm(matrices, axis=1, keepdims=True)
    tensions = rng.uniform(-5.0, 40.0, (COUNT, count))
    return matrices, np.einsum("kij,kj->ki", matrices, tensions), tensions


@jax.jit
@partial(jax.vmap, in_axes=(0, 0, None, None))
def FACES(matrix, wrench, low, high):
    return nearest_face(matrix, wrench, low, high), centred(matrix, wrench, low, high)[1]


def results(*arguments):
    return jax.tree.map(np.asarray, FACES(*arguments))


SHAPES = [(2, 3), (3, 5), (3, 8), (6, 8), *(pytest.param(6, n, marks=pytest.mark.thorough) for n in (7, 10))]


@pytest.mark.quick("2-3", "6-8")
@pytest.mark.parametrize(("dof", "count"), SHAPES)
def test_tensions_are_most_central(dof, count):
    matrices, wrenches, _ = balances(dof, count, count)
    for top in (25.0, np.inf):
        low, high = np.full(count, 1.0), np.full(count, top)
        face, largest = results(matrices, wrenches, low, high)
        np.testing.assert_allclose(np.einsum("kij,kj->ki", matrices, face.tensions), wrenches, atol=1e-7)
        margin = np.minimum(face.tensions - low, high - face.tensions).min(1)
        bounded = np.isfinite(largest)
        assert bounded.mean() > 0.1
        np.testing.assert_allclose(margin[bounded], largest[bounded], rtol=1e-6, atol=1e-6)
        # Where nothing is the limit, tensions are well above their smallest.
        assert (margin[np.isinf(largest)] > 10.0).all()


def test_cable_beside_the_face():
    """Two cables in line, and one that no wrench without change concerns."""
    matrix, wrench = np.array([[[1.0, -1.0, 0.0], [0.0, 0.0, 1.0]]]), np.array([[2.0, 7.0]])
    cases = (np.repeat(x, COUNT, axis=0) for x in (matrix, wrench))
    face, largest = results(*cases, np.full(3, 1.0), np.full(3, 9.0))
    np.testing.assert_allclose(face.tensions[0], [7.0, 5.0, 7.0], atol=1e-12)
    assert largest[0] == pytest.approx(2.0)


def test_ranges_of_cables_differ():
    """Where one cable has less range than the faces leave, tensions are within limits wherever any are."""
    matrices, wrenches, _ = balances(3, 5, 5)
    low, high = np.full(5, 1.0), np.array([4.0, 60.0, 40.0, 50.0, 45.0])
    face, largest = results(matrices, wrenches, low, high)
    margin = np.minimum(face.tensions - low, high - face.tensions).min(1)
    assert (largest == 1.5).mean() > 0.1
    np.testing.assert_array_equal(margin > 0.0, largest > 0.0)
