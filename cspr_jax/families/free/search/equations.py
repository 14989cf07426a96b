"""Equations and bounds of a motion at one time, for a search.

Values are the tensions over the weight, and all other limited quantities over their limits. All values are unknowns:
equations say that the tensions balance the motion, and that the other values are those of its state. So redundant
cables need no rule, and no matrix is inverted; that of a platform may be singular on the path.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.curves.spline import turning_of
from cspr_jax.motion.limits import other_limits
from cspr_jax.numerics.linear import rotations
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.cables import AnyRobot, cable_motion, wrench_units
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.point_mass import in_one_plane, plane_normal, spool_radius
from cspr_jax.robots.model.state import State
from cspr_jax.robots.statics.wrench_sets import tension_range
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.verification.criteria import BELOW, Criterion, pose_conditions

BATCH = 128
# Number of entries of x after the coordinates and their derivatives.
SCALARS = 2
# Highest derivative of the pose on which a quantity depends.
ORDERS = {"depth": 0, "length": 0, "speed": 1, "mass_centre_speed": 1, "acceleration": 2, "mass_centre_acceleration": 2}
# Smallest depth below the spool plane that a search allows, over the robot's radius.
DEPTH = 0.02


def coordinates(pattern: str) -> tuple[np.ndarray, np.ndarray]:
    """Indices of the coordinates of position and of rotation of an effector."""
    pattern_row = PATTERNS[pattern]
    return np.array(pattern_row.forces, int), np.array(pattern_row.moments, int)


def state_of(robot: AnyRobot, reference: Float[Array, "4"], *motion: Float[Array, "d"]) -> State:
    """State of a motion at one time."""
    along, about = coordinates(robot.pattern)
    position, velocity, acceleration = (jnp.zeros(3).at[along].set(part[: len(along)]) for part in motion)
    if not len(about):
        return State(position, velocity, acceleration)
    quaternions = (
        jnp.zeros(4).at[0].set(first).at[1 + about].set(part[len(along) :])
        for part, first in zip(motion, (1.0, 0.0, 0.0), strict=True)
    )
    turning = turning_of(*(rotations.product(one, reference) for one in quaternions))
    return State(position, velocity, acceleration, *turning[:3])


def keeps_depth(robot: AnyRobot) -> bool:
    """Tell whether the depth below the spool plane is one of the values."""
    return pose_conditions(robot)[1] or (robot.pattern in BELOW and not PATTERNS[robot.pattern].is_body)


def _other_values(robot: AnyRobot, limits: Limits, state: State) -> Array:
    # Return values other than tensions, duration and determinant: over limits, squares for the mass centre; depths over
    # the robot's radius.
    length, rate, second_derivative = cable_motion(robot, state)
    radius = spool_radius(robot)
    values = {
        "depth": state.position[2:],
        "length": length,
        "speed": rate,
        "acceleration": second_derivative,
        "mass_centre_speed": jnp.sum(state.velocity**2, keepdims=True),
        "mass_centre_acceleration": jnp.sum(state.acceleration**2, keepdims=True),
    }
    parts = []
    for limit in other_limits(limits):
        allowed = jnp.atleast_1d(jnp.asarray(getattr(limits, limit.name)))
        scale = radius if limit.is_height else allowed**2 if limit.of_mass_centre else allowed
        parts.append(values[limit.quantity] / scale)
    if keeps_depth(robot):
        parts.append(jnp.dot(plane_normal(robot), state.position)[None] / radius)
    return jnp.concatenate(parts) if parts else jnp.zeros(0)


def residual_at(
    robot: AnyRobot,
    limits: Limits,
    reference: Float[Array, "4"],
    motion: Sequence[Array],
    tensions: Float[Array, "n_cables"],
) -> Float[Array, "n_equations"]:
    """Residual of the equations at one time, without those for duration and determinant."""
    state, unit = state_of(robot, reference, *motion), wrench_units(robot)
    wrench = robot.wrench_matrix(state) @ tensions - robot.inertial_wrench(state) / (robot.mass * robot.gravity)
    return jnp.concatenate([wrench / unit, -_other_values(robot, limits, state)])


class ValueBounds(NamedTuple):
    """Bounds of the values at one time, and how criteria tighten them.

    Fields:
        low: (n_values,) lower bounds, -inf for none.
        high: (n_values,) upper bounds, inf for none.
        rises: (n_criteria, n_values) increase of a lower bound that increases the slack of a criterion by 1.
        falls: (n_criteria, n_values) decrease of an upper bound that does the same.
        orders: (n_values,) highest derivative of the pose on which a value depends; 3 if it depends on tensions, too.
        determinant: index of the value that is the determinant; None without one.
        depth: index of the value that is the depth below the spool plane, over the robot's radius; None without such a
            plane.
    """

    low: np.ndarray
    high: np.ndarray
    rises: np.ndarray
    falls: np.ndarray
    orders: np.ndarray
    determinant: int | None = None
    depth: int | None = None


class _Value(NamedTuple):
    # A value: its bounds, their flags, its cable or -1, its change when the slack grows by 1, and its order.
    low: float
    high: float
    low_flag: Verdict
    high_flag: Verdict
    cable: int
    change: float
    order: int


def bounds(robot: AnyRobot, limits: Limits, criteria: Sequence[Criterion], is_timed: bool = False) -> ValueBounds:
    """Bounds of the values."""
    weight, radius = float(robot.mass * robot.gravity), float(spool_radius(robot))
    infeasible, numbers = Verdict.WRENCH_INFEASIBLE, range(robot.n_cables)
    low, high = (np.asarray(side) / weight for side in tension_range(robot, limits))
    slack, over = Verdict.SLACK_CABLE | infeasible, Verdict.OVER_TENSION | infeasible
    # The motion does not determine tensions of redundant cables.
    order = 2 if robot.n_cables == robot.dof else 3
    values = [_Value(low[k], high[k], slack, over, k, 1.0 / weight, order) for k in numbers]
    for limit in other_limits(limits):
        allowed = np.broadcast_to(getattr(limits, limit.name), robot.n_cables if limit.per_cable else 1)
        for k, maximum in enumerate(allowed):
            # Squared values change twice as much.
            change = 1.0 / radius if limit.is_height else (2.0 if limit.of_mass_centre else 1.0) / maximum
            top = maximum / radius if limit.is_height else 1.0
            bottom = -1.0 if limit.quantity in ("speed", "acceleration") else -np.inf
            cable, flag = k if limit.per_cable else -1, limit.flag
            flag |= Verdict.MOTOR_TOO_FAST if limit.quantity == "speed" else Verdict.FEASIBLE
            values.append(_Value(bottom, top, flag, flag, cable, change, ORDERS[limit.quantity]))
    is_regular, _ = pose_conditions(robot)
    is_divided = isinstance(robot, PlatformRobot) or in_one_plane(robot)
    if keeps_depth(robot):
        minimum = DEPTH if is_divided else -np.inf
        values.append(_Value(minimum, np.inf, Verdict.ABOVE_SPOOLS, Verdict.FEASIBLE, -1, 1.0 / radius, 0))
    if is_timed:
        values.append(_Value(-np.inf, 1.0, Verdict.FEASIBLE, Verdict.FEASIBLE, -1, 0.0, 3))
    if is_regular:
        # The determinant keeps the sign that it has at the poses: `poses.tasks_of` bounds it, as it does the depth.
        values.append(_Value(-np.inf, np.inf, Verdict.SINGULAR, Verdict.SINGULAR, -1, 0.0, 0))

    def changes(side: str, bound: str) -> np.ndarray:
        return np.array(
            [
                [
                    # Speeds of cables stand for those of motors; both are over their limits.
                    (1.0 / limit.allowed if limit.flag == Verdict.MOTOR_TOO_FAST else value.change)
                    if getattr(value, side) & limit.flag
                    and value.cable in (*(limit.cables or numbers), -1)
                    and np.isfinite(getattr(value, bound))
                    else 0.0
                    for value in values
                ]
                for limit in criteria
            ]
        )

    low, high = (np.array([getattr(value, side) for value in values]) for side in ("low", "high"))
    index_of = {value.low_flag: k for k, value in enumerate(values)}
    depth = index_of.get(Verdict.ABOVE_SPOOLS) if is_divided else None
    sides = changes("low_flag", "low"), changes("high_flag", "high")
    orders = np.array([value.order for value in values])
    return ValueBounds(low, high, *sides, orders, determinant=index_of.get(Verdict.SINGULAR), depth=depth)
