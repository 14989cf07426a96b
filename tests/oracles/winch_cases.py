"""Random winches for the random motions of `any_motion_cases`: each number matters, none dwarfs the others."""

import math

import numpy as np

from . import any_motion

LIMITS = ("motor_speed_max", "motor_torque_max", "motor_power_max", "motor_load_max")


def random_winch(rng, case, layers):
    """Winches of a case as keys of [winch], and the cables' diameter (None without layers)."""
    count = len(case.robot["base_points"])
    size = np.abs(case.robot["base_points"]).max()
    found = any_motion.cables(case.robot, case.motion.state(np.linspace(*case.motion.times, 50)))
    winch = {
        "drum_radius": size * rng.uniform(0.01, 0.05, count),
        "gear_ratio": rng.uniform(1.0, 20.0, count),
        "efficiency": rng.uniform(0.6, 1.0, count),
    }
    arm = winch["drum_radius"] / winch["gear_ratio"]
    speed, acceleration = (np.abs(x / arm).max(0) for x in (found.rates, found.accelerations))
    torque = arm * case.robot["mass"] * case.robot["gravity"]
    winch["motor_inertia"] = torque * rng.uniform(0.0, 0.3, count) / acceleration
    winch["friction"] = torque * rng.uniform(0.0, 0.2, count)
    winch["viscous_friction"] = torque * rng.uniform(0.0, 0.2, count) / speed
    winch["motor_stall_torque"] = torque * rng.uniform(1.0, 3.0, count)
    winch["motor_no_load_speed"] = speed * rng.uniform(1.0, 3.0, count)
    if not layers:
        return winch, None
    winch["cable_length"] = 1.1 * found.lengths.max(0)
    winch["layer_turns"] = rng.uniform(0.2, 0.5, count) * winch["cable_length"] / (2.0 * math.pi * winch["drum_radius"])
    return winch, 0.05 * float(winch["drum_radius"].min())


def random_limit(rng, winch, name):
    """A limit of each motor, up to a common factor."""
    torque, speed = winch["motor_stall_torque"], winch["motor_no_load_speed"]
    usual = {"speed": speed, "torque": torque, "power": 0.3 * torque * speed, "load": np.ones(len(speed))}
    return usual[name.split("_")[1]] * np.exp(rng.uniform(-0.5, 0.5, len(speed)))
