"""State of an effector at one time: position, orientation and their derivatives."""

from typing import NamedTuple

from jax import Array


class State(NamedTuple):
    """Position, orientation and their time derivatives; a point mass has no orientation.

    Fields:
        position: (3,) position of the mass centre, m.
        velocity: (3,) m/s.
        acceleration: (3,) m/s^2.
        rotation: (3, 3) from platform to fixed axes; None for a point mass.
        angular_velocity: (3,) fixed axes, rad/s; None for a point mass.
        angular_acceleration: (3,) fixed axes, rad/s^2; None for a point mass.
        quaternion: (4,) rotation as a unit quaternion, scalar first, continuous along a motion; None where it is not
            needed.
    """

    position: Array
    velocity: Array
    acceleration: Array
    # None by default, for point masses, but typed as arrays, since platforms always have them.
    rotation: Array = None  # type: ignore[assignment]
    angular_velocity: Array = None  # type: ignore[assignment]
    angular_acceleration: Array = None  # type: ignore[assignment]
    quaternion: Array = None  # type: ignore[assignment]


def backwards(state: State) -> State:
    """State of the same motion with time reversed."""
    turning = None if state.rotation is None else -state.angular_velocity
    return state._replace(velocity=-state.velocity, angular_velocity=turning)
