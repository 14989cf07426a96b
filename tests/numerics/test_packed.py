"""Numbers that are written in one loop: what comes out is what went in, to the bits that are kept."""

import jax
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cspr_jax.numerics.bounds import chebyshev
from cspr_jax.numerics.linear import packed_arrays

numbers = st.floats(allow_nan=False, allow_infinity=False, allow_subnormal=False, width=64)


@jax.jit
def _there_and_back(values):
    return packed_arrays.unpacked(packed_arrays.packed(values)), packed_arrays.parts(packed_arrays.paired(values))


@given(st.lists(numbers, min_size=6, max_size=6))
def test_numbers_come_back(values):
    """In their order: as they were, two at a time, and within the rounding of float32, four at a time."""
    rough, whole = _there_and_back([np.full(3, x) for x in values])
    assert len(rough) == 8 and len(whole) == 6
    np.testing.assert_array_equal(np.stack(whole)[:, 0], values)
    size = np.abs(np.clip(values, -packed_arrays.LARGEST, packed_arrays.LARGEST))
    off = np.abs(np.stack(rough)[:6, 0] - np.clip(values, -packed_arrays.LARGEST, packed_arrays.LARGEST))
    assert (off <= packed_arrays.SINGLE_ERROR * size + 1.2e-38).all()  # below that float32 has nothing
    np.testing.assert_array_equal(np.stack(rough)[6:], 0.0)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, -0.0, 1.0 + packed_arrays.SINGLE_ERROR * 0.99])
def test_extreme_numbers(value):
    """What is no number stays none; what is too large becomes the largest, of its sign."""
    rough, _ = _there_and_back([np.full(2, x) for x in (1.5, value)])
    wanted = np.float32(np.clip(value, -packed_arrays.LARGEST, packed_arrays.LARGEST))
    np.testing.assert_array_equal(rough[1], np.full(2, wanted))
    np.testing.assert_array_equal(rough[0], 1.5)


def test_bernstein_coefficients_of_rounded_values_are_still_bounds():
    """Once what rounding can change between the nodes is taken off; without that they are not."""
    rng, x, far = np.random.default_rng(0), chebyshev.nodes(), np.linspace(-1.0, 1.0, 2001)
    place = x[rng.integers(1, len(x) - 1, 300)]
    # Parabolas that touch zero in a node, in float64.
    values = 3.0 * (x[:, None] - place) ** 2 + 1e-9
    between = 3.0 * (far[:, None] - place) ** 2 + 1e-9
    there_and_back = jax.jit(lambda v: packed_arrays.unpacked(packed_arrays.packed([v]))[0])
    rough = np.stack([np.asarray(there_and_back(v)) for v in values])
    bound = (chebyshev.bernstein() @ rough).min(0)
    allowed = chebyshev.LEBESGUE * packed_arrays.SINGLE_ERROR * np.abs(rough).max(0)
    assert (bound - allowed <= between.min(0)).all()
    off = np.polynomial.chebyshev.chebval(far, np.polynomial.chebyshev.chebfit(x, rough - values, chebyshev.DEGREE)).T
    assert 0.1 * allowed.max() < np.abs(off).max() and (np.abs(off).max(0) <= allowed).all()
