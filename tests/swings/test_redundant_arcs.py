"""Swings of point masses on more cables than degrees of freedom, beside linear programs at samples."""

import numpy as np
import pytest
from scipy.optimize import linprog
from support.commands import cspr

import cspr_jax
from cspr_jax.schema.verdicts import Verdict

KEYS = {"schema": 1, "robot": "boralugoda-rectangle", "family": "hypocycloid-standard", "z0": 20.0}
KEYS |= {"amplitude": "quintic", "samples": 61}
FAR, OTHER = {"position": [50.0, 18.0, 8.0]}, {"position": [-5.0, 10.0, 9.0]}
REST = {"rest": True}
MASS, GRAVITY = 10.0, 9.81
BASE = np.array([[0.0, 0.0, 30.0], [45.0, 0.0, 30.0], [45.0, 30.0, 30.0], [0.0, 30.0, 30.0]])


def largest_distance(position: np.ndarray, acceleration: np.ndarray, high: float) -> float:
    """How far all tensions can be from 0 and from the largest, by HiGHS, z up."""
    rays = BASE - position
    matrix = (rays / np.linalg.norm(rays, axis=1)[:, None]).T
    force = MASS * (acceleration + np.array([0.0, 0.0, GRAVITY]))
    # Unknowns: four tensions, and the distance.
    above = np.concatenate([-np.eye(4), np.ones((4, 1))], axis=1)
    below = np.concatenate([np.eye(4), np.ones((4, 1))], axis=1)
    rows, right = (above, np.zeros(4)) if np.isinf(high) else (np.vstack([above, below]), np.repeat([0.0, high], 4))
    equal = np.concatenate([matrix, np.zeros((3, 1))], axis=1)
    free = [(None, None)] * 5
    return -linprog([0, 0, 0, 0, -1.0], rows, right, equal, force, bounds=free, method="highs").fun


def least_distances(planned, high: float = np.inf) -> list[float]:
    """The least over the rows of each segment."""
    table, count = planned.rows(), KEYS["samples"]
    each = [largest_distance(p, a, high) for p, a in zip(table["position"], table["acceleration"], strict=True)]
    return [min(each[i : i + count]) for i in range(0, len(each), count)]


@pytest.fixture(scope="module")
def planned():
    return cspr_jax.plan(KEYS | {"pose": [REST, FAR, OTHER, REST]})


def test_plans_are_proved_and_margins_are_those_of_linear_programs(planned):
    answers = planned.answers
    assert planned.feasible and (answers.verdict == 0).all()
    weight = MASS * GRAVITY / 4
    for sampled, margin, bound in zip(
        least_distances(planned), answers.margin * weight, answers.margin_bound * weight, strict=True
    ):
        assert 0.0 < bound <= margin <= sampled * (1.0 + 1e-9)
        assert margin == pytest.approx(sampled, rel=0.02) and bound == pytest.approx(margin, rel=0.03)


def test_one_arc_less_fails_at_samples(planned):
    """Of the segments from and to rest, which take two."""
    assert planned.answers.arcs.tolist() == [2, 1, 2]
    fewer = cspr_jax.plan(KEYS | {"pose": [REST, FAR | {"arcs": 1}]})
    assert Verdict.WRENCH_INFEASIBLE.value & fewer.answers.verdict[0] and not fewer.feasible
    assert least_distances(fewer)[0] < 0.0 and fewer.answers.margin[0] < 0.0


@pytest.mark.thorough  # each set of limits compiles kernels of its own
def test_limits_refuse_what_samples_refuse(planned):
    """A largest tension below what the programs need, and a speed below that of the motion."""
    slow = cspr_jax.plan(KEYS | {"cable_speed_max": 1.0, "max_arcs": 3, "pose": [REST, FAR]})
    assert slow.answers.verdict[0] == Verdict.NO_ARCS | Verdict.CABLE_TOO_FAST
    tight = cspr_jax.plan(KEYS | {"tension_max": 60.0, "max_arcs": 3, "pose": [REST, FAR]})
    assert Verdict.WRENCH_INFEASIBLE.value & tight.answers.verdict[0] and least_distances(tight, 60.0)[0] < 0.0


@pytest.mark.thorough
def test_transitions_there_and_back():
    planned = cspr_jax.plan(KEYS | {"family": "transition", "pose": [REST, FAR, FAR, REST]})
    assert planned.feasible and (planned.answers.arcs % 2 == 0).all()
    assert min(least_distances(planned)) * 4 / (MASS * GRAVITY) >= planned.answers.margin_bound.min() > 0.0
    # The way back is the way there in reverse.
    assert planned.answers.arcs[0] == planned.answers.arcs[2]


@pytest.mark.thorough
def test_maps_have_the_numbers_of_plans(planned, tmp_path):
    sweep = tmp_path / "map.toml"
    sweep.write_text(
        'schema = 1\nmap = "minimum-arcs"\nrobot = "boralugoda-rectangle"\n'
        "[axes]\nx = [24.0, 50.0, 90.0]\ny = [18.0]\nz = [8.0]\nz0 = [20.0]\n"
        '[trajectory]\nfamily = "hypocycloid-standard"\namplitude = "quintic"\nfrom = { rest = true }\nmax_arcs = 4\n'
    )
    code, out, _ = cspr("run", sweep, "-o", tmp_path / "run")
    assert code == 0
    arcs = cspr_jax.open_result(out.strip()).to_xarray()["arcs"]
    assert arcs.values.ravel().tolist() == [1, planned.answers.arcs[0], 4]
