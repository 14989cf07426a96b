"""Splines of what was read: curves of SciPy exactly, tables by their interpolation, long tables window by window."""

import numpy as np
import pytest
from scipy.interpolate import BPoly, BSpline, CubicSpline, PchipInterpolator, make_interp_spline
from support.motions import states_along

from cspr_jax.config.motions import text
from cspr_jax.config.motions.table import MotionPieces, MotionTable
from cspr_jax.curves.interpolation import interpolated
from cspr_jax.curves.reading import pieces_of, spline_of, window_splines
from cspr_jax.errors import InputError

TIMES = np.array([0.0, 0.5, 1.2, 2.0, 3.3])
VALUES = np.random.default_rng(0).normal(size=(5, 7))


def states(spline, count=41):
    tau = np.linspace(0.0, 1.0, count)
    return tau * float(spline.duration()), states_along(spline, tau)


@pytest.mark.parametrize(
    "curve",
    [
        CubicSpline(TIMES, VALUES),
        make_interp_spline(TIMES, VALUES, k=3),
        make_interp_spline(TIMES, VALUES[:, :3], k=4),
        make_interp_spline(TIMES, VALUES[:, :2], k=3),
        PchipInterpolator(TIMES, VALUES[:, :3]),
        BPoly.from_derivatives(TIMES, VALUES[:, None, :3].repeat(3, 1)),
        BSpline([0.0, 0, 0, 0, 1, 1, 2, 3, 3, 3, 3], VALUES[[0, 1, 2, 3, 4, 0, 1], :3], 3),  # a knot that stands twice
    ],
    ids=lambda curve: type(curve).__name__,
)
def test_curves_of_scipy_are_exact(curve):
    times, found = states(spline_of(pieces_of(curve)))
    for order, part in enumerate((found.position, found.velocity, found.acceleration)):
        expected = curve(times, order)
        if expected.shape[1] == 2:
            expected = np.insert(expected, 1, 0.0, axis=1)
        smooth = slice(None) if order < 2 else slice(0, -1)  # a curve ends as it was before
        np.testing.assert_allclose(part[smooth], expected[smooth, :3], atol=1e-11 * (1.0 + np.abs(expected).max()))
    if expected.shape[1] == 7:
        units = curve(times)[:, 3:]
        units /= np.linalg.norm(units, axis=1, keepdims=True)
        np.testing.assert_allclose(found.quaternion, units, atol=1e-12)


@pytest.mark.parametrize(
    ("curve", "line"),
    [
        (make_interp_spline(TIMES, VALUES[:, :3], k=1), "position: its rate jumps by 6.89 at t = 0.5 s: must be"),
        (BPoly(VALUES[:4, None, :3].repeat(2, 1), [0, 1, 2]), "position: its value jumps"),
        (CubicSpline(TIMES, VALUES[:, 0]), "values of shape ()"),
        (CubicSpline(TIMES, VALUES[:, :5]), "values of shape (5,)"),
        (
            CubicSpline(TIMES, VALUES[:, :3] * np.array([1, 1, np.inf])) if False else 3,
            "motion: int: must be a BSpline",
        ),
    ],
)
def test_curves_that_are_no_motion(curve, line):
    with pytest.raises(InputError) as caught:
        spline_of(pieces_of(curve))
    assert line in str(caught.value)


def test_pieces_that_rest_and_quaternions_of_either_sign():
    """Rounding of what stands still is no jump; nor are pieces that go on with the other sign."""
    quaternion = np.tile([0.6, 0.0, 0.8, 0.0], (3, 4, 1)) * np.array([1.0, -1.0, -1.0])[:, None, None]
    still = np.full((3, 4, 3), 2.0) + 1e-15 * VALUES[:3, :4, None]
    spline = spline_of(MotionPieces(np.array([5.0, 5.01, 5.02, 6.0]), still, quaternion))
    np.testing.assert_array_equal(np.asarray(spline.quaternion), quaternion[:1].repeat(3, 0))
    assert float(spline.duration()) == 1.0
    with pytest.raises(InputError, match="interpolation"):
        spline_of(MotionPieces(np.array([0.0, 1.0]), still[:1]), interpolation="cubic")


def test_tables_name_their_interpolation():
    table = MotionTable(TIMES, VALUES[:, :3], interpolation="quintic", ends="natural")
    found = spline_of(table)
    expected = interpolated(TIMES, VALUES[:, :3], interpolation="quintic", ends="natural")
    np.testing.assert_array_equal(found.position, expected.position)
    np.testing.assert_array_equal(
        spline_of(table, interpolation="cubic", ends="rest").position, interpolated(TIMES, VALUES[:, :3]).position
    )
    rates = MotionTable(TIMES, VALUES[:, :3], velocities=VALUES[:, 3:6])
    assert spline_of(rates).position.shape == (4, 4, 3)
    np.testing.assert_array_equal(
        spline_of(rates, interpolation="cubic").position, interpolated(TIMES, VALUES[:, :3]).position
    )
    with pytest.raises(InputError, match="velocities"):
        spline_of(table, interpolation="hermite")
    with pytest.raises(InputError, match=r"times\[1\] = .*: must be at least times\[0\] = .*: times must increase"):
        spline_of(MotionTable(TIMES[::-1], VALUES[:, :3]))


