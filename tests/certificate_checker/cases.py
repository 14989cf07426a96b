"""Motions of robots of all kinds, once as programs and once as functions in NumPy."""

import numpy as np

from tests.certificate_checker.oracle import Oracle, piece, statement

SPOOLS = [[-2.0, -1.2, -0.1], [2.1, -1.1, 0.1], [0.1, 2.3, 0.0]]
MASS = {"mass": 5.0, "gravity": 9.81, "moments": []}
DRIVES = {
    "drum_radius": 0.05,
    "gear_ratio": 5.0,
    "motor_inertia": 0.002,
    "friction": 0.03,
    "viscous_friction": 0.001,
    "efficiency": 0.85,
    "stall_torque": 9.0,
    "no_load_speed": 400.0,
}


def winches(n):
    return {
        name: [value * (1 + 0.01 * i) if name != "efficiency" else value for i in range(n)]
        for name, value in DRIVES.items()
    }


def all_limits(n, motors=False):
    limits = {
        "tension_min": [1.0] * n,
        "tension_max": [90.0 + i for i in range(n)],
        "floor": 4.0,
        "cable_length_max": [6.0] * n,
        "cable_speed_max": [3.0] * n,
        "cable_acceleration_max": [12.0] * n,
        "speed_max": 3.0,
        "acceleration_max": 12.0,
        "touched": 0.01,
    }
    if motors:
        limits |= {
            "motor_speed_max": [300.0] * n,
            "motor_torque_max": [5.0] * n,
            "motor_power_max": [800.0] * n,
            "motor_load_max": [2.0] * n,
        }
    return limits


QUINTIC = [0.0, 0.0, 0.0, 10.0, -15.0, 6.0]  # from rest to rest in 1 s


def quintic(start, end):
    """Programs and function of a rest-to-rest motion in 1 s."""
    start, end = np.array(start, float), np.array(end, float)
    rows = [[a, *(np.array(QUINTIC[1:]) * (b - a))] for a, b in zip(start, end, strict=True)]
    return [["poly", [float(c) for c in row]] for row in rows], lambda t: np.array(
        [np.polyval(row[::-1], t) for row in rows]
    )


def point_mass(pulleys=False, motors=False):
    steps, x = quintic([-0.3, 0.1, 1.5], [0.4, 0.2, 1.9])
    robot = MASS | {"base_points": SPOOLS, "forces": [0, 1, 2]}
    if pulleys:
        robot["pulleys"] = {"radius": [0.06, 0.05, 0.0], "axes": [[0.0, 0.0, -2.0], [0.0, 0.1, -1.0], [0.0, 0.0, 0.0]]}
    if motors:
        robot["winches"] = winches(3)
    limits = all_limits(3, motors)
    pieces = [piece(0, 1, steps, [0, 1, 2])]
    return statement(robot, limits, pieces), Oracle(robot, limits, x), pieces


def planar():
    steps, x = quintic([-0.3, 0.0, 1.2], [0.5, 0.0, 1.6])
    robot = MASS | {"base_points": [[-2.0, 0.0, 0.0], [2.0, 0.0, 0.0]], "forces": [0, 2]}
    limits = all_limits(2)
    pieces = [piece(0, 1, steps, [0, 1, 2])]
    return statement(robot, limits, pieces), Oracle(robot, limits, x), pieces


def circle():
    """x = 0.5 cos(pi s), y = 0.5 sin(s pi), z = sqrt(2 + x / 3) with s = t + t^2 / 4; also division and acos."""
    program = [["poly", [0.0, 1.0, 0.25]], ["cos_pi", 0], ["sin_pi", 0], ["poly", [0.5]], ["*", 1, 3], ["*", 2, 3]]
    program += [
        ["poly", [3.0]],
        ["/", 4, 6],
        ["poly", [2.0]],
        ["+", 7, 8],
        ["sqrt", 9],
        ["acos", 4],
        ["sin", 11],
        ["cos", 11],
    ]
    program += [["-", 10, 13]]

    def x(t):
        s = t + t * t / 4
        a, b = 0.5 * np.cos(np.pi * s), 0.5 * np.sin(np.pi * s)
        return np.array([a, b, np.sqrt(2 + a / 3) - a])

    robot = MASS | {"base_points": SPOOLS, "forces": [0, 1, 2]}
    limits = {"tension_max": [400.0] * 3, "speed_max": 4.0, "floor": 3.0, "acceleration_max": 20.0}
    pieces = [piece(0, 1, program, [4, 5, 14])]
    return statement(robot, limits, pieces), Oracle(robot, limits, x), pieces


