"""Arrangements of cables: numbers by enumeration, copies by the workspaces of a symmetric robot, values by hand."""

import itertools
import json
import tomllib

import numpy as np
import pytest
from support.commands import cspr

import cspr_jax
from cspr_jax.api.sweeps import checked_sweep
from cspr_jax.config.arrangements import Invariants, _symmetries, arrangement_points
from cspr_jax.config.reading import checked
from cspr_jax.config.robot import RobotFile
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.plans.cell_plan import cell_plan
from cspr_jax.robots.model.arrangements import arrangement_of, distinct_arrangements, numbers_of

PLANAR = {
    "name": "square",
    "base_points": [[1.0, 0, 0], [-1.0, 0, 0], [0.8, 0, 1.5], [-0.8, 0, 1.5]],
    "platform_points": [[0.2, 0, 0.0], [-0.2, 0, 0.0], [0.1, 0, 0.3], [-0.1, 0, 0.3]],
    "inertia": [[0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]],
    "pattern": "1R2T",
    "mass": 2.0,
    "tension_max": 60.0,
    "parameter": [{"name": "arm", "value": 0.2, "lower": 0.1, "upper": 0.4, "moves": {"platform_points[0][0]": 1.0}}],
}
SWEEP = {
    "schema": 1,
    "map": "workspace",
    "robot": PLANAR,
    "axes": {"x": [-0.5, -0.2, 0.0, 0.2, 0.5], "y": [0.0], "z": [0.5, 0.9], "arrangement": "all"},
    "workspace": {"conditions": ["wrench-feasible"]},
}


def _robot(**more):
    return checked(RobotFile, PLANAR | more, "square")


@pytest.mark.parametrize("count", [1, 2, 4, 6])
def test_numbers_are_those_of_an_enumeration(count):
    every = list(itertools.permutations(range(count)))
    np.testing.assert_array_equal(numbers_of(np.array(every)), np.arange(len(every)))
    assert [tuple(arrangement_of(number, count)) for number in range(len(every))] == every


def _maps(arrangements):
    result = cspr_jax.compute_sweep(SWEEP | {"axes": SWEEP["axes"] | {"arrangement": arrangements}})
    return {int(result.arrangement[i]): result.wrench_margin.values[..., i] for i in range(result.arrangement.size)}


def test_copies_are_mirrored_robots():
    """Each arrangement has the margins of one that is kept, or their mirror image; those that are kept all differ."""
    every, kept = _maps(list(range(24))), _maps("all")
    for number, margins in every.items():
        images = [name for name, own in kept.items() for one in (own, own[::-1]) if np.allclose(margins, one)]
        assert len(set(images)) == 1 and images[0] <= number
    assert set(kept) < set(every)


def test_a_frame_with_all_symmetries_of_a_square():
    """Of the square's eight symmetries, which conjugate arrangements: orbits counted by Burnside's lemma."""
    corners = [np.array([1, 1, 2.0]), np.array([-1, 1, 2.0]), np.array([-1, -1, 2.0]), np.array([1, -1, 2.0])]
    turns = [np.roll(np.arange(4), k)[:: 1 - 2 * mirror] for k in range(4) for mirror in (0, 1)]
    every = [np.array(one) for one in itertools.permutations(range(4))]
    fixed = [sum(np.array_equal(turn[one], one[turn]) for one in every) for turn in turns]
    eight = [[*corner[:2], z] for z in (2.0, 3.0) for corner in corners]
    robot = _robot(
        pattern=None,
        base_points=[list(corner) for corner in corners] * 2,
        platform_points=[[*(0.2 * np.array(point[:2])), point[2] - 2.0] for point in eight],
        parameter=None,
    )
    symmetries = _symmetries(robot, Invariants())
    assert len({tuple(one.spools) + tuple(one.attachments) for one in symmetries[:8]}) == 8
    of_four = [one._replace(spools=one.spools[:4] % 4, attachments=one.attachments[:4]) for one in symmetries[:8]]
    assert len(distinct_arrangements(4, of_four)) == sum(fixed) / 8


