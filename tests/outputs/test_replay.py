"""Plans in MuJoCo: models and control files, and what `cspr replay` says of them."""

import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from support.folder import PLAN, folder

import cspr_jax
from cspr_jax.config.reading import read_toml
from cspr_jax.errors import ConfigError
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.outputs.mujoco.module import need_mujoco
from cspr_jax.outputs.mujoco.motion import played, suspended
from cspr_jax.outputs.mujoco.replay import path_of, tension_deviation
from outputs.test_outputs import cspr, strict_json

mujoco = pytest.importorskip("mujoco")
__all__ = ["folder"]  # a fixture

ROOT = Path(__file__).parents[2]
EXAMPLES = sorted(
    [path for path in (ROOT / "sweeps").glob("*.toml") if "pose" in read_toml(path)]
    + [ROOT / "docs" / "examples" / "hall_plan.toml"]
)
# No duration of its segments is feasible, which is what it is there for.
INFEASIBLE = "launch_baseline"
# A plan whose platform no tensions hold: a disturbance at its start is 2.6e24 times as large at its end.
UNSTABLE = "table_3_2"
OPEN_LOOP = 1e-6  # m


def open_loop(path):
    """What the documents show: a model and its control file, and MuJoCo's own steps."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    table = np.loadtxt(path.with_name(f"{path.stem}_control.csv"), delimiter=",", skiprows=1)
    t, tensions, row = table[:, 0], table[:, 1:], 0
    mujoco.mj_resetDataKeyframe(model, data, 0)

    def control(model, data):
        data.ctrl[:] = tensions[row + round(2 * (data.time - t[row]) / model.opt.timestep)]

    mujoco.set_mjcb_control(control)
    try:
        while row + 2 < len(t):
            model.opt.timestep = t[row + 2] - t[row]
            data.time = t[row]
            mujoco.mj_step(model, data)
            row += 2 if row + 3 == len(t) or t[row + 3] > t[row + 2] else 3
    finally:
        mujoco.set_mjcb_control(None)
    return model, data, table


def checked(path, **choices):
    """A plan, and its replay, which is as it should be."""
    plan = cspr_jax.plan(path)
    found = cspr_jax.replay(plan, **choices)
    assert found.path_deviation.max() < OPEN_LOOP
    assert np.abs(found.tension_deviation).max() < 1e-12 * found.tension.max()
    if Path(path).stem != UNSTABLE:
        assert found.through_deviation.max() < max(1e-9, 1e-12 * found.steps)  # rounding adds up over the steps
    np.testing.assert_allclose(found.time[-1], plan.answers.duration.sum())
    np.testing.assert_allclose(found.position[[0, -1]], plan.points[[0, -1]], atol=1e-9)
    return plan, found


@pytest.mark.thorough
@pytest.mark.parametrize(
    "name", ["docs/examples/hall_plan.toml", pytest.param("sweeps/planar_lines.toml", marks=pytest.mark.thorough)]
)
def test_plans_in_mujoco(name, tmp_path):
    """A point mass, z up, and one in a plane on redundant cables, z down; platforms are in test_mujoco."""
    plan, found = checked(ROOT / name, step=0.002)
    plan.save_mjcf(tmp_path / "model.xml", step=0.002)
    model, data, table = open_loop(tmp_path / "model.xml")
    rows, up = plan.rows(), np.array([1.0, 1.0, 1.0] if plan.robot_file.z_axis == "up" else [1.0, -1.0, -1.0])
    axes = [0, 2] if plan.robot_file.is_planar else [0, 1, 2]
    np.testing.assert_allclose(data.qpos, (up * plan.points[-1])[axes], atol=1e-9)
    assert data.time == pytest.approx(found.time[-1], abs=1e-12)
    np.testing.assert_allclose(data.site("spool_1").xpos, up * plan.robot_file.base_points[0])
    np.testing.assert_array_equal(table[[0, -1], 1:], found.tension[[0, -1]])
    # The keyframe moves on as planned.
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.qacc, (up * rows["acceleration"][0])[axes], atol=1e-9)
    np.testing.assert_allclose(data.ten_length, rows["length"][0], atol=1e-12)
    assert (
        model.body("effector").mass[0] == plan.robot_file.mass and model.opt.gravity[2] == -plan.problem.robot.gravity
    )
    assert (model.tendon_width > 0).all() and model.nbody == 2 and mujoco.get_mjcb_control() is None


@pytest.mark.thorough
def test_another_robot_is_seen(folder):
    """A mass, or a place of a spool, that is not the plan's."""
    with double_precision():
        plan = cspr_jax.plan("plan.toml")
        body, moved = suspended(plan), played(plan, 0.002)
        assert np.abs(tension_deviation(body, moved)).max() < 1e-14
        found = tension_deviation(body._replace(mass=1.001 * body.mass), moved)
        assert np.abs(found).max() == pytest.approx(0.001 * moved.tension.max(), rel=1e-3)
        shifted = body._replace(spools=body.spools + 0.001 * np.eye(3)[:, :1] * np.eye(3)[0])
        assert np.abs(tension_deviation(shifted, moved)).max() > 1e-4
        way = path_of(shifted, moved, by_segment=False)
        assert np.linalg.norm(way.position[-1] - moved.position[-1]) > 1e-4


