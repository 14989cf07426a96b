"""Amplitude functions: values, derivatives, continuity, and the bounds that certificates take from them."""

import math
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import point_mass as oracle

from cspr_jax.errors import InputError
from cspr_jax.families.swings.arcs import minimum_arcs
from cspr_jax.motion import amplitudes
from cspr_jax.motion.problem import Problem
from cspr_jax.robots.model.limits import Limits

DERIVATIVES = jax.jit(partial(amplitudes.derivatives, order=5))
LOCAL_BOUNDS = jax.jit(amplitudes.local_bounds)
CURVES = {
    "A1": amplitudes.named("A1"),
    "quintic": amplitudes.named("quintic"),
    "A3": amplitudes.named("A3"),
    "effective 0.1": amplitudes.named("effective", 0.1),
    "effective 0.5": amplitudes.named("effective", 0.5),
    "effective-c3 0.2": amplitudes.named("effective-c3", 0.2),
    "effective-c3 0.5": amplitudes.named("effective-c3", 0.5),
    "polynomial": amplitudes.from_polynomial([0.3, -2.0, 5.0, 1.0, -9.0, 4.0, 2.5, -1.0]),
    "constant": amplitudes.from_polynomial([0.7]),
}
CLEAN = [("quintic", None)] + [(n, e) for n in ("effective", "effective-c3") for e in (0.01, 0.0599, 0.13, 0.3, 0.5)]


def inside(curve, n=4001):
    """Points of [0, 1], none of them a knot, and none within 1e-3 of one (for finite differences)."""
    tau = np.linspace(2e-3, 1.0 - 2e-3, n)
    return tau[(np.abs(tau[:, None] - np.asarray(curve.knots)) > 1e-3).all(1)]


@pytest.mark.parametrize("name", CURVES)
def test_each_derivative_is_the_slope_of_the_one_before(name):
    """A wrong factor of a derivative would give a wrong acceleration, or a bound that does not hold."""
    tau, step = inside(CURVES[name]), 1e-4
    before, now, after = (DERIVATIVES(CURVES[name], tau + s) for s in (-step, 0.0, step))
    size = np.asarray(CURVES[name].largest)
    for j in range(5):
        slope = (np.asarray(after[j]) - np.asarray(before[j])) / (2.0 * step)
        second_derivative = size[j + 3] if j < 3 else 500.0 * size[j]  # beyond the fifth no largest value is kept
        np.testing.assert_allclose(now[j + 1], slope, rtol=0, atol=step**2 * second_derivative + 1e-11 * size[j] / step)


@pytest.mark.parametrize(
    ("name", "reference"),
    [
        ("quintic", oracle.quintic),
        ("effective 0.1", partial(oracle.effective, epsilon=0.1)),
        ("effective 0.5", partial(oracle.effective, epsilon=0.5)),
    ],
)
def test_against_the_printed_functions(name, reference):
    """(2.50) and (1.110) as somebody else wrote them down."""
    tau = np.linspace(0.0, 1.0, 1001)
    found = amplitudes.derivatives(CURVES[name], jnp.asarray(tau), order=2)
    assert len(found) == 3
    for mine, theirs in zip(found, reference(tau), strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=0, atol=1e-12 * np.abs(theirs).max())
    single = amplitudes.derivatives(CURVES[name], jnp.asarray(tau, jnp.float32), order=0)[0]
    assert single.dtype == jnp.float32
    np.testing.assert_allclose(single, reference(tau)[0], atol=1e-6)


@pytest.mark.parametrize(
    ("name", "continuous", "jump"),
    [("effective 0.1", 2, 6 / (0.1**2 * 0.9)), ("effective-c3 0.2", 3, 24 / (0.2**3 * (1 - 0.8 * 0.2)))],
)
def test_continuity_at_the_knots(name, continuous, jump):
    """Effective is C2 and its third derivative jumps; effective-c3 is C3 and its fourth jumps."""
    curve = CURVES[name]
    knots = np.asarray(curve.knots)
    left, right = DERIVATIVES(curve, np.nextafter(knots, 0.0)), DERIVATIVES(curve, knots)
    for j in range(continuous + 1):
        np.testing.assert_allclose(left[j], right[j], rtol=0, atol=1e-11 * float(curve.largest[j]))
    broken = np.abs(np.asarray(right[continuous + 1]) - np.asarray(left[continuous + 1]))
    np.testing.assert_allclose(broken, jump, rtol=1e-9)


@pytest.mark.parametrize(("name", "epsilon"), CLEAN)
def test_usable_functions_meet_the_boundary_conditions(name, epsilon):
    """(2.49): otherwise segments would not join, and minimum_arcs would refuse a good function."""
    curve = amplitudes.named(name, epsilon)
    assert amplitudes.boundary_errors(curve) == []
    at_ends = DERIVATIVES(curve, np.array([0.0, 1.0]))
    np.testing.assert_allclose(np.stack(at_ends[:3]), [[0, 1], [0, 0], [0, 0]], atol=1e-12 * float(curve.largest[2]))


