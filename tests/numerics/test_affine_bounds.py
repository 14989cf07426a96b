"""Affine bounds contain the functions, shrink with the square of a block, and fail where a formula is wrong."""

import jax
import numpy as np
import pytest

from cspr_jax.numerics.bounds import affine_bounds, function_bounds
from cspr_jax.numerics.bounds.affine_bounds import AffineBounds

# Samples have more digits than the bounds, whose rounding they show.
S = np.linspace(-1.0, 1.0, 401, dtype=np.longdouble)


def functions(seed: int, width: float, count: int = 3, *, parabolas: bool = False):
    """Random positive functions over s, (401, count), and bounds of them; the band is touched."""
    rng = np.random.default_rng(seed)
    middle, slope = rng.uniform(1.0, 3.0, count), rng.normal(size=count) * 0.3 * width
    radius = rng.uniform(0.01, 0.2, count) * width**2
    wave = np.cos(rng.uniform(2.0, 9.0, count) * S[:, None] + rng.uniform(0.0, 6.0, count))
    wave /= np.abs(wave).max(0)
    square = rng.normal(size=count) * 0.2 * width**2 if parabolas else None
    radius = radius * width if parabolas else radius
    curve = square * S[:, None] ** 2 if parabolas else 0.0
    return middle + slope * S[:, None] + curve + radius * wave, AffineBounds(middle, slope, radius, square)


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
    "turned": lambda f, g, of: of.rotated(TURN, of.cross(f, g)),
}
# Operations whose bounds of functions with bands around parabolas have such bands.
PARABOLAS = ("sum", "difference", "product", "constant", "square", "reciprocal", "reciprocal_root", "cross", "dot")
PARABOLAS += ("norm_squared", "turned")
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
    def rotated(matrix, f):
        return f @ matrix.T


class Bounds:
    """The operations on bounds, of both modules."""

    reciprocal, root, reciprocal_root = (
        function_bounds.reciprocal,
        function_bounds.root,
        function_bounds.reciprocal_root,
    )
    arc_sine, sincospi = function_bounds.arc_sine, function_bounds.sincospi
    squared, norm, norm_squared = affine_bounds.squared, affine_bounds.norm, affine_bounds.norm_squared
    cross, dot, rotated = affine_bounds.cross, affine_bounds.dot, affine_bounds.rotated


def excess(name: str, seed: int, width: float, fraction: float = 1.0, *, parabolas: bool = False):
    """How far the exact function leaves a share of the band, and the half height of the band."""
    f, f_bounds = functions(seed, width, parabolas=parabolas)
    g, g_bounds = functions(seed + 1000, width, parabolas=parabolas)
    exact = OPERATIONS[name](f, g, Exact)
    band = jax.tree.map(np.asarray, OPERATIONS[name](f_bounds, g_bounds, Bounds))
    s = S.reshape(-1, *(1,) * (exact.ndim - 1))
    square = 0.0 if band.square is None else band.square * s**2
    assert (exact >= np.asarray(band.low()) - 1e-15).all() and (exact <= np.asarray(band.high()) + 1e-15).all()
    return (np.abs(exact - band.middle - band.linear * s - square) - fraction * band.radius).max(), band.radius.max()


@pytest.mark.parametrize("parabolas", [False, True])
@pytest.mark.parametrize("name", OPERATIONS)
def test_bands_contain_functions(name, parabolas):
    # Remainders are largest in wide blocks; in narrow ones rounding is what is left.
    for width, count in ((1.0, 40), (0.1, 8), (1e-9, 8)):
        assert max(excess(name, seed, width, parabolas=parabolas)[0] for seed in range(count)) <= 0.0


@pytest.mark.parametrize("name", OPERATIONS)
def test_bands_shrink_with_the_square(name):
    for seed in range(10):
        assert 3.0 < excess(name, seed, 0.1)[1] / excess(name, seed, 0.05)[1] < 5.0


@pytest.mark.parametrize("name", PARABOLAS)
def test_bands_around_parabolas_shrink_with_the_third_power(name):
    for seed in range(10):
        assert 6.0 < excess(name, seed, 0.1, parabolas=True)[1] / excess(name, seed, 0.05, parabolas=True)[1] < 10.0


@pytest.mark.parametrize("name", ["product", "reciprocal", "reciprocal_root"])
def test_a_narrower_band_around_a_parabola_is_left(name):
    assert max(excess(name, seed, 1.0, 0.7, parabolas=True)[0] for seed in range(40)) > 0.0


def test_ends_and_tops_of_parabolas():
    """Bounds of the values are those of the parabola, not of its three parts."""
    f, band = functions(3, 1.0, 200, parabolas=True)
    curve = band.middle + band.linear * S[:, None] + band.square * S[:, None] ** 2
    low, high = map(np.asarray, jax.jit(lambda band: (band.low(), band.high()))(band))
    for side, values in ((low + band.radius, curve.min(0)), (high - band.radius, curve.max(0))):
        np.testing.assert_allclose(side, values.astype(float), atol=1e-4 * np.abs(values).max().astype(float))
    assert ((f >= low) & (f <= high)).all()


@pytest.mark.parametrize("name", ["product", "square", "reciprocal", "root", "arc_sine", "cosine"])
def test_a_narrower_band_is_left(name):
    """What a mistake in the remainder would do: a test above sees it."""
    assert max(excess(name, seed, 1.0, 0.7)[0] for seed in range(40)) > 0.0


def test_lengths_of_vectors_that_vanish():
    """A motion begins at rest: its speed is bounded there too."""
    for seed, at in ((seed, at) for seed in range(40) for at in (200, 230, 300)):
        f, f_bounds = functions(seed, 0.3)
        f, f_bounds = f - f[at], f_bounds - f[at].astype(float)
        band = jax.tree.map(np.asarray, affine_bounds.norm(f_bounds))
        assert (np.abs(Exact.norm(f) - band.middle - band.linear * S) <= band.radius).all()
        assert np.asarray(band.high()) <= 3.0 * Exact.norm(f).max() + 0.1


def test_nothing_is_known_where_a_function_may_vanish():
    near = AffineBounds(np.array(0.1), np.array(0.05), np.array(0.06))
    regularization = near._replace(square=np.array(-0.03), radius=np.array(0.03))

    @jax.jit
    def radii(near, regularization):
        roots = (Bounds.reciprocal, Bounds.root, Bounds.reciprocal_root)
        unknown = [operation(x).radius for operation in roots for x in (near, regularization)]
        return [*unknown, Bounds.arc_sine(near * 5.0 - 1.0).radius], Bounds.arc_sine(near).radius

    unknown, known = radii(near, regularization)
    assert np.isnan(unknown).all() and np.isfinite(known)