@pytest.mark.thorough
def test_the_command(folder, capsys):
    told = strict_json(cspr(capsys, "replay", "plan.toml", "--json", "--step", 0.002, "-o", "picture.svg"))
    found = cspr_jax.replay("plan.toml", step=0.002)
    assert told == found.to_dict() and told["largest_deviation"]["path"]["value"] == found.path_deviation.max() < 1e-9
    row = int(found.through_deviation.argmax())
    largest = told["largest_deviation"]["path_in_one_go"]
    assert (largest["t"], largest["segment"]) == (found.time[row], found.segment[row])
    assert set(found.segment) == {1, 2} and found.steps == len(found.time) - 2
    lines = cspr(capsys, "replay", "plan.toml", "--step", 0.002).splitlines()
    assert lines == found.lines() and len(lines) == 4 and "of MuJoCo" in lines[0]
    drawn = Path("picture.svg").read_text()
    assert "planned" in drawn and "all in one go" in drawn and "cable 3" in drawn
    found.plot(output="mine.svg")
    assert Path("mine.svg").read_text() == drawn
    printed = cspr(capsys, "plan", "plan.toml", "--mjcf", "told.xml", "--step", 0.002)
    assert printed == cspr(capsys, "plan", "plan.toml")
    assert cspr_jax.plan("plan.toml").save_mjcf("mine.xml", step=0.002) == Path("mine.xml")
    assert Path("told_control.csv").read_bytes() == Path("mine_control.csv").read_bytes()
    assert Path("told.xml").read_text() == Path("mine.xml").read_text().replace("mine_control", "told_control")
    texts = ElementTree.parse("told.xml").getroot().findall("custom/text")
    assert [text.get("data") for text in texts] == ["told_control.csv"]