def test_broken_boundary_conditions_are_named_and_refused(prototype):
    """A1 and A3 would leave a force jump at the end of every segment."""
    points, z0 = np.array([[0.5, 0.2, 1.5]]), np.array([1.7])
    for curve, error in [
        (CURVES["A1"], "A''(1) = -12, must be 0"),
        (CURVES["A3"], "A''(1) = -8, must be 0"),
        (CURVES["constant"], "A(0) = 0.7, must be 0"),
    ]:
        assert error in amplitudes.boundary_errors(curve)
        with pytest.raises(InputError) as raised:
            minimum_arcs(Problem(prototype, Limits(), curve), points, points, z0)
        assert error in str(raised.value)
    assert len(amplitudes.boundary_errors(CURVES["A1"])) == 1
    slope = amplitudes.from_polynomial([0.0, 1.0])
    assert amplitudes.boundary_errors(slope) == ["A'(0) = 1, must be 0", "A'(1) = 1, must be 0"]


@pytest.mark.parametrize("name", CURVES)
def test_largest_values(name):
    """`largest` must bound every derivative on [0, 1], and not by far: certificates start from it."""
    curve = CURVES[name]
    knots = np.asarray(curve.knots)
    tau = np.sort(np.concatenate([np.linspace(0.0, 1.0, 20_001), knots, np.nextafter(knots, 0.0)]))
    found = np.stack(DERIVATIVES(curve, tau))
    top = np.abs(found).max(1)
    assert (top <= np.asarray(curve.largest)).all()
    np.testing.assert_allclose(curve.largest, top, rtol=1e-6)
    np.testing.assert_allclose([curve.lowest, curve.highest], [found[0].min(), found[0].max()], rtol=0, atol=1e-7)


def test_overshoot_between_the_ends_is_found():
    """The extreme of 4 t (1 - t) lies inside; a double root of the slope must not be lost."""
    hump = amplitudes.from_polynomial([0.0, 4.0, -4.0])
    assert float(hump.highest) == pytest.approx(1.0)
    flat = amplitudes.from_polynomial(np.polynomial.Polynomial([-0.5, 1.0]).__pow__(4).coef)  # (t - 0.5)^4
    assert float(flat.lowest) == pytest.approx(0.0, abs=1e-12)


@given(st.sampled_from(sorted(CURVES)), st.integers(0, 2), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
@settings(max_examples=150)
def test_local_bounds_hold(name, piece, one, other):
    """Every certificate is built on these bounds: one sample above them and it proves nothing."""
    curve = CURVES[name]
    edges = [0.0, *np.asarray(curve.knots).tolist(), 1.0]
    piece = min(piece, len(edges) - 2)
    low, high = edges[piece], np.nextafter(edges[piece + 1], 0.0)
    start, stop = sorted(low + (high - low) * s for s in (one, other))
    bounds = LOCAL_BOUNDS(curve, np.asarray(0.5 * (start + stop)), np.asarray(0.5 * (stop - start)))
    values = DERIVATIVES(curve, np.clip(np.linspace(start, stop, 201), start, stop))
    assert len(bounds) == 5
    for j, bound in enumerate(bounds):
        assert np.abs(values[j]).max() <= float(bound) + 1e-12 * float(curve.largest[j])
        assert float(bound) <= float(curve.largest[j])


def test_local_bounds_of_a_point_are_its_values():
    """Without this, cutting an interval finer would never close the gap of a certificate."""
    for name in ("quintic", "effective 0.1", "polynomial"):
        curve, tau = CURVES[name], inside(CURVES[name], 101)
        bounds = LOCAL_BOUNDS(curve, tau, np.zeros_like(tau))
        for bound, value in zip(bounds, DERIVATIVES(curve, tau), strict=False):
            np.testing.assert_allclose(bound, np.abs(value), rtol=1e-12, atol=1e-300)


@pytest.mark.parametrize("coefficients", [[], [0.0] * 21, [0.0, math.nan], [math.inf]])
def test_unusable_polynomials_are_refused(coefficients):
    """NaN coefficients would pass every comparison that a verdict makes."""
    with pytest.raises(InputError, match="1 to 20 coefficients of at most 1e9"):
        amplitudes.from_polynomial(coefficients)


@pytest.mark.parametrize(
    ("name", "epsilon", "key"),
    [
        ("A4", None, "name"),
        ("quintic", 0.1, "epsilon"),
        ("A1", 0.1, "epsilon"),
        ("effective", None, "epsilon"),
        ("effective", 0.0, "epsilon"),
        ("effective-c3", 0.51, "epsilon"),
        ("effective", math.nan, "epsilon"),
    ],
)
def test_unusable_names_are_refused(name, epsilon, key):
    """A misspelt name or an epsilon without a meaning must not fall back to some other function."""
    with pytest.raises(InputError) as raised:
        amplitudes.named(name, epsilon)
    assert raised.value.key == key


@pytest.mark.parametrize("order", range(6))
def test_values_of_a_polynomial(order):
    """A = 10 tau^3 - 15 tau^4 + 6 tau^5, and its derivatives by NumPy."""
    tau = np.linspace(0.0, 1.0, 7).reshape(7, 1)
    wanted = np.polynomial.Polynomial([0.0, 0.0, 0.0, 10.0, -15.0, 6.0]).deriv(order)(tau)
    np.testing.assert_allclose(amplitudes.named("quintic").at(tau, order), wanted, atol=1e-12 * 720.0)
