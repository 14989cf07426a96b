"""The best inclination, maps of oscillations and searches from Python on more cables than degrees of freedom."""

import numpy as np
import pytest
from support.commands import cspr
from support.redundant import MASS, PLANAR_THREE, RECTANGLE, least_distances

import cspr_jax

KEYS = {"schema": 1, "family": "transition", "amplitude": "quintic", "samples": 61}
REST = {"rest": True}
# A target of each robot that takes two oscillations at most inclinations, and one at none.
CASES = {
    "boralugoda-rectangle": (RECTANGLE, [90.0, 40.0, 5.0]),
    "boralugoda-planar-three": (PLANAR_THREE, [80.0, 0.0, 5.0]),
}


def plan_of(robot, target, inclination, **pose):
    return cspr_jax.plan(
        KEYS | {"robot": robot, "inclination": inclination, "pose": [REST, {"position": target, **pose}]}
    )


@pytest.mark.thorough
@pytest.mark.parametrize(
    "robot", [pytest.param("boralugoda-rectangle", marks=pytest.mark.thorough), "boralugoda-planar-three"]
)
def test_no_other_inclination_needs_fewer_oscillations_or_has_a_larger_margin(robot):
    """Linear programs at samples refute one oscillation at any inclination, and two with a margin that is larger."""
    base, target = CASES[robot]
    best = plan_of(robot, target, "best")
    assert best.feasible and best.answers.oscillations.tolist() == [2]
    (distance,), weight = least_distances(base, best, 61), MASS * 9.81 / len(base)
    assert 0.0 < best.answers.margin_bound[0] * weight <= distance * (1.0 + 1e-9)
    for v in np.linspace(-0.9, 0.9, 7).tolist():
        assert least_distances(base, plan_of(robot, target, v, arcs=2), 61)[0] < 0.0
        assert least_distances(base, plan_of(robot, target, v, arcs=4), 61)[0] < distance * 1.02


@pytest.mark.thorough
def test_maps_have_the_verdicts_of_plans(tmp_path):
    sweep = tmp_path / "map.toml"
    sweep.write_text(
        'schema = 1\nmap = "minimum-oscillations"\nrobot = "boralugoda-planar-three"\n'
        "[axes]\nx = [24.0, 80.0, 300.0]\ny = [0.0]\nz = [5.0, 31.0]\n"
        '[trajectory]\nfamily = "transition"\namplitude = "quintic"\ninclination = "best"\nmax_arcs = 6\n'
    )
    code, out, _ = cspr("run", sweep, "-o", tmp_path / "run")
    assert code == 0
    data = cspr_jax.open_result(out.strip()).to_xarray().isel(y=0)
    assert (data.verdict.sel(z=31.0) != 0).all() and np.isnan(data.least_oscillations).all()
    for x in (24.0, 80.0, 300.0):
        cell, planned = data.sel(x=x, z=5.0), plan_of("boralugoda-planar-three", [x, 0.0, 5.0], "best")
        if x < 300.0:
            assert cell.verdict == planned.answers.verdict[0] == 0
            assert cell.oscillations == planned.answers.oscillations[0] > 0
            assert float(cell.used_z0) == planned.z0 and float(cell.margin) == planned.answers.margin[0]
        else:
            assert cell.verdict != 0 and cell.oscillations == 0


@pytest.mark.thorough
def test_searches_from_python_have_the_numbers_of_plans():
    robot = cspr_jax.load_robot("boralugoda-planar-three")
    answers = cspr_jax.minimum_oscillations(robot, [[80.0, 0.0, 5.0]], z0=25.0)
    planned = plan_of("boralugoda-planar-three", [80.0, 0.0, 5.0], 0.0)
    assert answers.verdict[0] == 0 and answers.arcs[0] == planned.answers.arcs[0]
    assert answers.margin[0] == planned.answers.margin[0] and answers.duration[0] == planned.answers.duration[0]


@pytest.mark.thorough
def test_envelopes_are_refused(tmp_path):
    sweep = tmp_path / "map.toml"
    sweep.write_text(
        'schema = 1\nmap = "transition-envelopes"\nrobot = "boralugoda-planar-three"\n'
        "[axes]\nx = [24.0]\ny = [0.0]\nz = [5.0]\nz0 = [20.0]\ntau = [0.5]\n"
        '[trajectory]\nfamily = "transition"\namplitude = "quintic"\n'
    )
    code, _, err = cspr("run", sweep, "-o", tmp_path / "run")
    assert code == 2 and "3 points: must be 2" in err and err.count("\n") == 1
    sweep.write_text(
        sweep.read_text()
        .replace("transition-envelopes", "minimum-oscillations")
        .replace("tau = [0.5]\n", "")
        .replace('"quintic"', '"ideal"')
    )
    code, _, err = cspr("run", sweep, "-o", tmp_path / "run")
    assert code == 2 and 'amplitude = "ideal"' in err and err.count("\n") == 1
