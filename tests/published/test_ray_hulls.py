"""Hulls along rays: of bodies whose volume is known, of WireX's robot as WireX prints it, and by linear programs."""

import math

import numpy as np
import pytest
from oracles import workspaces as oracle

from cspr_jax.numerics.elementary import double_precision
from cspr_jax.published import ray_hulls, tables


def test_hulls_of_known_bodies():
    """A ball from inside, to the sum of what its chords leave out; an octahedron exactly."""
    volume, surface = ray_hulls.hull(lambda p: np.linalg.norm(p - ray_hulls.CENTRE, axis=1) <= 1.5, 6)
    assert 0.999 < volume / (4.0 / 3.0 * math.pi * 1.5**3) < 1.0 and 0.999 < surface / (9.0 * math.pi) < 1.0
    volume, surface = ray_hulls.hull(lambda p: np.abs(p - ray_hulls.CENTRE).sum(1) <= 1.5, 3)
    assert volume == pytest.approx(4.0 / 3.0 * 1.5**3, rel=2e-4) and surface == pytest.approx(
        4.0 * math.sqrt(3.0) * 1.5**2, rel=2e-4
    )


def test_the_closed_form_gives_the_printed_hull():
    with double_precision():
        by_form, by_all = ray_hulls._conditions()
        got = ray_hulls.hull(by_form, ray_hulls.DIVISIONS)
        whole = ray_hulls.hull(by_all, 1)
    assert got == pytest.approx((5.731436529861277, 17.789244457956457), rel=1e-12)
    assert got == pytest.approx([float(text) for text in ray_hulls.PUBLISHED.values()], abs=5e-8)
    assert ray_hulls.PUBLISHED.items() <= tables.TABLES["peers"].published.items()

    def by_programs(positions):
        # Largest distance that all tensions can have from their limits, without a wrench.
        matrices = (oracle.full_wrench_matrix(ray_hulls.BASE, ray_hulls.PLATFORM, p, np.eye(3)) for p in positions)
        margins = [oracle.tension_margin(matrix, np.zeros((1, 6)), 1.0, 10.0) for matrix in matrices]
        return np.array(margins) >= 0.0

    assert whole == pytest.approx(ray_hulls.hull(by_programs, 1), rel=1e-9)


@pytest.mark.soak
def test_all_tensions_hold_a_larger_hull():
    """As linear programs (HiGHS) gave it, and larger along finer rays."""
    with double_precision():
        cells = {row: value for (row, column, _), value in ray_hulls.hulls().items() if column == "volume, m3"}
    form, whole, fine = cells.values()
    assert whole == pytest.approx(9.338946479502656, rel=1e-9) and form < whole < fine < 9.8
