"""Cables of any robot at one instant: tensions, lengths and their rates, by the balance of its kind."""

from typing import TypeAlias

from jax import Array

from cspr_jax.robots import force_balance, wrench_balance
from cspr_jax.robots.platform import PlatformRobot
from cspr_jax.robots.point_mass import PointMassRobot
from cspr_jax.robots.state import State

AnyRobot: TypeAlias = PointMassRobot | PlatformRobot


def tensions(robot: AnyRobot, state: State) -> Array:
    """Cable tensions.

    Args:
        robot: z down, with as many cables as degrees of freedom.
        state: in the robot's axes.

    Returns:
        (n_cables,) in cable order, N; negative where a cable would have to push.
    """
    if isinstance(robot, PlatformRobot):
        return wrench_balance.tensions(robot, state)
    return force_balance.tensions(robot, state.position, state.acceleration)


def cable_motion(robot: AnyRobot, state: State) -> tuple[Array, Array, Array]:
    """Lengths of the cables and their first two derivatives in time.

    Args:
        robot: the robot.
        state: in the robot's axes.

    Returns:
        lengths (n_cables,) m, rates (n_cables,) m/s (positive pays out), accelerations (n_cables,) m/s^2.
    """
    if isinstance(robot, PlatformRobot):
        return wrench_balance.cable_motion(robot, state)
    return force_balance.cable_motion(robot, state.position, state.velocity, state.acceleration)
