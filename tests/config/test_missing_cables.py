"""Robots without some cables: bit for bit those of files from which the cables were taken by hand."""

import json
import tomllib

import numpy as np
import pytest
from support.commands import cspr, refuse_sweep, strict_json, swept

import cspr_jax
from cspr_jax.config.equivalents import as_moved
from cspr_jax.config.missing_cables import without_cables
from cspr_jax.config.reading import checked
from cspr_jax.config.robot import RobotFile
from cspr_jax.errors import ConfigError
from cspr_jax.workspaces.any_cable_gone import AnyCableGone
from cspr_jax.workspaces.static_poses import FREQUENCY, MARGINS

SPOOLS = [[1.2, 0.0, 0.0], [0.4, 1.1, 0.05], [-1.0, 0.7, 0.0], [-0.9, -0.7, 0.0], [0.3, -1.2, 0.1]]
EACH = {
    "base_points": SPOOLS,
    "tension_max": [20.0, 21.0, 22.0, 23.0, 24.0],
    "axial_stiffness": [1e4, 2e4, 3e4, 4e4, 5e4],
    "pulley_radius": [0.01, 0.02, 0.03, 0.04, 0.05],
    "pulley_axes": [[0.0, 0.0, -1.0], [0.0, 0.1, -1.0], [0.1, 0.0, -1.0], [0.0, 0.0, -1.0], [0.0, 0.0, -1.0]],
}
ROBOT = {"name": "five", "mass": 1.0, "tension_min": 0.5, "cable_speed_max": [3.0, 3.1, 3.2, 3.3, 3.4]} | EACH
WINCH = {
    "drum_radius": [0.02, 0.03, 0.04, 0.05, 0.06],
    "gear_ratio": 5.0,
    "motor_speed_max": [400.0, 410.0, 420.0, 430.0, 440.0],
}
POSES = [
    {"position": [0.0, 0.0, 1.5], "time": 0.0},
    {"position": [0.15, 0.1, 1.4], "time": 1.5},
    {"position": [0.1, -0.1, 1.5], "time": 3.0},
]
LIMITS = {"cable_length_max": [2.5, 2.6, 2.7, 2.8, 2.9]}


def _by_hand(table, gone):
    each = {name for name, value in table.items() if isinstance(value, list) and len(value) == len(SPOOLS)}
    return table | {name: [x for i, x in enumerate(table[name]) if i not in gone] for name in each}


def _toml(table):
    """A plan or sweep whose values are all written in one line."""
    return "".join(f"{key} = {_value(value)}\n" for key, value in table.items())


def _value(value):
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_value(inner)}" for key, inner in value.items()) + " }"
    if isinstance(value, list):
        return f"[{', '.join(map(_value, value))}]"
    return json.dumps(value)


def _plan(robot, **more):
    return _toml({"schema": 1, "family": "spline", "robot": robot, **more, "pose": POSES})


def test_lists_lose_the_entries_of_missing_cables():
    read = lambda table: RobotFile(**tomllib.loads(_toml(table)))  # noqa: E731
    whole = read(ROBOT | {"winch": WINCH})
    left = without_cables(whole, [1], "f")
    assert left.model_dump() == read(_by_hand(ROBOT, (1,)) | {"winch": _by_hand(WINCH, (1,))}).model_dump()
    assert left.settings == whole.settings and left.missing_cables == (1,)
    assert without_cables(whole, None, "f") is whole


def test_a_plan_is_that_of_a_robot_cut_by_hand(tmp_path):
    (tmp_path / "a.toml").write_text(_plan(ROBOT | {"winch": WINCH}, without=[1], limits=LIMITS))
    cut = _by_hand(ROBOT, (1,)) | {"winch": _by_hand(WINCH, (1,))}
    (tmp_path / "b.toml").write_text(_plan(cut, limits=_by_hand(LIMITS, (1,))))
    code, out, error = cspr("plan", tmp_path / "a.toml", "--json", "-o", tmp_path / "a.h5")
    assert (code, error.count("\n")) == (0, 1) and "cables 1, 3, 4, 5 of the robot file" in error
    one, other = strict_json(out), strict_json(cspr("plan", tmp_path / "b.toml", "--json")[1])
    assert one.pop("without") == [1] and one == other
    # The file keeps the robot as it is written, and is read and drawn as that of three cables.
    result = cspr_jax.open_result(tmp_path / "a.h5")
    assert len(json.loads(result.attributes["robot_settings"])["base_points"]) == 5
    assert result.data["tension"].shape[1] == 4
    assert cspr("plot", tmp_path / "a.h5", "--quantity", "summary", "-o", tmp_path / "a.png")[0] == 0


