"""Winches: drums, gears and motors of the cables; angle, speed, torque and power of each motor.

With the drum radius r, the gear ratio i and the length l of a cable, the drum winds with the speed -l' / r, and the
motor with w = -i l' / r. Its torque, positive where it winds, follows from the balance of power: a tension f takes the
power -f l', the rotor stores J w w', and friction takes the rest:

    torque = r f / (i e^s) + J w' + s c + b w

with the efficiency e, the Coulomb friction c, the viscous friction b, and s = 1 where the motor winds, -1 where it pays
out. At standstill friction acts in either direction.

A drum with layers: the cable on it grows its radius by one step a layer of a number of turns. The radius then depends
on the length on the drum, in steps, and the angle is a broken line over the length.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.errors import InputError
from cspr_jax.errors.given_numbers import numbers
from cspr_jax.errors.suggestions import did_you_mean
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.winch_numbers import LINE, LOAD, WINCH_LIMITS, WINCH_NUMBERS, WinchNumber, missing_number

# A motor whose speed is below this one, in rad/s, stands still: friction may act in either direction.
STANDSTILL = 1e-6


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class Layers:
    """Layers of cable on drums, (n_cables,) each.

    Fields:
        radial_step: growth of the radius from layer to layer, m.
        turns: turns of a layer.
        cable_length: length of the cable from its end on the drum, m: what is not paid out lies on the drum.
    """

    radial_step: Array
    turns: Array
    cable_length: Array


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class Winches:
    """Winches of a robot, (n_cables,) each.

    Fields:
        drum_radius: distance of the cable's centre line from the axis of the drum, in the first layer, m.
        gear_ratio: turns of the motor for one turn of the drum.
        motor_inertia: inertia of all that turns, as the motor sees it, kg m^2.
        friction: Coulomb friction, as the motor sees it, N m.
        viscous_friction: friction over speed, as the motor sees it, N m s/rad.
        efficiency: power that reaches the cable over power of the motor while it winds.
        zero_length: length of the cable at angle 0, m.
        direction: 1 where a growing angle pays out, -1 where it winds.
        layers: layers on the drums; None: the radius is constant.
        stall_torque: torque at standstill of the line that falls to 0 at `no_load_speed`, N m; None: no line.
        no_load_speed: speed at which that line has no torque, rad/s; None: no line.
        encoder_counts: counts of an encoder for one turn of the motor; None: not known.
    """

    drum_radius: Array
    gear_ratio: Array
    motor_inertia: Array
    friction: Array
    viscous_friction: Array
    efficiency: Array
    zero_length: Array
    direction: Array
    layers: Layers | None = None
    stall_torque: Array | None = None
    no_load_speed: Array | None = None
    encoder_counts: Array | None = None


def winches_of(values: Mapping[str, Any], n_cables: int, cable_diameter: Any, at: str = "") -> Winches:
    """Winches of a robot, from the numbers of `robots.model.winch_numbers`, checked."""
    names = [row.name for row in (*WINCH_NUMBERS, *WINCH_LIMITS)]
    for name in values:
        if name not in names:
            raise InputError(
                f"{at}{name}", values[name], f"absent: {did_you_mean(name, names)}keys are {', '.join(names)}"
            )
    numbers: dict[str, Any] = {
        row.name: value for row in WINCH_NUMBERS if (value := _number(row, values, n_cables, at)) is not None
    }
    if missing := missing_number([name for name, value in values.items() if value is not None]):
        raise InputError(f"{at}{missing[0]}", None, f"given beside {missing[1]}", problem="missing")
    turns, length = numbers.pop("layer_turns", None), numbers.pop("cable_length", None)
    layers = None
    if turns is not None and length is not None:
        if not cable_diameter:
            raise InputError("cable_diameter", cable_diameter, f"a number > 0 beside {at}layer_turns, in m")
        radial_step = as_float64(np.broadcast_to(np.asarray(cable_diameter, float), (n_cables,)))
        layers = Layers(radial_step, turns, length)
    line: dict[str, Any] = {name: numbers.pop(f"motor_{name}", None) for name in ("stall_torque", "no_load_speed")}
    return Winches(**numbers, **line, layers=layers)


def winch_limits(values: Mapping[str, Any], n_cables: int, at: str = "") -> dict[str, Array]:
    """Limits of winches among their numbers, checked; the load is at most 1 where the motor has a line."""
    numbers = {row.name: value for row in WINCH_LIMITS if (value := _number(row, values, n_cables, at)) is not None}
    if values.get(LINE) is not None:
        return {LOAD: as_float64(np.ones(n_cables))} | numbers
    return numbers


def winch_table(winches: Winches, limits: Limits) -> dict[str, Any]:
    """Keys of `[winch]` of a robot: the inverse of `winches_of` and `winch_limits`."""
    numbers = {row.name: getattr(winches, row.name.removeprefix("motor_"), None) for row in WINCH_NUMBERS}
    numbers["motor_inertia"] = winches.motor_inertia
    if winches.layers is not None:
        numbers |= {"layer_turns": winches.layers.turns, "cable_length": winches.layers.cable_length}
    numbers |= {row.name: getattr(limits, row.name) for row in WINCH_LIMITS}
    return {name: np.asarray(value) for name, value in numbers.items() if value is not None}


def _number(row: WinchNumber, values: Mapping[str, Any], n_cables: int, at: str) -> Array | None:
    value = values.get(row.name)
    value = row.default if value is None else value
    if value is None:
        if row.is_required:
            raise InputError(f"{at}{row.name}", None, row.allowed, problem="missing")
        return None
    allowed = f"{row.allowed}, or {n_cables}: one a cable"
    array = numbers(f"{at}{row.name}", value, allowed)
    if array.shape not in ((), (n_cables,)) or not all(map(row.is_allowed, np.atleast_1d(array).tolist())):
        raise InputError(f"{at}{row.name}", value, allowed)
    return as_float64(np.broadcast_to(array, (n_cables,)))


class MotorStates(NamedTuple):
    """States of the motors, (n_cables,) each; positive where the angle grows.

    Fields:
        angle: rad.
        speed: rad/s.
        acceleration: rad/s^2.
        torque: that holds the cables at these tensions while they move so; at standstill without friction, N m.
        power: torque times speed, W: positive where the motor drives, negative where it brakes.
    """

    angle: Array
    speed: Array
    acceleration: Array
    torque: Array
    power: Array


def radii(winches: Winches, lengths: Float[Array, "n"]) -> Float[Array, "n"]:
    """Radii of the drums where the cables leave them."""
    if winches.layers is None:
        return jnp.broadcast_to(winches.drum_radius, lengths.shape)
    return winches.drum_radius + winches.layers.radial_step * _full_layers(winches, winches.layers, lengths)


def largest_radii(winches: Winches) -> Float[Array, "n"]:
    """Radii of the drums with all of the cable on them."""
    return radii(winches, jnp.zeros_like(winches.drum_radius))


def drum_angles(winches: Winches, lengths: Float[Array, "n"]) -> Float[Array, "n"]:
    """Angles by which drums have paid out since `zero_length`, rad."""
    if winches.layers is None:
        return (lengths - winches.zero_length) / winches.drum_radius
    return _rotation_angle(winches, winches.layers, winches.zero_length) - _rotation_angle(
        winches, winches.layers, lengths
    )


def motor_angles(winches: Winches, lengths: Float[Array, "n"]) -> Float[Array, "n"]:
    """Angles of the motors, rad."""
    return winches.direction * winches.gear_ratio * drum_angles(winches, lengths)


def cable_lengths(winches: Winches, angles: Float[Array, "n"]) -> Float[Array, "n"]:
    """Lengths of the cables at angles of the motors, m: the inverse of `motor_angles`."""
    paid_out = angles / (winches.direction * winches.gear_ratio)
    if winches.layers is None:
        return winches.zero_length + winches.drum_radius * paid_out
    layers, angle = winches.layers, _rotation_angle(winches, winches.layers, winches.zero_length) - paid_out
    full = jnp.maximum(jnp.floor(angle / (2.0 * jnp.pi * layers.turns)), 0.0)
    rest = (angle - 2.0 * jnp.pi * layers.turns * full) * (winches.drum_radius + layers.radial_step * full)
    return layers.cable_length - _wound(winches, layers, full) - rest


def layer_ends(winches: Winches, layers: Layers) -> Float[np.ndarray, "k n"]:
    """Lengths at which layers are full, from the empty drum to the cable's end, in descending order."""
    radial_step, radius, total = (np.asarray(x) for x in (layers.radial_step, winches.drum_radius, layers.cable_length))
    turn, first = 2.0 * np.pi * np.asarray(layers.turns), radius - 0.5 * radial_step
    largest = np.ceil((np.sqrt(first**2 + 2.0 * radial_step * total / turn) - first) / radial_step).max()
    return total - np.asarray(_wound(winches, layers, np.arange(largest + 2.0)[:, None]))


