"""Elementary functions and the arithmetic of bounds: everything else stands on them."""

import os
import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from cspr_jax.numerics.bounds.value_and_derivatives import Bounds
from cspr_jax.numerics.elementary import maximum_of, minimum_of, polynomial, sincospi
from cspr_jax.numerics.linear.lanes import smallest_of_each

# As users' kernels are compiled, and with `compile_options.proof_options`: there sums and products are rounded apart.
SINCOSPI, APART = (jax.jit(sincospi, compiler_options={"xla_backend_optimization_level": i}) for i in (1, 0))
PI = np.longdouble("3.14159265358979323846264338327950288")


def reference(x):
    """Sine and cosine of pi x in extended precision, after the exact reduction of x to [-1, 1]."""
    reduced = x - 2.0 * np.round(x / 2.0)  # exact: x is a double below 2^50
    angle = PI * reduced.astype(np.longdouble)
    return np.sin(angle), np.cos(angle)


@pytest.mark.parametrize(
    ("called", "dtype", "allowed"),
    [
        (SINCOSPI, "float64", 3.5e-16),
        (SINCOSPI, "float32", 2e-7),
        (APART, "float64", 3.5e-16),
        (APART, "float32", 2e-7),
    ],
    ids=["float64", "float32", "float64 apart", "float32 apart"],
)
def test_sine_and_cosine_keep_the_stated_precision(called, dtype, allowed):
    """A lost term of the series, or a wrong sign in a half turn, would make every trajectory wrong."""
    rng = np.random.default_rng(1)
    x = np.concatenate([np.linspace(-2.5, 2.5, 20_001), rng.uniform(-40.0, 40.0, 20_000)]).astype(dtype)
    sine, cosine = called(x)
    assert str(sine.dtype) == str(cosine.dtype) == dtype
    for found, wanted in zip((sine, cosine), reference(x.astype(float)), strict=True):
        assert np.abs(np.asarray(found).astype(np.longdouble) - wanted).max() <= allowed


def test_multiples_of_a_quarter_turn():
    """Cusps lie at whole half turns: there sine must be exactly 0 and cosine exactly +-1."""
    k = np.arange(-41.0, 42.0)
    sine, cosine = SINCOSPI(k)
    assert np.array_equal(np.abs(sine), np.zeros(83))
    assert np.array_equal(cosine, 1.0 - 2.0 * (np.abs(k) % 2))
    sine, cosine = SINCOSPI(k + 0.5)
    np.testing.assert_allclose(sine, 1.0 - 2.0 * (np.abs(k) % 2), rtol=0, atol=3e-16)
    np.testing.assert_allclose(cosine, 0.0, rtol=0, atol=3e-16)


def test_large_arguments_lose_nothing():
    """Many arcs mean many half turns: the angle must be reduced without rounding."""
    rng = np.random.default_rng(2)
    whole, part = np.floor(2.0 ** rng.uniform(10.0, 42.0, 4000)), rng.integers(0, 256, 4000) / 256.0
    x = np.concatenate([whole + part, -whole - part, [2.0**49, 2.0**49 + 1.0, 2.0**49 + 0.25]])
    for found, wanted in zip(SINCOSPI(x), reference(x), strict=True):
        assert np.abs(np.asarray(found).astype(np.longdouble) - wanted).max() <= 3e-16


def test_parity():
    """Reversed segments are compared to the last bit of margins: sine must be odd, cosine even."""
    x = np.random.default_rng(3).uniform(0.0, 50.0, 5000)
    (sine, cosine), (mirrored_sine, mirrored_cosine) = SINCOSPI(x), SINCOSPI(-x)
    assert np.array_equal(sine, -mirrored_sine)
    assert np.array_equal(cosine, mirrored_cosine)


def test_polynomial_is_lowest_power_first_and_keeps_the_dtype():
    """Swapped coefficients would turn every amplitude function round."""
    rng = np.random.default_rng(4)
    coefficients, x = rng.normal(size=7), rng.normal(size=50)
    wanted = np.polynomial.polynomial.polyval(x, coefficients)
    np.testing.assert_allclose(polynomial(coefficients, x), wanted, rtol=1e-13, atol=1e-13)
    own = rng.normal(size=(3, 50))  # one set of coefficients for each element
    np.testing.assert_allclose(polynomial(list(own), x), own[0] + own[1] * x + own[2] * x**2, rtol=1e-13)
    assert jax.eval_shape(lambda x: polynomial([1.0, 2.0], x), jnp.float32(0.0)).dtype == jnp.float32
    assert np.array_equal(polynomial([], np.ones(2)), np.zeros(2))


def waves(rng, n):
    """Values and two derivatives of n random smooth functions on 2001 points, (3, n, 2001)."""
    t = np.linspace(0.0, 1.0, 2001)
    size, pace, phase = rng.normal(size=(n, 4, 1)), rng.uniform(0.0, 12.0, (n, 4, 1)), rng.uniform(0.0, 7.0, (n, 4, 1))
    terms = [size * pace**j * np.sin(pace * t + phase + 0.5 * np.pi * j) for j in range(3)]
    return np.stack(terms).sum(2)


def largest(values):
    """Bounds of sampled values and derivatives (3, n, samples)."""
    return Bounds(*np.abs(values).max(-1))


