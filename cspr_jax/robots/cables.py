"""Cables of any robot: diameters and pulleys; tensions, lengths and rates, with the balance of its kind of robot."""

from __future__ import annotations

import dataclasses
from functools import partial
from typing import Any, TypeAlias, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.errors import InputError
from cspr_jax.errors.arguments import Axes, Diameter, Radii, Stiffnesses, Winch
from cspr_jax.numerics.elementary import as_float64, solved
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.limits import NO_LIMITS, Limits
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.platform import PlatformRobot, platform_radius
from cspr_jax.robots.model.point_mass import PointMassRobot
from cspr_jax.robots.model.pulleys import pulleys_of
from cspr_jax.robots.model.robot import MOVED
from cspr_jax.robots.model.state import State
from cspr_jax.robots.model.tension_rule_table import CENTRED
from cspr_jax.robots.model.winches import tensions_within, winch_limits, winches_of
from cspr_jax.robots.statics import force_balance, wrench_balance
from cspr_jax.robots.statics.wrench_sets import tension_range
from cspr_jax.robots.tensions.tension_distribution import Distribution
from cspr_jax.robots.tensions.tension_distribution import centred as most_central
from cspr_jax.robots.tensions.tension_rules import by_rule

AnyRobot: TypeAlias = PointMassRobot | PlatformRobot
# Limits of winches that bound tensions.
BOUNDING = {"motor_torque_max", "motor_power_max", "motor_load_max"}
RobotKind = TypeVar("RobotKind", bound=AnyRobot)


def with_cables(
    robot: RobotKind,
    *,
    cable_diameter: Diameter | None = None,
    pulley_radius: Radii | None = None,
    pulley_axes: Axes | None = None,
    axial_stiffness: Stiffnesses | None = None,
    winch: Winch | None = None,
) -> RobotKind:
    """A robot with thick or elastic cables, pulleys, or winches.

    Args:
        cable_diameter: diameter of the cables, m; None: 0.
        pulley_radius: () or (n_cables,) radii of the pulleys, m; None: no pulleys.
        pulley_axes: (3,) or (n_cables, 3) swivel axes, in the direction in which the cables enter; None: straight up.
        axial_stiffness: () or (n_cables,) axial stiffness EA of the cables, N; None: they do not stretch.
        winch: numbers of the winches and their limits, one for all or one per cable, by the keys of [winch] in robot
            files; None: not known.

    Returns:
        the robot.

    Raises:
        InputError: an impossible diameter or stiffness, or impossible pulleys or winches.
    """
    changes: dict[str, Any] = {}
    if cable_diameter is not None:
        if not 0.0 <= cable_diameter < np.inf:
            raise InputError("cable_diameter", cable_diameter, "a number >= 0, in m")
        changes["cable_diameter"] = as_float64(cable_diameter)
    if pulley_radius is not None:
        pulleys = pulleys_of(pulley_radius, pulley_axes, robot.n_cables, robot.z_axis)
        if PATTERNS[robot.pattern].is_planar and np.asarray(pulleys.axes)[:, 1].any():
            raise InputError("pulley_axes", pulley_axes, "vectors with y = 0: the plane of a planar robot")
        changes["pulleys"] = pulleys
    elif pulley_axes is not None:
        raise InputError("pulley_axes", pulley_axes, "absent without pulley_radius")
    if axial_stiffness is not None:
        stiffness, allowed = np.asarray(axial_stiffness, float), f"a number > 0, in N, or {robot.n_cables}: one a cable"
        if stiffness.shape not in ((), (robot.n_cables,)) or not ((stiffness > 0.0) & np.isfinite(stiffness)).all():
            raise InputError("axial_stiffness", axial_stiffness, allowed)
        changes["axial_stiffness"] = as_float64(np.broadcast_to(stiffness, (robot.n_cables,)))
    if winch is not None:
        diameter = robot.cable_diameter if cable_diameter is None else cable_diameter
        changes["winches"] = winches_of(winch, robot.n_cables, diameter, "winch.")
        of_winch: dict[str, Any] = winch_limits(winch, robot.n_cables, "winch.")
        changes["limits"] = dataclasses.replace(robot.limits, **of_winch)
    return dataclasses.replace(robot, **changes) if changes else robot


@partial(jax.jit, static_argnames=("rule",))
def tensions(
    robot: AnyRobot, state: State, limits: Limits = NO_LIMITS, rule: str = CENTRED
) -> Float[Array, "n_cables"]:
    """Cable tensions; those of redundant cables are chosen by a rule."""
    if robot.n_cables > robot.dof:
        return shared(robot, state, limits, rule).tensions
    if robot.pulleys is not None or robot.pattern not in MOVED:
        matrix, wrench = _balance(robot, state)
        return solved(matrix, wrench[:, None])[0][:, 0]
    if isinstance(robot, PlatformRobot):
        return wrench_balance.tensions(robot, state)
    return force_balance.tensions(robot, state.position, state.acceleration)


def shared(robot: AnyRobot, state: State, limits: Limits, rule: str) -> Distribution:
    """Tensions of redundant cables, with their residual; within limits of their motors, if there are such."""
    return by_rule(rule, *_balance(robot, state), *_range(robot, state, limits))


def margin(robot: AnyRobot, state: State, limits: Limits) -> Float[Array, ""]:
    """Largest distance that tensions can keep from their limits, N; -inf where the cables do not span all wrenches."""
    return most_central(*_balance(robot, state), *_range(robot, state, limits))[1]


def _balance(robot: AnyRobot, state: State) -> tuple[Array, Array]:
    unit = wrench_units(robot)
    return robot.wrench_matrix(state) / unit[:, None], robot.inertial_wrench(state) / unit


def _range(robot: AnyRobot, state: State, limits: Limits) -> tuple[Array, Array]:
    # Smallest and largest tensions, also those that motors allow.
    low, high = tension_range(robot, limits)
    if robot.winches is not None and BOUNDING & {name for name, value in vars(limits).items() if value is not None}:
        return tensions_within(robot.winches, limits, cable_motion(robot, state), (low, high))
    return low, high


def wrench_units(robot: AnyRobot) -> Float[Array, "dof"]:
    """Divisors that make components of wrenches comparable: 1 for forces, the platform's radius for moments."""
    forces = np.ones(len(PATTERNS[robot.pattern].forces))
    if not isinstance(robot, PlatformRobot):
        return jnp.asarray(forces)
    radius = platform_radius(robot)
    return jnp.concatenate([jnp.asarray(forces), jnp.full(robot.dof - len(forces), radius)])


def cable_motion(
    robot: AnyRobot, state: State
) -> tuple[Float[Array, "n_cables"], Float[Array, "n_cables"], Float[Array, "n_cables"]]:
    """Lengths of the cables and their first two derivatives in time."""
    if isinstance(robot, PlatformRobot):
        return wrench_balance.cable_motion(robot, state)
    return force_balance.cable_motion(robot, state.position, state.velocity, state.acceleration)
