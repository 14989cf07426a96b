"""Parameters of plans and sweeps: numbers that they move, beside the same numbers written by hand."""

import tomllib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.commands import cspr, strict_json

import cspr_jax
from cspr_jax.api.sweeps import checked_sweep
from cspr_jax.config.plan import checked_plan, plan_of_text
from cspr_jax.errors import ConfigError

ROBOT = """name = "frame"
base_points = [[0.5, -0.3, 0], [-0.5, -0.3, 0.1], [0, 0.6, 0]]
mass = 0.2
[[parameter]]
name = "width"
value = 1.0
lower = 0.5
upper = 2.0
moves = { "base_points[0][0]" = 0.5, "base_points[1][0]" = -0.5 }
"""
PLAN = """schema = 1
robot = "robot.toml"
family = "hypocycloid-standard"
amplitude = { name = "effective", epsilon = 0.2 }
z0 = 1.4
limits = { tension_max = [4.0, 4.5, 5.0] }
[[pose]]
rest = true
[[pose]]
position = [0.5, 0.2, 1.3]
"""
PARAMETERS = """
[[parameter]]
name = "depth"
value = 1.4
lower = 0.7
upper = 2.1
unit = "m"
moves = { z0 = 1, "pose[1].position[2]" = 0.1 }
[[parameter]]
name = "ends"
value = 0
lower = 0
upper = 3
moves = { "amplitude.epsilon" = 0.1, "limits.tension_max[1]" = -0.3, "parameter.depth" = 0.01 }
"""
SWEEP = """schema = 1
map = "minimum-arcs"
robot = "robot.toml"
[axes]
x = [0.3, 0.5, -0.6]
y = [0.2]
z = [1.3]
z0 = [1.4]
[trajectory]
from = { position = [0.1, 0, 1.4] }
amplitude = { name = "effective", epsilon = 0.2 }
[limits]
tension_max = 4
"""
OF_SWEEP = """
[[parameter]]
name = "ends"
value = 0.2
lower = 0.1
upper = 0.4
moves = { "trajectory.amplitude.epsilon" = 1, "limits.tension_max" = -2, "trajectory.from.position[0]" = 0.5 }
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "robot.toml").write_text(ROBOT)
    (tmp_path / "plan.toml").write_text(PLAN + PARAMETERS)
    (tmp_path / "sweep.toml").write_text(SWEEP + OF_SWEEP)
    return tmp_path


def _written(changes, width=1.0):
    """The plan with other numbers in its text, and the robot's width there."""
    text = PLAN
    for old, new in changes:
        assert text.count(old) == 1
        text = text.replace(old, new)
    return tomllib.loads(text) | {"parameters": {"width": width}}


def _rows(plan):
    rows = plan.rows()
    return {name: rows[name] for name in rows}


DEEPER = [("z0 = 1.4", "z0 = 1.7"), ("0.2, 1.3", "0.2, 1.33")]
WIDER = [("epsilon = 0.2", "epsilon = 0.35"), ("4.5", "4.05"), ("z0 = 1.4", "z0 = 1.415"), ("0.2, 1.3", "0.2, 1.3015")]
CASES = [({"depth": 1.7}, DEEPER), ({"ends": 1.5}, WIDER), ({"depth": 1.4}, []), ({"depth": 1.7, "width": 1.3}, DEEPER)]


@pytest.mark.parametrize(("values", "changes"), CASES)
def test_a_plan_at_a_value_is_the_plan_with_these_numbers(folder, values, changes):
    expected = cspr_jax.plan(_written(changes, values.get("width", 1.0)))
    of_key = cspr_jax.plan(tomllib.loads(PLAN + PARAMETERS) | {"parameters": values})
    of_argument = cspr_jax.plan("plan.toml", values)
    assert expected.feasible
    for plan in (of_key, of_argument):
        assert plan.to_dict()["segments"] == expected.to_dict()["segments"]
        assert plan.z0 == expected.z0 and plan.keys.amplitude == expected.keys.amplitude
        for name, column in _rows(expected).items():
            np.testing.assert_array_equal(_rows(plan)[name], column)


