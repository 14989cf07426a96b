"""Numbers of robots: lanes beside robots one by one, derivatives beside differences, halls and plans beside oracles."""

import copy
from pathlib import Path

import numpy as np
import pytest

import cspr_jax
from cspr_jax.config.design import checked_design
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.robots.model.shapes import point_distances
from cspr_jax.synthesis.measures.workspaces import WorkspaceMeasure
from tests.synthesis.problems import EIGHT, PLANAR, PROBLEMS, design, objective, workspace

# Problems of robots with 2, 3, 4, 6 and 8 cables, of points and bodies; the slow ones are thorough.
NAMES = [
    "planar margin",
    "three margin",
    *(pytest.param(n, marks=pytest.mark.thorough) for n in ("four margin", "body margin", "eight margin")),
]
STEP = 1e-5
CONDITIONS = {
    "no largest tension": {"limits": {"tension_min": 1}},
    "static": {"limits": {}, "workspace": {"conditions": ["static"]}},
    "a box of forces": {"workspace": {"conditions": ["wrench-feasible"], "wrench_box": [0.5, 0.4, 0.3]}},
    "an ellipsoid": {"workspace": {"conditions": ["wrench-feasible"], "wrench_ellipsoid": [0.5, 0.4, 0.3]}},
    "accelerations": {"workspace": {"conditions": ["wrench-feasible"], "acceleration": 0.7}},
}


def points_of(evaluator, count, seed=0):
    random, space = np.random.default_rng(seed), evaluator.space
    return [space.point(each, 0) for each in random.uniform(0.05, 0.95, (count, len(space.names)))]


@pytest.mark.parametrize("name", NAMES)
def test_robots_as_lanes_are_those_one_by_one(evaluator, name):
    one, many = evaluator(PROBLEMS[name]), evaluator(PROBLEMS[name])
    assert isinstance(one.objectives[0].measure, WorkspaceMeasure)
    points = points_of(one, 5)
    with double_precision():
        for exact, screened in zip(map(one.one, points), many.many(points), strict=True):
            assert screened.is_screened and not exact.is_screened
            assert screened.values == pytest.approx(exact.values, rel=1e-9) and screened.missed == exact.missed


def check_derivatives(measure, quantity, points):
    space, compared, close = measure.space, 0, 0
    with double_precision():
        for point in points:
            cells = np.arange(len(measure.columns(point)[quantity]))
            values, derivatives = measure.at(point, quantity, np.stack([np.full_like(cells, -1), cells], axis=1))
            assert values == pytest.approx(measure.columns(point)[quantity], rel=1e-7, abs=1e-7)
            differences = np.zeros_like(derivatives)
            for i in range(len(space.names)):
                shift = STEP * (np.arange(len(space.names)) == i)
                ends = [space.point(space.fractions(point) + s * shift, 0) for s in (1.0, -1.0, 2.0, -2.0)]
                above, below, far_above, far_below = (measure.columns(end)[quantity] for end in ends)
                # Extrapolated to a step of zero, since margins near singular poses are strongly curved.
                differences[:, i] = (8.0 * (above - below) - (far_above - far_below)) / (12.0 * STEP)
            errors = np.abs(differences - derivatives).max(1)
            is_close = errors <= 1e-6 * np.abs(derivatives).max()
            compared, close = compared + len(is_close), close + int(is_close.sum())
    # Few cells have a kink within the step, and few robots are so near a singular one that the step is too long.
    assert compared > 5 and close > 0.95 * compared, (close, compared)


@pytest.mark.parametrize("name", NAMES)
def test_derivatives_are_differences(evaluator, name):
    ours = evaluator(PROBLEMS[name])
    check_derivatives(ours.objectives[0].measure, "wrench_margin", points_of(ours, 2))


def test_cables_that_depend_on_each_other(evaluator):
    """Pairs of spools at one point: some cables have no normal but rounding, whose derivatives would be noise."""
    ours = evaluator(PROBLEMS["eight margin"] | {"robot": EIGHT | {"parameter": EIGHT["parameter"][1:2]}})
    check_derivatives(ours.objectives[0].measure, "wrench_margin", points_of(ours, 3))


@pytest.mark.parametrize("condition", CONDITIONS)
def test_derivatives_under_conditions(evaluator, condition):
    data = copy.deepcopy(PROBLEMS["three margin"])
    data["maps"]["places"] |= CONDITIONS[condition]
    ours = evaluator(data)
    check_derivatives(ours.objectives[0].measure, "wrench_margin", points_of(ours, 1))


@pytest.mark.soak
@pytest.mark.parametrize("name", [name for name in PROBLEMS if "wrench_margin" in str(PROBLEMS[name]["objective"])])
def test_derivatives_of_many_robots(evaluator, name):
    ours = evaluator(PROBLEMS[name])
    check_derivatives(ours.objectives[0].measure, "wrench_margin", points_of(ours, 1000))


def test_a_map_that_no_lanes_compute(evaluator):
    """Robots one by one, with derivatives by differences."""
    data = copy.deepcopy(PROBLEMS["planar margin"])
    data["maps"]["places"]["limits"]["cable_length_max"] = 3.0
    ours = evaluator(data)
    measure = ours.objectives[0].measure
    assert not isinstance(measure, WorkspaceMeasure) and {"wrench_margin", "length_margin"} <= set(measure.slacks())
    check_derivatives(measure, "length_margin", points_of(ours, 1))


