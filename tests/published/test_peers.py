"""Workspaces of papers on other tools: counts, and linear programs and least squares beside."""

import pytest

from cspr_jax.numerics.elementary import double_precision
from cspr_jax.published import peers

# Ours: no source prints them.
INSIDE = {
    "IPAnema 2, closure": (14823, 6401, 0),
    "IPAnema 2, set IROS 2016, closure": (14823, 3305, 0),
    "IPAnema 1, wrench-feasible": (99825, 7511, 0),
    "IPAnema 1, static": (99825, 10090, 0),
    "IPAnema 1, wrench-closure": (99825, 5609, 246),
    "CoGiRo, wrench-feasible": (1000, 807, 0),
    "CoGiRo, static": (1000, 1000, 0),
}


def check(monkeypatch, chosen):
    every = [grid for grid in peers.grids() if grid.name in chosen]
    monkeypatch.setattr(peers, "grids", lambda: every)
    with double_precision():
        cells = peers.peers()
    assert {row for row, _, _ in cells} == set(chosen)
    for name in chosen:
        assert tuple(cells[name, column, ""] for column in ("poses", "inside", "on the boundary")) == INSIDE[name]
        for way in ("HiGHS", "NNLS"):
            assert cells[name, f"differ, {way}", ""] == 0.0 and cells[name, f"us, {way}", ""] > 0.0


@pytest.mark.thorough
def test_cogiro_beside_linear_programs(monkeypatch):
    check(monkeypatch, ["CoGiRo, wrench-feasible"])


@pytest.mark.soak
def test_every_study(monkeypatch):
    monkeypatch.setattr(peers, "SAMPLE", 400)
    check(monkeypatch, list(INSIDE))
