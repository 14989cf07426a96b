"""Why no motion runs along a section: a point that no path speed can pass, or an end whose speed is not possible."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import numpy as np
from scipy.optimize import linprog

from cspr_jax.families.paths.least_time.constraints import TANGENTS, face_count, unit_wrenches
from cspr_jax.families.paths.least_time.controllable import FLAT, GridSolution
from cspr_jax.families.paths.least_time.discrete import Discrete
from cspr_jax.families.paths.least_time.motor_bounds import SIDES
from cspr_jax.families.paths.least_time.nodes import points_on, state_at
from cspr_jax.motion.limits import motor_limits_set
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.state import State
from cspr_jax.robots.statics.wrench_sets import spanning, tension_range
from cspr_jax.schema.limits import LIMITS
from cspr_jax.schema.verdicts import Verdict

FLAGS = {row.name: row.flag for row in LIMITS}
# Flag of a criterion, and index of its cable, or None.
HalfPlaneName = tuple[Verdict, int | None]
MISSED = 1e-9  # smallest violation of a tension's limit that counts, over the weight
DIGITS = 4  # digits of numbers in messages


def half_plane_names(
    problem: Problem, state: State, u: Float[np.ndarray, "n_rows"], x: Float[np.ndarray, "n_rows"]
) -> list[HalfPlaneName]:
    """Names of the half-planes at one point, in the order of `constraints.path_half_planes`."""
    robot, limits = problem.robot, problem.limits
    names = _of_faces(problem, state, np.stack([u, x], axis=1))
    if limits.cable_acceleration_max is not None:
        names += [(Verdict.CABLE_OVER_ACCELERATION, k) for k in range(robot.n_cables)] * 2
    if getattr(limits, "acceleration_max", None) is not None:
        names += [(FLAGS["acceleration_max"], None)] * (TANGENTS + 1)
    return names + ([] if robot.winches is None else _of_motors(problem))


def _of_motors(problem: Problem) -> list[HalfPlaneName]:
    robot, rows = problem.robot, motor_limits_set(problem.limits)
    if robot.n_cables > robot.dof:
        return [(Verdict.WRENCH_INFEASIBLE, None)] * face_count(robot)
    names: list[HalfPlaneName] = [(row.flag, k) for row in rows for _ in SIDES[0] for k in range(robot.n_cables)]
    return names * 2


def _of_faces(problem: Problem, state: State, coefficients: np.ndarray) -> list[HalfPlaneName]:
    # With as many cables as degrees of freedom, all cables but one span a face. The half-plane of this face limits the
    # tension of that cable: from below if the tension falls as the half-plane's left side grows, else from above.
    robot = problem.robot
    count = face_count(robot)
    if robot.n_cables > robot.dof:
        return [(Verdict.WRENCH_INFEASIBLE, None)] * count
    parts = unit_wrenches(robot, state)
    tensions = np.linalg.solve(parts.matrix, np.stack([parts.momentum, parts.momentum_rate], axis=1))
    beside = [set(range(robot.n_cables)) - set(chosen) for chosen in spanning(robot.n_cables, robot.dof).tolist()]
    cables = [cable for others in beside for cable in others] * 2
    is_smallest = [tensions[cable] @ fraction < 0.0 for cable, fraction in zip(cables, coefficients, strict=False)]
    return [
        (Verdict.SLACK_CABLE if minimum else Verdict.OVER_TENSION, cable)
        for minimum, cable in zip(is_smallest, cables, strict=True)
    ]


# Name of a bound that no half-plane at the point sets: the path speeds from which the end can be reached.
REST_OF_PATH = None


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


class NoMotion(NamedTuple):
    """Why no motion runs along a section.

    Fields:
        coordinate: s of the point at which the motion fails, m.
        position: (3,) this point, in the axes of the kernels, m.
        names: flags and cables of the criterion that needs a path acceleration at the point, and of the one that
            forbids it; None for the rest of the path, which limits the speed; () if the speed at an end is refused.
        needed: this acceleration, m/s^2; at an end the refused speed, m/s.
        allowed: the acceleration nearest to it that the other criterion allows, m/s^2; at an end the nearest possible
            speed, m/s.
        end: "start" or "end" if the speed there is not possible, else "".
        speeds: smallest and largest possible speed at such an end, m/s.
        static_tension: tension that prevents rest at the point; None if the robot can rest there.
    """

    coordinate: float
    position: np.ndarray
    names: tuple[HalfPlaneName | None, ...]
    needed: float
    allowed: float
    end: str = ""
    speeds: tuple[float, float] = (np.nan, np.nan)
    static_tension: StaticTension | None = None


def refusal(problem: Problem, path: Discrete, solution: GridSolution) -> NoMotion:
    """Tell why there is no motion along a section."""
    cell, n_cells = int(solution.empty), len(path.grid.width)
    node = max(cell, 0)
    state = _state(path, node)
    position = np.asarray(state.position)
    # A body that only turns has no path acceleration in m/s^2.
    scale, coordinate = float(np.linalg.norm(state.velocity)) or np.nan, float(path.grid.nodes[node])
    static = _static_tension(problem, path, node)
    if 0 <= cell < n_cells:
        needed, allowed, indices = _contradiction(path, solution, cell)
        half_planes = half_plane_names(problem, state, *(np.asarray(fraction[cell]) for fraction in path.start[:2]))
        # Indices count the half-planes at both ends of a cell; larger ones are those that lead into the next set.
        names = tuple(half_planes[k % len(half_planes)] if k < 2 * len(half_planes) else REST_OF_PATH for k in indices)
        return NoMotion(coordinate, position, names, scale * needed, scale * allowed, static_tension=static)
    is_start = cell < 0
    ends = (solution.low[0], solution.high[0]) if is_start else (0.0, path.cap()[-1])
    low, high = (scale * float(np.sqrt(max(x, 0.0))) for x in ends)
    speed = scale * float(np.sqrt(path.ends[0 if is_start else 1]))
    nearest = low if speed < low else high
    return NoMotion(coordinate, position, (), speed, nearest, "start" if is_start else "end", (low, high), static)


def _state(path: Discrete, node: int) -> State:
    points = points_on(path.section.curve, path.grid.nodes[[node]], ahead=node < len(path.grid.width))
    return jax.jit(state_at)(jax.tree.map(lambda x: x[0], points))


def _static_tension(problem: Problem, path: Discrete, node: int) -> StaticTension | None:
    # Return the tension that prevents rest at the node itself, or else at an end where the motion is to rest.
    ends = [end for end, x in zip((0, len(path.grid.width)), path.ends, strict=True) if x == 0.0]
    tensions = (static_tension(problem, _state(path, each)) for each in (node, *ends))
    return next((tension for tension in tensions if tension is not None), None)


def _contradiction(path: Discrete, solution: GridSolution, cell: int) -> tuple[float, float, tuple[int, ...]]:
    # At the path speed that is closest to possible, return the path acceleration that one half-plane needs, the largest
    # one that another allows, and the indices of both.
    start, end, twice = path.start, path.end, 2.0 * float(path.grid.width[cell])
    u = np.concatenate([start.u[cell], end.u[cell] + twice * end.x[cell], [twice, -twice]])
    x = np.concatenate([start.x[cell], end.x[cell], [1.0, -1.0]])
    ahead = [solution.high[cell + 1], -solution.low[cell + 1]]
    maximum = np.concatenate([start.bound[cell], end.bound[cell], ahead])
    table = np.stack([np.where(u > FLAT, u, 0.0), np.where(u < -FLAT, u, 0.0), x], axis=1)
    bounds = [(None, None), (None, None), (0.0, float(path.cap()[cell]))]
    optimum = linprog([-1.0, 1.0, 0.0], table, maximum, bounds=bounds)
    best = 0.0 if optimum.x is None else optimum.x[2]
    over = np.where(np.abs(u) > FLAT, u, 1.0)
    values = (maximum - x * best) / over
    upper, lower = np.where(u > FLAT, values, np.inf), np.where(u < -FLAT, values, -np.inf)
    minimum, largest = int(lower.argmax()), int(upper.argmin())
    if upper[largest] >= lower[minimum]:  # the half-plane that forbids the point does not bound u
        alone = int(np.where(np.abs(u) > FLAT, np.inf, maximum - x * best).argmin())
        return np.nan, np.nan, (alone,)
    return float(lower[minimum]), float(upper[largest]), (minimum, largest)
