"""Motors of a robot in its states."""

from __future__ import annotations

import jax

from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.cables import AnyRobot, cable_motion
from cspr_jax.robots.model.state import State
from cspr_jax.robots.model.winches import MotorStates, Winches, motor_states


def motors_at(robot: AnyRobot, winches: Winches, states: State, tensions: Float[jax.Array, "k n"]) -> MotorStates:
    """Motors that drive cables without stretch in k states, (k, n_cables) each."""
    return jax.vmap(lambda state, each: motor_states(winches, *cable_motion(robot, state), each))(states, tensions)
