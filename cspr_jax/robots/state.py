"""State of a robot at one instant: where its effector is, and how it moves."""

from typing import NamedTuple

from jax import Array


class State(NamedTuple):
    """State of an effector at one instant; a point mass has no orientation.

    Fields:
        position: (3,) of the mass centre, m.
        velocity: (3,) m/s.
        acceleration: (3,) m/s^2.
        quaternion: (4,) unit, scalar first, from platform to fixed axes; continuous along a motion.
        rotation: (3, 3) the same.
        angular_velocity: (3,) fixed axes, rad/s.
        angular_acceleration: (3,) fixed axes, rad/s^2.
    """

    position: Array
    velocity: Array
    acceleration: Array
    quaternion: Array | None = None
    rotation: Array | None = None
    angular_velocity: Array | None = None
    angular_acceleration: Array | None = None


def backwards(state: State) -> State:
    """State of the same motion with time reversed.

    Args:
        state: of the motion.

    Returns:
        the state with velocity and angular velocity of the other sign.
    """
    turning = None if state.angular_velocity is None else -state.angular_velocity
    return state._replace(velocity=-state.velocity, angular_velocity=turning)
