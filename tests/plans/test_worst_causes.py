"""Causes of motions of all families: their numbers are those at their times, and the worst there are, by dense samples.

States of the motions themselves, cables and tensions by formulas and linear programs that know nothing of the package.
"""

import numpy as np
import pytest
from motions.test_extremes import PLANS, refined
from oracles import any_motion, clearance
from oracles.sampled_motion import State
from support.motions import MANY, states_along

import cspr_jax

# Of others the largest value counts.
SMALLEST = ("slack_cable", "wrench_infeasible", "above_spools", "obstacle")
BALL = {"kind": "sphere", "centre": [0.0, 0.04, 1.542], "radius": 0.06}
SWING = {
    "family": "hypocycloid-standard",
    "z0": 1.4,
    "max_arcs": 3,
    "pose": [{"position": [0.1, 0.1, 1.3]}, {"position": [0.3, 0.2, 1.5], "arcs": 1}],
}
ASIDE = {
    "family": "hypocycloid-standard",
    "z0": 1.7,
    "pose": [{"position": [0.1, 0.05, 1.5]}, {"position": [-0.1, 0.05, 1.5], "arcs": 1}],
}
THREE = {"name": "three", "mass": 0.198, "base_points": [[0.225, -0.13, 0.0], [-0.225, -0.13, 0.0], [0.0, 0.26, 0.0]]}
FOUR = {"name": "four", "mass": 10.0, "z_axis": "up", "base_points": [[0, 0, 10], [10, 0, 10], [10, 9, 10], [0, 9, 10]]}
SIX = PLANS["hypocycloid"] | {"family": "hypocycloid", "max_arcs": 2}
SIX |= {"pose": [{"rest": True}, {"position": [0.9, -0.7, 1.2]}]}
LINE = {"robot": "prototype", "pose": [{"position": [0.0, 0.0, 1.4]}, {"position": [0.1, 0.05, 1.5]}]}
BEZIER = LINE | {"family": "bezier", "pose": [LINE["pose"][0], LINE["pose"][1] | {"duration": 0.4}]}
RECTANGLE = {
    "robot": "boralugoda-rectangle",
    "family": "bezier",
    "pose": [{"position": [10.0, 10.0, 5.0]}, {"position": [35.0, 20.0, 12.0], "duration": 3.0}],
}
COGIRO = {
    "robot": "cogiro",
    "family": "hypocycloid",
    "z0": 4.0,
    "samples": 50,
    "max_arcs": 2,
    "pose": [{"rest": True}, {"position": [1.5, 1.0, 1.6], "tilt_torsion": [0.3, 0.1, 0.2]}],
}
COGIRO |= {"amplitude": {"name": "effective-c3", "epsilon": 0.3}}
# Plans with limits that they break, and the criteria that do so.
CASES = {
    "swing": (SWING | {"tension_max": 1.0, "cable_speed_max": 0.5, "cable_acceleration_max": 2.5, "speed_max": 0.6,
                       "acceleration_max": 3.0, "cable_length_max": 1.6, "floor": 1.45},
              "slack_cable over_tension cable_too_fast cable_over_acceleration too_fast over_acceleration "
              "cable_too_long below_floor"),
    "four cables": ({"robot": FOUR, "family": "hypocycloid-standard", "z0": 5.0, "tension_max": 60.0, "pose": [
        {"position": [2.0, 2.0, 4.0]}, {"position": [9.0, 8.0, 4.0], "arcs": 1}]}, "wrench_infeasible"),
    "transition": (PLANS["transition"] | {"family": "transition", "max_arcs": 4, "cable_speed_max": 0.3},
                   "cable_too_fast"),
    "transition of four": ({"robot": FOUR, "family": "transition", "z0": 5.0, "max_arcs": 3, "tension_max": 60.0,
                            "pose": [{"rest": True}, {"position": [9.5, 8.5, 4.0]}]}, "wrench_infeasible"),
    "ball": (ASIDE | {"robot": THREE, "obstacle": [BALL]}, "obstacle"),
    "pulleys": (ASIDE | {"robot": THREE | {"pulley_radius": 0.02}, "tension_max": 0.9}, "slack_cable over_tension"),
    "six cables": (SIX | {"speed_max": 0.5, "acceleration_max": 0.5, "cable_length_max": 2.0, "floor": 1.3},
                   "too_fast over_acceleration cable_too_long below_floor"),
    "eight cables": (COGIRO | {"tension_min": 300.0}, "wrench_infeasible"),
    "s-curve": (LINE | {"family": "s-curve", "cable_length_max": 1.54, "floor": 1.45}, "cable_too_long below_floor"),
    "quintic": (LINE | {"family": "quintic", "cable_length_max": 1.54, "floor": 1.45}, "cable_too_long below_floor"),
    "path": (LINE | {"family": "path", "path": {"ramp_time": 0.01, "grid": 60}, "floor": 1.45}, "below_floor"),
    "bezier": (BEZIER | {"tension_max": 3.0, "cable_speed_max": 0.4, "acceleration_max": 5.0},
               "slack_cable over_tension cable_too_fast over_acceleration"),
    "bezier of four": (RECTANGLE | {"cable_speed_max": 4.0}, "wrench_infeasible cable_too_fast"),
    "ellipse": (PLANS["ellipse"] | {"family": "ellipse", "speed_max": 0.45, "tension_max": 0.7, "floor": 1.39},
                "too_fast over_tension below_floor"),
    "spline": (PLANS["spline"] | {"family": "spline", "cable_acceleration_max": 1.0, "tension_max": 1.0},
               "slack_cable over_tension cable_over_acceleration"),
}  # fmt: skip
QUICK = ("four cables", "spline")