def assert_bounds(bounds, values):
    for bound, value in zip(bounds, np.abs(values), strict=True):
        assert (value <= np.asarray(bound)[:, None] * (1.0 + 1e-12)).all()


def test_bounds_hold_for_random_functions():
    """A bound that is too small makes a certificate lie."""
    rng = np.random.default_rng(5)
    f, g = waves(rng, 200), waves(rng, 200)
    product = np.stack([f[0] * g[0], f[1] * g[0] + f[0] * g[1], f[2] * g[0] + 2.0 * f[1] * g[1] + f[0] * g[2]])
    assert_bounds(largest(f) + largest(g), f + g)
    assert_bounds(largest(f) + largest(g), f - g)
    assert_bounds(largest(f) * largest(g), product)
    assert_bounds(largest(f).times(-1.7), -1.7 * f)
    assert_bounds(largest(f).combined(largest(g)), np.hypot(f, g))
    rate = 2.3
    vector = f + 1j * g
    rotated = np.stack([vector[0], vector[1] + 1j * rate * vector[0]])
    rotated = np.stack([*rotated, vector[2] + 2j * rate * vector[1] - rate**2 * vector[0]])
    assert_bounds(largest(f).combined(largest(g)).rotated(jnp.asarray(rate)), rotated)


def test_bounds_are_attained():
    """Exponentials meet every bound with equality: a missing term shows, and a superfluous one."""
    a, b, rate = 1.3, 0.7, 2.3
    f, g = Bounds(*(a**j * np.e**a for j in range(3))), Bounds(*(b**j * np.e**b for j in range(3)))
    np.testing.assert_allclose(f * g, [(a + b) ** j * np.e ** (a + b) for j in range(3)], rtol=1e-13)
    np.testing.assert_allclose(f + g, [a**j * np.e**a + b**j * np.e**b for j in range(3)], rtol=1e-13)
    np.testing.assert_allclose(f.times(-3.0), [3.0 * v for v in f], rtol=1e-13)
    np.testing.assert_allclose(f.combined(f.times(2.0)), [5.0**0.5 * v for v in f], rtol=1e-13)
    circle = Bounds(1.0, a, a**2)  # a vector that turns at rate a, seen from axes that turn against it
    np.testing.assert_allclose(circle.rotated(rate), [1.0, a + rate, (a + rate) ** 2], rtol=1e-13)


def test_smallest_of_each_array():
    """As NumPy finds them, each by itself; NaN stays NaN."""
    arrays = np.random.default_rng(3).normal(size=(3, 17, 5))
    arrays[1, 4, 2], arrays[2, :, 0] = np.nan, np.inf
    found = jax.jit(smallest_of_each)(list(arrays))
    np.testing.assert_array_equal(found, arrays.min(1))


@pytest.mark.parametrize("shape", [(3, 5), (64, 64), (64, 2, 2, 2, 4, 2)])
def test_extremes_keep_nan_however_many_values_there_are(shape):
    """As NumPy's do; XLA alone leaves NaN out of many values."""
    values = np.random.default_rng(2).normal(size=shape)
    values.flat[:: values.size // 7] = np.nan
    for axis in (None, *range(len(shape)), -1):
        for found, wanted in ((minimum_of, np.min), (maximum_of, np.max)):
            compiled = jax.jit(lambda x, found=found, axis=axis: found(x, axis=axis))(values)
            np.testing.assert_array_equal(compiled, wanted(values, axis=axis))
    alone = jax.jit(lambda x: smallest_of_each([x])[0])(values)
    np.testing.assert_array_equal(alone, values.min(0))


@pytest.mark.parametrize(("first", "kept"), [("", True), ("jnp.ones(3).sum()", False)])
def test_where_jax_has_started_before_extremes_test_for_nan(first, kept):
    """The flag comes too late, which a warning says; whoever starts jax has NaN kept by XLA, also in sums."""
    code = f"""
import warnings
import jax, jax.numpy as jnp, numpy as np
{first}
from cspr_jax.numerics import elementary
values = np.ones((1000, 200), np.float32)
values[7, 5] = np.nan
with warnings.catch_warnings(record=True) as seen, elementary.double_precision():
    warnings.simplefilter("always")
    functions = elementary.minimum_of, elementary.maximum_of
    extremes = [jax.jit(f, static_argnames="axis")(values, axis=1) for f in functions]
    sums = jax.jit(lambda x: jnp.minimum(x, 0.0).sum(1))(values)
print(all(np.isnan(x).tolist() == np.isnan(values).any(1).tolist() for x in extremes))
print(bool(np.isnan(sums[7])), elementary.keeps_nan(), [str(one.message) for one in seen])
"""
    here = {name: value for name, value in os.environ.items() if name != "XLA_FLAGS"} | {"JAX_PLATFORMS": "cpu"}
    done = subprocess.run([sys.executable, "-c", code], env=here, capture_output=True, text=True)
    right, told = done.stdout.splitlines()
    assert right == "True", done.stderr
    assert told == "True True []" if kept else told.startswith("False False ['XLA leaves NaN out")


def test_extremes_of_whole_numbers_and_of_none():
    assert maximum_of(jnp.arange(5)) == 4 and minimum_of(jnp.zeros(0), initial=jnp.inf) == jnp.inf
    np.testing.assert_array_equal(minimum_of(jnp.ones((2, 3)), axis=1, keepdims=True), np.ones((2, 1)))
