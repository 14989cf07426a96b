"""Drums pay out lengths along a motion: these have exact derivatives in time, and motors that drive them.

Cables without stretch: lengths and rates of `robots.cables.cable_motion`. Elastic ones: the drum pays out unstretched
lengths, which depend on the tensions and so on the acceleration; speeds and accelerations are derivatives of the
motion's formulas (jvp), not differences. Where the third or fourth derivative of the motion jumps, or a rule that
chooses tensions of redundant cables changes the cables at their limits, the speed or the acceleration of elastic cables
jumps there; at such an instant they are those of one side. Where the effector rests, without acceleration, so do the
drums.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from cspr_jax.motion.motion import Motion
from cspr_jax.numerics.elementary import maximum_of
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots import cables
from cspr_jax.robots.cables import AnyRobot, cable_motion
from cspr_jax.robots.elasticity.springs import unstretched_lengths
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.state import State
from cspr_jax.robots.model.winches import MotorStates, motor_states
from cspr_jax.runtime.persistent_jit import persistent_jit


class DrumStates(NamedTuple):
    """Drums pay out an unstretched length, m, with two derivatives in time, at a tension, N; (n_cables,) each."""

    length: Array
    rate: Array
    acceleration: Array
    tension: Array


def drum_states(robot: AnyRobot, limits: Limits, motion: Motion, tau: Float[Array, ""], rule: str) -> DrumStates:
    """Compute what the drums pay out at one normalised time of a motion."""
    if robot.axial_stiffness is None:
        state = motion.state(tau)
        return DrumStates(*cable_motion(robot, state), cables.tensions(robot, state, limits, rule))

    def paid_out(t):
        state = motion.state(t)
        tension = cables.tensions(robot, state, limits, rule)
        return unstretched_lengths(cable_motion(robot, state)[0], tension, robot.axial_stiffness), tension

    def with_rate(t):
        (length, tension), (rate, _) = jax.jvp(paid_out, (t,), (jnp.ones_like(t),))
        return length, rate, tension

    (length, rate, tension), (_, second, _) = jax.jvp(with_rate, (tau,), (jnp.ones_like(tau),))
    duration = motion.duration()
    return DrumStates(length, rate / duration, second / duration**2, tension)


# A state whose velocities and accelerations are below this one, in m/s and m/s^2, rests.
AT_REST = 1e-9


def _resting(state: State, drums: DrumStates) -> DrumStates:
    # Before and after a motion from rest to rest the drums rest too, even if its third derivative jumps there.
    moving = [state.velocity, state.acceleration, state.angular_velocity, state.angular_acceleration]
    fastest = maximum_of(jnp.concatenate([jnp.abs(jnp.ravel(each)) for each in moving if each is not None]))
    rests = fastest <= AT_REST
    derivatives = [jnp.where(rests, 0.0, each) for each in (drums.rate, drums.acceleration)]
    return drums._replace(rate=derivatives[0], acceleration=derivatives[1])


@persistent_jit(static_argnames=("rule",))
def drums_and_motors(
    robot: AnyRobot, limits: Limits, motion: Motion, tau: Float[Array, "k"], *, rule: str
) -> tuple[DrumStates, MotorStates | None]:
    """Compute what the drums pay out at k normalised times of a motion, and the states of motors, if any."""

    def one(t):
        drums = drum_states(robot, limits, motion, t, rule)
        drums = _resting(motion.state(t), drums)
        return drums, None if robot.winches is None else motor_states(robot.winches, *drums)

    return jax.vmap(one)(tau)
