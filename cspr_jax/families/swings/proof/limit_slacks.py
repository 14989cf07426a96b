"""Slacks of limits of tension, height, cable length, and of speeds and accelerations of cables and mass centre.

In the notation of `slacks`, with m the number of cables, rho_k the length of cable k, F the tension over the weight,
derivatives with respect to tau, and w_k = (p - a_k) . p', F of cable k is kappa_k rho_k / (m z0 eta).

    tension        kappa_k rho_k / (m z0) - F_min eta,   F_max eta - kappa_k rho_k / (m z0)
    floor          (floor - z) / z0
    length         (rho_max^2 - rho_k^2) / (2 z0^2)
    speed          (rho_k^2 - (w_k / (T v_max))^2) / (2 z0^2)
    acceleration   (a_max T^2 rho_k^3 -+ (rho_k^2 w_k' - w_k^2)) / (a_max T^2 z0^3)
    mass centre    1 - (|p'| / (T v_max))^2,   1 - (|p''| / (T^2 a_max))^2

Each slack is dimensionless, and no division in it can overflow.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from cspr_jax.families.swings.hypocycloid import Segment, duration, oscillation
from cspr_jax.families.swings.proof.slacks import IntervalBounds, SwingState, row_bounds
from cspr_jax.motion.limits import limits_set
from cspr_jax.numerics.bounds.value_and_derivatives import Bounds
from cspr_jax.numerics.elementary import sincospi
from cspr_jax.numerics.linear.lanes import Vector, dot, largest
from cspr_jax.numerics.shapes import Float, Num
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.point_mass import PointMassRobot, plane_normal
from cspr_jax.schema.limits import Limit


class _CableState(NamedTuple):
    # A segment and one of its cables at one time; derivatives in tau. These are scalars, from which XLA makes one loop.
    z0: Array
    time: Array
    weight: Array
    eta: Array
    lift: Array
    depth: Array
    length: Array
    rate: Array
    rate_derivative: Array
    velocity: Vector
    acceleration: Vector


class _OverInterval(NamedTuple):
    # Bounds for one cable over an interval; `square` bounds (rho^2)'' without the division in `length`.
    n_cables: int
    z0: Array
    time: Array
    weight: Array
    kappa: Bounds
    eta: Bounds
    depth: Bounds
    length: Bounds
    position: Bounds
    acceleration: Bounds
    square: Array


class _Closed(NamedTuple):
    # Closed form of a limit: its slack, the bound of the second derivative, and the number of slacks of each cable (2
    # if the slack is a pair).
    slack: Callable[[_CableState, Array], Any]
    curvature: Callable[[_OverInterval, Array], Array]
    sides: int = 1


def _acceleration_slacks(state: _CableState, limit: Array) -> tuple[Array, Array]:
    second_derivative = (state.length**2 * state.rate_derivative - state.rate**2) / (limit * state.time**2)
    return (state.length**3 - second_derivative) / state.z0**3, (state.length**3 + second_derivative) / state.z0**3


def _tension_curvature(over: _OverInterval, limit: Array) -> Array:
    full = over.kappa._replace(value=1.0 + over.kappa.value)
    lift = (full * over.length).times(1.0 / (over.n_cables * over.z0))
    return (lift + over.eta.times(limit / over.weight)).curvature


def _speed_curvature(over: _OverInterval, limit: Array) -> Array:
    rate = _rate(over.length, over.position, over.acceleration)
    return 0.5 * (over.square + (rate * rate).curvature / (over.time * limit) ** 2) / over.z0**2


def _acceleration_curvature(over: _OverInterval, limit: Array) -> Array:
    length, second_derivative = (
        over.length,
        _acceleration_bounds(over.length, over.position, over.acceleration, over.square),
    )
    cube = 6.0 * length.value * over.position.derivative**2 + 3.0 * length.value**2 * over.position.curvature
    return (cube + second_derivative.curvature / (limit * over.time**2)) / over.z0**3


def _square_fraction(vector: Vector, largest: Array) -> Array:
    return 1.0 - dot(vector, vector) / largest**2


# Every row of `schema.limits.LIMITS` has an entry.
CLOSED = {
    "tension_min": _Closed(lambda state, limit: state.lift - limit / state.weight * state.eta, _tension_curvature),
    "tension_max": _Closed(lambda state, limit: limit / state.weight * state.eta - state.lift, _tension_curvature),
    "floor": _Closed(
        lambda state, limit: (limit - state.depth) / state.z0, lambda over, _: over.depth.curvature / over.z0
    ),
    "cable_length_max": _Closed(
        lambda state, limit: (limit**2 - state.length**2) / (2.0 * state.z0**2),
        lambda over, _: 0.5 * over.square / over.z0**2,
    ),
    "cable_speed_max": _Closed(
        lambda state, limit: (state.length**2 - (state.rate / (state.time * limit)) ** 2) / (2.0 * state.z0**2),
        _speed_curvature,
    ),
    "cable_acceleration_max": _Closed(_acceleration_slacks, _acceleration_curvature, 2),
    "speed_max": _Closed(
        lambda state, limit: _square_fraction(state.velocity, state.time * limit),
        lambda over, limit: (
            2.0
            * (over.position.curvature**2 + over.position.derivative * over.acceleration.derivative)
            / (over.time * limit) ** 2
        ),
    ),
    "acceleration_max": _Closed(
        lambda state, limit: _square_fraction(state.acceleration, state.time**2 * limit),
        lambda over, limit: (
            2.0
            * (over.acceleration.derivative**2 + over.acceleration.value * over.acceleration.curvature)
            / (over.time**2 * limit) ** 2
        ),
    ),
}


def count(row: Limit, n_cables: int) -> int:
    """Number of smooth functions whose minimum is the slack of a limit."""
    return CLOSED[row.name].sides * (n_cables if row.per_cable else 1)


@jax.jit
def limit_slacks(
    robot: PointMassRobot,
    limits: Limits,
    segment: Segment,
    arcs: Num[Array, ""],
    tau: Float[Array, ""],
    state: SwingState,
) -> tuple[list[Array], ...]:
    """Slacks of each limit at one time: smooth functions, one or two for each cable."""
    if not limits_set(limits):
        return ()
    position, velocity, acceleration = _path(segment, arcs, tau, state)
    z0, time, weight = segment.center[2], duration(segment, arcs), robot.mass * robot.gravity
    speed_square = dot(velocity, velocity)

    def cable_state(cable: int) -> _CableState:
        ray = [position[i] - robot.base_points[cable, i] for i in range(3)]
        length = jnp.sqrt(dot(ray, ray))
        lift = state.kappa[cable] * length / (len(state.kappa) * z0)
        rate, rate_derivative = dot(ray, velocity), speed_square + dot(ray, acceleration)
        numbers = z0, time, weight, state.eta, lift, position[2], length, rate, rate_derivative
        return _CableState(*numbers, velocity, acceleration)

    cables = [cable_state(k) for k in range(robot.n_cables)]

    def row_slacks(row: Limit) -> list[Array]:
        slack, limit = CLOSED[row.name].slack, getattr(limits, row.name)
        if not row.per_cable:
            return [slack(cables[0], limit)]
        return jax.tree.leaves([slack(cable, limit[k]) for k, cable in enumerate(cables)])

    return tuple(row_slacks(row) for row in limits_set(limits))


def _path(segment: Segment, arcs: Array, tau: Array, state: SwingState) -> tuple[Vector, Vector, Vector]:
    # Return the position and its first two derivatives in tau.
    ratio, steady, period = oscillation(segment, arcs)
    span = segment.end_radius - segment.start_radius
    r, r1 = segment.start_radius + span * state.amplitude_values[0], span * state.amplitude_values[1]
    sine, cosine = sincospi(segment.sense * arcs * tau)
    lateral, axial = sincospi(segment.sense * segment.precession * tau)
    rate_r = r1 * cosine - r * segment.sense * steady / (math.pi * arcs) * sine
    rate_t = r1 * ratio * sine
    rates = axial * rate_r + lateral * rate_t, axial * rate_t - lateral * rate_r
    second_derivative = period * (state.d[0] - state.c[0]), period * (state.d[1] - state.c[1])
    return _in_space(segment, state.c, segment.center), _in_space(segment, rates), _in_space(segment, second_derivative)


def _in_space(segment: Segment, vector: Sequence[Array] | Array, origin: Sequence[Any] | Array = (0, 0, 0)) -> Vector:
    # Convert from the plane of the trajectory; without a matrix product, for which XLA makes a loop of its own.
    plane = segment.plane
    return [origin[i] + plane[i, 0] * vector[0] + plane[i, 1] * vector[1] for i in range(3)]


def limit_curvatures(
    robot: PointMassRobot,
    limits: Limits,
    segment: Segment,
    arcs: Num[Array, ""],
    over: IntervalBounds,
    kappa: Sequence[Bounds],
) -> tuple[Float[Array, ""], ...]:
    """Bound of the second derivative of each limit's slack over an interval."""
    if not limits_set(limits):
        return ()
    z0, time, weight = segment.center[2], duration(segment, arcs), robot.mass * robot.gravity
    position, acceleration = motion_bounds(segment, arcs, over)
    eta = row_bounds(segment, arcs, over, segment.tilt)
    depth = row_bounds(segment, arcs, over, segment.plane[2])

    def cable_bounds(kappa: Bounds, length: Bounds) -> _OverInterval:
        square = 2.0 * (position.derivative**2 + length.value * position.curvature)
        return _OverInterval(
            robot.n_cables, z0, time, weight, kappa, eta, depth, length, position, acceleration, square
        )

    cables = [cable_bounds(*each) for each in zip(kappa, _lengths(robot, segment, over, position, eta), strict=True)]

    def row_curvature(row: Limit) -> Array:
        curvature, limit = CLOSED[row.name].curvature, getattr(limits, row.name)
        if not row.per_cable:
            return curvature(cables[0], limit)
        return largest([curvature(cable, limit[k]) for k, cable in enumerate(cables)])

    return tuple(row_curvature(row) for row in limits_set(limits))