HALL = {
    "corners": [[-2, -2, -1], [2, 2, 5]],
    "obstacle": [
        {"kind": "sphere", "centre": [0, 0, 0], "radius": 0.3},
        {"kind": "cylinder", "start": [1, 0, 0], "end": [1, 0, 2], "radius": 0.2},
        {"kind": "box", "centre": [-1, 0.5, 0], "size": [0.4, 0.6, 0.8], "quaternion": [0.8, 0, 0, 0.6]},
    ],
}


def test_distances_in_a_hall(evaluator):
    """Beside the nearest of many points of the surfaces."""
    ours = evaluator(design(PLANAR, objective("hall", "clearance", "largest"), hall=HALL))
    random = np.random.default_rng(0)
    sphere = random.normal(size=(200_000, 3))
    sphere = 0.3 * sphere / np.linalg.norm(sphere, axis=1, keepdims=True)
    turn, along = random.uniform(0.0, 2.0 * np.pi, 200_000), random.uniform(0.0, 2.0, 200_000)
    cylinder = np.stack([1.0 + 0.2 * np.cos(turn), 0.2 * np.sin(turn), along], axis=1)
    faces = random.uniform(-1.0, 1.0, (200_000, 3))
    faces[np.arange(len(faces)), random.integers(0, 3, len(faces))] = random.choice([-1.0, 1.0], len(faces))
    cos, sin = 0.8**2 - 0.6**2, 2.0 * 0.8 * 0.6
    box = faces * [0.2, 0.3, 0.4] @ np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]]) + [-1, 0.5, 0]
    for point in points_of(ours, 3):
        spools = np.asarray(ours.space.robot_at(point).base_points)
        nearest = [np.linalg.norm(surface[:, None] - spools, axis=2).min(0) for surface in (sphere, cylinder, box)]
        walls = [spools - [-2, -2, -1], [2, 2, 5] - spools]
        expected = np.concatenate([*nearest, *(wall.T.ravel() for wall in walls)])
        assert ours.one(point).values[0] == pytest.approx(ours.objectives[0].measure.columns(point)["clearance"].min())
        signed = ours.objectives[0].measure.columns(point)["clearance"]
        assert np.abs(signed) == pytest.approx(np.abs(expected), abs=5e-3)
    bodies = checked_design(design(PLANAR, objective("hall", "clearance", "largest"), hall=HALL), Path("hall"))[
        0
    ].hall.obstacle
    inside = [np.array([[0.1, 0, 0]]), np.array([[1.0, 0.05, 0.5]]), np.array([[-1.0, 0.5, 0.3]])]
    depths = [float(point_distances(body.shape(), one)[0]) for body, one in zip(bodies, inside, strict=True)]
    assert depths == pytest.approx([-0.2, -0.15, -0.1])


def test_numbers_of_plans_are_those_of_the_command(evaluator):
    data = PROBLEMS["least power"]
    ours = evaluator(data | {"objective": [objective("lift", "duration", "smallest"), data["objective"][0]]})
    point = points_of(ours, 1, seed=3)[0]
    robot = ours.space.robot_at(point).model_dump(exclude_none=True, exclude={"parameter"})
    segments = cspr_jax.plan(data["plans"]["lift"] | {"schema": 1, "robot": robot}).to_dict()["segments"]
    with double_precision():
        columns = ours.objectives[0].measure.columns(point)
    for name in ("duration", "motor_power_max", "cable_speed_max", "tension_min", "margin", "tension_margin"):
        assert columns[name].tolist() == [segment[name] for segment in segments]
    assert ours.one(point).values[0] == sum(segment["duration"] for segment in segments)


def test_fractions_and_frames(evaluator):
    data = design(
        PLANAR, objective("frame", "extent_x", "smallest"), [{"of": "places", "quantity": "fraction", "lower": 0.5}]
    )
    ours = evaluator(data | {"maps": {"places": PROBLEMS["planar margin"]["maps"]["places"]}})
    point = ours.space.point(np.array([0.6]), 0)
    with double_precision():
        margins = ours.requirements[0].measure.columns(point)["wrench_margin"]
        assert ours.one(point).values == (pytest.approx(point.values[0]), np.mean(margins > 0.0))


@pytest.mark.parametrize("places", [workspace({"x": [0], "y": [0], "z": [1]}, {"tension_min": 1, "tension_max": 30})])
def test_words_name_the_cables_at_their_limits(evaluator, places):
    ours = evaluator(design(PLANAR, objective("places", "wrench_margin", "largest"), maps={"places": places}))
    with double_precision():
        narrow, wide = ours.space.point(np.array([0.0]), 0), ours.space.point(np.array([1.0]), 0)
        words = [ours.objectives[0].measure.words(point, "wrench_margin", np.array([0, 0])) for point in (narrow, wide)]
    assert words[0].startswith("at x = 0, y = 0, z = 1 (cable ") and words[0].endswith("at its smallest tension)")
    assert words[1].endswith("at its largest tension)")
