"""Hints of likely mistakes in what can be computed all the same: rounded P0, thin cables, poses among the spools."""

import re
import warnings
from pathlib import Path

import jax
import numpy as np
import pytest

import cspr_jax
from config.test_wording import BODY, RING, SPOOLS, spec_of
from cspr_jax.cli import main
from cspr_jax.config import hints, near_rest
from cspr_jax.config.keys.workspace import WorkspaceTable
from cspr_jax.config.plan import PlanFile
from cspr_jax.config.robot import resolve_robot
from cspr_jax.config.sweep import SweepFile, SweepTrajectory
from cspr_jax.errors import shown


@pytest.mark.parametrize(
    ("z_axis", "z0", "place", "told"),
    [
        ("down", 1.2345678, [0.0, 0.0, 1.235], True),  # as a table of four digits prints it
        ("down", 1.2345678, [0.0, 0.0, 1.2345678], False),
        ("down", 1.2345678, [0.0, 0.0, 1.2345678 + 1e-11], False),  # at rest, by the robot's size
        ("down", 1.2345678, [0.0, 9e-4, 1.2345678], True),
        ("down", 1.2345678, [0.002, 0.0, 1.2345678], False),
        ("down", 40.0, [0.0, 0.0, 40.03], True),  # of z0
        ("up", 1.2345678, [0.0, 0.0, -1.235], True),
        ("up", 1.2345678, [0.0, 0.0, 1.235], False),
    ],
)
def test_hints_about_a_rounded_p0(z_axis, z0, place, told):
    robot_file = spec_of(z_axis=z_axis, base_points=[[x + 5.0, y, 3.0] for x, y, _ in SPOOLS])
    centre = np.mean(robot_file.base_points, axis=0)
    text = near_rest.almost_at_rest("pose[1].position", (centre + place).tolist(), z0, robot_file)
    if not told:
        assert text == ""
        return
    written = [float(number) for number in re.search(r"from P0 = \[(.*?)\]", text)[1].split(", ")]
    sign = 1.0 if z_axis == "down" else -1.0
    np.testing.assert_allclose(written, centre + np.array([0.0, 0.0, sign * z0]), rtol=0.0, atol=1e-11)
    assert text.startswith("pose[1].position = [") and text.endswith("if P0 is meant: rest = true")


@pytest.mark.parametrize(
    ("robot", "asked", "told"),
    [
        ({}, {"conditions": ["interference-free"]}, True),
        ({}, {"conditions": ["wrench-feasible", "interference-free"]}, True),
        ({"cable_diameter": 0.0}, {"conditions": ["interference-free"]}, True),
        ({"cable_diameter": 0.004}, {"conditions": ["interference-free"]}, False),
        ({}, {"conditions": ["interference-free"], "platform_box": {"low": [-1, -1, -1], "high": [1, 1, 1]}}, False),
        ({}, {"conditions": ["wrench-feasible"]}, False),
    ],
)
def test_hints_about_cables_without_a_thickness(robot, asked, told):
    robot_file = spec_of(**BODY, base_points=RING).model_copy(update=robot)
    table = WorkspaceTable.model_construct(**{"obstacle": None, "platform_box": None, "platform_hull": None} | asked)
    keys = SweepFile.model_construct(workspace=table, trajectory=SweepTrajectory(), axes=None)
    lines = hints.sweep_hints(keys, robot_file)
    assert len(lines) == told and all("cable_diameter" in line and "excludes nothing" in line for line in lines)


def test_hints_about_a_start_of_a_sweep():
    """Of any of its depths of P0."""
    data = {"schema": 1, "map": "minimum-arcs", "robot": "prototype", "axes": {"x": [0.1], "y": [0.0], "z": [1.0]}}
    data["axes"]["z0"] = [1.0, 1.23456]
    for place, count in (([0.0, 0.0, 1.2346], 1), ([0.0, 0.0, 1.23456], 0), ([0.0, 0.1, 1.23456], 0)):
        keys = SweepFile.model_validate(data | {"trajectory": {"from": {"position": place}}})
        lines = hints.sweep_hints(keys, resolve_robot("prototype", "sweep.toml", Path()))
        assert len(lines) == count and all(line.startswith("trajectory.from.position = [0") for line in lines)


