"""Mistakes in design files: one line each, and nothing is written."""

import copy

import pytest

import cspr_jax
from cspr_jax.errors import ConfigError
from tests.synthesis.problems import FEASIBLE, LIFT, PROBLEMS, parameter

WIDTH = PROBLEMS["planar width"]
OF_AXIS = parameter("z", 1, 0, 2, {"maps.places.axes.z": 1})
OF_LIMIT = parameter("width", 1, 0, 2, {"maps.places.limits.tension_max": 1})
OF_POINT = parameter("x", 0.5, 0.4, 0.6, {"maps.places.axes.z.start": 1})
OF_STRENGTH = parameter("strength", 30, -10, 50, {"maps.places.limits.tension_max": 1})
LIFTS = {"plans": {"lift": LIFT}}
QUANTITY = "requirement[0].quantity"
EMPTY = {"of": "frame", "quantity": "extent_x", "lower": 2, "upper": 1}
# Changes of the file, by their dotted keys, and parts of the line.
MISTAKES = [
    ({"objective": []}, "objective", "a list of"),
    ({"objective.0.of": "shelf"}, 'objective[0].of = "shelf"', "one of places, frame, hall, robot, parameters"),
    ({"objective.0.quantity": "extent"}, 'quantity = "extent"', "did you mean extent_"),
    ({"objective.0.goal": "best"}, 'objective[0].goal = "best"', '"largest" or "smallest"'),
    ({"objective.0.of": "hall"}, "objective[0].of = hall", "there is no [hall]"),
    ({"objective.0.of": "parameters", "objective.0.quantity": "with"}, 'quantity = "with"', "did you mean width?"),
    ({"objective.0.of": "robot", "objective.0.quantity": "weight"}, 'quantity = "weight"', "one of base_points[0][0]"),
    ({"requirement.0.lower": 1.0}, "requirement[0].lower = 1", "feasible is required to be 1"),
    ({"requirement.0.quantity": "wrench_margin"}, "requirement[0].lower", "or upper, or both"),
    ({"requirement.0.quantity": "arcs", "requirement.0.upper": 3}, 'requirement[0].quantity = "arcs"', "one of"),
    ({"requirement.0": EMPTY}, "requirement[0].upper = 1", ">= lower"),
    ({"parameters": ["widht"]}, 'parameters[0] = "widht"', "did you mean width?"),
    ({"parameters": ["width", "width"]}, 'parameters[1] = "width"', "named once"),
    ({"arrangements": "all"}, 'arrangements = "all"', "all cables of a point mass end in it"),
    ({"parameter": [OF_AXIS]}, 'parameter[0].moves = "maps.places.axes.z"', "numbers of the file"),
    ({"parameter": [OF_LIMIT]}, "parameter[0].name = width", "a name that the robot file does not have"),
    ({"maps.places.robot": "prototype"}, "maps.places.robot", "absent"),
    ({"maps.places": {"file": "nowhere.toml"}}, "nowhere.toml", "cannot be read"),
    ({"maps.places.map": "workspaces"}, 'map = "workspaces"', 'did you mean "workspace"?'),
    ({"maps.places.axes.x": {"start": 0, "stop": 0, "count": 5}}, "axes.x", "whose stop differs from its start"),
    ({"maps.frame": {"file": "a.toml"}}, "maps.frame", "another name than frame"),
    ({"hall": {}}, "hall.corners", "[[hall.obstacle]]"),
    ({"hall": {"corners": [[0, 0, 0], [1, 1, -1]]}}, "hall.corners", "[least, largest]"),
    ({"search": {"screen": 0}}, "search.screen = 0", "at least 1"),
    ({"searches": {}}, "searches", "did you mean search?"),
    ({"robot.parameter": None}, "parameters", "there are none"),
    ({"requirement.0": FEASIBLE | {"prove": True, "of": "lift"}, **LIFTS}, "[0].prove", "no map of a workspace"),
    ({"requirement.0.prove": True, "parameter": [OF_POINT]}, "requirement[0].prove", "parameters move its axes"),
    ({"requirement.0.reduce": "largest"}, "requirement[0].reduce = largest", "absent"),
    ({"requirement.0": {"of": "places", "quantity": "fraction", "lower": 2}}, "requirement[0].lower", "from 0 to 1"),
    ({"requirement.0": {"of": "places", "quantity": "verdict", "upper": 0}}, QUANTITY, "stand for words"),
    ({"requirement.0": {"of": "places", "quantity": "clearance", "lower": 0}}, QUANTITY, "another one without"),
    ({"requirement.0": {"of": "lift", "quantity": "arcs", "upper": 3}, **LIFTS}, QUANTITY, "have no arcs"),
    ({"objective": [WIDTH["objective"][0]] * 2}, "objective[1]", "another objective than the first"),
    ({"maps.places.axes.parameter": {"width": [1, 2]}}, "axes.parameter.width", "the design has the robots"),
    ({"parameter": [OF_STRENGTH]}, "parameter[0].lower = -10", "a value that gives valid maps and plans"),
    ({"parameter": [parameter("s", 1, 1, 2, {"maps.places.schema": 1})]}, "parameter[0].moves", "numbers of the file"),
    ({"hall": {"obstacle": []}}, "hall.corners", "a hall needs it"),
    ({"plans": {"li ft": LIFT}}, "plans.li ft", "a name of letters"),
]  # fmt: skip


def changed(data, changes):
    """A design with other values at dotted keys; None removes a key."""
    data = copy.deepcopy(data)
    for key, value in changes.items():
        *parents, last = (int(part) if part.isdigit() else part for part in key.split("."))
        table = data
        for part in parents:
            table = table[part]
        if value is None:
            del table[last]
        else:
            table[last] = value
    return data


@pytest.mark.parametrize(("changes", "key", "allowed"), MISTAKES, ids=[" ".join(m[0]) for m in MISTAKES])
def test_mistakes_get_one_line(tmp_path, changes, key, allowed):
    with pytest.raises(ConfigError) as caught:
        cspr_jax.design(changed(WIDTH, changes), tmp_path / "out")
    line = caught.value.lines[0]
    assert "\n" not in line and key in line and allowed in line, line
    assert not (tmp_path / "out").exists()


def test_cells_about_an_axis_have_no_proofs(tmp_path):
    with pytest.raises(ConfigError, match=r"axes\.radius: cannot be combined with workspace.prove"):
        cspr_jax.design(changed(PROBLEMS["circle"], {"requirement.0.prove": True}), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_plans_that_no_robot_has(tmp_path):
    lift = LIFT | {"limits": {"uncertainty": {"spool_positions": 0.001}}}
    changes = {"objective.0": {"of": "lift", "quantity": "tolerated", "goal": "largest"}, "plans.lift": lift}
    with pytest.raises(ConfigError, match=r"no robot has an answer .* plans.lift: uncertainty"):
        cspr_jax.design(changed(PROBLEMS["least power"], changes | {"search": {"screen": 4}}), tmp_path / "out")


def test_parameters_that_give_no_robot():
    bad = parameter("mass", 2.0, -1.0, 3.0, {"mass": 1.0})
    with pytest.raises(ConfigError, match=r"parameter\[1\].lower = -1.0: must be a value that gives a robot"):
        cspr_jax.design(changed(WIDTH, {"robot.parameter": [*WIDTH["robot"]["parameter"], bad]}))
