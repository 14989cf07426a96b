"""Bounds of the time of all motions between two poses at zero velocity, from below.

A length that is to change by D, with a speed and an acceleration of at most v and a, takes a trapezoid's time: so do
cables' lengths, and the distance. Of tensions only what they do along a direction e, from where the mass centre can be:

    e . p'' <= e . g + sum over cables of max(lo c, hi c) / m,    c at most e . u, with u a unit vector to the spool.

Where it can be in a cell of time is in a box: what it reaches from the start, and from what it reaches the end. From
rest to rest, over a displacement d,

    integral (a_0 + (T - t) a_1) . p'' dt = a_1 . d    for any vectors a_0, a_1:

a time is too short if the largest values on the left, in their boxes, make less than that for some. It is a convex
problem, of which any point will do. Accelerations of zero are always let in: so all that is reached in a time is
reached in a longer one, and a time that is too short shows that all shorter ones are.
"""

import math

import numpy as np
from scipy.optimize import minimize

from . import any_motion, least_time_forms, path_rows, sampled_motion

CELLS, ROUNDS, ROUNDING = 48, 5, 1e-9


def trapezoids(robot, limits, start, end):
    """Least time by how much cables' lengths, and the position, change, s."""
    both = np.array([start.position, end.position], float)
    turns = sampled_motion.rotations(np.array([start.quaternion, end.quaternion], float))
    attached = both[:, None] + np.einsum("kij,nj->kni", turns, arms_of(robot))
    cables = np.linalg.norm(attached - robot["base_points"], axis=2)
    distance, time = np.linalg.norm(both[1] - both[0]), 0.0
    for prefix, changes in (("cable_", np.abs(cables[1] - cables[0])), ("", np.array([distance]))):
        names = (prefix + "speed_max", prefix + "acceleration_max")
        most = [np.broadcast_to(np.inf if limits.get(k) is None else limits[k], len(changes)) for k in names]
        for change, v, a in zip(changes, *most, strict=True):
            time = max(time, least_time_forms.trapezoid(change, v, a) if a < np.inf else change / v)
    return time


def arms_of(robot):
    """Attachments from the mass centre, (n, 3)."""
    points = robot["platform_points"]
    return np.zeros((len(robot["base_points"]), 3)) if points is None else np.subtract(points, robot["centre_of_mass"])


def grown(most, h, speed):
    """Bound of a displacement from rest at the ends of cells, (j, cells), from accelerations (j, cells)."""
    after = np.minimum(np.cumsum(most, axis=1) * h, speed)
    before = np.concatenate([np.zeros((len(most), 1)), after[:, :-1]], axis=1)
    return np.cumsum(np.minimum(before * h + 0.5 * h**2 * most, speed * h), axis=1)


class Reach:
    """What tensions and the weight can do to the mass centre of a robot between two poses."""

    def __init__(self, robot, limits, start, end):
        self.base, self.gravity = np.asarray(robot["base_points"], float), any_motion.gravity(robot)
        self.low, self.high = (x / robot["mass"] for x in path_rows.tension_range(robot, limits))
        self.arms = np.linalg.norm(arms_of(robot), axis=1)
        self.speed, self.most = (limits.get(k) or np.inf for k in ("speed_max", "acceleration_max"))
        self.ends = np.array([start.position, end.position], float)
        ahead = (self.ends[1] - self.ends[0]) * [1.0, 1.0, 0.0] + [1e-12, 0.0, 0.0]
        ahead /= np.linalg.norm(ahead)
        self.axes = np.stack([ahead, [-ahead[1], ahead[0], 0.0], [0.0, 0.0, 1.0]])

    def largest(self, e, low, high):
        """Largest accelerations (k,), not negative, along vectors e (k, 3), in boxes (k, 3) along the axes."""
        towards = self.base - ((0.5 * (low + high)) @ self.axes)[:, None]
        far, size = np.linalg.norm(towards, axis=2), np.linalg.norm(e, axis=1) + 1e-300
        radius = 0.5 * np.linalg.norm(high - low, axis=1)[:, None] + self.arms
        # An attachment is in a ball: its spool, seen from there, is within a cone about where the centre sees it.
        cone = np.where(radius < far, np.arcsin(np.minimum(radius / far, 1.0)), math.pi)
        away = np.arccos(np.clip(np.einsum("kd,knd->kn", e, towards) / far / size[:, None], -1.0, 1.0))
        c = np.cos(np.maximum(away - cone, 0.0)) * size[:, None]
        pulls = np.maximum(np.where(c == 0.0, 0.0, c * self.high), np.where(c == 0.0, 0.0, c * self.low))
        return np.clip(e @ self.gravity + pulls.sum(1), 0.0, self.most * size)

    def boxes(self, time):
        """Boxes that the mass centre is in, two arrays (CELLS, 3) along the axes; None if there is none."""
        h, ends = time / CELLS, self.ends @ self.axes.T
        most = np.full((6, CELLS), min(self.most, np.sum(self.high) + np.linalg.norm(self.gravity)))
        for _ in range(ROUNDS):
            # Accelerations are the same backwards in time.
            ahead, back = grown(most, h, self.speed), grown(most[:, ::-1], h, self.speed)[:, ::-1]
            high = np.minimum(ends[0] + ahead[:3].T, ends[1] + back[:3].T)
            low = np.maximum(ends[0] - ahead[3:].T, ends[1] - back[3:].T)
            if (low > high).any():
                return None
            both = np.concatenate([self.axes, -self.axes])
            made = [self.largest(np.tile(e, (CELLS, 1)), low, high) for e in both]
            most = np.minimum(most, made)
        return low, high

    def refutes(self, time):
        """Whether no motion takes this time, or a shorter one."""
        if not np.isfinite(min(self.most, np.sum(self.high))):
            return False
        boxes = self.boxes(time)
        if boxes is None:
            return True
        d = self.ends[1] - self.ends[0]
        size, fraction = np.linalg.norm(d), np.linspace(1.0, 0.0, CELLS + 1)[:, None]
        d = d / size

        def excess(x):
            """What accelerations can do for constant and for growing weights, less what they have to do; or more."""
            weights = (x[:3] + fraction * (d + x[3:] - d * (x[3:] @ d))) / size
            # What is convex is below its chords.
            ends = self.largest(weights[:-1], *boxes), self.largest(weights[1:], *boxes)
            return 0.5 * np.sum(ends) / CELLS * time**2 - 1.0

        def stop(intermediate_result):
            if intermediate_result.fun < -ROUNDING:
                raise StopIteration

        x = np.concatenate([-0.5 * d, np.zeros(3)])
        for method, steps in (("BFGS", 100), ("Nelder-Mead", 1000), ("BFGS", 100)):
            answer = minimize(excess, x, method=method, callback=stop, options={"maxiter": steps})
            if answer.fun < -ROUNDING:
                return True
            x = answer.x
        return False


def least(robot, limits, start, end, near=1e-3):
    """Bound of the time of all motions from below, s; as near to the largest one as a share."""
    reach, low = Reach(robot, limits, start, end), trapezoids(robot, limits, start, end)
    high = max(low, 1e-3 * math.sqrt(np.linalg.norm(reach.ends[1] - reach.ends[0])))
    while reach.refutes(high):
        low, high = high, 1.5 * high
    while high > (1.0 + near) * low > 0.0:
        middle = math.sqrt(low * high)
        low, high = (middle, high) if reach.refutes(middle) else (low, middle)
    return low
