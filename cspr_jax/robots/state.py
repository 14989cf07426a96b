"""The state of an effector: where it is, and how it moves."""

from typing import NamedTuple

from jax import Array


class State(NamedTuple):
    """Position, orientation and their derivatives in time at one instant; a point mass has no orientation.

    Fields:
        position: (3,) of the mass centre, m.
        velocity: (3,) m/s.
        acceleration: (3,) m/s^2.
        rotation: (3, 3) from platform to fixed axes; None for a point mass.
        angular_velocity: (3,) fixed axes, rad/s; None for a point mass.
        angular_acceleration: (3,) fixed axes, rad/s^2; None for a point mass.
    """

    position: Array
    velocity: Array
    acceleration: Array
    # A platform's are always there: what handles platforms need not ask.
    rotation: Array = None  # type: ignore[assignment]
    angular_velocity: Array = None  # type: ignore[assignment]
    angular_acceleration: Array = None  # type: ignore[assignment]