def test_files_of_motions_hold_the_plan_that_moved(folder):
    code, out, _ = cspr("plan", "plan.toml", "--set", "ends=1.5", "--set", "width=1.3", "--json", "-o", "motion.h5")
    expected = cspr_jax.plan(_written(WIDER, 1.3))
    assert code == 0 and strict_json(out)["segments"] == expected.to_dict()["segments"]
    motion = cspr_jax.open_result("motion.h5")
    kept = plan_of_text(str(motion.attributes["plan"]), folder / "motion.h5")
    assert motion.attributes["z0"] == kept.z0 == expected.z0 == 1.415
    assert kept.amplitude == expected.keys.amplitude and kept.tension_max == expected.keys.tension_max == [4, 4.05, 5]
    assert kept.parameters == {"width": 1.3}
    assert {table.name: table.value for table in kept.parameter} == {"depth": 1.415, "ends": 1.5}


@given(st.floats(0.7, 2.1))
def test_a_number_that_is_a_value_is_that_value(depth):
    plan = checked_plan(tomllib.loads(PLAN + PARAMETERS) | {"parameters": {"depth": depth}}, "plan")
    assert plan.z0 == depth and plan.parameters is None and plan.parameter[0].value == depth


def _with(**changes):
    parameter = {"name": "depth", "value": 1.0, "lower": 0.5, "upper": 2.0, "moves": {"z0": 1.0}} | changes
    return {"parameter": [parameter]}


def test_whole_numbers_stay_whole():
    spec = tomllib.loads(PLAN) | _with(name="arcs", value=2, lower=1, upper=5, moves={"pose[1].arcs": 2, "z0": 0.1})
    spec["pose"] = [spec["pose"][0], spec["pose"][1] | {"arcs": 4}]
    assert checked_plan(spec | {"parameters": {"arcs": 3}}, "plan").pose[1].arcs == 6
    with pytest.raises(
        ConfigError, match=r"plan: parameters = \{ arcs = 2.25 \}: must be values that give a plan .*4.5"
    ):
        checked_plan(spec | {"parameters": {"arcs": 2.25}}, "plan")


def test_values_of_the_robot_move_too(folder):
    spec = tomllib.loads(PLAN) | _with(moves={"z0": 0.5, "parameters.width": 0.3}) | {"parameters": {"width": 1.0}}
    plan = cspr_jax.plan(spec, {"depth": 2.0})
    assert plan.keys.parameters == {"width": 1.3}
    expected = cspr_jax.plan(_written([("z0 = 1.4", "z0 = 1.9")], 1.3))
    assert plan.to_dict()["segments"] == expected.to_dict()["segments"]


REFUSED = [
    ({"parameters": {"depth": 3.0}}, "parameters.depth = 3.0: must be from 0.5 to 2.0, as [[parameter]] of the plan"),
    ({"parameters": {"deph": 1.0}}, "parameters.deph = 1.0: did you mean depth? one of depth, width"),
    ({"parameters": {"depth": "deep"}}, 'parameters.depth = "deep": must be a number'),
    (_with(moves={"z": 1.0}), 'parameter[0].moves = "z": '),
    (_with(moves={"pose[1].position[3]": 1.0}), 'parameter[0].moves = "pose[1].position[3]": '),
    (_with(moves={"family": 1.0}), 'parameter[0].moves = "family": '),
    (
        _with(moves={"scale": 1.0}),
        'parameter[0].moves = "scale": must be numbers of the file, such as amplitude.epsilon, z0',
    ),
    (_with(moves={"schema": 1.0}), 'parameter[0].moves = "schema": '),
    (_with(moves={}), "parameter[0].moves = {}: must be"),
    (_with(name="width"), 'parameter[0].name = "width": must be a name that no parameter of the robot has'),
    (_with(name="arrangement"), "parameter[0].name = arrangement: must be a name that"),
    (_with(upper=0.4), "parameter[0].upper = 0.4: must be a number > lower"),
    (_with(moves={"z0": -2.0}), "parameter[0].upper = 2.0: must be a value that gives a plan (plan: z0 = -0.6"),
    (_with(moves={"parameter.depth": 1.0}), "parameter[0].moves = depth -> depth: must be parameters that do not"),
]


