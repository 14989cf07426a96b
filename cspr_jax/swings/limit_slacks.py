"""Limits of tension, height, cable length, of speeds and accelerations of cables and mass centre, as slacks.

In the notation of `slacks`, with m the number of cables, rho_k the length of cable k, F the tension over
the weight, and rates with respect to tau; w_k = (p - a_k) . p'. F of cable k is kappa_k rho_k / (m z0 eta).

    tension        kappa_k rho_k / (m z0) - F_min eta,   F_max eta - kappa_k rho_k / (m z0)
    floor          (floor - z) / z0
    length         (rho_max^2 - rho_k^2) / (2 z0^2)
    speed          (rho_k^2 - (w_k / (T v_max))^2) / (2 z0^2)
    acceleration   (a_max T^2 rho_k^3 -+ (rho_k^2 w_k' - w_k^2)) / (a_max T^2 z0^3)
    mass centre    1 - (|p'| / (T v_max))^2,   1 - (|p''| / (T^2 a_max))^2

Each is dimensionless and free of a division that could blow up.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from cspr_jax.arithmetic.bounds import Bounds
from cspr_jax.arithmetic.elementary import sincospi
from cspr_jax.motions.limits import limits_set
from cspr_jax.robots.limits import Limits
from cspr_jax.robots.point_mass import PointMassRobot, plane_normal
from cspr_jax.schema.limits import Limit
from cspr_jax.swings.hypocycloid import Segment, duration, oscillation
from cspr_jax.swings.slacks import Instant, Stretch, row_bounds


class _AtInstant(NamedTuple):
    # A segment at one instant: numbers, and (n_cables,) of the cables; derivatives in tau.
    z0: Array
    time: Array
    weight: Array
    eta: Array
    lift: Array
    depth: Array
    length: Array
    rate: Array
    rate_slope: Array
    velocity: Array
    acceleration: Array


class _OverInterval(NamedTuple):
    # Bounds over an interval; `square` bounds (rho^2)'' without the division that is in `length`.
    n_cables: int
    z0: Array
    time: Array
    weight: Array
    kappa: Bounds
    eta: Bounds
    depth: Bounds
    length: Bounds
    pace: Bounds
    pull: Bounds
    square: Array


class _Closed(NamedTuple):
    # Closed form of a limit: its slacks, the bound of their second derivatives, and how many slacks each cable has.
    slack: Callable[[_AtInstant, Array], Array]
    curvature: Callable[[_OverInterval, Array], Array]
    sides: int = 1


def _bends(state: _AtInstant, limit: Array) -> Array:
    bend = (state.length**2 * state.rate_slope - state.rate**2) / (limit * state.time**2)
    return jnp.concatenate([state.length**3 - bend, state.length**3 + bend]) / state.z0**3


def _lifted(over: _OverInterval, limit: Array) -> Array:
    whole = over.kappa._replace(value=1.0 + over.kappa.value)
    lift = (whole * over.length).times(1.0 / (over.n_cables * over.z0))
    return (lift + over.eta.times(limit / over.weight)).curvature


def _rated(over: _OverInterval, limit: Array) -> Array:
    rate = _rate(over.length, over.pace, over.pull)
    return 0.5 * (over.square + (rate * rate).curvature / (over.time * limit) ** 2) / over.z0**2


def _bent(over: _OverInterval, limit: Array) -> Array:
    length, bend = over.length, _bend(over.length, over.pace, over.pull, over.square)
    cube = 6.0 * length.value * over.pace.slope**2 + 3.0 * length.value**2 * over.pace.curvature
    return (cube + bend.curvature / (limit * over.time**2)) / over.z0**3


def _square_share(vector: Array, largest: Array) -> Array:
    return 1.0 - jnp.dot(vector, vector) / largest**2


# Every row of `schema.limits.LIMITS` has an entry.
CLOSED = {
    "tension_min": _Closed(lambda state, limit: state.lift - limit / state.weight * state.eta, _lifted),
    "tension_max": _Closed(lambda state, limit: limit / state.weight * state.eta - state.lift, _lifted),
    "floor": _Closed(
        lambda state, limit: (limit - state.depth) / state.z0, lambda over, _: over.depth.curvature / over.z0
    ),
    "cable_length_max": _Closed(
        lambda state, limit: (limit**2 - state.length**2) / (2.0 * state.z0**2),
        lambda over, _: 0.5 * over.square / over.z0**2,
    ),
    "cable_speed_max": _Closed(
        lambda state, limit: (state.length**2 - (state.rate / (state.time * limit)) ** 2) / (2.0 * state.z0**2), _rated
    ),
    "cable_acceleration_max": _Closed(_bends, _bent, 2),
    "speed_max": _Closed(
        lambda state, limit: _square_share(state.velocity, state.time * limit),
        lambda over, limit: (
            2.0 * (over.pace.curvature**2 + over.pace.slope * over.pull.slope) / (over.time * limit) ** 2
        ),
    ),
    "acceleration_max": _Closed(
        lambda state, limit: _square_share(state.acceleration, state.time**2 * limit),
        lambda over, limit: (
            2.0 * (over.pull.slope**2 + over.pull.value * over.pull.curvature) / (over.time**2 * limit) ** 2
        ),
    ),
}


def count(row: Limit, n_cables: int) -> int:
    """Number of smooth functions of which the slack of a limit is the smallest.

    Returns:
        one for a height; one for each cable, or two for either sign.
    """
    return CLOSED[row.name].sides * (n_cables if row.per_cable else 1)


@jax.jit
def limit_slacks(
    robot: PointMassRobot, limits: Limits, segment: Segment, arcs: Array, tau: Array, state: Instant
) -> tuple[list[Array], ...]:
    """The slacks of each limit, at one instant: smooth functions, one or two for each cable.

    Args:
        robot: a point mass on three cables.
        segment: of the parity of `arcs`.
        arcs: () number of arcs, a float.
        tau: () normalised time.
        state: the state at `tau`.

    Returns:
        a list of () for each limit of `limits_set`, as long as `count` says.
    """
    if not limits_set(limits):
        return ()
    position, slope, curvature = _path(segment, arcs, tau, state)
    rays = position[None] - robot.base_points
    length = jnp.linalg.norm(rays, axis=1)
    rate = rays @ slope
    rate_slope = jnp.dot(slope, slope) + rays @ curvature
    z0, time, weight = segment.hub[2], duration(segment, arcs), robot.mass * robot.gravity
    lift = jnp.stack(state.kappa) * length / (len(state.kappa) * z0)
    here = _AtInstant(z0, time, weight, state.eta, lift, position[2], length, rate, rate_slope, slope, curvature)
    slacks = (CLOSED[row.name].slack(here, getattr(limits, row.name)) for row in limits_set(limits))
    return tuple([slack] if slack.ndim == 0 else [slack[i] for i in range(slack.shape[0])] for slack in slacks)


def _path(segment: Segment, arcs: Array, tau: Array, state: Instant) -> tuple[Array, Array, Array]:
    # Return the position and its first two derivatives in tau.
    ratio, steady, period = oscillation(segment, arcs)
    span = segment.end_radius - segment.start_radius
    r, r1 = segment.start_radius + span * state.amplitude_values[0], span * state.amplitude_values[1]
    sine, cosine = sincospi(segment.sense * arcs * tau)
    lateral, axial = sincospi(segment.sense * segment.precession * tau)
    slope_r = r1 * cosine - r * segment.sense * steady / (math.pi * arcs) * sine
    slope_t = r1 * ratio * sine
    slope = jnp.stack([axial * slope_r + lateral * slope_t, axial * slope_t - lateral * slope_r])
    return segment.hub + segment.plane @ state.c, segment.plane @ slope, segment.plane @ (period * (state.d - state.c))


def limit_curvatures(
    robot: PointMassRobot, limits: Limits, segment: Segment, arcs: Array, over: Stretch, kappa: Bounds
) -> tuple[Array, ...]:
    """Bound of the second derivative of each limit's slack over an interval.

    Args:
        robot: a point mass on three cables.
        segment: of the parity of `arcs`.
        arcs: () number of arcs, a float.
        kappa: bounds of the variable part of the pseudotensions over the interval, leaves (n_cables,).

    Returns:
        one () for each limit of `limits_set`, the largest over the cables.
    """
    if not limits_set(limits):
        return ()
    z0, time, weight = segment.hub[2], duration(segment, arcs), robot.mass * robot.gravity
    pace, pull = pace_bounds(segment, arcs, over)
    eta = row_bounds(segment, arcs, over, segment.tilt)
    length = _length(robot, segment, over, pace, eta)
    depth = row_bounds(segment, arcs, over, segment.plane[2])
    square = 2.0 * (pace.slope**2 + length.value * pace.curvature)
    here = _OverInterval(robot.n_cables, z0, time, weight, kappa, eta, depth, length, pace, pull, square)
    return tuple(jnp.max(CLOSED[row.name].curvature(here, getattr(limits, row.name))) for row in limits_set(limits))


def pace_bounds(segment: Segment, arcs: Array, over: Stretch) -> tuple[Bounds, Bounds]:
    """Bounds of how the mass moves over an interval, derivatives in normalised time.

    Args:
        segment: of the parity of `arcs`.
        arcs: () number of arcs, a float.

    Returns:
        the bounds, () each: of the position from P0 and of its first two derivatives, m; of the second derivative and
        of its first two derivatives.
    """
    ratio, steady, period = oscillation(segment, arcs)
    omega, gain = math.pi * arcs, steady / period
    precession = math.pi * segment.precession
    one = jnp.ones_like(omega)
    wave = Bounds(one, omega, omega**2)
    rho = (over.bend + over.size.times(jnp.abs(segment.end_curvature))).times(1.0 / period)
    c = (over.size * wave).combined((over.size * wave).times(ratio)).turned(precession)
    d_r = rho * wave + (over.growth * wave).times(2.0 * gain / omega)
    d_t = ((rho + over.size.times(2.0 * gain)) * wave).times(ratio)
    return c, (d_r.combined(d_t).turned(precession) + c).times(period)  # c'' = T^2 lambda (d - c)


def _length(robot: PointMassRobot, segment: Segment, over: Stretch, pace: Bounds, eta: Bounds) -> Bounds:
    # |rho'| <= |p'|, and rho'' = (|p'|^2 - rho'^2 + ray . p'') / rho; leaves (n_cables,).
    nearest = least_lengths(robot, segment, over, pace, eta)
    slope = jnp.broadcast_to(pace.slope, nearest.shape)
    farthest = _at_middle(robot, segment, over) + over.radius * pace.slope
    return Bounds(farthest, slope, slope**2 / nearest + pace.curvature)


def _at_middle(robot: PointMassRobot, segment: Segment, over: Stretch) -> Array:
    return jnp.linalg.norm((segment.hub + segment.plane @ over.place)[None] - robot.base_points, axis=1)


def least_lengths(robot: PointMassRobot, segment: Segment, over: Stretch, pace: Bounds, eta: Bounds) -> Array:
    """Lower bounds of the lengths of the cables over an interval.

    No cable is shorter than the distance from the spool plane. Where the mass goes far within the interval, its
    greatest distance from P0 and its least depth say more than its length and depth in the middle.

    Args:
        robot: a point mass on three cables.
        pace: bounds of the position from P0, () each, as `pace_bounds` gives them.
        eta: bounds of the depth over z0, less 1, () each.

    Returns:
        (n_cables,) m, not negative.
    """
    in_middle = _at_middle(robot, segment, over) - over.radius * pace.slope
    from_hub = jnp.linalg.norm(segment.hub[None] - robot.base_points, axis=1) - pace.value
    lowest = jnp.maximum(segment.tilt @ over.place - over.radius * eta.slope, -eta.value)
    depth = (1.0 + lowest) * segment.hub[2] / jnp.linalg.norm(plane_normal(robot))
    return jnp.maximum(jnp.maximum(in_middle, from_hub), jnp.maximum(depth, 0.0))


def _rate(length: Bounds, pace: Bounds, pull: Bounds) -> Bounds:
    # w = ray . p'
    return Bounds(
        length.value * pace.slope,
        pace.slope**2 + length.value * pace.curvature,
        3.0 * pace.slope * pace.curvature + length.value * pull.slope,
    )


def _bend(length: Bounds, pace: Bounds, pull: Bounds, square: Array) -> Bounds:
    # rho^2 w' - w^2, with w' = |p'|^2 + ray . p'' and the bounds of rho^2 that need no division.
    rate = _rate(length, pace, pull)
    last = 3.0 * pace.curvature**2 + 4.0 * pace.slope * pull.slope + length.value * pull.curvature
    slope = Bounds(rate.slope, rate.curvature, last)
    return Bounds(length.value**2, 2.0 * length.value * pace.slope, square) * slope + rate * rate