def torques(
    winches: Winches,
    radius: Float[Array, "n"],
    speed: Float[Array, "n"],
    acceleration: Float[Array, "n"],
    tensions: Float[Array, "n"],
    side: Float[Array, "n"],
) -> Float[Array, "n"]:
    """Torques that wind, N m, from winding speeds and accelerations; `side` is s of the equation above, or 0."""
    load = radius * tensions / winches.gear_ratio
    moved = winches.motor_inertia * acceleration + side * winches.friction + winches.viscous_friction * speed
    side = jnp.asarray(side)
    # A choice costs less than a power.
    losses = jnp.where(side > 0.0, 1.0 / winches.efficiency, jnp.where(side < 0.0, winches.efficiency, 1.0))
    return load * losses + moved


def motor_states(
    winches: Winches,
    lengths: Float[Array, "n"],
    rates: Float[Array, "n"],
    accelerations: Float[Array, "n"],
    tensions: Float[Array, "n"],
) -> MotorStates:
    """States of the motors that give cables these lengths, rates, accelerations and tensions."""
    radius, speed, acceleration = wound(winches, (lengths, rates, accelerations))
    side = jnp.where(jnp.abs(speed) <= STANDSTILL, 0.0, jnp.sign(speed))
    torque = torques(winches, radius, speed, acceleration, tensions, side)
    sign = -winches.direction
    return MotorStates(motor_angles(winches, lengths), sign * speed, sign * acceleration, sign * torque, torque * speed)