def test_a_check_takes_missing_cables(tmp_path):
    t, points = np.linspace(0.0, 2.0, 9), np.linspace([0.0, 0.0, 1.5], [0.1, 0.1, 1.4], 9)
    np.savetxt(tmp_path / "m.csv", np.c_[t, points], delimiter=",", header="t,x,y,z", comments="")
    (tmp_path / "r.toml").write_text(_toml(ROBOT))
    (tmp_path / "cut.toml").write_text(_toml(_by_hand(ROBOT, (2,))))
    answers = [
        strict_json(cspr("check", tmp_path / "m.csv", "--robot", tmp_path / file, *words, "--json")[1])
        for file, words in (("r.toml", ("--without", "2")), ("cut.toml", ()))
    ]
    assert answers[0].pop("without") == [2] and answers[0] == answers[1]
    check = cspr_jax.check(tmp_path / "r.toml", t, points, without=[2])
    assert check.margin == answers[0]["margin"]
    many = cspr_jax.check_many(tmp_path / "r.toml", t, points[None], without=[2])
    assert many.verdict[0] == 0 and abs(many.margin[0] - check.margin) < 1e-9


SWEEP = {
    "schema": 1,
    "map": "workspace",
    "axes": {
        "x": {"start": -1.0, "stop": 1.0, "count": 6},
        "y": {"start": -1.0, "stop": 1.0, "count": 5},
        "z": [0.8, 1.6],
    },
    "workspace": {"conditions": ["wrench-feasible"]},
}
PLAIN = {"name": "five", "mass": 1.0, "tension_min": 0.5, "base_points": SPOOLS, "tension_max": EACH["tension_max"]}


def test_any_cable_gone_is_what_the_robots_without_each_have_in_common(tmp_path):
    each = []
    for i in range(5):
        (tmp_path / str(i)).mkdir()
        each.append(swept(tmp_path / str(i), _toml(SWEEP | {"robot": _by_hand(PLAIN, (i,))})))
        (tmp_path / f"w{i}").mkdir()
        one = swept(tmp_path / f"w{i}", _toml(SWEEP | {"robot": PLAIN, "without": [i]}))
        np.testing.assert_array_equal(one.data["wrench_margin"], each[i].data["wrench_margin"])
        np.testing.assert_array_equal(one.data["verdict"], each[i].data["verdict"])
        assert one.attributes["identity"] != each[i].attributes["identity"]
    common = swept(tmp_path, _toml(SWEEP | {"robot": PLAIN, "without": "any-one"}))
    margins = np.array([one.data["wrench_margin"] for one in each])
    np.testing.assert_array_equal(common.data["wrench_margin"], margins.min(0))
    np.testing.assert_array_equal(common.data["worst_cable"], margins.argmin(0) + 1)
    inside = np.all([one.data["verdict"] == 0 for one in each], axis=0)
    np.testing.assert_array_equal(common.data["verdict"] == 0, inside)
    assert 0 < inside.sum() < inside.size
    assert cspr("plot", tmp_path / "run" / "s.h5", "--quantity", "worst_cable", "-o", tmp_path / "w.png")[0] == 0
    assert cspr("verify", tmp_path / "run")[0] == 0


@pytest.mark.parametrize(
    ("without", "words"),
    [
        ([5], "must be cables of five, from 0 to 4, each once"),
        ([1, 1], "each once"),
        ([0, 1, 2], "2 cables are left for 3 degrees of freedom: the mass swings in the vertical plane"),
        ([0, 1, 2, 3, 4], "0 cables are left for 3 degrees of freedom: it falls"),
        ([], "at least"),
        ([-1], "without[0]"),
        ("any-one", "must be a list of cables"),
    ],
)
def test_impossible_cables_are_refused(tmp_path, without, words):
    sweep = SWEEP | {"map": "feasible-acceleration", "robot": PLAIN, "without": without}
    del sweep["workspace"]
    refuse_sweep(tmp_path, _toml(sweep), words)


def test_limits_of_each_cable_are_those_of_the_file(tmp_path):
    (tmp_path / "a.toml").write_text(_plan(ROBOT, without=[1], limits={"tension_max": [20.0, 20.0, 20.0]}))
    code, _, error = cspr("plan", tmp_path / "a.toml")
    assert code == 2 and "tension_max = [20.0, 20.0, 20.0]" in error and "or 5: one a cable" in error
    assert error.count("\n") == 1


def test_a_planar_robot_keeps_level_spools():
    table = {"name": "p", "mass": 1.0, "planar": True, "base_points": [[-1.0, 0, 0], [1.0, 0, 0], [0.0, 0, -0.5]]}
    whole = RobotFile(**tomllib.loads(_toml(table)))
    assert without_cables(whole, [2], "f").base_points == whole.base_points[:2]
    with pytest.raises(ConfigError, match=r"^f: without = \[0\]: base_points = .*level"):
        without_cables(whole, [0], "f")


PLANAR = {
    "name": "planar",
    "mass": 1.0,
    "inertia": [[0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]],
    "pattern": "1R2T",
    "tension_min": 0.5,
    "tension_max": 60.0,
    "base_points": [
        [x, 0.0, z] for x, z in ((-1.0, 0.0), (1.0, 0.0), (-1.2, 0.1), (1.2, 0.1), (-0.7, 0.0), (0.7, 0.0))
    ],
    "platform_points": [[x, 0.0, z] for z in (0.1, -0.1, 0.0) for x in (-0.1, 0.1)],
}


