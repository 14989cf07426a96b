"""Peaks of motions: extremes of tensions, heights, cable lengths and speeds, and of motors, along them."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.motion.limits import lowest_depth, motor_limits_set
from cspr_jax.motion.motion import Motion, common_shape, has_pieces, sample_times
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.elementary import minimum_of
from cspr_jax.numerics.search.minima import narrowed_times
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots import cables
from cspr_jax.robots.model.limits import NO_LIMITS, Limits
from cspr_jax.robots.model.point_mass import plane_normal
from cspr_jax.robots.model.tension_rule_table import CENTRED
from cspr_jax.robots.model.winches import MotorDemands, motor_demands
from cspr_jax.robots.statics.wrench_sets import tension_range
from cspr_jax.runtime.persistent_jit import persistent_jit
from cspr_jax.runtime.stages import stage

SAMPLES = 64  # smallest number of samples of an arc
BATCH = 512  # number of samples computed at a time
# Largest number of samples that is held at a time.
MAX_SAMPLES = 200_000
TINY = 1e-300
# A rate below this fraction of the next sample's is a standstill.
ZERO_RATE = 1e-9


@dataclasses.dataclass(frozen=True)
class Peaks:
    """Extremes along n motions, refined between samples; (n,) each.

    Fields:
        tension_min: smallest tension of any cable, N.
        tension_max: largest tension of any cable, N.
        mu_min: smallest tension per mass and length, 1/s^2.
        depth_min: smallest depth of the mass centre below the spool plane, along the vertical, m.
        lowest: largest z of any point of the effector, z down, m.
        length_max: largest length of a cable, with what lies on its pulley, m.
        speed_max: largest speed of a cable, m/s.
        acceleration_max: largest acceleration of a cable, m/s^2.
        mass_centre_speed: largest speed of the mass centre, m/s.
        mass_centre_acceleration: largest acceleration of the mass centre, m/s^2.
        tension_margin: smallest distance of tensions from their limits; of redundant cables, whose tensions can be
            chosen, that of the most central ones, N.
        are_found: whether the tension rule of redundant cables kept the limits at all times; 1 or 0.
        motor_speed: largest speed of a motor, rad/s; these five are NaN without winches.
        motor_torque: largest torque of a motor, at standstill in the worse direction of friction, N m.
        motor_power: largest power of a motor, driving or braking, W.
        motor_load: largest torque over stall torque plus speed over no-load speed; NaN without such a line.
        motor_torque_rms: largest root mean square of a motor's torque over the motion, N m.
        samples: number of times at which the motion was sampled.
        when: time at which each of the extremes above is attained, (n, n_extremes), s.
        cables: which cable attains it, from 0 on; -1: none.
    """

    tension_min: np.ndarray
    tension_max: np.ndarray
    mu_min: np.ndarray
    depth_min: np.ndarray
    lowest: np.ndarray
    length_max: np.ndarray
    speed_max: np.ndarray
    acceleration_max: np.ndarray
    mass_centre_speed: np.ndarray
    mass_centre_acceleration: np.ndarray
    tension_margin: np.ndarray
    are_found: np.ndarray
    motor_speed: np.ndarray
    motor_torque: np.ndarray
    motor_power: np.ndarray
    motor_load: np.ndarray
    motor_torque_rms: np.ndarray
    samples: np.ndarray
    when: np.ndarray
    cables: np.ndarray


# A maximum is searched for as the minimum of the negative.
_SIGNS = np.array([1.0, -1.0, 1.0, 1.0, -1.0, -1.0, -1.0, -1.0, -1.0, -1.0, 1.0, 1.0, -1.0, -1.0, -1.0, -1.0])
EXTREMES = [field.name for field in dataclasses.fields(Peaks)][: len(_SIGNS)]
OF_MOTORS = len(MotorDemands._fields)


def _names(robot: Any) -> list[str]:
    # Extremes that a robot has; those of motors are the last ones, and a load needs a line of speed and torque.
    if robot.winches is None:
        return EXTREMES[:-OF_MOTORS]
    return EXTREMES if robot.winches.stall_torque is not None else EXTREMES[:-1]


def _values_at(robot, limits: Limits, corners, rule: str, motion: Motion, tau: Array) -> Array:
    # Values whose extremes are searched, the cables that attain them, and torques of motors with rates of their cables.
    state = motion.state(tau)
    if robot.n_cables > robot.dof:
        chosen = cables.shared(robot, state, limits, rule)
        force, are_found = chosen.tensions, jnp.where(chosen.is_within, 1.0, 0.0)
        central = force if rule == CENTRED else cables.shared(robot, state, limits, CENTRED).tensions
    else:
        force = central = cables.tensions(robot, state)
        are_found = jnp.asarray(1.0)
    smallest, largest = tension_range(robot, limits)
    length, rate, rate_derivative = cables.cable_motion(robot, state)
    of_cables = {
        "tension_min": force,
        "tension_max": -force,
        "mu_min": force / length / robot.mass,
        "length_max": -length,
        "speed_max": -jnp.abs(rate),
        "acceleration_max": -jnp.abs(rate_derivative),
        "tension_margin": jnp.minimum(central - smallest, largest - central),
    }
    if robot.winches is not None:
        of_motors = motor_demands(robot.winches, (length, rate, rate_derivative), force)
        of_cables |= {name: -values for name, values in of_motors._asdict().items()}
    extremes = {name: minimum_of(values) for name, values in of_cables.items()} | {
        "depth_min": plane_normal(robot) @ state.position,
        "lowest": -lowest_depth(robot, state, corners),
        "mass_centre_speed": -jnp.linalg.norm(state.velocity),
        "mass_centre_acceleration": -jnp.linalg.norm(state.acceleration),
        "are_found": are_found,
    }
    nearest = dict.fromkeys(EXTREMES, jnp.asarray(-1.0))
    nearest |= {name: jnp.argmin(values).astype(float) for name, values in of_cables.items()}
    values = [table[name] for table in (extremes, nearest) for name in _names(robot)]
    return jnp.hstack(values if robot.winches is None else [*values, of_motors.motor_torque, rate])


@persistent_jit(static_argnames=("rule",))
def _values(case, arguments, *, rule: str) -> Array:
    robot, limits, corners = case
    return jax.vmap(partial(_values_at, robot, limits, corners, rule))(*arguments)


@persistent_jit(static_argnames=("rule",))
def _values_of_one(case, motion: Motion, tau: Array, *, rule: str) -> Array:
    robot, limits, corners = case
    return jax.vmap(partial(_values_at, robot, limits, corners, rule, motion))(tau)


def peaks(
    robot: Any,
    motions: Sequence[Motion],
    samples: Sequence[int],
    limits: Limits = NO_LIMITS,
    rule: str = CENTRED,
    corners: Float[np.ndarray, "m 3"] | None = None,
) -> Peaks:
    """Extremes along motions, narrowed down between samples."""
    # Give every limit of tensions a value, so that one compiled function serves all.
    low, high = tension_range(robot, limits)
    limits = dataclasses.replace(_of_motors(robot, limits), tension_min=low, tension_max=high)
    count = len(_names(robot))
    table, torques = np.empty((len(motions), 3, count)), np.full(len(motions), np.nan)
    times = [sample_times(motion, count) for motion, count in zip(motions, samples, strict=True)]
    alike: dict[Any, list[int]] = {}
    for i, (motion, tau) in enumerate(zip(motions, times, strict=True)):
        # Motions of one structure and one number of samples are computed together, except those that may have very
        # many pieces, which would be copied for each sample.
        group = i if has_pieces(motion) else None
        shapes = tuple(np.shape(array) for array in jax.tree.leaves(motion))
        alike.setdefault((group, jax.tree.structure(motion), shapes, len(tau)), []).append(i)
    for (*_, n_samples), members in alike.items():
        length = max(MAX_SAMPLES // n_samples, 1)
        for first in range(0, len(members), length):
            stage(f"demands of {len(motions)} segments")
            batch = members[first : first + length]
            alike_motions, tau = [motions[i] for i in batch], np.stack([times[i] for i in batch])
            along = _along((robot, limits, corners), alike_motions, rule)
            values = along(tau)
            table[batch] = _narrowed(along, tau, values, count)
            if robot.winches is not None:
                torques[batch] = _root_mean_squares(tau, *np.split(values[..., 2 * count :], 2, axis=2))
    missing = np.full((len(motions), 3, len(EXTREMES) - count), np.nan)
    missing[:, 2] = -1.0
    table = np.concatenate([table, missing], axis=2)
    columns = (table[:, 0] * _SIGNS + 0.0).T  # no -0
    return Peaks(
        **dict(zip(EXTREMES, columns, strict=True)),
        motor_torque_rms=torques,
        samples=np.array([len(tau) for tau in times]),
        when=table[:, 1] * np.array([[float(motion.duration())] for motion in motions]),
        cables=table[:, 2].astype(int),
    )


def _of_motors(robot: Any, limits: Limits) -> Limits:
    # Limits of winches narrow the tensions among which a rule chooses.
    if robot.winches is None or robot.n_cables == robot.dof:
        return NO_LIMITS
    rows = motor_limits_set(limits)
    return Limits(**{row.name: getattr(limits, row.name) for row in rows})


def _along(case: tuple[Any, Limits, Any], motions: list[Motion], rule: str) -> Callable[[np.ndarray], np.ndarray]:
    # Values at times (n_motions, n) along motions of one structure, (n_motions, n, ...). Searches for several extremes
    # meet at the same times, each of which is computed once.
    shape = common_shape(motions[0])
    # One motion may have very many pieces.
    stacked: Any = None
    if len(motions) > 1:
        stacked = jax.tree.map(lambda *leaves: np.stack([np.asarray(array, float) for array in leaves]), *motions)

    def values(tau: np.ndarray) -> np.ndarray:
        if stacked is None:
            times, rows = np.unique(tau, return_inverse=True)
            computed = in_batches(partial(_values_of_one, case, shape, rule=rule), times, batch_size=BATCH)
        else:
            times, rows = np.unique(np.arange(len(tau))[:, None] + 1j * tau, return_inverse=True)
            items = jax.tree.map(lambda array: array[times.real.astype(int)], stacked)
            computed = in_batches(partial(_values, case, rule=rule), (items, times.imag), batch_size=BATCH)
        return computed[rows.reshape(tau.shape)]

    return values


def _root_mean_squares(
    tau: Float[np.ndarray, "n_motions n"],
    torques: Float[np.ndarray, "n_motions n n_cables"],
    rates: Float[np.ndarray, "n_motions n n_cables"],
) -> Float[np.ndarray, " n_motions"]:
    # Largest mean of a motor. Friction jumps where a rate changes its sign or vanishes: up to there counts the value at
    # the sample on that side.
    width, squares, speeds = np.diff(tau)[..., None], torques**2, np.abs(rates)
    earlier, later = speeds[:, :-1], speeds[:, 1:]
    both = earlier + later
    jumps = (rates[:, :-1] * rates[:, 1:] <= ZERO_RATE * both**2) & (both > 0.0)
    fraction = np.where(jumps, earlier / np.where(jumps, both, 1.0), 0.5)
    integrals = np.sum(width * (fraction * squares[:, :-1] + (1.0 - fraction) * squares[:, 1:]), axis=1)
    return np.sqrt((integrals / np.maximum(np.sum(width, axis=1), TINY)).max(1))


def _narrowed(at: Callable[[np.ndarray], np.ndarray], tau: np.ndarray, samples: np.ndarray, count: int) -> np.ndarray:
    minimum, when = narrowed_times(lambda points: at(points)[..., :count], tau, samples[..., :count])
    nearest = np.diagonal(at(when)[..., count : 2 * count], axis1=1, axis2=2)
    return np.stack([minimum, when, nearest], axis=1)