def values(robot, limits, ball, motion):
    """Values of criteria, (n, n_cables) or (n, 1), at normalised times; smaller ones are worse."""
    points = getattr(robot, "platform_points", None)
    keys = {name: float(getattr(robot, name)) for name in ("mass", "gravity")} | {"pattern": robot.pattern}
    keys |= {"z_axis": "down", "base_points": np.asarray(robot.base_points), "centre_of_mass": np.zeros(3)}
    keys |= {"platform_points": points, "inertia": getattr(robot, "inertia", None), "pulley_radius": None}
    if robot.pulleys is not None:
        keys |= {"pulley_radius": robot.pulleys.radius, "pulley_axes": robot.pulleys.axes}
    allowed = {name: getattr(limits, name) for name in ("tension_min", "tension_max")}
    centring = any_motion.Centring(*any_motion.tension_limits(keys, allowed))

    def at(tau):
        parts = [states_along(motion, part) for part in np.resize(tau, (-(-len(tau) // MANY), MANY))]
        names = ["position", "velocity", "acceleration"]
        names += [] if points is None else ["rotation", "angular_velocity", "angular_acceleration"]
        columns = [np.concatenate([getattr(part, name) for part in parts])[: len(tau)] for name in names]
        if points is None:
            columns += [np.broadcast_to(np.eye(3), (len(tau), 3, 3)), *np.zeros((2, len(tau), 3))]
        state = State(*columns)
        found = any_motion.cables(keys, state)
        matrix, wrench = any_motion.balance(keys, state, found)
        if robot.n_cables > robot.dof:
            table = {"wrench_infeasible": centring.largest(matrix, wrench)[:, None]}
        else:
            tensions = any_motion.tensions(matrix, wrench)
            table = {"slack_cable": tensions, "over_tension": -tensions}
        if ball:
            ends = [part.reshape(-1, 3) for part in (found.leaving, found.attachments - found.leaving)]
            apart = clearance.point_to_segment(np.broadcast_to(ball["centre"], ends[0].shape), *ends)
            table["obstacle"] = apart.astype(float).reshape(len(tau), -1) - ball["radius"]
        lowest = np.maximum(state.position[:, 2], found.attachments[:, :, 2].max(1))
        return table | {
            "below_floor": -lowest[:, None],
            "cable_too_long": -found.lengths,
            "cable_too_fast": -np.abs(found.rates),
            "cable_over_acceleration": -np.abs(found.accelerations),
            "too_fast": -np.linalg.norm(state.velocity, axis=1)[:, None],
            "over_acceleration": -np.linalg.norm(state.acceleration, axis=1)[:, None],
        }

    return at


@pytest.mark.ci(
    "ball", "bezier", "eight cables", "ellipse", "path", "pulleys", "quintic", "s-curve", "swing", "transition of four"
)
@pytest.mark.quick("four cables")
@pytest.mark.parametrize(
    "case", [name if name in QUICK else pytest.param(name, marks=pytest.mark.thorough) for name in CASES]
)
def test_numbers_of_causes(case):
    """To a millionth of their scales: what is told is so at its time, of its cable, and nothing is worse."""
    keys, flags = CASES[case]
    planned = cspr_jax.plan({"schema": 1, "robot": "prototype"} | keys)
    seen = set()
    for motion, causes in zip(planned.motions, planned.causes, strict=True):
        motion, duration = motion.motion, float(motion.duration())  # from the centroid of the spools, z down
        at = values(planned.problem.robot, planned.problem.limits, BALL if "obstacle" in keys else None, motion)

        def worst_of_all(tau, at=at):
            return {name: table.min(1) for name, table in at(tau).items()}

        expected = refined(worst_of_all, motion, [cause.criterion for cause in causes])
        for cause in causes:
            seen.add(cause.criterion)
            (lowest, times, scale), value = expected[cause.criterion], cause.needed
            if cause.criterion == "below_floor":
                value = float(planned.frame.inward([0.0, 0.0, value])[2])
            value *= 1.0 if cause.criterion in SMALLEST else -1.0
            assert abs(value - lowest.min()) <= 1e-6 * scale, (cause, lowest.min())
            tau = cause.t / duration
            beside = at(np.clip([tau - 1e-12, tau, tau + 1e-12], 0.0, 1.0))[cause.criterion]
            (cable,) = cause.cables or (0,)
            assert np.abs(beside[:, cable] - value).min() <= 1e-6 * scale, (cause, beside)
            # Where values hardly change, any time of such a value will do.
            as_low = lowest <= lowest.min() + 1e-9 * scale
            near = np.abs(times[as_low] - tau).min()
            assert np.abs(beside[:, cable] - lowest.min()).min() <= 1e-10 * scale or near <= 1e-6, (cause, near)
    assert seen == set(flags.split())
