"""The protocol of all robots: cables from spools to an effector, whatever its degrees of freedom."""

from typing import Protocol

from jax import Array

from cspr_jax.errors import InputError
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.pulleys import Pulleys
from cspr_jax.robots.model.state import State
from cspr_jax.robots.model.winches import Winches


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
        """Number of degrees of freedom; static in compiled functions."""

    @property
    def pattern(self) -> str:
        """Name of its pattern of motion, a row of `robots.model.patterns`; static in compiled functions."""

    @property
    def n_cables(self) -> int:
        """Number of cables."""

    @property
    def pulleys(self) -> Pulleys | None:
        """Pulleys between base points and cables; None: the cables leave from the base points."""

    @property
    def cable_diameter(self) -> Array | None:
        """Diameter of the cables, (), m; None: 0."""

    @property
    def axial_stiffness(self) -> Array | None:
        """Axial stiffness EA of the cables, (n_cables,), N; None: they do not stretch."""

    @property
    def winches(self) -> Winches | None:
        """Winches of the cables; None: not known."""

    def wrench_matrix(self, state: State) -> Array:
        """Wrenches of unit tensions.

        Args:
            state: position, and the rotation of a platform; z down.

        Returns:
            (dof, n_cables), one column a cable: the force; for a platform, below it, the moment about its mass centre
            or joint, m; only components that the pattern balances.
        """

    def inertial_wrench(self, state: State) -> Array:
        """Wrench that the cables must supply.

        Args:
            state: the state; z down.

        Returns:
            (dof,) force, N; for a platform then the moment, N m; components as in `wrench_matrix`.
        """


MOVED = ("2T", "3T", "3R3T")  # patterns of trajectories and searches; workspaces take all patterns


def check_moved(robot: Robot, *, pulleys: bool = False) -> None:
    """Refuse robots for which there are neither trajectories nor searches."""
    if robot.pattern not in MOVED:
        allowed = " or ".join(f'"{name}"' for name in MOVED)
        raise InputError("pattern", robot.pattern, f"{allowed} (what is asked for does not exist yet for others)")
    if robot.pulleys is not None and not pulleys:
        raise InputError(
            "pulley_radius", None, "must be absent (what is asked for does not exist yet for them)", problem="pulleys"
        )


def check_determined(robot: Robot, *, pulleys: bool = False) -> None:
    """Refuse robots whose tensions do not follow from their motion."""
    check_moved(robot, pulleys=pulleys)
    if robot.n_cables != robot.dof:
        raise InputError(
            "base_points",
            None,
            f"must be {robot.dof} (what is asked for does not exist yet for more cables than degrees of freedom)",
            problem=f"{robot.n_cables} points",
        )