@pytest.mark.parametrize(
    ("spools", "planar", "place", "told"),
    [
        (SPOOLS, False, [0.2, 0.1, 0.0], True),
        (SPOOLS, False, [0.2, 0.1, 1e-3], False),
        (SPOOLS, False, [0.2, 0.1, -1.0], False),
        ([[x, y, 3.0 + 0.5 * x - 0.2 * y] for x, y, _ in SPOOLS], False, [0.2, 0.1, 3.08], True),
        ([[x, y, z + 2.0 * k] for k in (0, 1) for x, y, z in SPOOLS], False, [0.0, 0.0, 1.0], False),  # two frames
        ([[-1.0, 0.0, 1.0], [1.0, 0.0, 1.0]], True, [0.3, 0.0, 1.0], True),
    ],
)
def test_hints_about_a_pose_among_the_spools(spools, planar, place, told):
    """It says that the pose is in their plane, and asks about the z axis only where every target is above them."""
    keys = {"schema": 1, "robot": "r", "z0": 1.0, "pose": [{"rest": True}, {"position": place}]}
    robot_file = spec_of(base_points=spools, **({"planar": True} if planar else {}))
    lines = hints.plan_hints(PlanFile.model_validate(keys), robot_file)
    wanted = f"pose[1].position = {shown(place)}: in the plane of the spools"
    assert [line.startswith(wanted) for line in lines if "z_axis" not in line] == [True] * told
    assert any("z_axis" in line for line in lines) == (place[2] < np.min(spools, axis=0)[2])


PLAN = """schema = 1
robot = "prototype"
z0 = { choose = "mean" }
[[pose]]
rest = true
[[pose]]
position = [0.2, 0.1, 1.2345678]
[[pose]]
position = [-0.2, 0.1, 1.33]
[[pose]]
"""


@pytest.mark.thorough
def test_p0_can_be_copied_from_the_table_of_a_plan(capsys, tmp_path):
    """With all of its digits it is at rest there; with four it is not, and a hint says so."""
    path = tmp_path / "plan.toml"
    path.write_text(PLAN + "rest = true\n")
    assert main(["plan", str(path)]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    z0, last = re.search(r"z0 = (\S+) m", out)[1], re.findall(r"\((0, 0, \S+)\)", out)[0]
    assert abs(float(z0) - cspr_jax.plan(path).z0) < 1e-11 and last == f"0, 0, {z0}"
    for place, code, count in ((last, 0, 0), (f"0, 0, {float(z0):.4g}", None, 1)):
        path.write_text(PLAN.replace('{ choose = "mean" }', z0) + f"position = [{place}]\n")
        found = main(["plan", str(path)])
        out, err = capsys.readouterr()
        assert code in (None, found)
        lines = err.splitlines()
        assert len(lines) == count and all(
            line.startswith("cspr: hint: pose[3].position = [0.0, 0.0, 1.282]: ") for line in lines
        )
        planned = cspr_jax.plan(path)
        assert len(planned.warnings) == count and all("from P0 = [0, 0, " in line for line in planned.warnings)


def test_a_motion_from_python_warns_of_a_rounded_p0():
    """Once each, and not of P0 itself."""
    robot, z0 = cspr_jax.load_robot("prototype"), 1.2345678
    near, target = np.array([0.0, 0.0, 1.235]), np.array([0.2, 0.1, 1.2])
    calls = (
        ("start", "start = None", lambda: cspr_jax.hypocycloid(robot, near, target, z0=z0, arcs=2)),
        ("end", "its coordinates in full", lambda: cspr_jax.hypocycloid(robot, target, near, z0=z0, arcs=2)),
    )
    for key, cure, call in calls:
        with pytest.warns(UserWarning, match=rf"{key} = \[0.0, 0.0, 1.235\]: 0.00043 m .* is meant: {cure}$") as told:
            call()
        assert len(told) == 1 and told[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        cspr_jax.hypocycloid(robot, np.array([0.0, 0.0, z0]), target, z0=z0, arcs=2)


def test_gradients_near_p0_grow_as_the_distance_shrinks():
    """They are right, those of a direction that turns the faster the nearer to P0; at rest they are moderate."""
    robot, z0, target = cspr_jax.load_robot("prototype"), 1.2345, np.array([0.3, 0.2, 1.1])
    problem = cspr_jax.make_problem(robot)

    def margin(start):
        return cspr_jax.sampled_margin(problem, cspr_jax.hypocycloid(robot, start, target, z0=z0, arcs=3))

    both = jax.jit(jax.value_and_grad(margin))
    for apart in (1e-1, 1e-3, 1e-5):
        start = np.array([apart, 0.5 * apart, z0])
        gradient = np.asarray(both(start)[1])
        assert 0.2 < np.abs(gradient).max() * apart < 0.6
        step = 1e-4 * apart
        for axis in range(3):
            ends = [float(both(start + sign * step * np.eye(3)[axis])[0]) for sign in (1.0, -1.0)]
            np.testing.assert_allclose((ends[0] - ends[1]) / (2.0 * step), gradient[axis], rtol=1e-4, atol=1e-4 / apart)
    assert np.abs(np.asarray(both(np.array([0.0, 0.0, z0]))[1])).max() == 0.0
