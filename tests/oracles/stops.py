"""Stops by another way: SLSQP over splines from a state to rest anywhere, and dense checks of motions; NumPy and SciPy.

Point masses on as many cables as degrees of freedom, z down: tensions follow from the motion.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline
from scipy.optimize import linprog, minimize

DEGREE = 5


@dataclass(frozen=True)
class Hanging:
    """A point mass on cables: base (n, 3) m, z down; tensions between low and high, N; axes that move."""

    base: np.ndarray
    mass: float
    low: float
    high: float
    axes: tuple[int, ...] = (0, 1, 2)
    gravity: float = 9.81

    def tensions(self, position, acceleration):
        """Tensions (k, n) that give positions (k, 3) accelerations (k, 3)."""
        away = self.base - position[:, None]
        units = away / np.linalg.norm(away, axis=2, keepdims=True)
        force = self.mass * (acceleration - np.array([0.0, 0.0, self.gravity]))
        axes = list(self.axes)
        return np.linalg.solve(np.swapaxes(units[..., axes], 1, 2), force[:, axes, None])[..., 0]

    def supplies(self, position, acceleration, allowance):
        """Whether some tensions within their limits, widened by an allowance, supply an acceleration: any cables."""
        away = self.base - position
        units = (away / np.linalg.norm(away, axis=1, keepdims=True))[:, list(self.axes)].T
        force = self.mass * (acceleration - np.array([0.0, 0.0, self.gravity]))[list(self.axes)]
        bounds = [(self.low - allowance, self.high + allowance)] * len(self.base)
        return linprog(np.zeros(len(self.base)), A_eq=units, b_eq=force, bounds=bounds).status == 0


def least_stop(robot, position, velocity, acceleration, intervals=8, samples=48, starts=6, seed=0):
    """Least duration that SLSQP finds from a state to rest anywhere, inf without one."""
    rng, best, d = np.random.default_rng(seed), np.inf, len(robot.axes)
    knots = np.concatenate([np.zeros(DEGREE), np.linspace(0.0, 1.0, intervals + 1), np.ones(DEGREE)])
    count, tau = intervals + DEGREE, np.linspace(0.0, 1.0, samples)
    tables = [BSpline(knots, np.eye(count), DEGREE).derivative(k)(tau) for k in range(3)]
    tables[0] = BSpline(knots, np.eye(count), DEGREE)(tau)
    axes = list(robot.axes)
    x, v, a = (np.asarray(part, float)[axes] for part in (position, velocity, acceleration))

    def controls(z):
        duration, end, inner = np.exp(z[0]), z[1 : 1 + d], z[1 + d :].reshape(-1, d)
        first = x + duration * v / (DEGREE * intervals)
        bend = 2.0 * duration**2 * a / (DEGREE * (DEGREE - 1) * intervals**2)
        second = x + 3.0 * (first - x) + bend
        return duration, np.concatenate([[x, first, second], inner, [end, end, end]])

    def motion(z):
        duration, table = controls(z)
        parts = []
        for k in range(3):
            full = np.tile(np.asarray(position, float) * (k == 0), (samples, 1))
            full[:, axes] = tables[k] @ table / duration**k
            parts.append(full)
        return duration, parts

    def slacks(z):
        _, (place, _, pull) = motion(z)
        with np.errstate(all="ignore"):
            try:
                forces = robot.tensions(place, pull)
            except np.linalg.LinAlgError:
                return np.full(2 * samples * len(robot.base), -1e3)
        unit = robot.mass * robot.gravity
        both = np.concatenate([forces - robot.low, robot.high - forces]).ravel() / unit
        return np.clip(np.nan_to_num(both, nan=-1e3), -1e3, 1e3)

    speed = np.linalg.norm(v)
    for k in range(starts):
        duration = (0.25 + 2.0 * speed / robot.gravity) * (1.0, 2.0, 4.0)[k % 3]
        end = (
            x
            + 0.4 * duration * v * rng.uniform(0.3, 1.0)
            + (k > 2) * 0.3 * (robot.base.mean(0)[axes] - x) * (np.array(axes) != 2)
        )
        fraction = np.linspace(0.0, 1.0, count)[3:-3, None]
        z = np.concatenate([[np.log(duration)], end, (x + (end - x) * (2.0 * fraction - fraction**2)).ravel()])
        rules = [{"type": "ineq", "fun": slacks}]
        ranges = [(z[0] - 3.0, z[0] + 3.0), *((value - 2.0, value + 2.0) for value in z[1:])]
        with np.errstate(all="ignore"):
            found = minimize(
                lambda z: z[0], z, method="SLSQP", bounds=ranges, constraints=rules, options={"maxiter": 300}
            ).x
        if np.isfinite(found).all() and slacks(found).min() > -1e-5:
            best = min(best, float(np.exp(found[0])))
    return best
