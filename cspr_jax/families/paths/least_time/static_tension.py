"""Tension that prevents a robot from being at rest at a point."""

from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import linprog

from cspr_jax.families.paths.least_time.constraints import unit_wrenches
from cspr_jax.motion.problem import Problem
from cspr_jax.robots.model.state import State
from cspr_jax.robots.statics.wrench_sets import tension_range

MISSED = 1e-9  # smallest violation of a tension's limit that counts, over the weight
DIGITS = 4  # digits of numbers in messages


class StaticTension(NamedTuple):
    """Tension that breaks its limit in static equilibrium; the equilibrium has the smallest possible violations.

    Fields:
        cable: index of the cable, from 0.
        needed: tension in the equilibrium, N.
        allowed: limit that it breaks, N.
        is_largest: whether it is above the largest allowed tension, and not below the smallest one.
        position: (3,) the point, m.
    """

    cable: int
    needed: float
    allowed: float
    is_largest: bool
    position: np.ndarray

    @property
    def text(self) -> str:
        """The tension and its limit in words."""
        needed, allowed = (f"{value:.{DIGITS}g}" for value in (self.needed, self.allowed))
        if self.is_largest:
            return f"a tension of {needed} N is needed in cable {self.cable + 1}, {allowed} allowed"
        return f"cable {self.cable + 1} has a tension of {needed} N, at least {allowed} needed"

    def to_dict(self) -> dict[str, Any]:
        """The tension as the JSON of a plan has it."""
        return self._asdict() | {"position": self.position.tolist(), "unit": "N"}


def static_tension(problem: Problem, state: State) -> StaticTension | None:
    """The tension with the largest violation at rest, among tensions whose largest violation is smallest."""
    robot = problem.robot
    wrenches, count = unit_wrenches(robot, state), robot.n_cables
    low, high = (np.broadcast_to(side, count) for side in tension_range(robot, problem.limits))
    matrix, rest = np.asarray(wrenches.matrix, float), np.asarray(wrenches.rest, float)
    # Unknowns are the tensions, and the amount by which they may break their limits.
    has_high = np.isfinite(high)
    sides = np.vstack([-np.eye(count), np.eye(count)[has_high]])
    table = np.hstack([sides, -np.ones((len(sides), 1))])
    bounds = np.concatenate([-np.where(np.isfinite(low), low, 0.0), high[has_high]])
    balance = np.hstack([matrix, np.zeros((len(matrix), 1))])
    cost = np.append(np.zeros(count), 1.0)
    optimum = linprog(cost, table, bounds, balance, rest, bounds=[(None, None)] * (count + 1))
    if optimum.x is None or optimum.x[-1] <= MISSED * float(robot.mass * robot.gravity):
        return None
    tensions = optimum.x[:count]
    over = np.where(has_high, tensions - high, -np.inf)
    cable = int(np.maximum(over, low - tensions).argmax())
    is_largest = bool(over[cable] > low[cable] - tensions[cable])
    allowed = float(high[cable] if is_largest else low[cable])
    return StaticTension(cable, float(tensions[cable]), allowed, is_largest, np.asarray(state.position))
