"""An independent oracle: slacks of all criteria on samples, in floating point, from functions of time in NumPy."""

import json
from fractions import Fraction
from itertools import pairwise

import numpy as np

from cspr_jax.certificate_checker.checking import check
from cspr_jax.certificate_checker.reading import checksum, read

STEP = 1e-3
SUSPENDED = [([0, 1, 2], [], False), ([0, 1, 2], [0, 1, 2], False), ([0, 2], [], False)]


def text(value):
    """Floats as the rational numbers they are, in nested lists too."""
    if isinstance(value, list | tuple | np.ndarray):
        return [text(entry) for entry in value]
    return str(Fraction(value) if not isinstance(value, np.floating) else Fraction(float(value)))


def derivatives(function, t):
    """Value, first and second derivative by differences of fourth order."""
    values = [np.asarray(function(t + k * STEP), float) for k in (-2, -1, 0, 1, 2)]
    first = (values[0] - 8 * values[1] + 8 * values[3] - values[4]) / (12 * STEP)
    second = (-values[0] + 16 * values[1] - 30 * values[2] + 16 * values[3] - values[4]) / (12 * STEP**2)
    return values[2], first, second


def rotation(q):
    w, v = q[0], np.asarray(q[1:], float)
    skew = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return ((w * w - v @ v) * np.eye(3) + 2 * np.outer(v, v) + 2 * w * skew) / (w * w + v @ v)


def wrapped(base, point, radius, axis):
    """Direction from the effector and length over a pulley, by angles about its centre."""
    k = axis / np.linalg.norm(axis)
    v = point - base
    h = v @ k
    e = (v - h * k) / np.linalg.norm(v - h * k)
    centre = base + radius * e
    away = np.array([(point - centre) @ -e, (point - centre) @ k])  # the spool lies at the angle 0
    distance = np.hypot(*away)
    leave = np.arctan2(away[1], away[0]) % (2 * np.pi) - np.arccos(radius / distance)
    spot = centre + radius * (np.cos(leave) * -e + np.sin(leave) * k)
    free = np.linalg.norm(point - spot)
    return (spot - point) / free, free + radius * max(leave, 0.0)


