"""Designs whose optimum is known, and designs beside differential evolution."""

import numpy as np
import pytest
from scipy.optimize import brentq, differential_evolution

import cspr_jax
from cspr_jax.config.design import SearchKeys
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.synthesis.evaluations import FIRST
from cspr_jax.synthesis.search import Progress, searched
from tests.synthesis.problems import (
    CIRCLE,
    FEASIBLE,
    PLANAR,
    PROBLEMS,
    RECTANGLE,
    THREE,
    TRIANGLE,
    VOLUME,
    axis,
    design,
    objective,
    placed,
    workspace,
)

# Largest relative errors of optima.
CLOSE = 1e-6


def planar_tensions(width, x, z, mass=2.0, gravity=9.81):
    """Tensions of two cables from level spools, by the balance of a point in their plane."""
    half = 0.5 * width
    first = mass * gravity * (half - x) * np.hypot(x + half, z) / (2.0 * half * z)
    second = mass * gravity * (half + x) * np.hypot(half - x, z) / (2.0 * half * z)
    return first, second


def planar_margin(width):
    """Smallest distance of tensions from their limits over the rectangle of poses."""
    x, z = np.meshgrid(np.linspace(-0.8, 0.8, 5), np.linspace(0.5, 1.5, 4))
    tensions = np.stack(planar_tensions(width, x, z))
    return min(tensions.min() - 1.0, 30.0 - tensions.max())


def test_the_smallest_width_of_two_cables_for_a_rectangle(tmp_path):
    result = cspr_jax.design(PROBLEMS["planar width"], tmp_path / "out")
    expected = brentq(planar_margin, 1.65, 1.9, xtol=1e-14)
    assert result.feasible and result.best.parameters["width"] == pytest.approx(expected, rel=CLOSE)
    assert result.best.sensitivities.holdings[0].by.startswith("places.wrench_margin at x = ")


def test_the_largest_margin_of_two_cables_for_a_rectangle(tmp_path):
    result = cspr_jax.design(PROBLEMS["planar margin"], tmp_path / "out")
    widths = np.linspace(1.7, 3.0, 2001)
    start = widths[np.argmax([planar_margin(width) for width in widths])]
    near = np.linspace(start - 1e-3, start + 1e-3, 2001)
    best = max(planar_margin(width) for width in near)
    assert result.best.values[0] == pytest.approx(best, rel=CLOSE)
    # At a kink the derivatives of two poses cancel.
    prices = [one.price for one in result.best.sensitivities.holdings]
    assert len(prices) == 2 and sum(prices) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("depths", [[1.0], [1.0, 1.3]], ids=["one depth", "two depths"])
def test_the_smallest_triangle_about_a_circle(tmp_path, depths):
    """At rest all cables are taut inside of the triangle of spools; its inscribed circle has half their radius."""
    places = CIRCLE | {
        "axes": {"radius": [0.7], "azimuth": (np.pi / 6.0 + np.arange(6) * np.pi / 3.0).tolist(), "z": depths}
    }
    goal = objective("parameters", "size", "smallest")
    result = cspr_jax.design(design(TRIANGLE, goal, [FEASIBLE], maps={"places": places}), tmp_path / "out")
    assert result.feasible and result.best.parameters["size"] == pytest.approx(1.4, rel=CLOSE)


def test_proved_widths_hold_everywhere(tmp_path):
    """All of the full cells, by tensions in closed form, not only their centres."""
    places = RECTANGLE | {
        "axes": {
            "x": {"start": -0.6, "stop": 0.6, "count": 4},
            "y": [0],
            "z": {"start": 0.75, "stop": 1.25, "count": 2},
        }
    }
    goal = objective("frame", "extent_x", "smallest")
    data = design(PLANAR, goal, [FEASIBLE | {"prove": True}], maps={"places": places})
    result = cspr_jax.design(data, tmp_path / "out")
    assert result.feasible and result.best.proofs[0].cells == result.best.proofs[0].proved == 8
    robot = cspr_jax.load_robot(tmp_path / "out" / "best.toml")
    width = float(np.ptp(np.asarray(robot.base_points)[:, 0]))
    random = np.random.default_rng(0)
    x, z = random.uniform(-0.8, 0.8, 8000), random.uniform(0.5, 1.5, 8000)
    tensions = np.stack(planar_tensions(width, x, z))
    assert tensions.min() > 1.0 and tensions.max() < 30.0
    # What is kept in reserve for the proof costs less than a hundredth of the width.
    smallest = brentq(planar_margin, 1.65, 1.9)
    assert smallest < width < 1.01 * smallest


