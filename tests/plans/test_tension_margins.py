"""Margins of segments in newtons, of every family, beside limits, oracles and proofs."""

import numpy as np
import pytest
from oracles.lines import tension_margin

import cspr_jax

REST, AWAY = {"rest": True}, {"position": [0.7, 0.7, 2.6]}
SWING = {"schema": 1, "robot": "prototype", "z0": 1.7, "pose": [REST, AWAY], "samples": 100}


def segment_of(**keys):
    return cspr_jax.plan(SWING | keys).to_dict()["segments"][0]


@pytest.mark.parametrize("limits", [{}, {"tension_min": 0.02}, {"tension_max": 1.2}, {"tension_min": 5.0}])
def test_margins_are_distances_from_limits(limits):
    """Of a swing whose verdict rests on fast bounds, and of one that is refused, with the general proof."""
    segment = segment_of(limits=limits)
    high = limits.get("tension_max", np.inf) - segment["tension_max"]
    assert segment["tension_margin"] == pytest.approx(
        min(segment["tension_min"] - limits.get("tension_min", 0.0), high), abs=1e-6
    )
    assert (segment["tension_margin"] > 0.0) == (segment["verdict"] == "feasible")


@pytest.mark.parametrize("rule", ["centred", "least-norm"])
def test_a_rule_does_not_change_the_margin_of_redundant_cables(rule):
    """It is what all tensions can keep, by the oracle, of a straight line."""
    poses = [{"position": [5.0, 5.0, 6.0]}, {"position": [15.0, 20.0, 5.0]}]
    keys = {"schema": 1, "robot": "boralugoda-rectangle", "family": "s-curve", "max_acceleration": 2.0, "pose": poses}
    plan = cspr_jax.plan(keys | {"tensions": rule})
    rows, robot = plan.rows(50.0), plan.problem.robot
    loads = {"mass": float(robot.mass), "gravity": float(robot.gravity)}
    states = zip(rows["position"], rows["acceleration"], strict=True)
    every = [tension_margin(plan.robot_file.base_points, *state, **loads) for state in states]
    assert min(every) == pytest.approx(plan.to_dict()["segments"][0]["tension_margin"], rel=1e-3)
    assert min(every) > 0.1
