"""Ten turns on an ellipse far beyond the hull of the spools, played by MuJoCo."""

import numpy as np
import pytest
from oracles import ellipses as oracle

import cspr_jax

pytest.importorskip("mujoco")
GRAVITY, HEIGHT, INRADIUS = 9.81, 2.0, 0.43
SPOOLS = 2.0 * INRADIUS * np.array([[np.sqrt(0.75), -0.5, 0.0], [-np.sqrt(0.75), -0.5, 0.0], [0.0, 1.0, 0.0]])


def plan(turns):
    ellipse = {"centre": [0.0, 0.0, HEIGHT], "half_axes": [[1.2, 0.0, 0.0], [0.0, 0.9, 0.0]], "frequency": "natural"}
    robot = {"name": "r", "base_points": SPOOLS.tolist(), "mass": 0.5, "gravity": GRAVITY}
    return cspr_jax.plan({"schema": 1, "robot": robot, "family": "ellipse", "ellipse": ellipse, "turns": turns})


def check_replay(turns, step):
    planned = plan(turns)
    assert planned.feasible
    found = cspr_jax.replay(planned, step=step)
    frequency = np.sqrt(GRAVITY / HEIGHT)
    assert found.time[-1] == pytest.approx(2.0 * np.pi * turns / frequency, rel=1e-12)
    place = oracle.states([0.0, 0.0, HEIGHT], [1.2, 0.0, 0.0], [0.0, 0.9, 0.0], frequency, frequency * found.time)[0][0]
    # Without correction, by the tensions of the plan alone, in one go.
    assert np.abs(found.position - place).max() < 1e-6 and found.through_deviation.max() < 1e-6
    # Outside of the triangle of the spools for most of the time, with all cables taut.
    assert (oracle.shares(SPOOLS, GRAVITY, place, np.zeros_like(place)).min(1) < 0.0).mean() > 0.8
    assert found.tension.min() > 0.0


def test_a_turn_in_mujoco():
    check_replay(1, 0.005)


@pytest.mark.thorough
def test_ten_turns_in_mujoco():
    check_replay(10, 0.002)