class _Rows:
    """A map of two cells, of robots without tensions in the first one."""

    first_margin = "wrench_margin"

    def __init__(self, wrench, clearance):
        self._columns = {name: np.full(2, np.nan) for name in (*MARGINS, FREQUENCY)}
        self._columns |= {"wrench_margin": np.array(wrench), "clearance": np.array(clearance)}

    def with_orientations(self, cells):
        zeros, chosen = np.zeros(2, np.int16), cells["x"]
        columns = self._columns | dict.fromkeys(("verdict", "nearest_bodies", "cell_side", "cell_open"), zeros)
        columns |= {"inside": np.ones((2, 1), bool), "orientation_fraction": np.ones(2)}
        return {name: values[chosen] for name, values in columns.items()}

    def fraction(self, inside):
        return inside.mean(1)


def test_the_worst_cable_does_not_depend_on_tiles():
    """Cells one by one, and together: where no margin of the tensions is known, the clearance does not stand in."""
    whole = object.__new__(AnyCableGone)
    whole._maps = [_Rows([np.nan, 2.0], [3.0, 3.0]), _Rows([np.nan, 1.0], [1.0, 4.0])]
    each = [whole({"x": np.array([i])})["worst_cable"][0] for i in range(2)]
    assert each == whole({"x": np.arange(2)})["worst_cable"].tolist() == [1, 2]


@pytest.mark.thorough
def test_fractions_of_any_cable_gone_are_of_orientations_in_common():
    """Orientations one by one: those that every robot without a cable has, not the smallest fraction of a robot."""
    angles = np.linspace(-0.6, 0.6, 7)
    turns = [[float(np.cos(0.5 * a)), 0.0, float(np.sin(0.5 * a)), 0.0] for a in angles]
    axes = {"x": [-0.4, 0.0, 0.3], "y": [0.0], "z": [0.6, 1.0, 1.4]}
    workspace = {"conditions": ["wrench-feasible"], "orientations": "inclusion", "quaternions": turns}
    sweep = SWEEP | {"robot": PLANAR, "axes": axes, "workspace": workspace}

    def fractions(**more):
        return cspr_jax.compute_sweep(sweep | more)["orientation_fraction"].values.ravel()

    inside = np.ones((9, len(turns)), bool)
    for k in range(6):
        left = {name: [x for i, x in enumerate(PLANAR[name]) if i != k] for name in ("base_points", "platform_points")}
        for i, turn in enumerate(turns):
            one = {"conditions": ["wrench-feasible"], "orientation": turn}
            cells = cspr_jax.compute_sweep(sweep | {"robot": PLANAR | left, "workspace": one})
            inside[:, i] &= cells["verdict"].values.ravel() == 0
    common = fractions(without="any-one")
    np.testing.assert_allclose(common, inside.mean(1), atol=1e-12)
    smallest = np.min([fractions(without=[k]) for k in range(6)], axis=0)
    assert (common <= smallest + 1e-12).all() and (common < smallest - 0.05).any() and (common > 0.0).any()


def _with_two_more(**more):
    """Six cables in three parallel pairs, and two beside them."""
    pairs = cspr_jax.parallel_pair_robot(0.5, 0.05, mass=1.0)
    lists = {name: np.asarray(getattr(pairs, name)).tolist() for name in ("base_points", "platform_points", "inertia")}
    lists["base_points"] += [[0.3, 0.0, 0.0], [-0.3, 0.1, 0.0]]
    lists["platform_points"] += [[0.1, 0.0, 0.0], [-0.1, 0.0, 0.0]]
    return {"name": "eight", "mass": 1.0} | lists | more


def test_settings_of_an_equivalent_say_so(tmp_path):
    """Of a platform whose six cables that are left are parallel pairs: its plan and its file move a point mass."""
    robot = RobotFile(**_with_two_more())
    moved = as_moved(robot, [("3T",)], [6, 7])
    settings = json.loads(json.dumps(moved.settings))
    assert settings["translation_only"] is True and len(settings["base_points"]) == 8
    again = as_moved(checked(RobotFile, settings, "f"), [("3R3T", "3T")], [6, 7])
    assert again.base_points == moved.base_points and again.settings == settings
    assert "translation_only" not in as_moved(robot, [("3R3T", "3T")], [6, 7]).settings
    plan = {"robot": _with_two_more(), "family": "transition", "z0": 1.2, "without": [6, 7]}
    (tmp_path / "p.toml").write_text(
        _toml({"schema": 1, **plan, "pose": [{"rest": True}, {"position": [0.1, 0.0, 1.2]}]})
    )
    assert cspr("plan", tmp_path / "p.toml", "-o", tmp_path / "m.h5")[0] == 0
    assert cspr("plot", tmp_path / "m.h5", "--quantity", "tensions", "-o", tmp_path / "t.png")[0] == 0


def test_all_cables_of_an_equivalent_are_six():
    plan = {"schema": 1, "robot": _with_two_more(translation_only=True), "family": "hypocycloid-standard", "z0": 1.2}
    with pytest.raises(ConfigError, match=r"robot\.translation_only = true: must be absent: ") as error:
        cspr_jax.plan(plan | {"pose": [{"rest": True}, {"position": [0.1, 0.0, 1.2]}]})
    assert "\n" not in str(error.value)