def test_points_that_fall_together_and_cables_that_differ():
    points = PLANAR["platform_points"]
    both = _robot(platform_points=[points[0], points[0], points[2], points[3]], parameter=None)
    assert len(arrangement_points(both, "all", Invariants())) == 12
    assert len(arrangement_points(_robot(), "all", Invariants())) < 24
    for differs in ({"tension_max": [60.0, 60.0, 60.0, 50.0]}, {"pulley_radius": [0.1, 0.2, 0.1, 0.1]}):
        assert len(arrangement_points(_robot(**differs), "all", Invariants())) == 24
    assert len(arrangement_points(_robot(tension_max=[60, 60, 50, 50]), "all", Invariants())) < 24
    assert len(arrangement_points(_robot(), "all", Invariants(cables=False))) == 24


def test_copies_are_those_of_all_that_a_sweep_asks_for():
    """Identical robots are copies whatever is asked for; mirrored ones only where nothing tells directions apart."""
    points = PLANAR["platform_points"]
    robot = PLANAR | {"platform_points": [points[0], points[0], points[2], points[3]]}
    robot = {name: value for name, value in robot.items() if name != "parameter"}
    arm = PLANAR["parameter"][0] | {"moves": {"platform_points[1][0]": 1.0}}

    def count(changes, of=robot):
        spec = (
            SWEEP | {"robot": of} | {name: SWEEP[name] | value for name, value in changes.items() if name != "limits"}
        )
        return len(checked_sweep(spec | {k: v for k, v in changes.items() if k == "limits"}).grid.axes["arrangement"])

    mirrored = robot | {"platform_points": points}
    assert count({}, mirrored) < 24 == count({"workspace": {"wrench_box": [1.0, 1.0, 0.1]}}, mirrored)
    assert count({}) == 12 == count({"workspace": {"wrenches": [[0.0, -20.0, 0.0]]}})
    assert count({"limits": {"tension_max": [50.0, 50.0, 50.0, 50.0]}}) == 12
    assert count({"axes": {"parameter.arm": [0.2, 0.3]}}, robot | {"parameter": [arm]}) == 24


def test_values_of_parameters_move_the_same_points_in_any_arrangement():
    number = int(numbers_of(np.array([[2, 0, 3, 1]]))[0])
    arranged = _robot().with_parameters({"arrangement": number, "arm": 0.3})
    points = np.array(PLANAR["platform_points"])
    points[0, 0] += 0.1
    np.testing.assert_allclose(arranged.platform_points, points[[2, 0, 3, 1]])
    again = arranged.with_parameters({"arm": 0.2})
    np.testing.assert_allclose(again.platform_points, np.array(PLANAR["platform_points"])[[2, 0, 3, 1]])


def test_plans_of_cells_have_their_arrangement():
    result = {"settings": SWEEP | {"map": "poses", "trajectory": {"family": "hypocycloid"}}}
    spec = cell_plan(result["settings"], {"x": 0.0, "y": 0.0, "z": 0.9, "z0": 1.0, "arrangement": 7.0}, {})
    assert spec["parameters"] == {"arrangement": 7.0}


def _text(axis):
    parts = [(SWEEP, ()), (PLANAR, ("robot",)), (SWEEP["axes"] | {"arrangement": axis}, ("axes",))]
    lines = [""]
    for table, names in [*parts, (SWEEP["workspace"], ("workspace",))]:
        lines += [f"[{name}]" for name in names]
        simple = {name: value for name, value in table.items() if not isinstance(value, dict) and name != "parameter"}
        lines += [f"{name} = {json.dumps(value)}" for name, value in simple.items()]
    return "\n".join(lines)


