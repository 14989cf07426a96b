"""Affine bounds contain the functions, shrink with the square of a block, and fail where a formula is wrong."""

import jax
import numpy as np
import pytest

from cspr_jax.arithmetic import affine_bounds as bounds
from cspr_jax.arithmetic.affine_bounds import AffineBounds

# Samples have more digits than the bounds, whose rounding they show.
S = np.linspace(-1.0, 1.0, 401, dtype=np.longdouble)


@pytest.fixture(autouse=True)
def float64():
    with jax.enable_x64(True):
        yield


def functions(seed: int, width: float, count: int = 3):
    """Random positive functions over s, (401, count), and bounds of them; the band is touched."""
    rng = np.random.default_rng(seed)
    middle, slope = rng.uniform(1.0, 3.0, count), rng.normal(size=count) * 0.3 * width
    radius = rng.uniform(0.01, 0.2, count) * width**2
    wave = np.cos(rng.uniform(2.0, 9.0, count) * S[:, None] + rng.uniform(0.0, 6.0, count))
    wave /= np.abs(wave).max(0)
    return middle + slope * S[:, None] + radius * wave, AffineBounds(middle, slope, radius)


OPERATIONS = {
    "sum": lambda f, g, of: f + g,
    "difference": lambda f, g, of: 2.0 - (f - g),
    "product": lambda f, g, of: f * g,
    "constant": lambda f, g, of: -3.0 * f + 1.5,
    "square": lambda f, g, of: of.squared(f - 2.0),
    "reciprocal": lambda f, g, of: of.reciprocal(f),
    "root": lambda f, g, of: of.root(f),
    "reciprocal_root": lambda f, g, of: of.reciprocal_root(f),
    "arc_sine": lambda f, g, of: of.arc_sine(0.25 * (f - 2.0)),
    "sine": lambda f, g, of: of.sincospi(f)[0],
    "cosine": lambda f, g, of: of.sincospi(f - g)[1],
    "cross": lambda f, g, of: of.cross(f, g),
    "dot": lambda f, g, of: of.dot(f, g),
    "norm_squared": lambda f, g, of: of.norm_squared(f),
    "norm": lambda f, g, of: of.norm(f - 0.5 * g),
    "turned": lambda f, g, of: of.turned(TURN, of.cross(f, g)),
}
TURN = np.array([[0.0, 1.0, 2.0], [-1.0, 3.0, 0.5], [0.2, -0.4, 0.0]])


class Exact:
    """The same operations on samples."""

    squared, reciprocal, root, arc_sine = np.square, np.reciprocal, np.sqrt, np.arcsin
    cross = staticmethod(np.cross)

    @staticmethod
    def reciprocal_root(f):
        return f**-0.5

    @staticmethod
    def sincospi(f):
        return np.sin(np.pi * f), np.cos(np.pi * f)

    @staticmethod
    def dot(f, g):
        return (f * g).sum(-1)

    @staticmethod
    def norm_squared(f):
        return (f**2).sum(-1)

    @staticmethod
    def norm(f):
        return (f**2).sum(-1) ** 0.5

    @staticmethod
    def turned(matrix, f):
        return f @ matrix.T


def excess(name: str, seed: int, width: float, share: float = 1.0):
    """How far the exact function leaves a share of the band, and the half height of the band."""
    f, f_bounds = functions(seed, width)
    g, g_bounds = functions(seed + 1000, width)
    exact = OPERATIONS[name](f, g, Exact)
    band = jax.tree.map(np.asarray, OPERATIONS[name](f_bounds, g_bounds, bounds))
    s = S.reshape(-1, *(1,) * (exact.ndim - 1))
    return (np.abs(exact - band.middle - band.slope * s) - share * band.radius).max(), band.radius.max()


@pytest.mark.parametrize("name", OPERATIONS)
def test_bands_contain_functions(name):
    for seed in range(40):
        for width in (1.0, 0.1, 1e-9):
            assert excess(name, seed, width)[0] <= 0.0


@pytest.mark.parametrize("name", OPERATIONS)
def test_bands_shrink_with_the_square(name):
    for seed in range(10):
        assert 3.0 < excess(name, seed, 0.1)[1] / excess(name, seed, 0.05)[1] < 5.0


@pytest.mark.parametrize("name", ["product", "square", "reciprocal", "root", "arc_sine", "cosine"])
def test_a_narrower_band_is_left(name):
    """What a mistake in the remainder would do: a test above sees it."""
    assert max(excess(name, seed, 1.0, 0.7)[0] for seed in range(40)) > 0.0


def test_lengths_of_vectors_that_vanish():
    """A motion begins at rest: its speed is bounded there too."""
    for seed, at in ((seed, at) for seed in range(40) for at in (200, 230, 300)):
        f, f_bounds = functions(seed, 0.3)
        f, f_bounds = f - f[at], f_bounds - f[at].astype(float)
        band = jax.tree.map(np.asarray, bounds.norm(f_bounds))
        assert (np.abs(Exact.norm(f) - band.middle - band.slope * S) <= band.radius).all()
        assert np.asarray(band.high()) <= 3.0 * Exact.norm(f).max() + 0.1


def test_nothing_is_known_where_a_function_may_vanish():
    near = AffineBounds(np.array(0.1), np.array(0.05), np.array(0.06))
    for operation in (bounds.reciprocal, bounds.root, bounds.reciprocal_root):
        assert np.isnan(operation(near).radius)
    assert np.isnan(bounds.arc_sine(near * 5.0 - 1.0).radius) and np.isfinite(bounds.arc_sine(near).radius)