class MotorDemands(NamedTuple):
    """Motions ask these magnitudes of the motors, (n_cables,) each; at standstill of the worse direction of friction.

    Fields:
        motor_speed: rad/s.
        motor_torque: N m.
        motor_power: W.
        motor_load: torque over stall torque plus speed over no-load speed; 0 without such a line.
    """

    motor_speed: Array
    motor_torque: Array
    motor_power: Array
    motor_load: Array


def motor_demands(winches: Winches, motion: tuple[Array, Array, Array], tensions: Float[Array, "n"]) -> MotorDemands:
    """Demands of cables with these lengths, rates, accelerations and tensions."""
    radius, speed, acceleration = wound(winches, motion)

    def torque(side: float) -> Array:
        return jnp.abs(torques(winches, radius, speed, acceleration, tensions, jnp.full_like(speed, side)))

    largest = jnp.maximum(
        jnp.where(speed >= -STANDSTILL, torque(1.0), 0.0), jnp.where(speed <= STANDSTILL, torque(-1.0), 0.0)
    )
    load = jnp.zeros_like(speed)
    if winches.stall_torque is not None and winches.no_load_speed is not None:
        load = largest / winches.stall_torque + jnp.abs(speed) / winches.no_load_speed
    return MotorDemands(jnp.abs(speed), largest, largest * jnp.abs(speed), load)


def wound(winches: Winches, motion: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
    """Radii of the drums, and winding speeds and accelerations of the motors, from lengths and two derivatives."""
    length, rate, second_derivative = motion
    radius = radii(winches, length)
    gain = -winches.gear_ratio / radius
    return radius, gain * rate, gain * second_derivative


def tensions_within(
    winches: Winches, limits: Limits, motion: tuple[Array, Array, Array], allowed: tuple[Array, Array]
) -> tuple[Array, Array]:
    """Smallest and largest tensions among those allowed with which motors keep their torque, power and load."""
    radius, speed, acceleration = wound(winches, motion)
    low, high = allowed
    largest = [limits.motor_torque_max] if limits.motor_torque_max is not None else []
    if limits.motor_power_max is not None:
        largest.append(limits.motor_power_max / jnp.maximum(jnp.abs(speed), STANDSTILL))
    if limits.motor_load_max is not None:
        left = limits.motor_load_max - jnp.abs(speed) / jnp.asarray(winches.no_load_speed)
        largest.append(left * jnp.asarray(winches.stall_torque))
    for side in (1.0, -1.0):
        sides, occurs = jnp.full_like(speed, side), side * speed >= -STANDSTILL
        own_torque = torques(winches, radius, speed, acceleration, jnp.zeros_like(speed), sides)
        gain = winches.gear_ratio * winches.efficiency**sides / radius
        for torque in largest:
            low = jnp.where(occurs, jnp.maximum(low, (-torque - own_torque) * gain), low)
            high = jnp.where(occurs, jnp.minimum(high, (torque - own_torque) * gain), high)
    return low, high


def _wound(winches: Winches, layers: Layers, full: Any) -> Any:
    # Length of the cable in `full` layers, m.
    return 2.0 * jnp.pi * layers.turns * full * (winches.drum_radius + 0.5 * layers.radial_step * (full - 1.0))


def _full_layers(winches: Winches, layers: Layers, lengths: Array) -> Array:
    # Largest whole number whose layers are not longer than what lies on the drum: the root of a quadratic.
    turns = jnp.maximum(layers.cable_length - lengths, 0.0) / (2.0 * jnp.pi * layers.turns)
    first = winches.drum_radius - 0.5 * layers.radial_step
    root = jnp.floor(2.0 * turns / (first + jnp.sqrt(first**2 + 2.0 * layers.radial_step * turns)))
    # Rounding may put a length at the end of a layer into the wrong one.
    beyond = _wound(winches, layers, root + 1.0) <= layers.cable_length - lengths
    short = _wound(winches, layers, root) > jnp.maximum(layers.cable_length - lengths, 0.0)
    return root + jnp.where(beyond, 1.0, 0.0) - jnp.where(short, 1.0, 0.0)


def _rotation_angle(winches: Winches, layers: Layers, lengths: Array) -> Array:
    # Angle of the drum since it was empty, rad.
    full = _full_layers(winches, layers, lengths)
    rest = layers.cable_length - lengths - _wound(winches, layers, full)
    return 2.0 * jnp.pi * layers.turns * full + rest / (winches.drum_radius + layers.radial_step * full)
