"""Cables of any robot at one instant: tensions, lengths and their rates, by the balance of its kind."""

from jax import Array

from cspr_jax.robots import force_balance, wrench_balance
from cspr_jax.robots.platform import PlatformRobot
from cspr_jax.robots.point_mass import PointMassRobot
from cspr_jax.robots.state import State
from cspr_jax.robots.wrench_balance import Pose


def _pose(state: State) -> Pose:
    # Of a platform: nothing of it is None.
    return Pose(*(getattr(state, name) for name in Pose._fields))


def tensions(robot: PointMassRobot | PlatformRobot, state: State) -> Array:
    """Cable tensions.

    Args:
        robot: z down, with as many cables as degrees of freedom.
        state: in the robot's axes.

    Returns:
        (n_cables,) in cable order, N; negative where a cable would have to push.
    """
    if isinstance(robot, PlatformRobot):
        return wrench_balance.tensions(robot, _pose(state))
    return force_balance.tensions(robot, state.position, state.acceleration)


def cable_motion(robot: PointMassRobot | PlatformRobot, state: State) -> tuple[Array, Array, Array]:
    """Lengths of the cables and their first two derivatives in time.

    Args:
        robot: the robot.
        state: in the robot's axes.

    Returns:
        lengths (n_cables,) m, rates (n_cables,) m/s (positive pays out), accelerations (n_cables,) m/s^2.
    """
    if isinstance(robot, PlatformRobot):
        return wrench_balance.cable_motion(robot, _pose(state))
    return force_balance.cable_motion(robot, state.position, state.velocity, state.acceleration)
