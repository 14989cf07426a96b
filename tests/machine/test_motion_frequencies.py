"""Natural frequencies along plans and checks, over workspaces, and warnings about swings near them."""

import math

import numpy as np
import pytest
from outputs.test_outputs import cspr, strict_json
from support.folder import PLAN, ROBOT, folder

import cspr_jax
from cspr_jax.errors import ConfigError

__all__ = ["folder"]  # a fixture

SOFT, HARD = "axial_stiffness = 20\n", "axial_stiffness = 5e4\n"
MAP = """schema = 1
map = "workspace"
robot = "elastic.toml"
[axes]
x = [0.0, 0.1, 3.0]
y = [0.05]
z = [1.2]
[workspace]
conditions = ["static"]
[run]
store = ["verdict", "natural_frequency_min"]
"""


def _plan(folder, line):
    (folder / "elastic.toml").write_text(ROBOT + line)
    (folder / "plan.toml").write_text(PLAN.replace("mine.toml", "elastic.toml"))
    return cspr_jax.plan("plan.toml")


def _expected(plan, robot, rows):
    # Frequencies at all rows of a plan, from tensions of its file.
    name = "tension_each" if "tension_each" in rows else "tension"
    return cspr_jax.natural_frequencies(robot, rows["position"], tensions=rows[name], point="mass-centre").frequencies


def test_along_a_plan(folder, capsys):
    """The lowest of all instants, between rows; a line for swings near it, with both numbers."""
    plan = _plan(folder, SOFT)
    rows = plan.rows(400.0)
    found = _expected(plan, cspr_jax.load_robot("elastic.toml"), rows)
    end = plan.answers.duration[0]
    for i, segment in enumerate(plan.to_dict()["segments"]):
        inside = (rows["t"] <= end + 1e-9) if i == 0 else (rows["t"] >= end - 1e-9)
        at = int(np.where(inside, found[:, 0], np.inf).argmin())
        assert segment["natural_frequency_min"] == pytest.approx(found[at, 0], rel=1e-4)
        assert segment["natural_frequency_min"] <= found[at, 0] * (1.0 + 1e-12)
        assert segment["natural_frequency_t"] == pytest.approx(rows["t"][at] - i * end, abs=0.01)
    swing = math.sqrt(9.81 / 1.5)
    assert len(plan.warnings) == 2 and all(f"of the motion's, {swing:.4g} rad/s" in line for line in plan.warnings)
    nearest = found.flat[np.abs(np.log(found / swing)).argmin()]
    assert any(f"elastic cables, {nearest:.4g} rad/s" in line for line in plan.warnings)
    assert "elastic cables: lowest natural frequency" in cspr(capsys, "plan", "plan.toml")


def test_without_a_swing_near_it(folder, capsys):
    assert _plan(folder, HARD).warnings == ()
    told = strict_json(cspr(capsys, "plan", "plan.toml", "--json"))
    assert told["segments"][0]["natural_frequency_min"] > 2.0 * math.sqrt(9.81 / 1.5)
    rigid = _plan(folder, "").to_dict()["segments"][0]
    assert rigid["natural_frequency_min"] is None and rigid["natural_frequency_t"] is None


@pytest.mark.thorough
def test_of_a_check():
    robot = cspr_jax.with_cables(cspr_jax.load_robot("prototype"), axial_stiffness=100.0)
    times, path = np.linspace(0.0, 4.0, 9), np.zeros((9, 3))
    path[:, 2], path[:, 0] = 1.4, 0.05 * np.sin(np.linspace(0.0, 3.0, 9)) ** 2
    found = cspr_jax.check(robot, times, path)
    lowest = found.to_dict()["natural_frequency_min"]
    assert lowest == pytest.approx(_expected(found.plan, robot, found.plan.rows(200.0))[:, 0].min(), rel=1e-5)
    assert any("lowest natural frequency" in line for line in found.lines()) and not found.plan.warnings


@pytest.mark.thorough
def test_of_an_ellipse(folder):
    (folder / "elastic.toml").write_text(ROBOT + SOFT)
    circle = {"centre": [0.0, 0.0, 1.5], "radius": 0.05, "frequency": 2.3}
    poses = [{"ellipse": circle}, {"ellipse": circle, "turns": 1}]
    plan = cspr_jax.plan({"schema": 1, "robot": "elastic.toml", "family": "ellipse", "pose": poses})
    assert any("of the motion's, 2.3 rad/s" in line for line in plan.warnings)


@pytest.mark.thorough
def test_a_platform_in_parallel_pairs_can_turn(folder):
    """Its six cables count, not the three of the equivalent."""
    pairs = cspr_jax.parallel_pair_robot(0.5, 0.05, mass=1.0)
    robot = {"name": "pairs", "mass": 1.0, "translation_only": True, "axial_stiffness": 2e3}
    robot |= {name: np.asarray(getattr(pairs, name)).tolist() for name in ("base_points", "platform_points")}
    robot["inertia"] = np.asarray(pairs.inertia).tolist()
    poses = [{"rest": True}, {"position": [0.1, 0.0, 1.4]}, {"rest": True}]
    plan = cspr_jax.plan({"schema": 1, "robot": robot, "z0": 1.4, "pose": poses})
    rows = plan.rows(200.0)
    six = cspr_jax.with_cables(pairs, axial_stiffness=2e3)
    found = _expected(plan, six, rows)
    lowest = min(segment["natural_frequency_min"] for segment in plan.to_dict()["segments"])
    assert found.shape[1] == 6 and lowest == pytest.approx(found[:, 0].min(), rel=1e-4)


def test_over_a_workspace(folder, capsys):
    (folder / "elastic.toml").write_text(ROBOT + HARD)
    (folder / "map.toml").write_text(MAP)
    found = cspr_jax.compute_sweep("map.toml")["natural_frequency_min"].values.ravel()
    robot = cspr_jax.load_robot("elastic.toml")
    places = [[x, 0.05, 1.2] for x in (0.0, 0.1, 3.0)]
    np.testing.assert_allclose(found, cspr_jax.natural_frequencies(robot, places).frequencies[:, 0], rtol=1e-12)
    assert np.isfinite(found[:2]).all() and np.isnan(found[2])
    (folder / "elastic.toml").write_text(ROBOT)
    line = "run.store: natural_frequency_min: must be absent without"
    assert line in cspr(capsys, "run", "map.toml", code=2)
    with pytest.raises(ConfigError, match=line):
        cspr_jax.compute_sweep("map.toml")
