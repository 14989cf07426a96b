"""Workspaces of many robots at once, beside those of each robot, and beside linear programs."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import linprog

import cspr_jax
from cspr_jax.config.robot import resolve_robot
from cspr_jax.robots.model.arrangements import arrangement_of
from cspr_jax.schema.map_kinds import MapKind
from cspr_jax.workspaces.search import WorkspaceSearch
from cspr_jax.workspaces.search_over_robots import SearchOverRobots

SWEEPS = Path(__file__).parents[2] / "sweeps"
EIGHT = resolve_robot("cogiro-500", "test", Path()).model_dump(mode="json", exclude_none=True)
MOVES = [
    {"name": "size", "value": 1, "lower": 0.5, "upper": 2, "moves": {"scale": 1}},
    {"name": "load", "value": 0, "lower": -100, "upper": 400, "unit": "kg", "moves": {"mass": 1}},
    {
        "name": "lift",
        "value": 0,
        "lower": -1,
        "upper": 1,
        "moves": {"base_points[0][2]": 1, "platform_points[1][0]": 0.2},
    },
    {"name": "strength", "value": 0, "lower": -2000, "upper": 3000, "moves": {"tension_max": 1}},
]
LOAD = {"name": "load", "value": 0, "lower": -1, "upper": 4, "moves": {"mass": 1}}
PLANAR = {
    "name": "planar",
    "pattern": "1R2T",
    "mass": 5.0,
    "base_points": [[-2, 0, 0], [-1.7, 0, 0.1], [1.6, 0, 0], [2, 0, 0.2]],
    "platform_points": [[-0.3, 0, 0], [-0.1, 0, 0.2], [0.1, 0, 0.25], [0.3, 0, 0]],
    "inertia": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "tension_min": 1.0,
    "tension_max": 300.0,
    "parameter": [
        {"name": "size", "value": 1, "lower": 0.5, "upper": 2, "moves": {"scale": 1, "tension_min": 0.5}},
        LOAD,
    ],
}
POINT = {
    "name": "point",
    "mass": 3.0,
    "base_points": [[1, 1, 0], [-1, 1, 0.1], [-1, -1, 0], [1, -1, -0.1]],
    "tension_max": [60.0, 70.0, 80.0, 90.0],
    "parameter": [
        *PLANAR["parameter"][1:],
        {"name": "size", "value": 1, "lower": 0.5, "upper": 2, "moves": {"scale": 1}},
    ],
}
X, Y, Z = [-3.0, -0.4, 0.0, 2.5], [-2.0, 0.0, 1.1], [0.5, 2.0]
CASES = {
    "eight cables": (EIGHT | {"parameter": MOVES}, {"x": X, "y": Y, "z": Z}, {"conditions": ["wrench-feasible"]}),
    "seven cables": (
        {name: value[:7] if name.endswith("_points") else value for name, value in EIGHT.items()}
        | {"parameter": MOVES},
        {"x": X, "y": Y, "z": Z, "tilt": [0.0, 0.2]},
        {"conditions": ["static", "wrench-feasible"], "acceleration": 0.4, "wrench_box": [10, 20, 30, 1, 2, 3]},
    ),
    "in a plane": (
        PLANAR,
        {"x": [-1.0, 0.0, 0.3], "y": [0.0], "z": [0.7, 1.5], "tilt": [-0.1, 0.0]},
        {"conditions": ["wrench-feasible"], "wrenches": [[0, -60, 0], [5, -40, 1]]},
    ),
    "closure": (
        PLANAR | {"base_points": [[-2, 0, 0], [2, 0, 0.1], [-1.9, 0, 2], [2, 0, 2.1]]},
        {"x": [-1.0, 0.0, 0.3], "y": [0.0], "z": [0.7, 1.5], "tilt": [-1.1, 0.0]},
        {"conditions": ["wrench-closure"]},
    ),
    "point mass": (POINT, {"x": [-1.2, 0, 0.4], "y": [0, 0.5], "z": [0.2, 0.9]}, {"conditions": ["wrench-feasible"]}),
}
VALUES = {"size": [0.9, 1.3], "load": [-0.5, 2.0], "lift": [-0.4, 0.3], "strength": [-1500.0, 800.0]}


def _feasible(robot, axes):
    workspace = {"conditions": ["wrench-feasible"]}
    return {"schema": 1, "map": "workspace", "robot": robot, "axes": axes, "workspace": workspace}


def _spec(case, **axes):
    robot, targets, workspace = CASES[case]
    names = [table["name"] for table in robot["parameter"]]
    of_robot = {f"parameter.{name}": VALUES[name] for name in names} | axes
    return _feasible(robot, of_robot | targets) | {"workspace": workspace}


def _counted(monkeypatch):
    """How often robots were lanes."""
    seen = []
    whole = SearchOverRobots.answers

    def answers(self, poses):
        seen.append(len(poses.positions))
        return whole(self, poses)

    monkeypatch.setattr(SearchOverRobots, "answers", answers)
    return seen


def _one_by_one(monkeypatch, spec):
    with monkeypatch.context() as patched:
        patched.setattr(MapKind, "load_over_robots", lambda self: None)
        return cspr_jax.compute_sweep(spec)


@pytest.mark.quick("in a plane", "point mass")
@pytest.mark.parametrize("case", CASES)
def test_robots_as_lanes_have_the_workspaces_of_each(monkeypatch, case):
    spec, seen = _spec(case), _counted(monkeypatch)
    together = cspr_jax.compute_sweep(spec)
    assert sum(seen) == together.verdict.size * len(spec["workspace"]["conditions"])
    alone = _one_by_one(monkeypatch, spec)
    assert sum(seen) == together.verdict.size * len(spec["workspace"]["conditions"])
    assert set(together.data_vars) == set(alone.data_vars)
    for name, values in alone.data_vars.items():
        if values.dtype.kind == "f":
            scale = np.abs(values.values[np.isfinite(values.values)]).max(initial=1.0)
            np.testing.assert_allclose(together[name].values, values.values, atol=1e-11 * scale, rtol=0.0)
        else:
            np.testing.assert_array_equal(together[name].values, values.values)
    assert 0 < (alone.verdict == 0).sum() < alone.verdict.size


def _best_margin(base, centre, arms, mass, low, high):
    """Largest s with tensions s inside of their limits that hold the weight, by a linear program; z up."""
    attached = centre + arms
    units = base - attached
    units /= np.linalg.norm(units, axis=1, keepdims=True)
    wrench = np.concatenate([units, np.cross(arms, units)], axis=1).T
    count = len(base)
    goal = np.array([0, 0, mass * 9.81, 0, 0, 0])
    rows = np.block([[-np.eye(count), np.ones((count, 1))], [np.eye(count), np.ones((count, 1))]])
    limits = np.concatenate([-low * np.ones(count), high * np.ones(count)])
    equal = np.c_[wrench, np.zeros(6)]
    done = linprog(np.r_[np.zeros(count), -1.0], rows, limits, equal, goal, bounds=[(None, None)] * (count + 1))
    return -done.fun if done.status == 0 else np.nan


def test_arrangements_beside_linear_programs(monkeypatch):
    """Of random arrangements of cables, at random poses, with no rotation."""
    rng, seen = np.random.default_rng(5), _counted(monkeypatch)
    numbers = rng.integers(0, 40320, 12).tolist()
    axes = {"x": [-3.1, 0.7], "y": [1.3], "z": [0.6, 2.1], "arrangement": numbers}
    workspace = {"conditions": ["wrench-feasible"], "point": "mass-centre"}
    result = cspr_jax.compute_sweep(_feasible(EIGHT, axes) | {"workspace": workspace})
    assert sum(seen) == result.verdict.size
    base, points = np.array(EIGHT["base_points"]), np.array(EIGHT["platform_points"])
    for i, number in enumerate(numbers):
        arms = points[arrangement_of(number, 8)] - np.array(EIGHT["centre_of_mass"])
        for j, x in enumerate(axes["x"]):
            for k, z in enumerate(axes["z"]):
                expected = _best_margin(base, np.array([x, 1.3, z]), arms, EIGHT["mass"], 100.0, 5000.0)
                found = float(result.wrench_margin.values[j, 0, k, i])
                np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6)


def test_poses_that_kernels_leave_open_are_those_of_each_robot(monkeypatch):
    """In the plane of the spools, where the wrench matrix is singular, and where a limit is touched."""
    robot = POINT | {"base_points": [[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]], "tension_max": 50.0}
    robot |= {"parameter": [robot["parameter"][0]]}
    axes = {"parameter.load": [-0.5, 1.0, 2.0], "x": [0.0, 0.3], "y": [0.0], "z": [0.0, 0.5]}
    spec = _feasible(robot, axes)
    seen = _counted(monkeypatch)
    together, alone = cspr_jax.compute_sweep(spec), _one_by_one(monkeypatch, spec)
    assert sum(seen) == together.verdict.size
    np.testing.assert_array_equal(together.verdict, alone.verdict)
    np.testing.assert_allclose(together.wrench_margin, alone.wrench_margin, rtol=1e-9)
    assert len(np.unique(together.verdict)) > 1


def test_exact_margins_are_those_of_the_robot_of_each_pose(monkeypatch):
    """Where kernels decide nothing. Robots alternate from cell to cell."""
    spec = _spec("in a plane")
    spec["axes"] = {name: spec["axes"][name] for name in reversed(spec["axes"])}
    kernels = cspr_jax.compute_sweep(spec)
    monkeypatch.setattr(WorkspaceSearch, "_stages", lambda self: iter(()))
    exact = cspr_jax.compute_sweep(spec)
    np.testing.assert_array_equal(kernels.verdict, exact.verdict)
    np.testing.assert_allclose(kernels.wrench_margin, exact.wrench_margin, rtol=0.0, atol=1e-9)


def test_arrangements_of_points_that_move(monkeypatch):
    """A parameter moves the same attachment point, whichever cable ends in it."""
    spec = _spec("eight cables", arrangement=[0, 5040, 40000])
    spec["axes"] |= {"x": [0.4], "y": [0.2], "parameter.size": [1.0], "parameter.strength": [0.0]}
    seen = _counted(monkeypatch)
    together, alone = cspr_jax.compute_sweep(spec), _one_by_one(monkeypatch, spec)
    assert sum(seen) == together.verdict.size
    np.testing.assert_allclose(together.wrench_margin, alone.wrench_margin, rtol=1e-9)


@pytest.mark.parametrize(
    ("more", "workspace"),
    [
        ({}, {"conditions": ["wrench-feasible", "interference-free"]}),
        ({"cable_length_max": 5.0}, {"conditions": ["wrench-feasible"]}),
        ({"pulley_radius": 0.05}, {"conditions": ["wrench-feasible"]}),
        (
            {
                "centre_of_mass": [0.0, 0.0, 0.05],
                "parameter": [MOVES[0], LOAD | {"moves": {"centre_of_mass[2]": 0.01}}],
            },
            {"conditions": ["static"]},
        ),
        (
            {
                "winch": {"drum_radius": 0.05, "motor_torque_max": 20.0},
                "parameter": [MOVES[0], LOAD | {"moves": {"winch.drum_radius": 0.01}}],
            },
            {"conditions": ["wrench-feasible"]},
        ),
    ],
)
def test_other_robots_and_conditions_are_computed_one_by_one(monkeypatch, more, workspace):
    spec = _spec("in a plane")
    spec |= {"robot": json.loads(json.dumps(PLANAR | more)), "workspace": workspace}
    spec["axes"] = {name: points for name, points in spec["axes"].items() if name != "tilt"}
    spec["axes"]["parameter.load"] = [-0.5, 1.0, 2.0]
    if "cable_length_max" not in more and "interference-free" in workspace["conditions"]:
        spec["robot"]["cable_diameter"] = 0.01
    seen = _counted(monkeypatch)
    together, alone = cspr_jax.compute_sweep(spec), _one_by_one(monkeypatch, spec)
    assert not seen
    for name, values in alone.data_vars.items():
        np.testing.assert_array_equal(together[name].values, values.values)


def test_robots_whose_matrices_lack_facets_are_computed_one_by_one(monkeypatch):
    """Four of eight cables at one point have no facet normal with a fifth; in another arrangement others have none."""
    points = [*EIGHT["platform_points"][:4], *[EIGHT["platform_points"][4]] * 4]
    spec = _spec("eight cables")
    spec |= {"robot": EIGHT | {"platform_points": points, "parameter": MOVES[:1]}}
    spec["axes"] = {"parameter.size": [0.9, 1.2], "x": [0.3], "y": [0.2], "z": [1.0]}
    seen = _counted(monkeypatch)
    together, alone = cspr_jax.compute_sweep(spec), _one_by_one(monkeypatch, spec)
    assert not seen
    np.testing.assert_array_equal(together.wrench_margin, alone.wrench_margin)


@pytest.mark.thorough
def test_arrangements_of_cogiro_beside_linear_programs():
    """The example: how many of 1,000 poses the real arrangement holds, and the best one, by 2,000 linear programs."""
    spec = tomllib.loads((SWEEPS / "cogiro_arrangements.toml").read_text())
    spec["axes"]["arrangement"] = [0, 11641]
    result = cspr_jax.compute_sweep(spec)
    base, points = np.array(EIGHT["base_points"]), np.array(EIGHT["platform_points"])
    expected = np.zeros(result.verdict.shape, bool)
    for index in np.ndindex(expected.shape):
        x, y, z, number = (result[name].values[i] for name, i in zip(result.verdict.dims, index, strict=True))
        arms = points[arrangement_of(int(number), 8)] - np.array(EIGHT["centre_of_mass"])
        margin = _best_margin(base, np.array([x, y, z]), arms, EIGHT["mass"], 0.0, 5000.0)
        assert abs(margin) > 1e-6
        expected[index] = margin > 0.0
    np.testing.assert_array_equal(result.verdict == 0, expected)
    np.testing.assert_array_equal((result.verdict == 0).sum(("x", "y", "z")), [865, 868])


@pytest.mark.soak
def test_where_cogiro_ranks():
    """Of all arrangements of its cables on 1,000 poses: four hold more, one as many; 1,349 hold none."""
    result = cspr_jax.compute_sweep(SWEEPS / "cogiro_arrangements.toml")
    counts = (result.verdict == 0).sum(("x", "y", "z")).values
    assert counts.size == 40320 and counts[0] == 865 and counts.max() == 868 == counts[11641]
    assert ((counts > 865).sum(), (counts == 865).sum(), (counts == 0).sum()) == (4, 2, 1349)


PIECEWISE = POINT | {
    "base_points": [[1, 1, 0], [-1, 1, 0.1], [-1, -1, 0], [1, -1, -0.1]],
    "mass": 20.0,
    "tension_max": 100.0,
    "winch": {"drum_radius": 1.0, "motor_torque_max": 250.0},
    "parameter": [
        {"name": "p", "value": 0, "lower": -70, "upper": 300, "moves": {"tension_max": 1.0}},
        {"name": "q", "value": 0, "lower": -100, "upper": 100, "moves": {"winch.motor_torque_max": 1.0}},
    ],
}


@pytest.mark.parametrize(
    "values", [{"p": [0, 100], "q": [0, -100]}, {"p": [0, -60, 299]}, {"p": [0.0, 300.0, 100.0], "q": [0.0]}]
)
def test_the_smaller_of_two_limits_is_no_affine_function(monkeypatch, values):
    """The torque of a motor bounds tensions where their own limit is larger: at one corner, or between two values."""
    axes = {f"parameter.{name}": each for name, each in values.items()}
    targets = {"x": [0.0, 0.3], "y": [0.1], "z": [0.4, 0.5, 0.7, 0.9]}
    spec = _feasible(PIECEWISE, axes | targets)
    seen = _counted(monkeypatch)
    together, alone = cspr_jax.compute_sweep(spec), _one_by_one(monkeypatch, spec)
    assert not seen
    np.testing.assert_array_equal(together.verdict, alone.verdict)
    np.testing.assert_array_equal(together.wrench_margin, alone.wrench_margin)


def test_components_that_are_always_zero_are_those_of_each_robot(monkeypatch):
    """Three cables at one point of a planar platform: closure is refuted there, and not left open."""
    more = {"platform_points": [[-0.3, 0, 0]] * 3 + [[0.3, 0, 0]], "centre_of_mass": [0.0, 0.0, 0.0]}
    spec = _spec("closure")
    spec |= {"robot": CASES["closure"][0] | more}
    spec["axes"] = {"parameter.size": [0.8, 1.2], "x": [-1.2, -0.3, 0.5], "y": [0.0], "z": [0.7, 1.5]}
    together, alone = cspr_jax.compute_sweep(spec), _one_by_one(monkeypatch, spec)
    np.testing.assert_array_equal(together.verdict, alone.verdict)
    np.testing.assert_array_equal(together.closure_margin, alone.closure_margin)


@pytest.mark.parametrize("largest", [500.0, 2000.0])
def test_poses_are_open_as_near_to_limits_as_those_of_each_robot(monkeypatch, largest):
    """Unless the weights differ by less than a factor of a thousand."""
    heavier = LOAD | {"lower": 0, "upper": 1e6}
    robot = POINT | {"mass": 1.0, "tension_max": None, "parameter": [heavier]}
    robot = {name: value for name, value in robot.items() if value is not None}
    axes = {"parameter.load": [0.0, largest], "x": [0.0], "y": [0.2], "z": [0.5]}
    spec = _feasible(robot, axes) | {"workspace": {"conditions": ["static"]}}
    seen = _counted(monkeypatch)
    cspr_jax.compute_sweep(spec)
    assert bool(seen) == (largest < 1000.0)


def test_a_touched_limit_contradicts_nothing():
    """A weight whose two cables have exactly the smallest tension."""
    robot = {"name": "v", "planar": True, "mass": 2 / 9.81, "base_points": [[-1, 0, 0], [1, 0, 0]], "z_axis": "up"}
    robot |= {"tension_min": float(np.sqrt(2.0)), "tension_max": 100.0}
    axes = {"x": [0.0], "y": [0.0], "z": [-1.0]}
    spec = _feasible(robot, axes)
    result = cspr_jax.compute_sweep(spec)
    assert result.verdict.item() == 0 and abs(result.wrench_margin.item()) < 1e-12