SMALL_BOX = {"x": axis(-0.6, 0.6, 5), "y": axis(-0.5, 0.5, 5), "z": axis(1.1, 1.9, 3)}


def cells_of(axes):
    """Centers and half widths of full cells."""
    points = [np.linspace(one["start"], one["stop"], one["count"]) for one in axes.values()]
    halves = [0.5 * (one[1] - one[0]) for one in points]
    return np.stack(np.meshgrid(*points, indexing="ij"), axis=-1).reshape(-1, 3), np.array(halves)


@pytest.mark.soak
@pytest.mark.parametrize("goal", [VOLUME, objective("parameters", "width", "smallest")], ids=["volume", "width"])
def test_proved_requirements_hold_at_random_poses_of_each_cell(tmp_path, goal):
    """A thousand places a cell, by solving the balance of three cables."""
    places = workspace(SMALL_BOX, {"tension_min": 2, "tension_max": 90})
    data = placed(
        THREE, goal, places, FEASIBLE | {"prove": True}, {"of": "frame", "quantity": "extent_z", "lower": 0.1}
    )
    result = cspr_jax.design(data, tmp_path / "out")
    centers, halves = cells_of(SMALL_BOX)
    assert result.feasible and result.best.proofs[0].proved == len(centers)
    spools = np.asarray(cspr_jax.load_robot(tmp_path / "out" / "best.toml").base_points)
    random = np.random.default_rng(0)
    for center in centers:
        points = center + halves * random.uniform(-1.0, 1.0, (1000, 3))
        arms = spools - points[:, None]
        directions = arms / np.linalg.norm(arms, axis=2, keepdims=True)
        weight = np.tile([0.0, 0.0, -5.0 * 9.81], (1000, 1))
        tensions = np.linalg.solve(np.swapaxes(directions, 1, 2), weight[..., None])[..., 0]
        assert tensions.min() >= 2.0 and tensions.max() <= 90.0


def evolved(evaluator, seed=1):
    """Value and number of evaluations of SciPy's differential evolution with its usual population."""
    sense, count = evaluator.objectives[0].sense, len(evaluator.space.names)

    def costs(fractions):
        points = [evaluator.space.point(column, 0) for column in fractions.T]
        return np.array(
            [1e6 * (1.0 + one.missed) if one.missed else -sense * one.values[0] for one in evaluator.many(points)]
        )

    with double_precision():
        result = differential_evolution(
            costs, [(0.0, 1.0)] * count, vectorized=True, updating="deferred", polish=False, rng=seed, tol=1e-6
        )
    return -sense * result.fun, 15 * count * result.nfev


# Problems of one or two parameters leave differential evolution so few evaluations that screening takes as many.
TWENTIETH = ("three margin", "three volume", "four margin", "body margin", "eight margin")


@pytest.mark.soak
@pytest.mark.parametrize("name", PROBLEMS)
def test_optima_beside_differential_evolution(evaluator, name, record_property):
    ours = evaluator(PROBLEMS[name])
    with double_precision():
        best = searched(ours, SearchKeys(), Progress())[0].evaluation
    reference, count = evolved(evaluator(PROBLEMS[name]))
    sense = ours.objectives[0].sense
    record_property("ours, its count, evolution, its count", (best.values[0], ours.count, reference, count))
    assert best.missed == 0.0
    assert sense * (best.values[0] - reference) >= -1e-3 * abs(reference)
    assert name not in TWENTIETH or 20 * ours.count <= count


@pytest.mark.parametrize("name", ["three margin"])
def test_no_robot_nearby_is_better(evaluator, name):
    ours = evaluator(PROBLEMS[name])
    with double_precision():
        best = searched(ours, SearchKeys(), Progress())[0].evaluation
        fractions, random = ours.space.fractions(best.point), np.random.default_rng(0)
        steps = random.normal(size=(300, len(fractions))) * 10.0 ** random.uniform(-5, -1, (300, 1))
        others = ours.many([ours.space.point(fractions + step, 0) for step in steps])
    ranks = [FIRST.rank(ours, one)[:2] for one in others]
    assert min(ranks)[1] >= FIRST.rank(ours, best)[1] - 1e-9