def hexapod():
    """Three pairs of spools, crossed to a platform that is turned and moved."""
    angles = np.radians([0, 20, 120, 140, 240, 260])
    base = np.round(np.c_[3 * np.cos(angles), 3 * np.sin(angles), 0.05 * np.array([1, -1, 1, 0, -1, 0])], 6)
    inner = np.radians([-50, 70, 70, 190, 190, 310])
    arms = np.round(np.c_[0.5 * np.cos(inner), 0.5 * np.sin(inner), -0.05 + 0 * inner], 6)
    steps, x = quintic([-0.1, 0.05, 2.0], [0.15, 0.1, 2.2])
    turns = quintic([1.0, 0.02, 0.0, -0.03], [0.9, -0.03, 0.05, 0.04])[0]
    rows = [np.array(step[1]) for step in turns]

    def q(t):
        return np.array([np.polyval(row[::-1], t) for row in rows])

    robot = {
        "base_points": base.tolist(),
        "mass": 12.0,
        "gravity": 9.81,
        "forces": [0, 1, 2],
        "moments": [0, 1, 2],
        "platform_points": arms.tolist(),
        "inertia": [[0.9, 0.05, 0.0], [0.05, 0.8, 0.02], [0.0, 0.02, 1.4]],
    }
    limits = all_limits(6)
    pieces = [piece(0, 1, steps + turns, [0, 1, 2], [3, 4, 5, 6])]
    return statement(robot, limits, pieces), Oracle(robot, limits, x, q), pieces


def joint():
    """Three cables hold a pole on a spherical joint."""
    robot = {
        "base_points": [[-1.1, 2.6, 0.6], [0.1, -1.6, 0.4], [2.8, 2.8, 0.2]],
        "mass": 4.0,
        "gravity": 9.81,
        "forces": [],
        "moments": [0, 1, 2],
        "platform_points": [[0.0, -0.1, -1.4], [-0.3, -0.1, -1.5], [-0.2, 0.2, -1.4]],
        "inertia": [[0.4, 0.0, 0.01], [0.0, 0.5, 0.0], [0.01, 0.0, 0.1]],
        "joint_arm": [-0.1, -0.4, -0.6],
    }
    rows = [[1.0, 0.05], [0.1, 0.1, 0.025], [-0.05, 0.05, -0.05], [0.02, -0.05, 0.075]]
    program = [["poly", [0.1]], ["poly", [-0.2]], ["poly", [3.0]]] + [["poly", row] for row in rows]
    limits = {"tension_max": [1e5] * 3, "cable_speed_max": [3.0] * 3}
    pieces = [piece(0, 1, program, [0, 1, 2], [3, 4, 5, 6])]
    oracle = Oracle(
        robot, limits, lambda t: np.array([0.1, -0.2, 3.0]), lambda t: np.array([np.polyval(r[::-1], t) for r in rows])
    )
    return statement(robot, limits, pieces), oracle, pieces


def lines():
    """Five cables hold a platform whose moments are balanced about two axes of its own."""
    _, hexa, _ = hexapod()
    robot = dict(hexa.robot)
    robot["base_points"] = [
        [2.54, 1.6, 0.19],
        [1.7, 2.47, 0.14],
        [-2.95, 0.54, -0.16],
        [-0.53, -2.95, 0.04],
        [-0.38, -2.98, -0.01],
    ]
    robot["platform_points"] = [
        [0.07, 0.5, -0.21],
        [0.25, -0.43, 0.24],
        [-0.43, 0.25, 0.21],
        [0.14, -0.48, 0.19],
        [0.43, 0.26, 0.01],
    ]
    robot |= {"moments": [], "line_axes": [[1.0, 0.1, 0.0], [0.0, 1.0, -0.1]]}
    limits = all_limits(5)
    _, oracle, pieces = hexapod()
    oracle = Oracle(robot, limits, oracle.x, oracle.q)
    return statement(robot, limits, pieces), oracle, pieces


def all_cases():
    return {
        "point mass": point_mass(),
        "pulleys": point_mass(pulleys=True),
        "motors": point_mass(motors=True),
        "pulleys and motors": point_mass(True, True),
        "planar": planar(),
        "circle": circle(),
        "hexapod": hexapod(),
        "joint": joint(),
        "lines": lines(),
    }
