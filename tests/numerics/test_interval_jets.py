"""Interval jets: bounds of functions and of their derivatives contain what automatic differentiation finds."""

import itertools
from functools import partial

import jax
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cspr_jax.numerics.bounds.interval_jets import Jet, lowest

FORMULAS = {
    "sum": lambda x: 2.0 * x - 3.0 + x * x,
    "square": lambda x: (x - 0.3) ** 2 * 4.0 + 1.0,
    "length": lambda x: ((x - 0.3) ** 2 * 4.0 + 0.1) ** 0.5,
    "quotient": lambda x: (1.0 - x) / (x * x + 0.5),
    "mixed": lambda x: 2.0 - (x**2 * 3.0 + 0.2) ** -1.5 * (x - 0.1) / 2.0 - x,
}


@partial(jax.jit, static_argnums=0)
def derivatives(name, x):
    """Values of a formula and its first two derivatives."""
    formula = FORMULAS[name]
    return [jax.vmap(f)(x) for f in (formula, jax.grad(formula), jax.grad(jax.grad(formula)))]


@pytest.mark.parametrize("name", FORMULAS)
@settings(max_examples=40)
@given(st.floats(-2.0, 2.0), st.floats(1e-3, 2.0))
def test_bounds_contain_all_values(name, start, width):
    formula, x = FORMULAS[name], start + width * np.linspace(0.0, 1.0, 23)
    one, none = np.ones(1), np.zeros(1)
    with np.errstate(invalid="ignore"):  # a quotient by what may be zero, of which nothing is known
        jet = formula(Jet((start * one, (start + width) * one), (one, one), (none, none)))
    values = [np.asarray(found) for found in derivatives(name, x)]
    for (low, high), found in zip((jet.value, jet.derivative, jet.second_derivative), values, strict=True):
        room = 1e-9 * (1.0 + np.abs(found).max())
        assert not low[0] > found.min() + room and not high[0] < found.max() - room
    # Over a block of width 1.
    scaled = Jet(
        jet.value, tuple(width * y for y in jet.derivative), tuple(width**2 * y for y in jet.second_derivative)
    )
    ends = np.asarray(values[0])[[0, -1], None]
    assert lowest(ends, scaled)[0] <= values[0].min() + 1e-9 * (1.0 + np.abs(values[0]).max())


def test_small_blocks_have_sharp_bounds():
    """The bound of a block's smallest value comes nearer with the third power of its width, or faster."""
    formula, gaps = FORMULAS["mixed"], []
    for width in (0.1, 0.05, 0.025):
        one = np.ones(1)
        jet = formula(Jet((-0.2 * one, (width - 0.2) * one), (width * one, width * one), (0.0 * one, 0.0 * one)))
        x = -0.2 + width * np.linspace(0.0, 1.0, 2001)
        gaps.append(formula(x).min() - lowest(formula(x)[[0, -1], None], jet)[0])
    assert all(-1e-12 <= b <= a / 3.9 + 1e-12 for a, b in itertools.pairwise(gaps))
