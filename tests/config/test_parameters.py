"""Parameters of robot files: numbers that move together, beside the same numbers moved by hand."""

import json
import tomllib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.commands import cspr, strict_json

import cspr_jax
from cspr_jax.config.formats.writing import robot_text
from cspr_jax.config.missing_cables import without_cables
from cspr_jax.config.reading import checked
from cspr_jax.config.robot import RobotFile, read_robot
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.outputs.plots.robots.robot_at import spools_of
from cspr_jax.plans.cell_plan import cell_plan

SPOOLS = np.array([[0.5, -0.3, 0.0], [-0.5, -0.3, 0.1], [0.0, 0.6, 0.0]])
ROBOT = """name = "frame"
base_points = [[0.5, -0.3, 0], [-0.5, -0.3, 0.1], [0, 0.6, 0]]
mass = 0.2
tension_max = [4, 5, 6]
[winch]
drum_radius = 0.02
motor_torque_max = [1, 2, 3]
"""
PARAMETERS = """
[[parameter]]
name = "width"
value = 1.0
lower = 0.5
upper = 2.0
unit = "m"
moves = { "base_points[0][0]" = 0.5, "base_points[1][0]" = -0.5 }
[[parameter]]
name = "load"
value = 0.2
lower = 0.1
upper = 3
unit = "kg"
moves = { mass = 1, "tension_max[2]" = 10 }
[[parameter]]
name = "size"
value = 1
lower = 0.5
upper = 3
moves = { scale = 1, "parameter.load" = 0.1, "winch.drum_radius" = 0.01, "winch.motor_torque_max[1]" = -0.1 }
"""
PLAN_TEXT = """schema = 1
robot = "robot.toml"
family = "hypocycloid-standard"
z0 = 1.4
[[pose]]
rest = true
[[pose]]
position = [0.8, 0.2, 1.3]
"""
PLAN = tomllib.loads(PLAN_TEXT)
SWEEP = """schema = 1
map = "minimum-arcs"
robot = "robot.toml"
[axes]
x = [0.5, 0.8, -0.9]
"parameter.width" = [0.6, 1.5]
y = [0.2]
z = [1.3]
parameter.load = [0.3, 0.2]
z0 = [1.4]
[trajectory]
from = { rest = true }
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "robot.toml").write_text(ROBOT + PARAMETERS)
    (tmp_path / "plan.toml").write_text(PLAN_TEXT)
    (tmp_path / "sweep.toml").write_text(SWEEP)
    return tmp_path


def _moved(width=1.0, load=0.2, size=1.0):
    """The numbers of the file, moved by the formulas of docs/design.md."""
    more = load - 0.2 + 0.1 * (size - 1.0)
    spools = SPOOLS.copy()
    spools[0, 0] += 0.5 * (width - 1.0)
    spools[1, 0] -= 0.5 * (width - 1.0)
    return {
        "base_points": spools + (size - 1.0) * (SPOOLS - SPOOLS.mean(0)),
        "mass": 0.2 + more,
        "tension_max": [4.0, 5.0, 6.0 + 10.0 * more],
        "drum_radius": 0.02 + 0.01 * (size - 1.0),
        "motor_torque_max": [1.0, 2.0 - 0.1 * (size - 1.0), 3.0],
    }


@given(st.floats(0.5, 2.0), st.floats(0.2, 2.5), st.floats(0.5, 3.0))
def test_numbers_move_as_by_hand(width, load, size):
    robot = checked(RobotFile, tomllib.loads(ROBOT + PARAMETERS), "robot.toml")
    moved, hand = robot.with_parameters({"width": width, "load": load, "size": size}), _moved(width, load, size)
    winch = hand.pop("drum_radius"), hand.pop("motor_torque_max")
    for name, value in hand.items():
        np.testing.assert_allclose(getattr(moved, name), value, rtol=1e-13, atol=1e-14)
    np.testing.assert_allclose(moved.winch.drum_radius, winch[0], rtol=1e-13)
    np.testing.assert_allclose(moved.winch.motor_torque_max, winch[1], rtol=1e-13)
    # The moved robot is a robot file whose values are those that were set; going back gives the numbers of the file.
    values = {parameter.name: parameter.value for parameter in moved.parameter}
    expected = {"width": width, "load": hand["mass"], "size": size}
    np.testing.assert_allclose(list(values.values()), list(expected.values()), rtol=1e-13)
    there = moved.with_parameters({"width": 0.8, "size": 2.0})
    np.testing.assert_allclose(there.base_points, _moved(width=0.8, size=2.0)["base_points"], atol=1e-13)
    back = there.with_parameters({"width": 1.0, "size": 1.0}).with_parameters({"load": 0.2})
    np.testing.assert_allclose(back.base_points, SPOOLS, atol=1e-13)
    assert back.mass == pytest.approx(0.2, rel=1e-12)


def test_nothing_moves_at_the_values_of_the_file(folder):
    robot = read_robot(folder / "robot.toml")
    same = robot.with_parameters({"width": 1.0, "size": 1.0})
    assert same.settings == robot.settings and same.file == robot.file
    assert robot.with_parameters({}) is robot


def test_platform_points_are_scaled_about_the_origin():
    spec = checked(RobotFile, json.loads(json.dumps(_platform())), "p").with_parameters({"body": 2.0})
    np.testing.assert_allclose(spec.platform_points, 2.0 * np.array(_platform()["platform_points"]))
    np.testing.assert_array_equal(spec.base_points, _platform()["base_points"])


def _platform():
    angles = np.arange(6) * np.pi / 3.0
    ring = np.stack([np.cos(angles), np.sin(angles), np.zeros(6)], axis=1)
    return {
        "name": "six",
        "mass": 1.0,
        "base_points": ring.round(3).tolist(),
        "platform_points": (0.2 * ring[:, [1, 0, 2]]).round(3).tolist(),
        "inertia": np.diag([0.1, 0.1, 0.1]).tolist(),
        "parameter": [{"name": "body", "value": 1, "lower": 0.5, "upper": 2, "moves": {"platform_scale": 1}}],
    }


def test_plans_take_values_of_parameters(folder):
    by_hand = _moved(width=1.5, load=0.3)
    inline = {"name": "frame", **{name: np.asarray(by_hand[name]).tolist() for name in ("base_points", "mass")}}
    inline |= {"tension_max": by_hand["tension_max"], "winch": {"drum_radius": 0.02, "motor_torque_max": [1, 2, 3]}}
    expected = cspr_jax.plan(PLAN | {"robot": inline}).to_dict()["segments"]
    values = {"width": 1.5, "load": 0.3}
    assert cspr_jax.plan(PLAN | {"parameters": values}).to_dict()["segments"] == expected
    # Values of the call, and of --set, replace those of the file.
    plan = cspr_jax.plan(PLAN | {"parameters": {"width": 0.7, "load": 0.3}}, {"width": 1.5})
    assert plan.to_dict()["segments"] == expected
    code, out, _ = cspr("plan", "plan.toml", "--set", "width=1.5", "--set", "load=0.3", "--json", "-o", "motion.h5")
    assert code == 0 and strict_json(out)["segments"] == expected
    # The motion's file holds the robot that moves.
    kept = json.loads(cspr_jax.open_result("motion.h5").attributes["robot_settings"])
    np.testing.assert_allclose(kept["base_points"], by_hand["base_points"], rtol=1e-13)
    np.testing.assert_allclose(cspr_jax.load_robot("robot.toml", values).base_points, by_hand["base_points"])


REFUSED = [
    ({"width": 3.0}, "plan: parameters.width = 3.0: must be from 0.5 to 2.0, as [[parameter]] of the robot file says"),
    ({"widht": 1.0}, "plan: parameters.widht = 1.0: did you mean width? one of width, load, size"),
    ({"size": 3.0, "load": 3.0}, "plan: parameters.load = 3.2: must be from 0.1 to 3.0"),
    ({"width": "wide"}, 'plan: parameters.width = "wide": must be a number'),
]


@pytest.mark.parametrize(("values", "line"), REFUSED)
def test_wrong_values_are_refused_in_one_line(folder, values, line):
    with pytest.raises(ConfigError) as error:
        cspr_jax.plan(PLAN | {"parameters": values})
    assert str(error.value).startswith(line) and "\n" not in str(error.value)


def test_a_robot_without_parameters_has_no_values():
    with pytest.raises(ConfigError, match="must be absent: the robot file has no"):
        cspr_jax.plan(PLAN | {"robot": "prototype", "parameters": {"width": 1.0}})


@pytest.mark.parametrize("words", ["width", "width=", "=2", "width=inf"])
def test_wrong_words_of_set_are_refused(folder, words):
    code, _, error = cspr("plan", "plan.toml", "--set", words)
    assert code == 2 and error.startswith(f"cspr: --set: {words}: must be NAME=VALUE")


def _with(**changes):
    parameter = {"name": "width", "value": 1.0, "lower": 0.5, "upper": 2.0, "moves": {"mass": 1.0}} | changes
    return {"parameter": [parameter]}


WRONG = [
    (_with(upper=0.4), "parameter[0].upper = 0.4: must be a number > lower"),
    (_with(value=3.0), "parameter[0].value = 3.0: must be from lower to upper"),
    (_with(moves={}), "parameter[0].moves = {}: must be"),
    (_with(moves={"mass": 0.0}), "parameter[0].moves = mass = 0: must be numbers that are not 0"),
    (_with(moves={"base_points[0][3]": 1.0}), 'parameter[0].moves = "base_points[0][3]": '),
    (_with(moves={"masss": 1.0}), 'parameter[0].moves = "masss": did you mean mass?'),
    (_with(moves={"platform_scale": 1.0}), 'parameter[0].moves = "platform_scale": '),
    (_with(moves={"name": 1.0}), 'parameter[0].moves = "name": '),
    (_with(moves={"mass": -1.0}), "parameter[0].upper = 2.0: must be a value that gives a robot (robot: mass = -0.8"),
    (_with(moves={"scale": 4.0}), "parameter[0].lower = 0.5: must be a value that gives a robot (scale = -1.0"),
    (_with(moves={"parameter.width": 1.0}), "parameter[0].moves = width -> width: must be parameters that do not"),
    ({"parameter": [*_with()["parameter"], *_with()["parameter"]]}, "parameter[1].name = width: must be a name that"),
    (_with(name="a b"), 'parameter[0].name = "a b": must be'),
]


@pytest.mark.parametrize(("more", "line"), WRONG)
def test_wrong_parameters_are_refused_in_one_line(more, line):
    with pytest.raises(ConfigError) as error:
        checked(RobotFile, tomllib.loads(ROBOT) | more, "robot.toml")
    assert error.value.lines[0].startswith(f"robot.toml: {line}"), error.value.lines[0]


def test_parameters_that_move_each_other_are_refused():
    first = _with(moves={"parameter.height": 1.0})["parameter"][0]
    second = _with(name="height", moves={"mass": 1.0, "parameter.width": -1.0})["parameter"][0]
    with pytest.raises(ConfigError, match="width -> height -> width: must be parameters that do not move themselves"):
        checked(RobotFile, tomllib.loads(ROBOT) | {"parameter": [first, second]}, "robot.toml")


def test_a_corner_of_the_bounds_may_give_no_robot():
    both = [_with(name=name, moves={"mass": -0.12}, value=1.0)["parameter"][0] for name in ("one", "other")]
    robot = checked(RobotFile, tomllib.loads(ROBOT) | {"parameter": both}, "robot.toml")
    with pytest.raises(InputError, match=r"parameters: robot: mass = -0.0\d*: .*: values that give a robot"):
        robot.with_parameters({"one": 2.0, "other": 2.0})


def test_axes_of_parameters_are_the_maps_of_their_robots(folder):
    result = cspr_jax.open_result(cspr_jax.run("sweep.toml", "over"))
    assert list(result.axes) == ["x", "parameter.width", "y", "z", "parameter.load", "z0"]
    assert result.units["parameter.width"] == "m" and result.units["parameter.load"] == "kg"
    alone = tomllib.loads(SWEEP)
    values = {name: alone["axes"].pop(name) for name in ("parameter.width", "parameter")}
    for i, width in enumerate(values["parameter.width"]):
        for j, load in enumerate(values["parameter"]["load"]):
            one = cspr_jax.open_result(
                cspr_jax.run(alone | {"parameters": {"width": width, "load": load}}, f"one{i}{j}")
            )
            for name, data in one.data.items():
                np.testing.assert_array_equal(result.data[name][:, i, :, :, j], data)
    assert len(np.unique(result.data["duration"])) > 2
    # The best width of a target is that of its fewest arcs.
    best = result.best("parameter.width")
    arcs = np.where(result.data["arcs"] > 0, result.data["arcs"], 10_000)
    np.testing.assert_array_equal(best.data["arcs"], arcs.min(1))
    assert best.units["best_parameter.width"] == "m"
    assert set(best.to_xarray()["best_parameter.width"].values.ravel()) <= {0.6, 1.5}
    # The plan of a cell moves the robot of the cell.
    index = (1, 1, 0, 0, 0, 0)
    cell = {name: data[index] for name, data in result.data.items()}
    plan = cspr_jax.plan(cell_plan(result.settings, result.coordinates(index), cell))
    assert float(plan.problem.robot.mass) == pytest.approx(0.3)
    np.testing.assert_allclose(plan.answers.duration, cell["duration"], rtol=1e-12)
    # Pictures show its spools, and none where they depend on what is not fixed; the load does not move them.
    wider = np.array([[0.25, 0, 0], [-0.25, 0, 0], [0, 0, 0]])
    np.testing.assert_allclose(spools_of(result, {"parameter.width": 1.5}), SPOOLS + wider)
    assert spools_of(result, {"parameter.load": 0.2}) is None


def test_maps_over_robots_are_verified_and_joined(folder):
    code, _, _ = cspr("run", "sweep.toml", "-o", "whole")
    assert code == 0 and cspr("verify", "whole")[0] == 0
    for name, points in (("a", "[0.6]"), ("b", "[1.5]")):
        (folder / f"{name}.toml").write_text(SWEEP.replace("[0.6, 1.5]", points))
        assert cspr("run", f"{name}.toml", "-o", name)[0] == 0
    code, _, error = cspr("merge", "a", "b", "-o", "joined")
    assert code == 0, error
    joined, full = cspr_jax.open_result("joined/a.h5"), cspr_jax.open_result("whole/sweep.h5")
    for name, data in full.data.items():
        np.testing.assert_array_equal(joined.data[name], data)


REFUSED_AXES = [
    (
        '"parameter.width" = [0.6, 1.5]',
        '"parameter.width" = [0.6, 2.5]',
        "axes.parameter.width = 2.5: must be from 0.5",
    ),
    (
        '"parameter.width" = [0.6, 1.5]',
        '"parameter.wide" = [0.6, 1.5]',
        "axes.parameter.wide = 0.6: did you mean width?",
    ),
    (
        "[axes]",
        "parameters = { load = 0.3 }\n[axes]",
        "parameters.load = 0.3: must be absent beside axes.parameter.load",
    ),
    ('"parameter.width" = [0.6, 1.5]', '"parameter.width" = []', "axes.parameter.width = []: must be"),
]


@pytest.mark.parametrize(("old", "new", "line"), REFUSED_AXES)
def test_wrong_axes_are_refused_in_one_line(folder, old, new, line):
    (folder / "sweep.toml").write_text(SWEEP.replace(old, new))
    code, out, error = cspr("run", "sweep.toml", "-o", "out")
    assert code == 2 and error.startswith(f"cspr: sweep.toml: {line}"), error
    assert error.count("\n") == 1 and not out and not (folder / "out").exists()


def test_cables_go_after_parameters_are_set():
    square = {"base_points": [[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]], "mass": 1.0, "name": "square"}
    moves = {"base_points[3][0]": 1.0, "base_points[1][1]": 0.5}
    square |= {"parameter": [{"name": "lean", "value": 0, "lower": -0.5, "upper": 0.5, "moves": moves}]}
    robot = checked(RobotFile, square, "square").with_parameters({"lean": 0.4})
    left = without_cables(robot, [0], "square")
    np.testing.assert_allclose(left.base_points, [[-1, 1.2, 0], [-1, -1, 0], [1.4, -1, 0]])
    assert left.full is robot


def test_parameters_are_written_as_they_are_read():
    robot = checked(RobotFile, tomllib.loads(ROBOT + PARAMETERS), "robot.toml").with_parameters({"size": 1.2})
    spec = robot.model_dump(mode="json", exclude_none=True)
    assert checked(RobotFile, tomllib.loads(robot_text(spec)), "written").model_dump() == robot.model_dump()
