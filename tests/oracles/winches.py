"""NumPy and HiGHS reference for the motors of any motion of any cable robot, on top of `any_motion`.

A winch is a dict of arrays (n,): drum_radius, gear_ratio, motor_inertia, friction, viscous_friction, efficiency; where
there are layers also growth, layer_turns, cable_length; where the motor has a line motor_stall_torque,
motor_no_load_speed. Limits are a dict of motor_speed_max, motor_torque_max, motor_power_max, motor_load_max (n,).

A drum of radius r and a gear of ratio i turn the motor, where it winds, at w = -i l' / r. The motor's power T w is the
cable's, -f l', over (winding) or times (paying out) the efficiency, and what inertia J w' w and friction take. Winding
friction acts at w >= -STANDSTILL, that of paying out at w <= STANDSTILL. Each time has a need for each limit: the
largest value over the limit, of redundant cables with the tensions that make it smallest.
"""

import numpy as np
from scipy.optimize import linprog

from . import any_motion

STANDSTILL = 1e-6


def drum_radius(winch, length):
    """Radius of each drum (k, n) with the cables paid out so far, layer by layer."""
    radius = np.broadcast_to(winch["drum_radius"], length.shape).copy()
    if winch.get("growth") is None:
        return radius
    left = winch["cable_length"] - length
    while True:
        full = 2.0 * np.pi * radius * winch["layer_turns"]
        more = left >= full
        if not more.any():
            return radius
        left = np.where(more, left - full, left)
        radius = np.where(more, radius + winch["growth"], radius)


class Motors:
    """Motors of a robot along a motion."""

    def __init__(self, robot, winch, limits, motion):
        self.robot, self.winch, self.limits, self.motion = robot, winch, limits, motion
        self.low, self.high = any_motion.tension_limits(robot, limits)

    def rates(self, found):
        """Radius over ratio, speed and acceleration of winding, (k, n) each."""
        r = drum_radius(self.winch, found.lengths) / self.winch["gear_ratio"]
        return r, -found.rates / r, -found.accelerations / r

    def sides(self, found):
        """For winding and paying out: whether it occurs, torque of a unit tension, and torque without tension."""
        r, speed, acceleration = self.rates(found)
        moved = self.winch["motor_inertia"] * acceleration + self.winch["viscous_friction"] * speed
        winds = speed >= -STANDSTILL, r / self.winch["efficiency"], moved + self.winch["friction"]
        pays = speed <= STANDSTILL, r * self.winch["efficiency"], moved - self.winch["friction"]
        return speed, (winds, pays)

    def needs(self, name, times):
        """Largest value of any motor over its limit, (k,)."""
        state = self.motion.state(np.atleast_1d(times))
        found = any_motion.cables(self.robot, state)
        speed, sides = self.sides(found)
        if name == "motor_speed_max":
            return (np.abs(speed) / self.limits[name]).max(1)
        matrix, wrench = any_motion.balance(self.robot, state, found)
        if matrix.shape[1] == matrix.shape[2]:
            tension = any_motion.tensions(matrix, wrench)
            return self.of_tensions(name, speed, sides, tension).max(1)
        return np.array([self.least(name, k, speed, sides, matrix[k], wrench[k]) for k in range(len(matrix))])

    def factors(self, name, speed):
        """Value over limit is |torque| times the first, plus the second."""
        limit, zero = self.limits[name], np.zeros_like(speed)
        if name == "motor_torque_max":
            return 1.0 / limit + zero, zero
        if name == "motor_power_max":
            return np.abs(speed) / limit, zero
        line = self.winch["motor_stall_torque"], self.winch["motor_no_load_speed"]
        return 1.0 / (line[0] * limit) + zero, np.abs(speed) / (line[1] * limit)

    def of_tensions(self, name, speed, sides, tension):
        """Value of each motor over its limit, (k, n), the worse side where both occur."""
        factor, offset = self.factors(name, speed)
        each = [np.where(on, np.abs(gain * tension + own) * factor + offset, -np.inf) for on, gain, own in sides]
        return np.maximum(*each)

    def least(self, name, k, speed, sides, matrix, wrench):
        """Smallest largest value over limits, with tensions within theirs: a program in tensions and that value."""
        factor, offset = self.factors(name, speed)
        n = matrix.shape[1]
        rows, right = [], []
        for on, gain, own in sides:
            for sign in (1.0, -1.0):
                for j in np.flatnonzero(on[k]):
                    row = np.zeros(n + 1)
                    row[j], row[n] = sign * gain[k, j] * factor[k, j], -1.0
                    rows.append(row)
                    right.append(-sign * own[k, j] * factor[k, j] - offset[k, j])
        equal = np.concatenate([matrix, np.zeros((len(matrix), 1))], axis=1)
        bounds = [*zip(self.low, self.high, strict=True), (None, None)]
        scale = np.abs(equal).max(1)
        answer = linprog(
            np.append(np.zeros(n), 1.0), np.array(rows), right, equal / scale[:, None], wrench / scale, bounds
        )
        return answer.fun if answer.status == 0 else np.inf


def turning_times(motors, times, parts=40):
    """Times between samples in which a cable turns, where a drum with layers may enter another one and leave it."""
    if motors.winch.get("growth") is None:
        return times[:0]
    rates = any_motion.cables(motors.robot, motors.motion.state(times)).rates
    first = np.flatnonzero((rates[1:] * rates[:-1] <= 0.0).any(1))
    return np.linspace(times[first], times[first + 1], parts).ravel()


def largest_need(motors, name, samples=4001, rounds=5, parts=20):
    """Largest need over a motion, and its time: samples, and finer ones about the highest of them."""
    times = np.linspace(*motors.motion.times, samples)
    width = times[1] - times[0]
    times = np.union1d(times, turning_times(motors, times))
    values = motors.needs(name, times)
    at = times[np.argsort(values)[-3:]]
    best = values.max()
    for _ in range(rounds):
        fine = np.clip(at[:, None] + width * np.linspace(-1.0, 1.0, 2 * parts + 1), *motors.motion.times)
        found = motors.needs(name, fine.ravel()).reshape(fine.shape)
        best = max(best, found.max())
        at, width = fine[np.arange(len(fine)), found.argmax(1)], width / parts
    return best, at[-1]
