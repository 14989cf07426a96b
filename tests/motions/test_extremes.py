"""Extremes of motions of all families and their times, beside dense samples of states that NumPy refines."""

from functools import partial

import numpy as np
import pytest
from support.motions import MANY, states_along

import cspr_jax
from cspr_jax.motion.peaks import EXTREMES

SIGNS = {"tension_min": 1.0, "mu_min": 1.0, "depth_min": 1.0}  # of the others the largest value counts
STARTS, POINTS, ROUNDS = 9, 11, 8
REST = {"position": [0.0, 0.0, 1.4], "rest": True}
LINE = {"robot": "prototype", "pose": [REST, {"position": [0.1, 0.05, 1.5], "rest": True}]}
PLANS = {
    "hypocycloid-standard": {"z0": 1.4, "pose": [{"rest": True}, {"position": [0.3, 0.2, 1.5]}]},
    "transition": {"z0": 1.4, "pose": [{"rest": True}, {"position": [0.4, 0.2, 1.5]}]},
    "hypocycloid": {"robot": "laval-mssm", "z0": 1.4, "pose": [{"rest": True}, {"position": [0.3, 0.2, 1.4]}]},
    "ellipse": {
        "ellipse": {"centre": [0.0, 0.0, 1.4], "radius": 0.2, "frequency": 2.5},
        "turns": 1.0,
        "pose": [{}, {}],
    },
    "s-curve": LINE,
    "quintic": LINE,
    "bezier": {"pose": [{"position": [0.0, 0.0, 1.4]}, {"position": [0.1, 0.05, 1.5]}], "tension_max": 3.0},
    "path": {**LINE, "tension_max": 1.6, "path": {"ramp_time": 0.01, "grid": 60}},
    # The lowest place is the end.
    "spline": {"pose": [{"position": [0.0, 0.0, 1.4]}, {"position": [0.1, 0.1, 1.3], "time": 0.8},
                        {"position": [0.05, 0.0, 1.6], "time": 1.7}]},
}  # fmt: skip
QUICK = ("quintic", "spline")


