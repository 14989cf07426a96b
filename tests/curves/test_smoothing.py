"""Smoothing gives the smoothest curve near the samples among those with the same ends, and adds no jolt to it."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline, make_interp_spline
from scipy.optimize import brentq

from cspr_jax.config.motions.table import MotionTable
from cspr_jax.curves.reading import spline_of
from cspr_jax.curves.smoothing import smoothed

from .test_noise import least_jerk, trapezoid

STILL = np.zeros(1)
# Curves through values at knots, and derivatives that are 0 at both ends besides.
CURVES = {
    ("cubic", "rest"): (lambda t, v: CubicSpline(t, v, bc_type="clamped"), (2,)),
    ("cubic", "natural"): (lambda t, v: CubicSpline(t, v, bc_type="natural"), ()),
    ("cubic", "periodic"): (lambda t, v: CubicSpline(t, v, bc_type="periodic"), ()),
    ("quintic", "rest"): (lambda t, v: make_interp_spline(t, v, 5, bc_type=((zeros(v, 1, 2),) * 2)), ()),
    ("quintic", "natural"): (lambda t, v: make_interp_spline(t, v, 5, bc_type=((zeros(v, 3, 4),) * 2)), ()),
}


def zeros(values, *orders):
    return [(order, np.zeros(values.shape[1])) for order in orders]


def bending(curve, times):
    """Integral of the squared second derivative, by Gauss between the knots."""
    nodes, weights = np.polynomial.legendre.leggauss(6)
    width = np.diff(times)[:, None]
    points = times[:-1, None] + width * (nodes + 1.0) / 2.0
    values = curve(points.ravel(), 2).reshape(*points.shape, -1)
    return float(np.einsum("ij,ijk->", width * weights / 2.0, values**2))


def smoothest(times, values, deviation, kind, ends):
    """Values at the samples by a dense quadratic program with a multiplier for the deviation, and their integral."""
    make, orders = CURVES[kind, ends]
    unit = np.eye(len(times))
    if ends == "periodic":
        unit = np.vstack([unit[:-1, :-1], unit[0, :-1]])
    basis = make(times, unit)
    nodes, weights = np.polynomial.legendre.leggauss(6)
    width = np.diff(times)[:, None]
    points = (times[:-1, None] + width * (nodes + 1.0) / 2.0).ravel()
    rows = basis(points, 2) * np.sqrt((width * weights / 2.0).ravel())[:, None]
    keeps = (
        np.concatenate([basis(times[[0, -1]], order) for order in orders]) if orders else np.zeros((0, unit.shape[1]))
    )

    def solve(power):
        matrix = rows.T @ rows + 10.0**power * unit.T @ unit
        system = np.block([[matrix, keeps.T], [keeps, np.zeros((len(keeps), len(keeps)))]])
        right = np.vstack([10.0**power * unit.T @ values, np.zeros((len(keeps), values.shape[1]))])
        return unit @ np.linalg.solve(system, right)[: unit.shape[1]]

    def miss(power):
        return np.sqrt(np.mean((solve(power) - values) ** 2)) - deviation

    found = solve(brentq(miss, -12.0, 9.0, xtol=1e-6))
    return found, bending(make(times, found), times)


@pytest.mark.parametrize(("kind", "ends"), CURVES)
def test_a_quadratic_program_finds_no_smoother_curve(kind, ends):
    rng = np.random.default_rng(3)
    times = np.cumsum(rng.uniform(0.06, 0.14, size=40))
    fraction = (times - times[0]) / np.ptp(times)
    turn = 2.0 * np.pi * fraction
    paths = {"rest": least_jerk(fraction, 1.0), "natural": fraction + 0.3 * np.sin(turn), "periodic": np.sin(turn)}
    values = np.stack([paths[ends], 0.5 * paths[ends] ** 2, 0.2 * paths[ends] + 2.0], axis=1)
    values += 2e-3 * rng.normal(size=values.shape)
    if ends == "periodic":
        values[-1] = values[0]
    found = smoothed(MotionTable(times, values, interpolation=kind, ends=ends), 2e-3)
    expected, least = smoothest(times, values, 2e-3, kind, ends)
    np.testing.assert_allclose(found.positions, expected, atol=3e-6)
    assert bending(CURVES[kind, ends][0](times, found.positions), times) == pytest.approx(least, rel=1e-3)
    assert np.sqrt(np.mean((found.positions - values) ** 2)) == pytest.approx(2e-3, rel=1e-3)
    assert (found.interpolation, found.ends) == (kind, ends)


def state(curve, times, order):
    """A derivative of a spline at times, from its Bernstein coefficients."""
    knots, table = np.asarray(curve.knots), np.asarray(curve.position)
    piece = np.clip(np.searchsorted(knots, times, side="right") - 1, 0, len(knots) - 2)
    width, degree = np.diff(knots)[piece], table.shape[1] - 1
    fraction, rows = (times - knots[piece]) / width, table[piece]
    for k in range(order):
        rows = (degree - k) * np.diff(rows, axis=1) / width[:, None, None]
    while rows.shape[1] > 1:
        rows = rows[:, :-1] * (1.0 - fraction)[:, None, None] + rows[:, 1:] * fraction[:, None, None]
    return rows[:, 0]


RECORDS = {
    "from rest to rest": lambda t: np.stack(
        [0.05 * least_jerk(t, 4.0), 0.03 * least_jerk(t, 4.0), 1.0 + 0 * t], axis=1
    ),
    "with jumps of the acceleration": lambda t: np.stack([trapezoid(t, 0.3, 4.0 / 3.0), 0 * t, 1.0 + 0 * t], axis=1),
    "rest, then motion": lambda t: np.stack(
        [least_jerk(t - 1.5, 1.5), 0 * t, 2.0 + 0.1 * least_jerk(t - 2.0, 1.0)], axis=1
    ),
}


@pytest.mark.parametrize("name", RECORDS)
@pytest.mark.parametrize("kind", ["quintic", pytest.param("cubic", marks=pytest.mark.thorough)])
@pytest.mark.parametrize(
    ("decimals", "noise"), [pytest.param(12, 0.0, marks=pytest.mark.thorough), (4, 0.0), (12, 1e-4)]
)
def test_no_jolt_where_a_record_is_at_rest(name, kind, decimals, noise):
    """The curve that is proved begins and ends at rest, and bends no more than the one through the samples."""
    times = np.linspace(0.0, 4.0, 201)
    exact = RECORDS[name](times)
    values = np.round(exact + noise * np.random.default_rng(1).normal(size=exact.shape), decimals)
    fine = np.linspace(0.0, 4.0, 4001)
    largest = np.abs(np.gradient(np.gradient(RECORDS[name](fine), fine, axis=0), fine, axis=0))[5:-5].max()
    through = spline_of(MotionTable(times, values, interpolation=kind))
    before = np.sum(state(through, fine, 2) ** 2)
    for deviation in (1e-6, 3e-5, 1e-4, 3e-4, 1e-3):
        found = smoothed(MotionTable(times, values, interpolation=kind), deviation)
        assert found.ends is None and not any("motion" in note for note in found.notes)
        curve = spline_of(found)
        assert np.sum(state(curve, fine, 2) ** 2) <= before * (1.0 + 1e-6)
        assert np.abs(state(curve, fine[[0, -1]], 1)).max() < 1e-9
        if name != "with jumps of the acceleration" and deviation >= noise:
            assert np.abs(state(curve, fine[[0, -1]], 2)).max() < 1e-6
            if deviation >= 1e-4:
                assert np.abs(state(curve, fine, 2)).max() < 1.15 * largest
        before = np.sum(state(curve, fine, 2) ** 2) * 1.001  # a larger deviation makes it smoother still


@pytest.mark.parametrize("noise", [0.0, 1e-4, 1e-3])
@pytest.mark.parametrize("kind", ["cubic", "quintic"])
def test_an_end_in_motion_is_kept_as_measured(noise, kind):
    times = np.arange(0.0, 4.0, 0.01)
    rng = np.random.default_rng(2)
    for rest, values in (
        (False, np.stack([np.cos(2 * times), np.sin(2 * times), 2.0 + 0 * times], axis=1)),
        (True, np.stack([times**3 / 64.0, 0 * times, 0 * times], axis=1)),
    ):
        speeds = np.gradient(values, times, axis=0, edge_order=2)[[0, -1]]
        table = MotionTable(times, values + noise * rng.normal(size=values.shape), interpolation=kind)
        found = smoothed(table, max(noise, 1e-5))
        curve = spline_of(found)
        assert found.ends == "natural"
        assert found.notes[1].startswith("positions end" if rest and kind == "cubic" else "positions begin and end")
        # A spline without an acceleration at its end misses the speed by a little.
        np.testing.assert_allclose(state(curve, times[[0, -1]], 1), speeds, atol=0.3)
        if rest and kind == "cubic":
            assert np.abs(state(curve, times[:1], 1)).max() < 1e-9
        assert np.abs(state(curve, times, 2)).max() < (0.5 if rest else 4.7)


@pytest.mark.parametrize("step", [1e-9, 1e-7, 1e-5, 1e-4])
def test_stamps_that_nearly_repeat_do_not_break_it(step):
    """Two samples at nearly one time are two samples, but no two knots."""
    rng = np.random.default_rng(4)
    times = np.arange(81) * 0.05
    values = np.stack([0.05 * least_jerk(times, 4.0), 0 * times, 1.0 + 0 * times], axis=1)
    values += 1e-5 * rng.normal(size=values.shape)
    twice = np.insert(times, 40, times[39] + step), np.insert(values, 40, values[39] + 2e-5, axis=0)
    plain, found = (smoothed(MotionTable(*table), 1e-5) for table in ((times, values), twice))
    curves = [spline_of(table) for table in (plain, found)]
    accelerations = [state(curve, np.linspace(0.0, 4.0, 997), 2) for curve in curves]
    np.testing.assert_allclose(*accelerations, atol=0.1 * np.abs(accelerations[0]).max())
    assert len(found.times) == 81


def test_orientations_at_rest_and_in_motion():
    times = np.arange(0.0, 4.0, 0.01)
    rng = np.random.default_rng(5)
    for angle, moves in ((0.4 * least_jerk(times, 3.99), False), (0.2 * times, True)):
        units = np.stack([np.cos(angle / 2), np.sin(angle / 2), 0 * angle, 0 * angle], axis=1)
        table = MotionTable(times, np.ones((400, 3)), units + 1e-4 * rng.normal(size=units.shape))
        found = smoothed(table, 1e-4, angle=2e-4)
        assert found.ends == ("natural" if moves else None)
        curve = spline_of(found)
        rotated = np.asarray(curve.quaternion)
        speeds = 3.0 * np.diff(rotated, axis=1)[[0, -1], [0, -1]] / 0.01
        largest = 0.1 if moves else 0.0
        np.testing.assert_allclose(np.linalg.norm(speeds, axis=1), largest, atol=0.005 if moves else 1e-9)