@pytest.mark.parametrize(("more", "line"), REFUSED)
def test_wrong_parameters_are_refused_in_one_line(folder, more, line):
    with pytest.raises(ConfigError) as error:
        cspr_jax.plan(tomllib.loads(PLAN) | _with() | more)
    assert error.value.lines[0].startswith(f"plan: {line}"), error.value.lines[0]
    assert len(error.value.lines) == 1


def test_the_command_refuses_names_of_neither(folder):
    code, out, error = cspr("plan", "plan.toml", "--set", "height=1")
    assert (code, out) == (2, "")
    assert error == "cspr: plan.toml: parameters.height = 1.0: must be one of depth, ends, width\n"


def test_numbers_of_sweeps_move(folder):
    changes = [("epsilon = 0.2", "epsilon = 0.3"), ("tension_max = 4", "tension_max = 3.8"), ("[0.1, 0,", "[0.15, 0,")]
    text = SWEEP
    for old, new in changes:
        text = text.replace(old, new)
    values = {"ends": 0.3, "width": 1.3}
    expected = cspr_jax.compute_sweep(tomllib.loads(text) | {"parameters": {"width": 1.3}})
    code, _, error = cspr("run", "sweep.toml", "--set", "ends=0.3", "--set", "width=1.3", "-o", "out")
    assert code == 0, error
    result = cspr_jax.open_result("out/sweep.h5")
    for name, data in expected.data_vars.items():
        np.testing.assert_array_equal(result.data[name], data.values)
    # What the run records is the sweep that moved: the same as if its file held these numbers.
    assert result.settings["limits"] == {"tension_max": 3.8} and result.settings["parameters"] == {"width": 1.3}
    there = text + OF_SWEEP.replace("value = 0.2", "value = 0.3")
    by_hand = checked_sweep(tomllib.loads(there), {"width": 1.3})
    assert checked_sweep("sweep.toml", values).identity == by_hand.identity == result.attributes["identity"]
    assert cspr("verify", "out")[0] == 0 and cspr("run", "sweep.toml", "--set", "ends=0.4", "-o", "out")[0] == 3


REFUSED_OF_SWEEPS = [
    ('{ "trajectory.amplitude.epsilon" = 1,', '{ "axes.z0[0]" = 1,', 'parameter[0].moves = "axes.z0[0]": '),
    ('{ "trajectory.amplitude.epsilon" = 1,', '{ "robot.mass" = 1,', 'parameter[0].moves = "robot.mass": '),
    (
        'epsilon" = 1',
        'epsilon" = 9',
        "parameter[0].lower = 0.1: must be a value that gives a sweep (sweep: trajectory.",
    ),
    ('"ends"', '"width"', 'parameter[0].name = "width": must be a name that no parameter of the robot has'),
]


@pytest.mark.parametrize(("old", "new", "line"), REFUSED_OF_SWEEPS)
def test_wrong_parameters_of_sweeps_are_refused_in_one_line(folder, old, new, line):
    (folder / "sweep.toml").write_text((SWEEP + OF_SWEEP).replace(old, new))
    code, out, error = cspr("run", "sweep.toml", "-o", "out")
    assert code == 2 and error.startswith(f"cspr: sweep.toml: {line}"), error
    assert error.count("\n") == 1 and not out and not (folder / "out").exists()