def values(robot, motion, tau):
    """What each extreme is the extreme of, (n,), by textbook formulas; the smallest one counts."""
    batches = [states_along(motion, part) for part in np.resize(tau, (-(-len(tau) // MANY), MANY))]
    state = {name: np.concatenate([getattr(one, name) for one in batches])[: len(tau)]
             for name in batches[0]._fields if getattr(batches[0], name) is not None}  # fmt: skip
    place, speed, second_derivative = (state[name] for name in ("position", "velocity", "acceleration"))
    points, base = np.zeros((len(tau), 1, 3)), np.asarray(robot.base_points)
    force = robot.mass * (second_derivative - [0.0, 0.0, robot.gravity])
    wrench, arms = force[:, :, None], np.zeros((len(tau), len(base), 3))
    moved, pushed = speed[:, None], second_derivative[:, None]
    if "rotation" in state:
        turn, omega, alpha = state["rotation"], state["angular_velocity"], state["angular_acceleration"]
        centre = np.zeros(3) if robot.centre_of_mass is None else np.asarray(robot.centre_of_mass)
        points = arms = np.einsum("nij,kj->nki", turn, np.asarray(robot.platform_points) - centre)
        moved = moved + np.cross(omega[:, None], arms)
        pushed = pushed + np.cross(alpha[:, None], arms) + np.cross(omega[:, None], np.cross(omega[:, None], arms))
        inertia = turn @ np.asarray(robot.inertia) @ turn.swapaxes(1, 2)
        spin = np.einsum("nij,nj->ni", inertia, omega)
        torque = np.einsum("nij,nj->ni", inertia, alpha) + np.cross(omega, spin)
        wrench = np.concatenate([force, torque], axis=1)[:, :, None]
    ways = place[:, None] + arms - base
    length = np.linalg.norm(ways, axis=2)
    units = ways / length[:, :, None]
    rate = (units * moved).sum(2)
    second = (units * pushed).sum(2) + ((moved**2).sum(2) - rate**2) / length
    matrix = -units.swapaxes(1, 2)
    if "rotation" in state:
        matrix = np.concatenate([matrix, np.cross(arms, -units).swapaxes(1, 2)], axis=1)
    tension = np.linalg.solve(matrix, wrench)[:, :, 0]
    return {
        "tension_min": tension.min(1),
        "tension_max": -tension.max(1),
        "mu_min": (tension / length).min(1) / robot.mass,
        "depth_min": place[:, 2],
        "lowest": -(place[:, 2] + np.maximum(points[..., 2].max(1), 0.0)),
        "length_max": -length.max(1),
        "speed_max": -np.abs(rate).max(1),
        "acceleration_max": -np.abs(second).max(1),
        "mass_centre_speed": -np.linalg.norm(speed, axis=1),
        "mass_centre_acceleration": -np.linalg.norm(second_derivative, axis=1),
    }


def refined(at, motion, columns=None):
    """Of each column of values the smallest ones around the lowest samples of pieces, their times, the scale."""
    knots = np.unique([0.0, *np.asarray(motion.breaks(), float).ravel(), 1.0])
    knots = knots[np.append(True, np.diff(knots) > 1e-9)]
    count = max(20 * MANY // (len(knots) - 1), 9)
    pieces = np.linspace(knots[:-1] + 1e-13 * (knots[:-1] > 0.0), knots[1:] - 1e-13 * (knots[1:] < 1.0), count, axis=1)
    dense, tau = at(pieces.ravel()), pieces.ravel()
    low, high = np.repeat(pieces[:, 0], count), np.repeat(pieces[:, -1], count)
    result = {}
    for name in columns or dense:
        column = dense[name]
        table = column.reshape(pieces.shape)
        padded = np.pad(table, ((0, 0), (1, 1)), constant_values=np.inf)
        is_low = ((table <= padded[:, :-2]) & (table <= padded[:, 2:])).ravel()
        start = np.argsort(np.where(is_low, column, np.inf), kind="stable")[:STARTS]
        start = start[is_low[start]]
        center, width = tau[start], (high - low)[start] / (count - 1)
        for _ in range(ROUNDS):
            points = center[:, None] + width[:, None] * np.linspace(-1.0, 1.0, POINTS)
            points = np.clip(points, low[start][:, None], high[start][:, None])
            found = at(points.ravel())[name].reshape(points.shape)
            center = points[np.arange(len(start)), found.argmin(1)]
            width = 2.0 * width / (POINTS - 1)
        result[name] = found.min(1), center, float(np.abs(column).max())
    return result


@pytest.mark.quick("spline")
@pytest.mark.parametrize(
    "family", [name if name in QUICK else pytest.param(name, marks=pytest.mark.thorough) for name in PLANS]
)
def test_extremes_and_their_times(family):
    check_extremes(cspr_jax.plan({"schema": 1, "robot": "prototype", "family": family} | PLANS[family]))


@pytest.mark.parametrize("side", ["both", "before", "after"])
def test_extremes_at_joints(side):
    """Of pieces shorter than distances of samples: at kinks of accelerations, and on either side of their jumps.

    Were joints no samples, values would be missed by 1e-5 of their scales and more.
    """
    aside, velocity = (5e-6, None) if side == "both" else (0.0, 0.003)
    times = np.array([0.0, 0.8, 0.801, 0.8027, 1.7])
    places = np.array([[0.0, 0.0, 1.4], [0.1, 0.1, 1.3], [0.1 + aside, 0.1, 1.3], [0.1, 0.1, 1.3], [0.05, 0.0, 1.6]])
    velocities = None if velocity is None else velocity * np.eye(5, 3, -2)
    if side == "after":
        times, places, velocities = 1.7 - times[::-1], places[::-1], -velocities[::-1]
    check_extremes(cspr_jax.check("prototype", times, places, velocities=velocities).plan)


def check_extremes(planned):
    """To a millionth of their scales; at the times that are told the motion has these values."""
    robot, demands = planned.problem.robot, planned.demands
    for i, motion in enumerate(planned.motions):
        duration = float(motion.duration())
        expected = refined(partial(values, robot, motion), motion)
        told = demands.when[i] / duration
        beside = values(robot, motion, np.clip(np.concatenate([told - 1e-12, told, told + 1e-12]), 0.0, 1.0))
        for name, (lowest, times, scale) in expected.items():
            sign, column = SIGNS.get(name, -1.0), EXTREMES.index(name)
            value = sign * getattr(demands, name)[i]
            if name == "lowest":  # in the axes of the file
                value = -float(planned.frame.inward([0.0, 0.0, getattr(demands, name)[i]])[2])
            assert abs(value - lowest.min()) <= 1e-6 * scale, (name, value, lowest.min())
            misses = np.abs(beside[name][column :: len(EXTREMES)] - lowest.min()).min()
            assert misses <= 1e-6 * scale, (name, told[column])
            # Where values hardly change, any time of such a value will do.
            as_low = lowest <= lowest.min() + 1e-9 * scale
            assert misses <= 1e-10 * scale or np.abs(times[as_low] - told[column]).min() <= 1e-6, (name, told[column])