def test_a_plan_that_is_not_feasible(folder, capsys):
    """It is neither written nor played, unless that is asked for: then no cable of MuJoCo pushes."""
    Path("plan.toml").write_text(PLAN.replace("[0.3, 0.2, 1.6]", "[1.8, 0.2, 0.4]").replace("z0", "max_arcs = 1\nz0"))
    before = set(folder.iterdir())
    assert "not played" in cspr(capsys, "replay", "plan.toml", code=1)
    assert "m.xml: not written" in cspr(capsys, "plan", "plan.toml", "--mjcf", "m.xml", code=1)
    plan = cspr_jax.plan("plan.toml")
    with pytest.raises(ConfigError, match="not proved feasible"):
        plan.save_mjcf("m.xml")
    with pytest.raises(ConfigError, match="not played"):
        cspr_jax.replay(plan)
    assert set(folder.iterdir()) == before
    assert "the file says so" in cspr(
        capsys, "plan", "plan.toml", "--mjcf", "m.xml", "--anyway", "--step", 0.01, code=1
    )
    assert "NOT PROVED FEASIBLE" in Path("m.xml").read_text()
    found = cspr_jax.replay(plan, anyway=True, step=0.01)
    assert found.tension.min() < 0.0 and found.path_deviation.max() > 0.01
    assert np.abs(found.tension_deviation).max() < 1e-9 * found.tension.max()
    assert {path.name for path in set(folder.iterdir()) - before} == {"m.xml", "m_control.csv"}


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("plan", "plan.toml", "--mjcf", "m.mjcf"), "--mjcf: m.mjcf: must end in .xml"),
        (("plan", "plan.toml", "--step", "0.01"), "--step: must be absent without --mjcf"),
        (("plan", "plan.toml", "--mjcf", "m.xml", "--step", "0"), "--step: 0.0: must be a number > 0, in s"),
        (
            ("plan", "plan.toml", "--mjcf", "m.xml", "--step", "1e-9"),
            "--step: 1e-09 s: must give at most 20000000 rows",
        ),
        (("plan", "plan.toml", "--mjcf", "m.xml", "-o", "m_control.csv"), "-o: m_control.csv: must be another name"),
        (("plan", "plan.toml", "--anyway"), "--anyway: must be absent without -o, --mjcf or --animate"),
        (("replay", "plan.toml", "--step", "nan"), "--step: nan: must be a number > 0, in s"),
        (("replay", "plan.toml", "-o", "picture"), "-o: picture: must end in .png"),
        (("replay", "plan.toml", "-o", "a.bmp2"), "-o: a.bmp2: must end in .png"),
        (("replay", "no.toml"), "no.toml: cannot be read"),
    ],
)
def test_mistakes(folder, capsys, words, line):
    before = set(folder.iterdir())
    assert cspr(capsys, *words, code=2).startswith(f"cspr: {line}")
    assert set(folder.iterdir()) == before


def test_without_mujoco(folder, capsys, monkeypatch):
    """Models are written without it."""
    monkeypatch.setitem(sys.modules, "mujoco", None)
    assert (
        cspr(capsys, "replay", "plan.toml", code=2) == "cspr: mujoco: is not installed: pip install 'cspr_jax[sim]'\n"
    )
    with pytest.raises(ConfigError, match="cspr_jax\\[sim\\]"):
        need_mujoco()
    cspr(capsys, "plan", "plan.toml", "--mjcf", "m.xml", "--step", 0.01)
    assert Path("m.xml").is_file()


def test_the_callback_of_another_stays(folder):
    def own(model, data):
        pass

    mujoco.set_mjcb_control(own)
    try:
        cspr_jax.replay("plan.toml", step=0.01)
        assert mujoco.get_mjcb_control() is own
    finally:
        mujoco.set_mjcb_control(None)


@pytest.mark.soak
@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_every_example_in_mujoco(path, tmp_path):
    if path.stem == INFEASIBLE:
        with pytest.raises(ConfigError, match="not proved feasible"):
            cspr_jax.replay(path)
        return
    plan, found = checked(path)
    if path.stem == UNSTABLE:
        return
    _, data, _ = open_loop(plan.save_mjcf(tmp_path / "model.xml", step=0.001))
    up = np.array([1.0, 1.0, 1.0] if plan.robot_file.z_axis == "up" else [1.0, -1.0, -1.0])
    axes = [0, 2] if plan.robot_file.is_planar else [0, 1, 2]
    np.testing.assert_allclose(data.qpos[: len(axes)], (up * found.position[-1])[axes], atol=OPEN_LOOP)
