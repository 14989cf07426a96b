"""Margins and frequencies of ellipses by formulas: against samples, linear programs and bisection."""

import numpy as np
import pytest
from oracles import ellipses as oracle
from oracles.beziers import tensions
from support.ellipses import ellipses, flat_spools, triangle

import cspr_jax
from cspr_jax.families.ellipses import harmonics
from cspr_jax.families.ellipses.harmonics import Ellipse
from cspr_jax.families.ellipses.hull import hull_of
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.robots.statics.kernel_axes import prepared

GRAVITY = 9.81
LEVEL = np.array([[np.sqrt(0.75), -0.5, 0.0], [-np.sqrt(0.75), -0.5, 0.0], [0.0, 1.0, 0.0]])


def on(spools, gravity=GRAVITY, **others):
    return cspr_jax.point_mass(spools, mass=0.7, gravity=gravity, planar=oracle.is_planar(spools), **others)


def compare_with_samples(rng, triangles, each, instants=oracle.INSTANTS):
    """Counts of feasible, of slack ones and of those above the spools, after each was compared with samples."""
    counts = np.zeros(3, int)
    for _ in range(triangles):
        spools, gravity = triangle(rng), rng.uniform(1.0, 15.0)
        centre, a, b, frequency = ellipses(rng, spools, gravity, each)
        found = cspr_jax.ellipse_margins(on(spools, gravity), centre, a, b, frequency)
        sampled, refined = (x.min(1) for x in oracle.margins(spools, gravity, centre, a, b, frequency, instants))
        below = oracle.depths(spools, centre) > 0.0
        assert (found[~below] <= 0.0).all()
        found, sampled, refined = found[below], sampled[below], refined[below]
        tolerance = 1e-9 * (1.0 + np.abs(refined))
        assert (sampled >= found - tolerance).all()
        np.testing.assert_array_less(np.abs(refined - found), tolerance)
        # No exception: a feasible ellipse has taut cables at all samples, any other a slack one.
        assert (sampled[found > 0.0] > 0.0).all()
        assert (refined[found < -1e-11] < 0.0).all() and (np.abs(found) > 1e-11).all()
        counts += [(found > 0.0).sum(), (found <= 0.0).sum(), (~below).sum()]
    return counts


def test_the_sampled_shares_are_tensions():
    rng = np.random.default_rng(5)
    for spools, axes in ((triangle(rng), 3), (flat_spools(rng, 2, planar=True), 2)):
        centre, a, b, frequency = (x[0] for x in ellipses(rng, spools, GRAVITY, 1))
        position, _, acceleration = (x[0] for x in oracle.states(centre, a, b, frequency, np.linspace(0.0, 6.0, 50)))
        lengths = np.linalg.norm(position[:, None] - spools, axis=2)
        force = tensions(spools, 0.7, GRAVITY, position, acceleration) / lengths / (0.7 * GRAVITY)
        shares = axes * oracle.depths(spools, position)[:, None] * force
        np.testing.assert_allclose(oracle.shares(spools, GRAVITY, position, acceleration), shares, atol=1e-9)


@pytest.mark.parametrize("height, radius", [(2.0, 1.0), (2.0, 0.5), (0.7, 2.5), (5.0, 0.01)])
def test_circles_below_level_spools(height, radius):
    """The margin is 1 - (2 R / b) |1 - w^2 z0 / g| about the vertical through the centroid."""
    frequency = np.sqrt(GRAVITY / height) * np.linspace(0.05, 2.0, 40)
    centre = np.tile([0.0, 0.0, height], (40, 1))
    axes = np.array([radius, 0.0, 0.0]), np.array([0.0, radius, 0.0])
    found = cspr_jax.ellipse_margins(on(LEVEL), centre, *axes, frequency)
    swing = 2.0 * radius * np.abs(1.0 - frequency**2 * height / GRAVITY)
    np.testing.assert_allclose(found, 1.0 - swing, rtol=1e-12, atol=1e-12 * (1.0 + swing.max()))
    (ends,) = cspr_jax.ellipse_frequencies(on(LEVEL), centre[:1], *axes)
    within = 0.5 / radius
    exact = np.sqrt(GRAVITY / height * np.array([[max(1.0 - within, 0.0), 1.0 + within]]))
    np.testing.assert_allclose(ends, exact, rtol=1e-12, atol=1e-7)


def test_printed_frequencies():
    centre, radii = np.tile([0.0, 0.0, 2.0], (2, 1)), np.array([[1.0], [0.5]])
    wide, inscribed = cspr_jax.ellipse_frequencies(on(LEVEL), centre, radii * [1.0, 0.0, 0.0], radii * [0.0, 1.0, 0.0])
    np.testing.assert_allclose(wide, [[1.56605, 2.71247]], atol=5e-6)
    assert inscribed[0, 0] < 1e-7


