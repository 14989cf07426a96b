"""Outcome of a launch: computed once with the plan, and only read by whatever is written."""

import numpy as np
import pytest

import cspr_jax
from cspr_jax.launch import launch_result

PLAN = {
    "schema": 1,
    "robot": "launch-robot",
    "family": "bezier",
    "pose": [
        {"position": [0.0, 0.0, -0.5]},
        {"position": [0.0, 0.0, -0.8], "duration": 1.2},
        {"duration": 1.6},
    ],
    "launch": {
        "segment": 1,
        "point": [0.0, -0.05, -0.9],
        "target": [0.0, 0.1, -1.675],
        "time": 0.4,
        "release": 0.8,
        "errors": {"release": 0.005, "throws": 50},
    },
}


@pytest.fixture
def throws(monkeypatch):
    """How often a sample was thrown."""
    counts, scatter = [], launch_result.scatter

    def counted(*arguments):
        counts.append(1)
        return scatter(*arguments)

    monkeypatch.setattr(launch_result, "scatter", counted)
    return counts


def test_throws_once(throws, tmp_path):
    plan = cspr_jax.plan(PLAN)
    plan.to_dict()
    plan.to_table()
    plan.save(tmp_path / "motion.h5", anyway=True)
    plan.to_xarray()
    assert len(throws) == 1


def test_outcome_agrees_with_the_motion(tmp_path):
    """Release and landing lie where rows of the motion and free fall say, in time since the start of the plan."""
    plan = cspr_jax.plan(PLAN)
    launch, rows = plan.launch, plan.rows(rate=1000.0)
    assert launch.time == pytest.approx(1.2 + 0.8)
    for name, value in (("position", launch.position), ("velocity", launch.velocity)):
        at_release = [np.interp(launch.time, rows["t"], column) for column in rows[name].T]
        np.testing.assert_allclose(value, at_release, atol=1e-5)
    fall = np.array([0.0, 0.0, -0.5 * 9.80665 * 0.4**2])  # z of this robot points up
    np.testing.assert_allclose(launch.position + 0.4 * launch.velocity + fall, launch.landing, atol=1e-9)
    np.testing.assert_allclose(launch.landing, PLAN["launch"]["target"], atol=1e-9)
    flight = launch.columns()["flight_position"]
    np.testing.assert_allclose(flight[[0, -1]], [launch.position, launch.landing], atol=1e-9)
    np.testing.assert_allclose(plan.points[2], rows["position"][-1], atol=1e-12)


def test_plans_without_a_launch_have_no_outcome():
    poses = [{"position": [0.0, 0.0, -0.5]}, {"position": [0.0, 0.0, -0.8]}]
    assert cspr_jax.plan({"schema": 1, "robot": "launch-robot", "family": "bezier", "pose": poses}).launch is None
