"""Bounds of the motors over a block of time: slacks of their limits, and the tensions with which these are kept.

Formulas are those of `robots.model.winches`. Friction, and with it the torque, jumps where a winch changes between
winding (s = 1) and paying out (s = -1); at standstill both count. A lower bound takes every side that may occur within
the block; an upper bound takes a side that is proved to occur throughout, or else the largest one of those that may.
Likewise with the radius of a drum whose cable changes between two layers within the block: each of both radii, with
each side of friction, is a case. Over more layers the radius is an interval.

With s given, the torque is affine in the tension, so that limits of torque, power and load bound the tension between
functions of time. Cases, and signs of magnitudes, are leading axes of arrays, so that XLA computes what they share
once.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.numerics.bounds.affine_bounds import AffineBounds, constant, flat, selected
from cspr_jax.numerics.bounds.function_bounds import reciprocal
from cspr_jax.numerics.elementary import maximum_of, minimum_of
from cspr_jax.numerics.shapes import Bool, Float
from cspr_jax.robots.bounds.state_bounds import CableBounds
from cspr_jax.robots.model.winches import STANDSTILL, Winches, radii

# Signs of a magnitude are along the first of three or four axes, cases along the last but one.
SIGNS = np.array([1.0, -1.0])


class Lines(NamedTuple):
    """Lines around functions of time: their values at both ends of the block.

    Fields:
        below: (2, ..., n_cables) values of a line below each function.
        above: (2, ..., n_cables) values of a line above it.
    """

    below: Array
    above: Array

    def smallest(self, axis: int) -> "Lines":
        """Lines around the smallest of several functions: above the line between the smallest values at both ends."""
        # Take the line above with the smallest largest value.
        nearest = jnp.argmin(maximum_of(self.above, axis=0, keepdims=True), axis=axis, keepdims=True)
        above = jnp.take_along_axis(self.above, nearest, axis=axis)
        return Lines(minimum_of(self.below, axis=axis), jnp.squeeze(above, axis=axis))


class MotorBounds(NamedTuple):
    """Bounds of the motors of one block, in c cases of friction and radius.

    Fields:
        radius: (c or 1, n_cables) radius of the drum over the gear ratio, m.
        speed: (c or 1, n_cables) winding speed, rad/s.
        own_torque: (c, n_cables) torque without tension, of inertia and friction, N m.
        side: (c, 1) sides of friction.
        has_one_radius: (n_cables,) whether the radius is the same throughout the block.
    """

    radius: AffineBounds
    speed: AffineBounds
    own_torque: AffineBounds
    side: Array
    has_one_radius: Array

    def may_act(self) -> Bool[Array, "c n_cables"]:
        """Tell which cases may occur at some time."""
        return ~((self.speed * self.side).high() < -STANDSTILL)

    def over_cases(self, lines: Lines) -> Lines:
        """Lines around the smallest value in all cases that occur; cases are along the last axis but one."""
        may_act, can_act = self.may_act(), (self.speed * self.side).low() >= -STANDSTILL
        shape = (1,) * (lines.below.ndim - 2) + may_act.shape
        may_act, can_act = may_act.reshape(shape), (can_act & self.has_one_radius[None]).reshape(shape)
        below = minimum_of(jnp.where(may_act, lines.below, jnp.inf), axis=-2)
        certain = Lines(lines.below, jnp.where(can_act, lines.above, jnp.inf)).smallest(-2).above
        possible = maximum_of(jnp.where(may_act, lines.above, -jnp.inf), axis=-2)
        return Lines(below, jnp.where(can_act.any(-2), certain, possible))


def motor_bounds(winches: Winches, cables: CableBounds) -> MotorBounds:
    """Bounds of the motors that move cables without stretch."""
    near, far = (radii(winches, length) / winches.gear_ratio for length in (cables.length.high(), cables.length.low()))
    low, high, side = near[None], far[None], np.array([[1.0], [-1.0]])
    if winches.layers is not None:
        side = np.tile(side, (2, 1))
        are_two = far - near < 1.5 * winches.layers.radial_step / winches.gear_ratio
        low, high = (jnp.stack([near, near, *[jnp.where(are_two, far, near)] * 2]), jnp.stack([near, near, far, far]))
        high = jnp.where(are_two[None], high, far[None])
    inverse = _interval(1.0 / high, 1.0 / low)
    speed, acceleration = (_beside(flat(-bounds), 1) * inverse for bounds in (cables.rate, cables.acceleration))
    moved = acceleration * winches.motor_inertia[None] + speed * winches.viscous_friction[None]
    own_torque = moved + side * winches.friction[None]
    return MotorBounds(_interval(low, high), speed, own_torque, jnp.asarray(side), near == far)


def _interval(low: Array, high: Array) -> AffineBounds:
    return AffineBounds(0.5 * (low + high), jnp.zeros_like(low), 0.5 * (high - low))


def torque_bounds(winches: Winches, motors: MotorBounds, tension: AffineBounds) -> AffineBounds:
    """Bounds of the torques in each case, (c, n_cables) N m."""
    load = motors.radius * _beside(flat(tension), 1)
    return load * winches.efficiency[None] ** -motors.side + motors.own_torque


def motor_slack(
    winches: Winches, quantity: str, limit: Float[Array, "n_cables"], motors: MotorBounds, tension: AffineBounds
) -> Lines:
    """Lines around the slack of a limit of winches."""
    if quantity == "motor_speed":
        slack = _beside(motors.speed, 1) * -SIGNS[:, None, None] + limit[None, None]
        return motors.over_cases(_lines(slack).smallest(1))
    value = torque_bounds(winches, motors, tension)
    if quantity == "motor_power":
        value = value * motors.speed
    if quantity == "motor_load":
        value = value * (1.0 / jnp.asarray(winches.stall_torque)[None])
        # Signs of the speed, of the torque, cases, and cables.
        slack = _beside(_room_of_load(winches, limit, motors), 1, at=1)
        each = slack - _beside(_beside(value, 1) * SIGNS[:, None, None], 1)
        return motors.over_cases(_lines(each).smallest(1).smallest(1))
    return motors.over_cases(_lines(_beside(value, 1) * -SIGNS[:, None, None] + limit[None, None]).smallest(1))


class TensionLines(NamedTuple):
    """Tensions that are allowed over a block; lines around the smallest one, N, and around the largest one, N."""

    low: Lines
    high: Lines

    def narrowed(
        self, winches: Winches, quantity: str, limit: Float[Array, "n_cables"], motors: MotorBounds
    ) -> "TensionLines":
        """Tensions with which a limit of winches is kept, too."""
        both = motors.over_cases(_tensions(winches, quantity, limit, motors))
        # The largest of the smallest tensions is minus the least of their negatives.
        previous = Lines(
            *(jnp.stack(x, axis=1) for x in ((self.high.below, -self.low.above), (self.high.above, -self.low.below)))
        )
        narrower = Lines(*(jnp.stack(x) for x in zip(both, previous, strict=True)))
        narrower = Lines(*(jnp.moveaxis(x, 0, 1) for x in narrower)).smallest(1)
        return TensionLines(
            Lines(-narrower.above[:, 1], -narrower.below[:, 1]), Lines(narrower.below[:, 0], narrower.above[:, 0])
        )


def tension_lines(low: Float[Array, "n_cables"], high: Float[Array, "n_cables"]) -> TensionLines:
    """Tensions between constants."""
    return TensionLines(*(Lines(*[jnp.stack([side, side])] * 2) for side in (low, high)))


def _tensions(winches: Winches, quantity: str, limit: Array, motors: MotorBounds) -> Lines:
    # Lines around the largest tensions, and around minus the smallest, with which a limit is kept, (2, 2, c, n).
    gain = _beside(reciprocal(motors.radius) * winches.efficiency[None] ** motors.side, 1)
    own_torque = _beside(motors.own_torque, 1) * -SIGNS[:, None, None]
    if quantity == "motor_load":
        slack = _beside(_room_of_load(winches, limit, motors) * jnp.asarray(winches.stall_torque)[None, None], 1, at=1)
        return _lines((slack + _beside(own_torque, 1)) * _beside(gain, 1)).smallest(1)
    if quantity != "motor_power":
        return _lines((own_torque + limit[None, None]) * gain)
    # The torque of a power grows without bound towards standstill.
    speed = motors.speed * jnp.where(motors.speed.middle < 0.0, -1.0, 1.0)
    turns = speed.low() > 0.0
    away = selected(turns, speed, constant(jnp.ones_like(speed.middle)))
    slowest = constant(limit[None] / jnp.maximum(motors.speed.magnitude(), STANDSTILL))
    lines = _lines((_beside(selected(turns, reciprocal(away) * limit[None], slowest), 1) + own_torque) * gain)
    return lines._replace(above=jnp.where(turns[None, None], lines.above, jnp.inf))


def _room_of_load(winches: Winches, limit: Array, motors: MotorBounds) -> AffineBounds:
    # Load that the speed leaves to the torque, for both signs of the speed, (2, c or 1, n_cables).
    fraction = -SIGNS[:, None, None] / jnp.asarray(winches.no_load_speed)[None, None]
    return _beside(motors.speed, 1) * fraction + limit[None, None]


def _beside(bounds: AffineBounds, count: int, at: int = 0) -> AffineBounds:
    # Bounds with more axes of length 1.
    return bounds.each(lambda x: jnp.expand_dims(x, tuple(range(at, at + count))))


def _lines(value: AffineBounds) -> Lines:
    ends = jnp.stack([value.middle - value.linear, value.middle + value.linear])
    return Lines(ends - value.radius[None], ends + value.radius[None])


def part_of(lines: Lines) -> tuple[Array, ...]:
    """Bounds of a slack by numbers, and rises of its lines; see `verification.bounds.block_slacks.BlockSlacks`."""
    below, above = lines
    return minimum_of(below, axis=0), maximum_of(above, axis=0), below[1] - below[0], above[1] - above[0]