def test_maps_of_some_and_of_all_arrangements_are_joined(tmp_path, monkeypatch, figures):
    monkeypatch.chdir(tmp_path)
    for name, axis in (("all", "all"), ("some", [[3, 2, 1, 0], [0, 1, 2, 3]])):
        (tmp_path / f"{name}.toml").write_text(_text(axis))
        assert cspr("run", f"{name}.toml", "-o", name)[0] == 0
        assert cspr("verify", name)[0] == 0
    code, _, error = cspr("merge", "all", "some", "-o", "joined")
    assert code == 0, error
    joined, every = (cspr_jax.open_result(path) for path in ("joined/all.h5", "all/all.h5"))
    assert set(joined.axes["arrangement"]) == {*every.axes["arrangement"], 0.0, 23.0}
    assert every.settings["arrangements"] == len(every.axes["arrangement"]) and "arrangements" not in joined.settings
    index = np.searchsorted(joined.axes["arrangement"], every.axes["arrangement"])
    np.testing.assert_array_equal(joined.data["wrench_margin"][..., index], every.data["wrench_margin"])
    best = every.best("arrangement")
    margins = every.data["wrench_margin"]
    chosen = np.searchsorted(every.axes["arrangement"], best.data["best_arrangement"])
    picked = np.take_along_axis(margins, chosen[..., None], axis=-1)[..., 0]
    np.testing.assert_array_equal(picked, margins.max(-1))
    assert cspr("plot", "some/some.h5", "--at", "arrangement=23")[0] == 0
    assert "arrangement = 23" in figures[0].get_suptitle()
    assert cspr("size", "all/all.h5")[2].count("axes.arrangement: must be absent: motors are sized for one robot") == 1


@pytest.mark.parametrize(
    ("axis", "words"),
    [
        ([24], "axes.arrangement = 24: must be a whole number from 0 to 23"),
        ([[0, 1, 2, 2]], "axes.arrangement = [0, 1, 2, 2]: must be the numbers 0 to 3, each once"),
        ("each", "axes.arrangement"),
        ([], "axes.arrangement"),
        ([1.5], "axes.arrangement"),
    ],
)
def test_wrong_arrangements_have_one_line(tmp_path, axis, words):
    path = tmp_path / "s.toml"
    path.write_text(_text(axis))
    code, out, error = cspr("run", path, "-o", tmp_path / "out")
    assert code == 2 and error.startswith(f"cspr: {path}: {words}") and error.count("\n") == 1 and not out
    assert not (tmp_path / "out").exists()


def test_point_masses_and_reserved_names():
    mass = checked(RobotFile, tomllib.loads('name="m"\nmass=1\nbase_points=[[1,0,0],[-1,0,0],[0,1,0]]'), "m")
    with pytest.raises(InputError, match=r"parameters.arrangement = 1: must be absent: all cables of a point mass"):
        mass.with_parameters({"arrangement": 1})
    table = PLANAR["parameter"][0] | {"name": "arrangement"}
    with pytest.raises(ConfigError, match="a name that no other parameter has, nor arrangement"):
        _robot(parameter=[table])
    ten = {"base_points": [[i, 0, 0] for i in range(10)], "platform_points": [[0.1 * i, 0, 0.1] for i in range(10)]}
    with pytest.raises(InputError, match="a list, of robots on more than 9 cables"):
        arrangement_points(_robot(**ten, parameter=None), "all", Invariants())


def test_cables_that_are_gone_are_not_alike():
    mirrored = {name: value for name, value in PLANAR.items() if name != "parameter"}
    spec = SWEEP | {"robot": mirrored}
    assert len(checked_sweep(spec).grid.axes["arrangement"]) < 24
    assert len(checked_sweep(spec | {"without": [0]}).grid.axes["arrangement"]) == 24


def test_arrangements_of_very_many_cables_have_no_numbers():
    points = {"base_points": [[i, 0, 0] for i in range(20)], "platform_points": [[0.1 * i, 0, 0.1] for i in range(20)]}
    robot = _robot(**points, parameter=None)
    with pytest.raises(InputError, match="arrangement: permutations of 20 cables: must be of at most 18"):
        arrangement_points(robot, [list(range(20))], Invariants())


def test_the_axis_has_one_name():
    for axes in ({"parameter.arrangement": [0, 1]}, {"parameter": {"arrangement": [0, 1]}}):
        with pytest.raises(ConfigError, match=r"parameter\.arrangement = an axis: must be called arrangement alone"):
            checked_sweep(SWEEP | {"axes": {"x": [0.0], "y": [0.0], "z": [0.5]} | axes})
