"""The protocol of all robots: cables from spools to an effector, whatever its degrees of freedom."""

from typing import Protocol

from jax import Array

from cspr_jax.errors import InputError
from cspr_jax.robots.limits import Limits
from cspr_jax.robots.state import State


class Robot(Protocol):
    """A robot on cables.

    With the tensions t of its cables in a state, wrench_matrix(state) @ t = inertial_wrench(state).
    """

    @property
    def base_points(self) -> Array:
        """Spool points, (n_cables, 3), m."""

    @property
    def mass(self) -> Array:
        """Mass of the effector, (), kg."""

    @property
    def gravity(self) -> Array:
        """Gravity, (), m/s^2."""

    @property
    def limits(self) -> Limits:
        """Limits beyond taut cables."""

    @property
    def dof(self) -> int:
        """Number of degrees of freedom; known when a function is compiled."""

    @property
    def n_cables(self) -> int:
        """Number of cables."""

    def wrench_matrix(self, state: State) -> Array:
        """Wrenches of unit tensions.

        Args:
            state: position, and the rotation of a platform; z down.

        Returns:
            (dof, n_cables), one column a cable: the force, of a platform the moment about its mass centre below it, m.
        """

    def inertial_wrench(self, state: State) -> Array:
        """Wrench that the cables must supply.

        Args:
            state: the state; z down.

        Returns:
            (dof,) force, N, of a platform the moment about its mass centre after it, N m.
        """


def check_determined(robot: Robot) -> None:
    """Refuse a robot whose motion does not determine its tensions.

    Args:
        robot: the robot.

    Raises:
        InputError: more cables than degrees of freedom.
    """
    if robot.n_cables != robot.dof:
        raise InputError(
            "base_points",
            None,
            f"must be {robot.dof} (what is asked for does not exist yet for more cables than degrees of freedom)",
            fault=f"{robot.n_cables} points",
        )
