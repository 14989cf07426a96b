"""Obstacles of a plan in the picture of its motion and in its model for MuJoCo."""

import dataclasses
import importlib
import shutil
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from support.commands import cspr

from cspr_jax.outputs.mujoco.mjcf import _geom
from cspr_jax.outputs.plots.robots.obstacles import outline, points_of
from cspr_jax.robots.model import shapes
from cspr_jax.schema.families import registered

FAMILY = Path(__file__).parents[2] / "docs" / "examples" / "straight_lines"
PLAN = """schema = 1
robot = "prototype"
family = "straight-line"
z0 = 1.7
[[pose]]
rest = true
[[pose]]
position = [0.1, 0.05, 1.5]
[[obstacle]]
kind = "sphere"
centre = [0.5, 0.2, 1.5]
radius = 0.1
[[obstacle]]
kind = "cylinder"
start = [-0.4, 0.0, 1.0]
end = [-0.4, 0.0, 1.6]
radius = 0.05
[[obstacle]]
kind = "box"
centre = [0.0, 0.5, 1.2]
size = [0.3, 0.1, 0.2]
quaternion = [0.8, 0.6, 0.0, 0.0]
"""


@pytest.fixture
def plan(tmp_path, monkeypatch):
    """A plan among obstacles, of a family that knows them."""
    shutil.copytree(FAMILY, tmp_path / "straight_lines")
    monkeypatch.syspath_prepend(tmp_path)
    importlib.invalidate_caches()
    family = importlib.import_module("straight_lines")
    (tmp_path / "plan.toml").write_text(PLAN)
    with registered(dataclasses.replace(family.FAMILY, proof="any")):
        yield tmp_path / "plan.toml"
    for name in [name for name in sys.modules if name.partition(".")[0] == "straight_lines"]:
        sys.modules.pop(name)


def test_pictures_and_models_show_obstacles(plan):
    motion, picture, model = (plan.with_name(name) for name in ("motion.h5", "motion.png", "model.xml"))
    assert cspr("plan", plan, "-o", motion, "--mjcf", model, "--anyway")[0] == 1
    code, _, err = cspr("plot", motion, "-o", picture)
    assert (code, err) == (0, "") and picture.stat().st_size > 10_000
    geoms = {geom.get("name"): geom for geom in ElementTree.parse(model).getroot().find("worldbody").iter("geom")}
    kinds = [geoms[f"obstacle_{k}"].get("type") for k in (1, 2, 3)]
    assert kinds == ["sphere", "capsule", "box"] and all(g.get("contype") == "0" for g in geoms.values())
    # The file's z points down, MuJoCo's up.
    np.testing.assert_allclose([float(x) for x in geoms["obstacle_1"].get("pos").split()], [0.5, -0.2, -1.5])
    mujoco = pytest.importorskip("mujoco")
    spec = mujoco.MjModel.from_xml_path(str(model))
    box = spec.geom("obstacle_3")
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, box.quat)
    corner = box.pos + turn.reshape(3, 3) @ box.size
    written = shapes.box([0.0, 0.5, 1.2], [0.3, 0.1, 0.2], [0.8, 0.6, 0.0, 0.0])
    gaps = np.linalg.norm(points_of(written) * [1.0, -1.0, -1.0] - corner, axis=1)
    assert gaps.min() < 1e-12


def test_shapes_of_platforms_in_models():
    hull = shapes.hull(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]))
    assert _geom(hull)["type"] == "mesh"
    assert len(outline(points_of(shapes.sphere([0.0, 0.0, 0.0], 1.0))[:, (0, 2)])) >= 32