def motion_bounds(segment: Segment, arcs: Num[Array, ""], over: IntervalBounds) -> tuple[Bounds, Bounds]:
    """Bounds of the position and of its second derivative in normalised time, over an interval."""
    ratio, steady, period = oscillation(segment, arcs)
    omega, gain = math.pi * arcs, steady / period
    precession = math.pi * segment.precession
    one = jnp.ones_like(omega)
    wave = Bounds(one, omega, omega**2)
    rho = (over.second_derivative + over.swing_radius.times(jnp.abs(segment.end_curvature))).times(1.0 / period)
    c = (over.swing_radius * wave).combined((over.swing_radius * wave).times(ratio)).rotated(precession)
    d_r = rho * wave + (over.radial_rate * wave).times(2.0 * gain / omega)
    d_t = ((rho + over.swing_radius.times(2.0 * gain)) * wave).times(ratio)
    return c, (d_r.combined(d_t).rotated(precession) + c).times(period)  # c'' = T^2 lambda (d - c)


def _lengths(
    robot: PointMassRobot, segment: Segment, over: IntervalBounds, position: Bounds, eta: Bounds
) -> list[Bounds]:
    # |rho'| <= |p'|, and rho'' = (|p'|^2 - rho'^2 + ray . p'') / rho.
    nearest = least_lengths(robot, segment, over, position, eta)
    farthest = [x + over.radius * position.derivative for x in _at_middle(robot, segment, over)]
    second_derivatives = [position.derivative**2 / x + position.curvature for x in nearest]
    return [
        Bounds(x, position.derivative, second_derivative)
        for x, second_derivative in zip(farthest, second_derivatives, strict=True)
    ]


