"""Bounds of splines contain the states of every instant, within pieces and over many of them."""

import jax
import numpy as np
import pytest
from support.splines import random_spline, states_of

from cspr_jax.numerics.bounds import piecewise_bounds

S = np.linspace(-1.0, 1.0, 33)
NAMES = ("position", "velocity", "acceleration", "rotation", "angular_velocity", "angular_acceleration")


def excess(seed: int, degree: int, count: int) -> dict[str, tuple[float, float]]:
    """How far each field leaves its band in blocks of one length, over its size, and the largest radius."""
    spline, table = random_spline(seed, degree=degree)
    edges = np.linspace(0.0, table.x[-1], count + 1)
    times = 0.5 * (edges[:-1] + edges[1:])[:, None] + 0.5 * np.diff(edges)[:, None] * S
    states, bounds, result = states_of(spline, times), spline.bounds(edges[:-1], edges[1:]), {}
    for name in NAMES:
        values, band = getattr(states, name), jax.tree.map(np.asarray, getattr(bounds, name))
        s = S.reshape(1, -1, *(1,) * (values.ndim - 2))
        over = np.abs(values - band.middle[:, None] - band.linear[:, None] * s) - band.radius[:, None]
        # Blocks in which the quaternion may vanish have no bounds.
        result[name] = np.nanmax(over) / np.abs(values).max(), np.nanmax(band.radius)
    return result


@pytest.mark.parametrize("degree", [3, 5])
@pytest.mark.parametrize("count", [2, 7, 60, 500])
def test_bounds_contain_states(degree, count):
    for seed in range(4):
        # What is left is rounding of the instants themselves.
        assert max(over for over, _ in excess(seed, degree, count).values()) < 1e-11


def test_bounds_shrink_with_the_square():
    coarse, fine = excess(1, 5, 200), excess(1, 5, 400)
    for name in NAMES:
        assert coarse[name][1] > 3.0 * fine[name][1]


def test_a_hull_of_the_whole_piece_would_not_do(monkeypatch):
    """Coefficients that are cut at the wrong share leave the band: the test above sees it."""
    split = piecewise_bounds._split
    monkeypatch.setattr(piecewise_bounds, "_split", lambda table, fraction: split(table, 0.9 * fraction))
    assert excess(0, 5, 60)["acceleration"][0] > 1e-3
