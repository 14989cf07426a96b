"""Tensions with which motors keep limits of torque, power and load on a path, linear near a reference motion.

With path acceleration u and squared path speed x a motor turns at w = w' sqrt(x) and accelerates with w' u + w'' x,
where ' is the derivative along the path. Its torque r f / (i e^s) + J dw/dt + s c + b w, in `robots.model.winches`, is
affine in the tension, u and x but for viscous friction, and so is the torque that a limit allows but for power and
load. sqrt(x) and 1 / sqrt(x) are replaced by their tangents at the x of the reference: what a limit of power or of load
allows is then never overestimated. Searches that take each motion as the next reference end where the tangents are
exact.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.motion.limits import motor_limits_set
from cspr_jax.robots.cables import AnyRobot, cable_motion
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.state import State
from cspr_jax.robots.model.winches import STANDSTILL, radii

# Sides of friction: winding, paying out.
SIDES = np.array([[[1.0], [-1.0]]])
# Motors turn at no less than this speed at references, rad/s.
SLOWEST = 1e3 * STANDSTILL


class ReferenceMotion(NamedTuple):
    """Motion near which limits of motors are linear.

    Fields:
        u: (...) path acceleration, m/s^2.
        x: (...) squared path speed, m^2/s^2.
    """

    u: Any
    x: Any


class LinearBounds(NamedTuple):
    """Bounds u_coefficient u + x_coefficient x + constant of the tension of each cable.

    Fields:
        u: (..., n_cables) coefficients of the path acceleration, N s^2/m.
        x: (..., n_cables) coefficients of the squared path speed, N s^2/m^2.
        constant: (..., n_cables) N; infinite for no bound.
    """

    u: Array
    x: Array
    constant: Array

    def at(self, reference: ReferenceMotion) -> Array:
        """Values at the reference."""
        return self.u * reference.u + self.x * reference.x + self.constant


class MotorTensions(NamedTuple):
    """Tensions with which motors keep their limits: for each limit and side of friction, (n_limits, 2, n_cables).

    Fields:
        low: smallest tensions.
        high: largest tensions.
        width: half of the distance between them at the reference, N; 0 without a bound.
    """

    low: LinearBounds
    high: LinearBounds
    width: Array


def motor_tensions(robot: AnyRobot, limits: Limits, state: State, reference: ReferenceMotion) -> MotorTensions:
    """Tensions at one point of a path, traversed at unit path speed by `state`."""
    winches: Any = robot.winches
    length, rate, acceleration = cable_motion(robot, state)
    radius = radii(winches, length) / winches.gear_ratio
    speed, speed_change = -rate / radius, -acceleration / radius
    magnitude = jnp.maximum(jnp.abs(speed), SLOWEST)
    root = jnp.maximum(jnp.sqrt(reference.x), SLOWEST / magnitude)
    # The motor's speed, by the tangent of the square root.
    turning = LinearBounds(jnp.zeros_like(speed), 0.5 * magnitude / root, 0.5 * magnitude * root)
    viscous = winches.viscous_friction * jnp.sign(speed)
    no_load_u = (winches.motor_inertia * speed)[None, None]
    no_load_x = (winches.motor_inertia * speed_change + viscous * turning.x)[None, None]
    no_load = (viscous * turning.constant)[None, None] + SIDES * winches.friction[None, None]
    rows = [_allowed(winches, row.quantity, getattr(limits, row.name), turning) for row in motor_limits_set(limits)]
    torque_x, torque = (jnp.stack([row[k] * jnp.ones_like(speed) for row in rows])[:, None] for k in (0, 1))
    gain = radius[None, None] * winches.efficiency[None, None] ** -SIDES
    acts = SIDES * (speed * jnp.sqrt(reference.x))[None, None] >= -STANDSTILL

    def bounds(sign: float) -> LinearBounds:
        constant = jnp.where(acts, (sign * torque - no_load) / gain, sign * jnp.inf)
        return LinearBounds(
            jnp.broadcast_to(-no_load_u / gain, constant.shape), (sign * torque_x - no_load_x) / gain, constant
        )

    width = jnp.where(acts, (torque + torque_x * reference.x) / gain, 0.0)
    return MotorTensions(bounds(-1.0), bounds(1.0), width)


def _allowed(winches: Any, quantity: str, limit: Array, turning: LinearBounds) -> tuple[Array, Array]:
    # Coefficient of x, and constant, of the torque that a limit allows.
    if quantity == "motor_power":
        # The tangent of 1 / sqrt(x): the speed at the reference is twice the constant of `turning`.
        slowest = 2.0 * turning.constant
        return -0.5 * limit / slowest * (turning.x / turning.constant), 1.5 * limit / slowest
    if quantity == "motor_load":
        steepness = winches.stall_torque / winches.no_load_speed
        return -steepness * turning.x, winches.stall_torque * limit - steepness * turning.constant
    return jnp.zeros_like(turning.x), limit
