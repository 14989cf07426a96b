"""Claims of the documents about the designs in `sweeps`: what their robots do, and that the searches find them."""

from pathlib import Path

import numpy as np
import pytest

import cspr_jax
from cspr_jax.config.design import read_design
from cspr_jax.config.reading import read_toml
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.synthesis.problem import DesignProblem
from cspr_jax.synthesis.space import Point

SWEEPS = Path(__file__).parents[2] / "sweeps"


def evaluated(name, *points):
    """Numbers of robots of an example, from plans and maps of one robot."""
    path = SWEEPS / f"{name}.toml"
    with double_precision():
        evaluator = DesignProblem(*read_design(path), path).evaluator()
        return [evaluator.one(Point(point)) for point in points]


def test_the_triangle_and_the_prototype():
    """Beside plans: that of Table 2.1, and the same targets on the triangle that was found."""
    fewest, fastest = evaluated("design_triangle", (1.5, 0.6, 1.7021609), (1.5, 0.6, 1.5788076))
    assert fewest.values[:2] == (32.0, pytest.approx(41.812, abs=2e-3)) and fewest.missed < 1e-5
    assert fastest.values[:2] == (33.0, pytest.approx(41.517, abs=2e-3)) and fastest.missed < 1e-5
    table = cspr_jax.plan(SWEEPS / "table_2_1.toml")
    assert (table.answers.arcs.sum(), table.answers.duration.sum()) == (49, pytest.approx(64.04, abs=5e-3))
    spec = read_toml(SWEEPS / "design_triangle.toml")
    widened = np.array(spec["robot"]["base_points"], float)
    widened = widened.mean(0) + 1.5 * (widened - widened.mean(0))
    widened[:2, 0] += [0.5 * (0.6 - 0.45033320996790809), -0.5 * (0.6 - 0.45033320996790809)]
    robot = {"name": "found", "base_points": widened.tolist(), "mass": 0.198}
    plan = cspr_jax.plan(spec["plans"]["targets"] | {"schema": 1, "robot": robot, "z0": 1.7021609})
    assert plan.feasible and plan.answers.arcs.sum() == 32
    assert plan.tension_margin.min() == pytest.approx(0.02, abs=1e-6)


def test_the_smallest_motors():
    """Powers are those of `size`, and no robot nearby does with less."""
    best, of_file = evaluated("design_motors", (4.0, 2.0765408, 6.4253990, 5.8), (8.0, 1.0, 7.0, 4.0))
    assert best.values[0] == pytest.approx(94.620, abs=2e-3) and best.missed < 1e-6
    assert of_file.values[0] == pytest.approx(217.86, abs=0.01)
    spec = read_toml(SWEEPS / "design_motors.toml")
    robot = spec["robot"] | {"base_points": [[3.0, 2.0765408, 5.8], [7.0, 2.0765408, 5.8], [5.0, 6.4253990, 5.8]]}
    del robot["parameter"]
    sizes = cspr_jax.size(spec["plans"]["transport"] | {"schema": 1, "robot": robot})
    assert max(sizes.joint.power.max(), sizes.joint.braking_power.max()) == pytest.approx(best.values[0], rel=1e-6)
    # The duct: a cylinder along x at y = 7.2 and z = 5.6, of radius 0.6; the ceiling is at 6 m.
    spools = np.array(robot["base_points"])
    duct = np.hypot(spools[:, 1] - 7.2, spools[:, 2] - 5.6) - 0.6
    assert min(duct.min(), (6.0 - spools[:, 2]).min()) == pytest.approx(0.2, abs=1e-6)
    random, near = np.random.default_rng(0), np.array(best.point.values)
    others = evaluated("design_motors", *(tuple(near + 0.05 * random.normal(size=4) * [1, 1, 1, 0]) for _ in range(20)))
    inside = [one for one in others if one.missed == 0.0 and one.point.values[0] >= 4.0]
    assert all(one.values[0] >= best.values[0] - 1e-6 for one in inside)


@pytest.mark.thorough
def test_spools_for_orientations():
    best, mssm = evaluated("design_orientations", (0.7137125561212998, 0.017322171377993058), (1.0, 0.0))
    assert (best.values[0], mssm.values[0]) == (289.25, 280.75)


@pytest.mark.thorough
def test_rails_and_shelves(tmp_path):
    result = cspr_jax.design(SWEEPS / "design_rails.toml", tmp_path / "out")
    assert [setting.tasks for setting in result.settings] == [("near",), ("middle", "far")]
    assert result.best.values[0] == pytest.approx(20.818, abs=2e-3)


@pytest.mark.soak
@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("design_motors", {0: 94.620}),
        ("design_triangle", {0: 32.0, 1: 41.812}),
        ("design_orientations", {0: 289.25}),
    ],
)
def test_searches_find_what_the_documents_say(tmp_path, name, values):
    result = cspr_jax.design(SWEEPS / f"{name}.toml", tmp_path / "out")
    assert result.feasible
    for i, value in values.items():
        assert result.best.values[i] == pytest.approx(value, rel=1e-4)