def test_margins_are_those_of_samples():
    feasible, slack, above = compare_with_samples(np.random.default_rng(0), 20, 100)
    assert min(feasible, slack) > 300 and above > 50


def test_margins_are_in_the_order_of_the_cables():
    rng = np.random.default_rng(6)
    for spools in (triangle(rng), flat_spools(rng, 2, planar=True)):
        case = ellipses(rng, spools, GRAVITY, 24, above=False)
        robot, frame = prepared(on(spools))
        with double_precision():
            items = Ellipse(frame.inward(case[0]), case[1], case[2])
            found = harmonics.of_many(harmonics.harmonic_margins, hull_of(robot), items, case[3])
        exact = oracle.margins(spools, GRAVITY, *case, 401)[1]
        np.testing.assert_allclose(found, exact, rtol=1e-9, atol=1e-9 * (1.0 + np.abs(exact).max()))


@pytest.mark.soak
def test_margins_of_a_hundred_thousand_ellipses_are_those_of_samples():
    counts = compare_with_samples(np.random.default_rng(1), 1000, 100)
    assert counts.sum() == 100_000 and (counts > 5000).all()


LONGER = [pytest.param(*case, marks=pytest.mark.thorough) for case in ((2, True), (3, True), (4, False))]


@pytest.mark.parametrize("cables, planar", [(5, True), (5, False), *LONGER])
def test_margins_on_any_cables_are_those_of_linear_programs(cables, planar):
    rng, counts = np.random.default_rng(cables), [0, 0]
    for _ in range(2):
        spools = flat_spools(rng, cables, planar=planar)
        centre, a, b, frequency = ellipses(rng, spools, GRAVITY, 8, above=False)
        found = cspr_jax.ellipse_margins(on(spools), centre, a, b, frequency)
        for k, margin in enumerate(found):
            programmed = oracle.margin_by_programs(spools, GRAVITY, centre[k], a[k], b[k], frequency[k], instants=101)
            assert margin == pytest.approx(programmed, rel=1e-7, abs=1e-7)
            counts[int(margin > 0.0)] += 1
    assert min(counts) > 1


def compare_intervals(rng, triangles, each, instants):
    """Numbers of ellipses with and without feasible frequencies, after their ends were compared with bisection."""
    counts = np.zeros(2, int)
    for k in range(triangles):
        spools = flat_spools(rng, 2, planar=True) if k % 3 == 1 else triangle(rng)
        centre, a, b, _ = ellipses(rng, spools, GRAVITY, each)
        found = cspr_jax.ellipse_frequencies(on(spools), centre, a, b)
        low, high, margin = oracle.intervals(spools, GRAVITY, centre, a, b, instants)
        for i, ends in enumerate(found):
            if len(ends) == 0:
                assert margin[i] < 1e-9
            elif high[i] > 1e6:
                assert (ends == [[0.0, np.inf]]).all() and low[i] == 0.0
            else:
                np.testing.assert_allclose(ends, [[low[i], high[i]]], rtol=1e-9, atol=1e-9)
            counts[min(len(ends), 1)] += 1
    return counts


@pytest.mark.thorough
def test_frequencies_are_those_of_bisection():
    assert (compare_intervals(np.random.default_rng(2), 2, 16, 201) > 5).all()


@pytest.mark.soak
def test_many_frequencies_are_those_of_bisection():
    assert (compare_intervals(np.random.default_rng(3), 20, 100, 401) > 200).all()


@pytest.mark.parametrize("cables, planar", [(5, False), *LONGER])
def test_frequencies_on_any_cables_end_where_linear_programs_do(cables, planar):
    rng, bounded = np.random.default_rng(cables + 10), 0
    spools = flat_spools(rng, cables, planar=planar)
    centre, a, b, _ = ellipses(rng, spools, GRAVITY, 8, above=False)

    def programmed(k, frequency):
        return oracle.margin_by_programs(spools, GRAVITY, centre[k], a[k], b[k], frequency, instants=101)

    for k, ends in enumerate(cspr_jax.ellipse_frequencies(on(spools), centre, a, b)):
        if len(ends) == 0:
            assert programmed(k, np.sqrt(GRAVITY / oracle.depths(spools, centre[k]))) < 1e-7
            continue
        for end in ends[0][(ends[0] > 0.0) & np.isfinite(ends[0])]:
            assert programmed(k, end) == pytest.approx(0.0, abs=1e-7)
            bounded += 1
    assert bounded > 3