def _at_middle(robot: PointMassRobot, segment: Segment, over: IntervalBounds) -> list[Array]:
    return _distances(robot, _in_space(segment, over.position, segment.center))


def _distances(robot: PointMassRobot, position: Vector | Array) -> list[Array]:
    rays = ([position[i] - spool[i] for i in range(3)] for spool in robot.base_points)
    return [jnp.sqrt(dot(ray, ray)) for ray in rays]


def least_lengths(
    robot: PointMassRobot, segment: Segment, over: IntervalBounds, position: Bounds, eta: Bounds
) -> list[Array]:
    """Lower bounds of the cable lengths over an interval.

    No cable is shorter than the distance from the spool plane. If the mass moves far within the interval, its largest
    distance from P0 and its smallest depth give better bounds than its length and depth in the middle.
    """
    tilt = segment.tilt[0] * over.position[0] + segment.tilt[1] * over.position[1]
    lowest = jnp.maximum(tilt - over.radius * eta.derivative, -eta.value)
    depth = jnp.maximum((1.0 + lowest) * segment.center[2] / jnp.linalg.norm(plane_normal(robot)), 0.0)
    each = zip(_at_middle(robot, segment, over), _distances(robot, segment.center), strict=True)
    return [largest([x - over.radius * position.derivative, y - position.value, depth]) for x, y in each]


def _rate(length: Bounds, position: Bounds, acceleration: Bounds) -> Bounds:
    # Here w = ray . p'.
    return Bounds(
        length.value * position.derivative,
        position.derivative**2 + length.value * position.curvature,
        3.0 * position.derivative * position.curvature + length.value * acceleration.derivative,
    )


def _acceleration_bounds(length: Bounds, position: Bounds, acceleration: Bounds, square: Array) -> Bounds:
    # Bound rho^2 w' - w^2, with w' = |p'|^2 + ray . p'' and the bounds of rho^2 that need no division.
    rate = _rate(length, position, acceleration)
    last = (
        3.0 * position.curvature**2
        + 4.0 * position.derivative * acceleration.derivative
        + length.value * acceleration.curvature
    )
    derivative = Bounds(rate.derivative, rate.curvature, last)
    return Bounds(length.value**2, 2.0 * length.value * position.derivative, square) * derivative + rate * rate