class Oracle:
    """A robot that moves as x(t) and q(t) say; `robot` and `limits` hold floats."""

    def __init__(self, robot, limits, position, quaternion=lambda t: np.array([1.0, 0, 0, 0])):
        self.robot, self.limits = robot, limits
        self.x, self.q = position, quaternion
        self.base = np.array(robot["base_points"], float)
        self.arms = np.array(robot.get("platform_points", np.zeros_like(self.base)), float)

    def attachments(self, t):
        return self.x(t) + self.arms @ rotation(self.q(t)).T

    def cables(self, t):
        """Units and lengths."""
        pulleys = self.robot.get("pulleys")
        units, lengths = [], []
        for i, point in enumerate(self.attachments(t)):
            if pulleys and pulleys["radius"][i]:
                unit, length = wrapped(self.base[i], point, pulleys["radius"][i], np.array(pulleys["axes"][i], float))
            else:
                length = np.linalg.norm(point - self.base[i])
                unit = (self.base[i] - point) / length
            units.append(unit)
            lengths.append(length)
        return np.array(units), np.array(lengths)

    def balance(self, t):
        """Wrench matrix and wrench; the moment by w and its derivative, all by differences."""
        robot, g = self.robot, np.array([0, 0, self.robot["gravity"]])
        units, _ = self.cables(t)
        r, _, _ = derivatives(lambda s: rotation(self.q(s)), t)
        force = robot["mass"] * (derivatives(self.x, t)[2] - g)

        def spin(s):
            value, rate, _ = derivatives(lambda s: rotation(self.q(s)), s)
            w = rate @ value.T
            return np.array([w[2, 1], w[0, 2], w[1, 0]])

        w, dw, _ = derivatives(spin, t)
        rows, right = [units[:, a] for a in robot["forces"]], [force[a] for a in robot["forces"]]
        axes = [r @ np.array(a, float) for a in robot.get("line_axes", [])] or [np.eye(3)[a] for a in robot["moments"]]
        if axes:
            inertia = r @ np.array(robot["inertia"], float) @ r.T
            arm = r @ np.array(robot.get("joint_arm", [0, 0, 0]), float)
            inertia = inertia + robot["mass"] * (arm @ arm * np.eye(3) - np.outer(arm, arm))
            moment = inertia @ dw + np.cross(w, inertia @ w) + np.cross(arm, force)
            moments = np.cross(self.arms @ r.T, units)
            rows += [moments @ a for a in axes]
            right += [a @ moment for a in axes]
        return np.array(rows), np.array(right)

    def slacks(self, t):
        """Slack of each criterion at a time, contacts and wrench_infeasible apart."""
        limits, out = self.limits, {}
        a, w = self.balance(t)
        n = len(self.base)
        square = a.shape[0] == a.shape[1]
        x, v, acc = derivatives(self.x, t)
        length, rate, second = derivatives(lambda s: self.cables(s)[1], t)
        values = {
            "cable_length_max": ("cable_too_long", length),
            "cable_speed_max": ("cable_too_fast", abs(rate)),
            "cable_acceleration_max": ("cable_over_acceleration", abs(second)),
        }
        if square:
            f = np.linalg.solve(a, w)
            out |= {f"slack_cable:{i}": f[i] - limits.get("tension_min", [0] * n)[i] for i in range(n)}
            values["tension_max"] = ("over_tension", f)
            if "winches" in self.robot:
                values |= self.motors(f, rate, second)
            if "platform_points" in self.robot:
                rho = np.sqrt(np.mean(np.sum(self.arms**2, axis=1)))
                count = a.shape[0] - len(self.robot["forces"])
                out["singular"] = abs(np.linalg.det(a)) / rho**count - 1e-9
        for key, (flag, value) in values.items():
            if key in limits:
                out |= {f"{flag}:{i}": limits[key][i] - value[i] for i in range(n)}
        if square and (self.robot["forces"], self.robot["moments"], "line_axes" in self.robot) in SUSPENDED:
            out["above_spools"] = x @ self.normal()
        if "floor" in limits:
            out["below_floor"] = limits["floor"] - x[2]
            if "platform_points" in self.robot:
                out["lowest_below_floor"] = limits["floor"] - max(self.attachments(t)[:, 2])
        if "speed_max" in limits:
            out["too_fast"] = limits["speed_max"] - np.linalg.norm(v)
        if "acceleration_max" in limits:
            out["over_acceleration"] = limits["acceleration_max"] - np.linalg.norm(acc)
        return out

    def normal(self):
        """Normal of the plane of the spools, fitted for more than three, through the origin."""
        if len(self.base) == 2:
            return np.array([0, 0, 1.0])
        sides = np.c_[self.base[:, :2], np.ones(3)] if len(self.base) == 3 else self.base[:, :2]
        p, q = np.linalg.lstsq(sides, self.base[:, 2], rcond=None)[0][:2]
        return np.array([-p, -q, 1])

    def motors(self, f, rate, second):
        m = {key: np.array(value, float) for key, value in self.robot["winches"].items()}
        speed, change = (-m["gear_ratio"] * value / m["drum_radius"] for value in (rate, second))
        torque = np.full((2, len(f)), 0.0)
        for row, p in enumerate((1.0, -1.0)):
            torque[row] = m["drum_radius"] * f / (m["gear_ratio"] * m["efficiency"] ** p) + m["motor_inertia"] * change
            torque[row] += p * m["friction"] + m["viscous_friction"] * speed
        counts = np.array([speed >= -1e-6, speed <= 1e-6])
        worst = np.max(np.where(counts, abs(torque), 0), axis=0)
        return {
            "motor_speed_max": ("motor_too_fast", abs(speed)),
            "motor_torque_max": ("motor_over_torque", worst),
            "motor_power_max": ("motor_over_power", worst * abs(speed)),
            "motor_load_max": ("motor_over_load", worst / m["stall_torque"] + abs(speed) / m["no_load_speed"]),
        }

    def smallest(self, times):
        rows = [self.slacks(t) for t in times]
        return {name: min(row[name] for row in rows) for name in rows[0]}


def piece(start, end, program, position, quaternion=None, **more):
    """A piece of motion whose steps hold floats."""
    steps = [["poly", text(step[1])] if step[0] == "poly" else step for step in program]
    keys = {"start": text(start), "end": text(end), "program": steps, "position": position, **more}
    return keys | ({"quaternion": quaternion} if quaternion else {})


def statement(robot, limits, pieces, **more):
    """All keys but the proof."""
    exact = {
        key: value if key in ("forces", "moments") else text(value)
        for key, value in robot.items()
        if key not in ("pulleys", "winches")
    }
    for key in {"pulleys", "winches"} & set(robot):
        exact[key] = {name: text(value) for name, value in robot[key].items()}
    return {
        "format": "cspr-certificate",
        "version": 1,
        "robot": exact,
        "limits": {key: text(value) for key, value in limits.items()},
        "motion": {"duration": pieces[-1]["end"], "pieces": pieces},
        **more,
    }


def cut(pieces, count, **witness):
    """Blocks of equal length, `count` in each piece."""
    blocks = []
    for entry in pieces:
        start, end = Fraction(entry["start"]), Fraction(entry["end"])
        edges = [start + (end - start) * k / count for k in range(count + 1)]
        blocks += [{"start": str(a), "end": str(b), **witness} for a, b in pairwise(edges)]
    return blocks


def feasible(content, bounds, blocks):
    return content | {"verdict": "feasible", "bounds": {k: text(v) for k, v in bounds.items()}, "blocks": blocks}


def infeasible(content, *failures):
    return content | {"verdict": "infeasible", "failures": list(failures)}


def verify(content):
    """Write, read and check."""
    return check(read(json.dumps(content | {"sha256": checksum(content)}))).holds
