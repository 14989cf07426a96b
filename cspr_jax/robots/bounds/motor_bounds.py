"""Bounds of the motors over a block of time: slacks of their limits, and the tensions with which these are kept.

Formulas are those of `robots.model.winches`. Friction, and with it the torque, jumps where a winch changes between
winding (s = 1) and paying out (s = -1); at standstill both count. A lower bound takes every side that may occur within
the block; an upper bound takes a side that is proved to occur throughout, or else the larger one of both. The radius of
a drum with layers is an interval where the cable changes between layers.

With s given, the torque is affine in the tension, so that limits of torque, power and load bound the tension between
functions of time. Sides of friction, and signs of magnitudes, are leading axes of arrays, so that XLA computes what
they share once.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.numerics.bounds.affine_bounds import AffineBounds, constant, flat, selected
from cspr_jax.numerics.bounds.function_bounds import reciprocal
from cspr_jax.numerics.shapes import Bool, Float
from cspr_jax.robots.bounds.state_bounds import CableBounds
from cspr_jax.robots.model.winches import STANDSTILL, Winches, radii

# Sides of friction along the last axis but one, and signs of a magnitude along the first of three or four.
SIDES = np.array([[1.0], [-1.0]])
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
        nearest = jnp.argmin(jnp.max(self.above, axis=0, keepdims=True), axis=axis, keepdims=True)
        above = jnp.take_along_axis(self.above, nearest, axis=axis)
        return Lines(jnp.min(self.below, axis=axis), jnp.squeeze(above, axis=axis))


class MotorBounds(NamedTuple):
    """Bounds of the motors of one block, (n_cables,) each.

    Fields:
        radius: radius of the drum over the gear ratio, m.
        speed: winding speed, rad/s.
        own_torque: (2, n_cables) torque without tension, of inertia and friction on each side, N m.
    """

    radius: AffineBounds
    speed: AffineBounds
    own_torque: AffineBounds

    def may_act(self) -> Bool[Array, "2 n_cables"]:
        """Tell whether friction may act on a side at some time."""
        return ~((_beside(self.speed, 1) * SIDES).high() < -STANDSTILL)

    def over_sides(self, lines: Lines) -> Lines:
        """Lines around the smallest value on all sides that occur; sides are along the last axis but one."""
        may_act, can_act = self.may_act(), (_beside(self.speed, 1) * SIDES).low() >= -STANDSTILL
        shape = (1,) * (lines.below.ndim - 2) + may_act.shape
        may_act, can_act = may_act.reshape(shape), can_act.reshape(shape)
        below = jnp.min(jnp.where(may_act, lines.below, jnp.inf), axis=-2)
        certain = Lines(lines.below, jnp.where(can_act, lines.above, jnp.inf)).smallest(-2).above
        return Lines(below, jnp.where(can_act.any(-2), certain, jnp.max(lines.above, axis=-2)))


def motor_bounds(winches: Winches, cables: CableBounds) -> MotorBounds:
    """Bounds of the motors that move cables without stretch."""
    near, far = (radii(winches, length) / winches.gear_ratio for length in (cables.length.high(), cables.length.low()))
    inverse = _interval(1.0 / far, 1.0 / near)
    speed, acceleration = (flat(-bounds) * inverse for bounds in (cables.rate, cables.acceleration))
    moved = acceleration * winches.motor_inertia + speed * winches.viscous_friction
    return MotorBounds(_interval(near, far), speed, _beside(moved, 1) + SIDES * winches.friction[None])


def _interval(low: Array, high: Array) -> AffineBounds:
    return AffineBounds(0.5 * (low + high), jnp.zeros_like(low), 0.5 * (high - low))


def torque_bounds(winches: Winches, motors: MotorBounds, tension: AffineBounds) -> AffineBounds:
    """Bounds of the torques on each side of friction, (2, n_cables) N m."""
    return _beside(motors.radius * flat(tension), 1) * winches.efficiency[None] ** -SIDES + motors.own_torque


def motor_slack(
    winches: Winches, quantity: str, limit: Float[Array, "n_cables"], motors: MotorBounds, tension: AffineBounds
) -> Lines:
    """Lines around the slack of a limit of winches."""
    if quantity == "motor_speed":
        return _lines(_beside(motors.speed, 1) * -SIGNS[:, None] + limit[None]).smallest(1)
    value = torque_bounds(winches, motors, tension)
    if quantity == "motor_power":
        value = value * _beside(motors.speed, 1)
    if quantity == "motor_load":
        value = value * (1.0 / jnp.asarray(winches.stall_torque)[None])
        # Signs of the speed, of the torque, sides, and cables.
        slack = _beside(_room_of_load(winches, limit, motors), 2, at=1)
        each = slack - _beside(_beside(value, 1) * SIGNS[:, None, None], 1)
        return motors.over_sides(_lines(each).smallest(1).smallest(1))
    return motors.over_sides(_lines(_beside(value, 1) * -SIGNS[:, None, None] + limit[None, None]).smallest(1))


class TensionLines(NamedTuple):
    """Tensions that are allowed over a block; lines around the smallest one, N, and around the largest one, N."""

    low: Lines
    high: Lines

    def narrowed(
        self, winches: Winches, quantity: str, limit: Float[Array, "n_cables"], motors: MotorBounds
    ) -> "TensionLines":
        """Tensions with which a limit of winches is kept, too."""
        both = motors.over_sides(_tensions(winches, quantity, limit, motors))
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
    # Lines around the largest tensions, and around minus the smallest, with which a limit is kept, (2, 2, sides, n).
    gain = _beside(_beside(reciprocal(motors.radius), 1) * winches.efficiency[None] ** SIDES, 1)
    own_torque = _beside(motors.own_torque, 1) * -SIGNS[:, None, None]
    if quantity == "motor_load":
        slack = _beside(_room_of_load(winches, limit, motors) * jnp.asarray(winches.stall_torque)[None], 2, at=1)
        return _lines((slack + _beside(own_torque, 1)) * _beside(gain, 1)).smallest(1)
    if quantity != "motor_power":
        return _lines((own_torque + limit[None, None]) * gain)
    # The torque of a power grows without bound towards standstill.
    speed = motors.speed * jnp.where(motors.speed.middle < 0.0, -1.0, 1.0)
    turns = speed.low() > 0.0
    away = selected(turns, speed, constant(jnp.ones_like(limit)))
    slowest = constant(limit / jnp.maximum(motors.speed.magnitude(), STANDSTILL))
    lines = _lines((_beside(selected(turns, reciprocal(away) * limit, slowest), 2) + own_torque) * gain)
    return lines._replace(above=jnp.where(turns.reshape(1, 1, 1, -1), lines.above, jnp.inf))


def _room_of_load(winches: Winches, limit: Array, motors: MotorBounds) -> AffineBounds:
    # Load that the speed leaves to the torque, for both signs of the speed, (2, n_cables).
    return _beside(motors.speed, 1) * (-SIGNS[:, None] / jnp.asarray(winches.no_load_speed)[None]) + limit[None]


def _beside(bounds: AffineBounds, count: int, at: int = 0) -> AffineBounds:
    # Bounds with more axes of length 1.
    return bounds.each(lambda x: jnp.expand_dims(x, tuple(range(at, at + count))))


def _lines(value: AffineBounds) -> Lines:
    ends = jnp.stack([value.middle - value.linear, value.middle + value.linear])
    return Lines(ends - value.radius[None], ends + value.radius[None])


def part_of(lines: Lines) -> tuple[Array, ...]:
    """Bounds of a slack by numbers, and rises of its lines; see `verification.bounds.block_slacks.BlockSlacks`."""
    below, above = lines
    return jnp.min(below, axis=0), jnp.max(above, axis=0), below[1] - below[0], above[1] - above[0]
