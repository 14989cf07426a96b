"""Sizes of motors: the largest torque, speed and power along motions, torques' root mean squares, and energies.

At standstill friction acts in either direction, and the worse torque counts. Largest values are searched for between
samples (`numerics.search.minima`); integrals over time are exact to `TOLERANCE`, whatever jumps there are where a
motor turns back or a layer begins (`numerics.quadrature`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.machine.drum_motions import drums_and_motors
from cspr_jax.motion.limits import choosing_limits
from cspr_jax.motion.motion import Motion, common_shape, sample_times
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.elementary import maximum_of
from cspr_jax.numerics.linear.rotations import matrix
from cspr_jax.numerics.quadrature import integrals
from cspr_jax.numerics.search.minima import narrowed
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots import cables
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.elasticity.springs import unstretched_lengths
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.state import State
from cspr_jax.robots.model.tension_rule_table import CENTRED
from cspr_jax.robots.model.winches import STANDSTILL, radii, torques
from cspr_jax.runtime.persistent_jit import persistent_jit

BATCH = 512  # number of times computed at once
TOLERANCE = 1e-8  # relative, of integrals over time
RESTS = 1e-12  # rad/s, below which integrals take a motor for resting
# Rates below this fraction of the fastest cable's are rounding, as on a path about a spool: their motor rests.
NOISE = 1e-11
# Integrals of a motor are exact to the tolerance, or to the tolerance times this fraction of the largest motor's.
FLOOR = 1e-6
CURVE = 400  # number of times along a motion in a picture


@dataclasses.dataclass(frozen=True)
class MotionDemands:
    """Motions ask these magnitudes of n motors, (n,) each.

    Fields:
        torque: largest torque of either sign, N m.
        speed: largest speed of either sign, rad/s.
        power: largest power that the motor gives, W.
        braking_power: largest power that the motor takes, W.
        torque_rms: root mean square of the torque over the duration, N m; NaN for poses at rest.
        energy: energy that the motor gives, J; NaN for poses at rest.
        regenerated_energy: energy that the motor takes, J; NaN for poses at rest.
        duration: s; NaN for poses at rest.
    """

    torque: np.ndarray
    speed: np.ndarray
    power: np.ndarray
    braking_power: np.ndarray
    torque_rms: np.ndarray
    energy: np.ndarray
    regenerated_energy: np.ndarray
    duration: float


@persistent_jit(static_argnames=("rule",))
def winding_states(
    robot: AnyRobot, limits: Limits, motion: Motion, tau: Float[Array, "k"], *, rule: str
) -> tuple[Float[Array, "k n"], Float[Array, "k n"], Float[Array, "k n"]]:
    """Winding speeds, 0 where they are rounding, winding torques, and those that integrals take at standstill."""
    drums, _ = drums_and_motors(robot, limits, motion, tau, rule=rule)
    return jax.vmap(partial(_worse, robot.winches))(*drums)


def _worse(winches: Any, length: Array, rate: Array, acceleration: Array, tension: Array) -> tuple[Array, Array, Array]:
    # At standstill friction acts in the worse direction; a motor that comes to rest stands still only at its end.
    radius = radii(winches, length)
    speed, change = (-winches.gear_ratio * each / radius for each in (rate, acceleration))
    winding, paying = (torques(winches, radius, speed, change, tension, jnp.full_like(speed, s)) for s in (1.0, -1.0))
    static, moving = (
        jnp.where(jnp.abs(winding) >= jnp.abs(paying), winding, paying),
        jnp.where(speed > 0, winding, paying),
    )
    rounding = jnp.maximum(RESTS, winches.gear_ratio / radius * NOISE * maximum_of(jnp.abs(rate)))
    rests = jnp.abs(speed) <= rounding
    torque = jnp.where(rests | (jnp.abs(speed) <= STANDSTILL), static, moving)
    return jnp.where(rests, 0.0, speed), torque, jnp.where(rests, static, moving)


@partial(jax.jit, static_argnames=("rule",))
def _holding(robot: AnyRobot, limits: Limits, poses: tuple[Array, Array], *, rule: str) -> Array:
    def one(position, quaternion):
        static = jnp.zeros(3)
        state = State(position, static, static, matrix(quaternion), static, static, quaternion)
        tension, zero = cables.tensions(robot, state, limits, rule), jnp.zeros(robot.n_cables)
        length = cables.cable_motion(robot, state)[0]
        drum = unstretched_lengths(length, tension, robot.axial_stiffness)
        return _worse(robot.winches, drum, zero, zero, tension)[1]

    return jax.vmap(one)(*poses)


def holding_demands(
    robot: AnyRobot, limits: Limits, positions: Float[np.ndarray, "k 3"], quaternions: Float[np.ndarray, "k 4"]
) -> MotionDemands:
    """Compute what poses at rest ask of motors: the largest torques that hold them, by the most central tensions."""
    of_robot = partial(_holding, robot, limits, rule=CENTRED)
    torque = np.abs(in_batches(of_robot, (positions, quaternions), batch_size=BATCH)).max(0)
    zeros, never = np.zeros_like(torque), np.full_like(torque, np.nan)
    return MotionDemands(torque, zeros, zeros, zeros, never, never, never, np.nan)


def motor_demands(
    robot: AnyRobot,
    limits: Limits,
    motions: Sequence[Motion],
    samples: Sequence[int],
    rule: str,
) -> MotionDemands:
    """Compute what consecutive motions ask of the motors of a robot with winches."""
    limits = choosing_limits(robot, limits)
    largest, sums, duration = [], [], 0.0
    for motion, count in zip(motions, samples, strict=True):
        of_motion = partial(winding_states, robot, limits, common_shape(motion), rule=rule)

        def states(tau, of_motion=of_motion):
            return in_batches(of_motion, tau, batch_size=BATCH)

        largest.append(_largest(states, sample_times(motion, count)))
        floor = FLOOR * _floors(largest[-1])
        length = float(motion.duration())
        edges = np.concatenate([[0.0], np.asarray(motion.breaks(), float), [1.0]])

        def integrands(tau, states=states):
            speed, _, torque = states(tau)
            return _integrands(speed, torque)

        sums.append(length * integrals(integrands, edges, TOLERANCE, floor))
        duration += length
    n = robot.n_cables
    square, energy, regenerated = np.sum(sums, axis=0).reshape(3, n)
    torque, speed, power, braking = np.max(largest, axis=0).reshape(4, n)
    return MotionDemands(torque, speed, power, braking, np.sqrt(square / duration), energy, regenerated, duration)


def _largest(states, tau: np.ndarray) -> np.ndarray:
    # Largest torques, speeds, powers and braking powers of all motors, (4 n,).
    def at(times: np.ndarray) -> np.ndarray:
        speed, torque = (each.reshape(*times.shape, -1) for each in states(times.ravel())[:2])
        power = torque * speed
        return -np.concatenate([np.abs(torque), np.abs(speed), power.clip(min=0.0), (-power).clip(min=0.0)], axis=-1)

    return -narrowed(at, tau[None], at(tau[None]))[0] + 0.0


def _integrands(speed: np.ndarray, torque: np.ndarray) -> np.ndarray:
    power = torque * speed
    return np.concatenate([torque**2, power.clip(min=0.0), (-power).clip(min=0.0)], axis=-1)


def _floors(largest: np.ndarray) -> np.ndarray:
    # Largest integrands of any motor, in the order of `_integrands`.
    torque, speed = np.max(largest.reshape(4, -1)[:2], axis=1)
    return np.repeat([torque**2, torque * speed, torque * speed], len(largest) // 4)


def winding_curves(
    robot: AnyRobot, limits: Limits, motions: Sequence[Motion], rule: str, count: int = CURVE
) -> tuple[Float[np.ndarray, "k n"], Float[np.ndarray, "k n"]]:
    """Winding speeds and torques along consecutive motions, `count` times each."""
    limits = choosing_limits(robot, limits)
    parts = [
        in_batches(
            partial(winding_states, robot, limits, common_shape(motion), rule=rule),
            sample_times(motion, count),
            batch_size=BATCH,
        )
        for motion in motions
    ]
    speeds, torque, _ = zip(*parts, strict=True)
    return np.concatenate(speeds), np.concatenate(torque)


def joint_cycle(of_motions: Sequence[MotionDemands]) -> MotionDemands:
    """Largest values of motions and poses at rest; root mean squares and energies of the motions in turn."""
    columns = {
        name: np.max([getattr(each, name) for each in of_motions], axis=0)
        for name in ("torque", "speed", "power", "braking_power")
    }
    moving = [each for each in of_motions if np.isfinite(each.duration)]
    if not moving:
        never = np.full_like(columns["torque"], np.nan)
        return MotionDemands(**columns, torque_rms=never, energy=never, regenerated_energy=never, duration=np.nan)
    duration = sum(each.duration for each in moving)
    square = np.sum([each.duration * each.torque_rms**2 for each in moving], axis=0) / duration
    energy = np.sum([each.energy for each in moving], axis=0)
    regenerated = np.sum([each.regenerated_energy for each in moving], axis=0)
    return MotionDemands(
        **columns, torque_rms=np.sqrt(square), energy=energy, regenerated_energy=regenerated, duration=duration
    )
