"""Lower bounds of the time between two poses: least times by hand, and motions that are proved feasible."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import least_time_forms

import cspr_jax
from cspr_jax.curves.spline import Spline
from cspr_jax.families.free.search.time_bounds import least_time, time_bounds
from cspr_jax.motion.amplitudes import named
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.elementary import as_float64, double_precision
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.statics.kernel_axes import centred

SIZES = st.floats(0.01, 100.0)


@settings(max_examples=200, deadline=None)
@given(way=SIZES, speeding=SIZES, slowing=SIZES, speed=SIZES)
def test_least_time_of_a_way(way, speeding, slowing, speed):
    """Speed up, go on at the largest speed, slow down: the ways of the three parts are the whole."""
    time = float(least_time(*map(np.array, (way, speeding, slowing, speed))))
    top = min(speed, np.sqrt(2.0 * way * speeding * slowing / (speeding + slowing)))
    up, down = top / speeding, top / slowing
    assert time >= (up + down) * (1.0 - 1e-12)
    assert 0.5 * top * (up + down) + top * (time - up - down) == pytest.approx(way, rel=1e-9)


def bound_of(plan):
    with double_precision():
        return time_bounds(plan.problem, [motion.motion for motion in plan.motions])


def test_vertical_line():
    """On the axis of a ring of spools the least time of the line is known, and no motion is faster than the bound."""
    weight = 2.0 * 9.81
    robot = least_time_forms.ring_robot(3, 1.0, 2.0)
    exact, _ = least_time_forms.vertical(robot, 0.0, 1.2 * weight, 0.6, 1.5)
    points = robot["base_points"]
    mass = {"name": "ring", "base_points": np.asarray(points).tolist(), "mass": 2.0}
    line = {"points": [[0.0, 0.0, 0.6], [0.0, 0.0, 1.5]], "ramp_time": 0.0, "grid": 200}
    plan = cspr_jax.plan({"schema": 1, "robot": mass, "family": "path", "path": line, "tension_max": 1.2 * weight})
    (bound,) = bound_of(plan)
    assert 0.5 * exact < bound <= exact <= plan.answers.duration[0]


def test_spools_that_pull_down():
    """Below the plane of spools of several heights a cable can pull down: a fall may be faster than a free one."""
    points = [[1.0, 0.0, 0.0], [-0.5, 0.8, 0.0], [-0.5, -0.8, 3.0]]
    with double_precision():
        robot, _ = centred(cspr_jax.point_mass(points, mass=1.0, name="slanted"))
        problem = Problem(robot, Limits(tension_max=as_float64(np.full(3, 100.0))), named("A1"))
        places = np.array([[0.0, 0.0, 2.0 + 0.2 * k] for k in range(6)])
        fall = Spline(as_float64(np.array([0.0, 1.0])), as_float64(places[[[0, 0, 0, 5, 5, 5]]]), None)
        (bound,) = time_bounds(problem, [fall])
    assert bound <= float(least_time(np.array(1.0), 300.0 + 9.81, 300.0 - 9.81, np.inf))


@pytest.mark.thorough
def test_speeds_of_cables():
    line = {"points": [[0.0, 0.0, 1.0], [0.0, 0.0, 1.4]], "ramp_time": 0.0, "grid": 100}
    keys = {"schema": 1, "robot": "prototype", "family": "path", "path": line}
    (slow,) = bound_of(cspr_jax.plan(keys | {"limits": {"cable_speed_max": 0.1}}))
    paid = np.hypot(0.26, 1.4) - np.hypot(0.26, 1.0)
    assert slow == pytest.approx(paid / 0.1, rel=1e-6)
