"""Motions that a robot cannot follow, since they leave its plane or its guide."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import cspr_jax
from cspr_jax.config.motions.table import MotionPieces, MotionTable
from cspr_jax.curves.files import kept_to, moving_ends, samples_of
from cspr_jax.curves.reading import pieces_of, spline_of
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.families.splines.functions import function_motion

TIMES = np.linspace(0.0, 1.0, 5)
PLACES = np.stack([TIMES, 0.0 * TIMES, 2.0 + TIMES], axis=1)
PITCHES = np.stack([np.cos(0.1 * TIMES), 0.0 * TIMES, np.sin(0.1 * TIMES), 0.0 * TIMES], axis=1)


@pytest.mark.parametrize(
    ("pattern", "places", "quaternions", "is_planar", "words"),
    [
        (
            "2T",
            PLACES + np.array([0.0, 0.1, 0.0]),
            None,
            False,
            "positions: y reaches 0.1 m: must be 0 on a planar robot",
        ),
        ("1R2T", PLACES, PITCHES[:, [0, 2, 1, 3]], False, "must turn about y alone"),
        ("1R2T", PLACES, PITCHES[:, [0, 1, 3, 2]], False, "must turn about y alone"),
        ("1T", PLACES, None, False, "positions: x and y: must be the same everywhere on a vertical guide"),
        ("3R", PLACES * 1e-5, PITCHES, False, "positions: they differ by 1e-05 m: must be those of the joint"),
        ("3T", PLACES, None, True, "positions: x and z alone: must have y too, but for planar robots"),
        ("3R3T", PLACES, PITCHES, True, "positions: x and z alone"),
    ],
)
def test_motions_that_leave_the_pattern(pattern, places, quaternions, is_planar, words):
    spline = spline_of(MotionTable(TIMES, places, quaternions))
    with pytest.raises(InputError) as error:
        kept_to(pattern, spline, is_planar=is_planar)
    assert words in str(error.value) and "\n" not in str(error.value)


def test_rounding_leaves_no_pattern():
    off = 1e-12 * np.sin(7.0 * TIMES)[:, None]
    spline = spline_of(MotionTable(TIMES, PLACES + off * [0.0, 1.0, 0.0], PITCHES + off * [0.0, 1.0, 0.0, 1.0]))
    kept = kept_to("1R2T", spline, is_planar=False)
    assert not kept.position[:, :, 1].any() and not kept.quaternion[:, :, [1, 3]].any()
    np.testing.assert_array_equal(kept.position[:, :, [0, 2]], spline.position[:, :, [0, 2]])
    still = spline_of(MotionTable(TIMES, 1e5 * off + [0.1, 0.2, 0.3], PITCHES))
    assert np.ptp(kept_to("3R", still, is_planar=False).position, axis=(0, 1)).max() == 0.0
    upward = spline_of(MotionTable(TIMES, PLACES * [0.0, 0.0, 1.0] + [3.0, 1.0, 0.0]))
    np.testing.assert_array_equal(kept_to("1T", upward, is_planar=False).position, upward.position)


def test_close_knots_and_curves_without_y():
    assert pieces_of(CubicSpline(TIMES, PLACES[:, [0, 2]])).is_planar
    assert not pieces_of(CubicSpline(TIMES, PLACES)).is_planar
    with pytest.raises(InputError, match="must be 1e-12 s or more behind"):
        spline_of(MotionPieces(np.array([0.0, 1e-200]), np.zeros((1, 2, 3))))


@pytest.mark.parametrize("size", [0.0, 1e-200, 1e300])
def test_quaternions_far_from_unit_ones(size):
    with pytest.raises(InputError, match=r"quaternions\[0\] = .*: must be a unit quaternion"):
        samples_of(TIMES, PLACES, size * PITCHES)


def test_a_record_at_rest_has_no_moving_ends():
    times = np.linspace(0.0, 10.0, 41)
    assert moving_ends(MotionTable(times, np.tile([0.1, 0.2, 2.5], (41, 1))), None) == []
    assert len(moving_ends(MotionTable(times, np.outer(times, [0.1, 0.2, 2.5])), None)) == 2


@pytest.mark.parametrize("function", [np.sin, lambda t: [t, t, t] if t > 0.0 else [0.0] * 3])
def test_functions_that_jax_cannot_follow(function):
    def wrapped(t):
        return np.asarray([function(t)] * 3) if function is np.sin else function(t)

    with pytest.raises(InputError, match=r"jax cannot follow it: must be one of jax\.numpy"):
        function_motion(wrapped, 1.0, frame=None, reference=None, is_platform=False)


def test_a_curve_without_y_is_refused_in_space():
    curve = CubicSpline(TIMES, PLACES[:, [0, 2]])
    with pytest.raises(ConfigError, match="x and z alone: must have y too"):
        cspr_jax.check("prototype", curve)
