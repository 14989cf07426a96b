"""Limits of a state: those that are set, the quantities that they bound, and their slacks."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.numerics.elementary import as_float64, maximum_of, minimum_of
from cspr_jax.numerics.shapes import Bool, Float
from cspr_jax.numerics.tolerances import TOUCHED
from cspr_jax.robots import cables
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.limits import NO_LIMITS, Limits
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.point_mass import spool_radius
from cspr_jax.robots.model.state import State
from cspr_jax.robots.model.winches import Winches, largest_radii
from cspr_jax.schema.limits import LIMITS, Limit
from cspr_jax.schema.verdicts import Verdict


def limits_set(limits: Limits) -> tuple[Limit, ...]:
    """Rows of the limits that are set, without those of winches, in the order of their slacks."""
    return tuple(row for row in LIMITS if getattr(limits, row.name) is not None and not row.of_winch)


def motor_limits_set(limits: Limits) -> tuple[Limit, ...]:
    """Rows of the limits of winches that are set and bound each time, in the order of their slacks."""
    names = [row.name for row in LIMITS if row.of_winch and row.flag != Verdict.MOTOR_OVER_TORQUE_RMS]
    return tuple(row for row in LIMITS if row.name in names and getattr(limits, row.name) is not None)


def has_motor_limits(limits: Limits) -> bool:
    """Tell whether limits of winches are set."""
    return bool(motor_limits_set(limits)) or limits.motor_torque_rms_max is not None


def without_motors(limits: Limits) -> Limits:
    """Limits without those of winches."""
    names = [row.name for row in LIMITS if row.of_winch and getattr(limits, row.name) is not None]
    return dataclasses.replace(limits, **dict.fromkeys(names)) if names else limits


def choosing_limits(robot: AnyRobot, limits: Limits) -> Limits:
    """Limits among which tensions are chosen: none without a choice, so that robots share compiled functions."""
    return limits if robot.n_cables > robot.dof else NO_LIMITS


def search_limits(robot: AnyRobot, limits: Limits) -> Limits:
    """Limits for searches, without motors: at these cable speeds no motor is too fast, on no layer of its drum."""
    return _with_motor_speeds(limits, robot.winches, lambda winches: winches.drum_radius)


def necessary_limits(robot: AnyRobot, limits: Limits) -> Limits:
    """Limits for lower bounds, without motors: motions that keep the limits of motors keep these cable speeds."""
    return _with_motor_speeds(limits, robot.winches, largest_radii)


def _with_motor_speeds(limits: Limits, winches: Winches | None, radii: Callable[[Winches], Array]) -> Limits:
    plain, largest = without_motors(limits), limits.motor_speed_max
    if winches is None or largest is None:
        return plain
    maximum = np.asarray(largest * radii(winches) / winches.gear_ratio)
    if limits.cable_speed_max is not None:
        maximum = np.minimum(maximum, limits.cable_speed_max)
    return dataclasses.replace(plain, cable_speed_max=as_float64(maximum))


def are_of_motors(limits: Limits, searched: Limits) -> Bool[np.ndarray, "n_cables"]:
    """Tell which cable speeds of `search_limits` are those of the motors."""
    maximum = np.asarray(searched.cable_speed_max)
    return np.ones(maximum.shape, bool) if limits.cable_speed_max is None else maximum < limits.cable_speed_max


def allowance(row: Limit, limit: np.ndarray | float, robot: AnyRobot) -> np.ndarray | float:
    """Amount by which a motion may exceed a limit: a fraction of the limit; for the floor, of the spools' radius."""
    return TOUCHED * (np.asarray(spool_radius(robot)) if row.is_height else limit)


def touchable_limits(robot: AnyRobot, limits: Limits) -> Limits:
    """Limits widened by `allowance`, for proofs: a motion that touches a limit keeps it."""
    rows = (*limits_set(limits), *motor_limits_set(limits))
    values = {row: np.asarray(getattr(limits, row.name), float) for row in rows}
    signs = {"most": 1.0, "least": -1.0}
    wider: dict[str, Any] = {
        row.name: limit + signs[row.sense] * allowance(row, limit, robot) for row, limit in values.items()
    }
    return dataclasses.replace(limits, **wider)


class Values(NamedTuple):
    """Quantities of a state that limits bound.

    Fields:
        tension: (n_cables,) N.
        depth: () z of the lowest point of the effector, z down, m.
        length: (n_cables,) lengths of the cables, m.
        speed: (n_cables,) magnitudes of their rates, m/s.
        acceleration: (n_cables,) magnitudes of their second derivatives, m/s^2.
        mass_centre_speed: () m/s.
        mass_centre_acceleration: () magnitude, m/s^2.
    """

    tension: Array
    depth: Array
    length: Array
    speed: Array
    acceleration: Array
    mass_centre_speed: Array
    mass_centre_acceleration: Array


def values(robot: AnyRobot, state: State) -> Values:
    """Quantities of a state that limits bound."""
    return _values(robot, state, cables.tensions(robot, state))


def lowest_depth(robot: AnyRobot, state: State, corners: Float[Array, "m 3"] | None = None) -> Float[Array, ""]:
    """Depth of the lowest point of the effector: mass centre, or joint, attachment points, and corners of its shape."""
    if not isinstance(robot, PlatformRobot):
        return state.position[2]
    points = robot.platform_points if corners is None else jnp.concatenate([robot.platform_points, corners])
    return state.position[2] + jnp.maximum(maximum_of(points @ state.rotation[2]), 0.0)


def _values(robot: AnyRobot, state: State, tensions: Array) -> Values:
    length, rate, second_derivative = cables.cable_motion(robot, state)
    of_cables = lowest_depth(robot, state), length, jnp.abs(rate), jnp.abs(second_derivative)
    return Values(tensions, *of_cables, jnp.linalg.norm(state.velocity), jnp.linalg.norm(state.acceleration))


def scales(n_cables: int, weight: Float[Array, ""], z0: Float[Array, "..."]) -> dict[str, tuple[float, Array]]:
    """Scales that make slacks dimensionless; slacks of quantities without a scale are relative to the limit."""
    return {"tension": (float(n_cables), weight), "depth": (1.0, z0)}


def slack(
    row: Limit, limit: Float[Array, "..."], value: Float[Array, "..."], scale: Mapping[str, tuple[float, Array]]
) -> Float[Array, "..."]:
    """Slack of a limit: positive exactly while it is met, and free of units."""
    if row.quantity not in scale:
        fraction = value / limit
        return 1.0 - fraction if row.sense == "most" else fraction - 1.0
    factor, unit = scale[row.quantity]
    return (limit - value if row.sense == "most" else value - limit) * factor / unit


def other_limits(limits: Limits) -> list[Limit]:
    """Rows of the limits that are set, except limits of tensions, which the margin of redundant cables includes."""
    return [row for row in limits_set(limits) if row.quantity != "tension"]


def other_slacks(robot: AnyRobot, limits: Limits, state: State, z0: Float[Array, ""]) -> list[Array]:
    """Smallest slack of each of `other_limits`."""
    quantities = _values(robot, state, jnp.zeros(robot.n_cables))
    scale = scales(robot.n_cables, robot.mass * robot.gravity, z0)
    return [
        minimum_of(slack(row, getattr(limits, row.name), getattr(quantities, row.quantity), scale))
        for row in other_limits(limits)
    ]
