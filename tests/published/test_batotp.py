"""The sample of batotp: its data, and the least time along its path beside the printed ones."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from cspr_jax.numerics.elementary import double_precision
from cspr_jax.published import batotp, tables


def test_the_sample_of_batotp_is_a_path_within_its_robot():
    """Its points lie below the triangle of its spools, as its script asks, and its spools have their centroid at 0."""
    keys = batotp.sample()
    points, base = np.array(keys["points"]), np.array(keys["base_points"])
    assert points.shape == (20, 3)
    np.testing.assert_allclose(base.mean(0), 0.0, atol=1e-9)
    path = CubicSpline(np.arange(20.0), points)(np.linspace(0.0, 19.0, 1901))
    shares = np.linalg.solve(np.c_[base[:, :2], np.ones(3)].T, np.c_[path[:, :2], np.ones(len(path))].T)
    assert shares.min() > 0.0 and path[:, 2].min() > base[:, 2].max()


def cells_of(count):
    with double_precision():
        cells = batotp.least_time(count)
    assert set(batotp.PUBLISHED) < set(cells)
    assert batotp.PUBLISHED.items() <= tables.TABLES["peers"].published.items()
    shipped, finest, bound = cells.values()
    assert shipped == finest
    return shipped, bound


@pytest.mark.thorough
def test_the_proved_time_is_shorter_than_the_printed_ones():
    """19.865 s with 100 cells a segment in a prototype, and a bound of 19.840 s."""
    time, bound = cells_of(1900)
    assert time == pytest.approx(19.8623, abs=1e-3) and 19.840 < bound < 19.857


@pytest.mark.thorough
def test_the_table_comes_closer():
    time, bound = cells_of(batotp.CELLS)
    assert time == pytest.approx(19.8566, abs=5e-4) and bound == pytest.approx(19.8506, abs=5e-4)