def test_rates_of_turning_and_legs_that_meet():
    """A body that turns about an axis that turns itself; its acceleration jumps where legs meet."""
    times = np.concatenate([np.linspace(0.0, 1.0, 26), np.linspace(1.0, 2.0, 26)])
    later = np.arange(52) >= 26
    second_derivative = np.where(later, -2.0, 2.0)
    way = np.where(later, 1.0 - (2.0 - times) ** 2 + 1.0, times**2)
    rate = np.where(later, 2.0 * (2.0 - times), 2.0 * times)
    axis = np.array([1.0, 2.0, 2.0]) / 3.0
    # Rz(t) then a turn by 0.7 t about a fixed axis of the body: angular velocity in fixed axes.
    c, s = np.cos(times), np.sin(times)
    rotated = np.stack([c * axis[0] - s * axis[1], s * axis[0] + c * axis[1], 0 * times + axis[2]], axis=1)
    spin = np.array([0.0, 0.0, 1.0]) + 0.7 * rotated
    bending = np.cross([0.0, 0.0, 1.0], 0.7 * rotated)
    half = 0.5 * times
    first = np.stack([np.cos(half), 0 * half, 0 * half, np.sin(half)], axis=1)
    second = np.concatenate([np.cos(0.7 * half)[:, None], np.sin(0.7 * half)[:, None] * axis], axis=1)
    scalar = first[:, :1] * second[:, :1] - (first[:, 1:] * second[:, 1:]).sum(1, keepdims=True)
    vector = first[:, :1] * second[:, 1:] + second[:, :1] * first[:, 1:] + np.cross(first[:, 1:], second[:, 1:])
    quaternions = np.concatenate([scalar, vector], axis=1)
    line = np.array([1.0, 0.5, 2.0])
    table = MotionTable(
        times,
        way[:, None] * line,
        quaternions * np.where(np.arange(52) % 7 == 3, -1.0, 1.0)[:, None],
        rate[:, None] * line,
        second_derivative[:, None] * line,
        spin,
        bending,
    )
    spline = spline_of(table)
    assert len(spline.knots) == 51
    where, found = states(spline, 402)
    np.testing.assert_allclose(found.acceleration, np.where(where < 1.0, 2.0, -2.0)[:, None] * line, atol=1e-9)
    turns = np.array([[0.0, 0.0, 1.0]]) + 0.7 * np.stack(
        [
            np.cos(where) * axis[0] - np.sin(where) * axis[1],
            np.sin(where) * axis[0] + np.cos(where) * axis[1],
            0 * where + axis[2],
        ],
        axis=1,
    )
    np.testing.assert_allclose(found.angular_velocity, turns, atol=1e-9)
    np.testing.assert_allclose(
        found.angular_acceleration, np.cross([0.0, 0.0, 1.0], turns - [0.0, 0.0, 1.0]), atol=1e-6
    )
    assert spline_of(table, interpolation="cubic").position.shape == (50, 4, 3)


@pytest.mark.parametrize("kind", ["cubic", "quintic", "hermite"])
def test_windows_join_to_the_spline_of_the_whole_table(tmp_path, kind):
    times = np.cumsum(np.random.default_rng(1).uniform(0.005, 0.02, size=1500))
    places = np.stack([np.cos(times), np.sin(times), times], axis=1)
    rates = np.stack([-np.sin(times), np.cos(times), 0 * times + 1.0], axis=1)
    turns = np.stack([np.cos(times / 2), 0 * times, np.sin(times / 2), 0 * times], axis=1)
    path, heads = tmp_path / "long.csv", "t,x,y,z,qw,qx,qy,qz,vx,vy,vz"
    np.savetxt(
        path, np.column_stack([times, places, turns, rates]), delimiter=",", header=heads, comments="", fmt="%.17g"
    )
    velocities = rates if kind == "hermite" else None
    whole = interpolated(times, places, turns, velocities=velocities, interpolation=kind)
    place, parts = 0, list(window_splines(text.windows(path, 400), interpolation=kind, z_axis="up"))
    assert len(parts) == 4
    for start, spline in parts:
        rows = slice(place, place + len(spline.knots) - 1)
        assert start == pytest.approx(times[place] - times[0], abs=1e-12)
        np.testing.assert_allclose(spline.position, whole.position[rows], atol=1e-12)
        np.testing.assert_allclose(np.abs(spline.quaternion), np.abs(whole.quaternion[rows]), atol=1e-12)
        place = rows.stop
    assert place == len(times) - 1
    with pytest.raises(InputError, match="periodic"):
        list(window_splines(text.windows(path, 400), interpolation=kind, ends="periodic"))


def test_windows_that_feel_their_ends_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(text, "OVERLAP", 3)
    path = tmp_path / "long.csv"
    rows = np.column_stack([np.arange(60) * 0.1, np.random.default_rng(2).normal(size=(60, 3))])
    np.savetxt(path, rows, delimiter=",", header="t,x,y,z", comments="")
    with pytest.raises(InputError, match="is felt from window to window"):
        list(window_splines(text.windows(path, 20), interpolation="quintic"))


def test_pieces_of_degree_0_stay_in_place():
    spline = spline_of(pieces_of(BPoly(np.full((1, 2, 3), 1.5), [0.0, 1.0, 2.0])))
    _, found = states(spline)
    np.testing.assert_allclose(found.position, 1.5)
    np.testing.assert_allclose(found.velocity, 0.0)
