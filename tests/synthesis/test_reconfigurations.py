"""Robots that are set anew between tasks, beside settings by closed forms and a search over all divisions."""

import itertools

import numpy as np
import pytest

import cspr_jax
from cspr_jax.config.reading import read_toml
from cspr_jax.errors import ConfigError
from tests.synthesis.problems import axis, objective, parameter

# Two spools on a rail at a height of 4 m, and shelves of poses that one setting does not serve.
RAIL = {
    "name": "rail",
    "planar": True,
    "base_points": [[0.5, 0, 0], [5.5, 0, 0]],
    "mass": 10.0,
    "parameter": [
        parameter("left", 0.5, 0.0, 6.0, {"base_points[0][0]": 1}),
        parameter("right", 5.5, 4.0, 12.0, {"base_points[1][0]": 1}),
    ],
}
ENDS = {"near": (1.0, 3.0), "middle": (3.5, 5.0), "far": (8.0, 10.0)}
LIMITS = {"tension_min": 10, "tension_max": 160}
MAPS = {
    name: {"map": "workspace", "axes": {"x": axis(*ends, 3), "y": [0], "z": axis(1.5, 3.5, 3)}, "limits": LIMITS}
    for name, ends in ENDS.items()
}
DATA = {
    "schema": 1,
    "robot": RAIL,
    "maps": MAPS,
    "reconfigure": {"parameters": ["left", "right"], "tasks": list(ENDS)},
    "objective": [objective("tasks", "wrench_margin", "largest")],
    "requirement": [{"of": "tasks", "quantity": "feasible"}],
    "search": {"starts": 2},
}


def margin(left, right, tasks):
    """Smallest margin of tensions over the poses of tasks, by the balance of a point on two cables."""
    x, z = (np.concatenate(values) for values in zip(*(poses(task) for task in tasks), strict=True))
    weight = 10.0 * 9.81 / ((right - left) * z)
    first, second = weight * (right - x) * np.hypot(x - left, z), weight * (x - left) * np.hypot(right - x, z)
    return min(np.minimum(first, second).min() - 10.0, 160.0 - np.maximum(first, second).max())


def poses(task):
    x, z = np.meshgrid(np.linspace(*ENDS[task], 3), np.linspace(1.5, 3.5, 3))
    return x.ravel(), z.ravel()


def best_margin(tasks):
    """The largest margin of one setting for tasks, on a grid that is refined about its best point."""
    center, width = np.array([3.0, 8.0]), np.array([3.0, 4.0])
    for _ in range(12):
        lefts, rights = (
            np.clip(c + w * np.linspace(-1, 1, 41), *b)
            for c, w, b in zip(center, width, ((0, 6), (4, 12)), strict=True)
        )
        points = [point for point in itertools.product(lefts, rights) if point[1] > point[0] + 0.1]
        values = [margin(*point, tasks) for point in points]
        center, width = np.array(points[int(np.argmax(values))]), 0.4 * width
    return max(values)


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    return cspr_jax.design(DATA, tmp_path_factory.mktemp("rail") / "out")


def test_each_task_alone_has_its_best_setting(result):
    for setting in result.alone:
        assert setting.value == pytest.approx(best_margin(setting.tasks), rel=1e-4)
        assert margin(*setting.parameters.values(), setting.tasks) == pytest.approx(setting.value, abs=1e-9)


def test_changes_are_as_few_as_can_be(result):
    tasks = list(ENDS)
    assert best_margin(tasks) < 0.0  # one setting does not serve all
    divisions = [[tasks[:1], tasks[1:]], [tasks[:2], tasks[2:]]]
    best = max(divisions, key=lambda groups: min(map(best_margin, groups)))
    assert [list(setting.tasks) for setting in result.settings] == best and result.feasible
    assert result.best.values[0] == pytest.approx(min(map(best_margin, best)), rel=1e-4)
    for setting in result.settings:
        assert margin(*setting.parameters.values(), setting.tasks) >= result.best.values[0] - 1e-9


def test_files_hold_the_settings(result):
    names = {path.stem for path in result.directory.glob("*.toml")}
    assert names == {"setting_1", "setting_2", "alone_near", "alone_middle", "alone_far"}
    for setting in (*result.settings, *result.alone):
        spools = read_toml(result.directory / f"{setting.name}.toml")["base_points"]
        assert [point[0] for point in spools] == list(setting.parameters.values())
    assert result.to_dict()["settings"][0]["tasks"] == list(result.settings[0].tasks)
    assert any(line == "fewest changes between tasks: 1" for line in result.lines())


def test_it_goes_on_to_the_same_files(result, tmp_path):
    asked = iter(range(10_000))
    cspr_jax.design(DATA, tmp_path / "out", stopped=lambda: next(asked) > 25)
    cspr_jax.design(DATA, tmp_path / "out")
    for name in ("design.json", "setting_1.toml", "setting_2.toml", "alone_far.toml"):
        assert (tmp_path / "out" / name).read_bytes() == (result.directory / name).read_bytes()


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        (
            {"reconfigure": {"parameters": ["rigth"], "tasks": list(ENDS)}},
            r'reconfigure.parameters\[0\] = "rigth": did you mean right',
        ),
        (
            {"reconfigure": {"parameters": ["left"], "tasks": ["near", "nearr"]}},
            r'reconfigure.tasks\[1\] = "nearr": did you mean near',
        ),
        ({"reconfigure": {"parameters": ["left"], "tasks": ["near"]}}, "reconfigure.tasks"),
        ({"objective": [objective("near", "wrench_margin", "largest")]}, r'objective\[0\].of = "near": must be tasks'),
        ({"objective": [objective("tasks", "wrench_margn", "largest")]}, "did you mean wrench_margin"),
        ({"reconfigure": None}, r"objective\[0\].of = tasks: must be another table: there is no \[reconfigure\]"),
    ],
)
def test_mistakes(tmp_path, changes, line):
    data = {key: value for key, value in {**DATA, **changes}.items() if value is not None}
    with pytest.raises(ConfigError, match=line):
        cspr_jax.design(data, tmp_path / "out")
    assert not (tmp_path / "out").exists()
