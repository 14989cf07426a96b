"""The slacks of `slacks.pose_slacks` for many platforms, one lane a case, and the part of them that the sieve needs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import jax.numpy as jnp
from jax import Array

from cspr_jax.families.platforms.platform_segment import PlatformSegment
from cspr_jax.families.platforms.platform_segment_lanes import InstantLanes, StateLanes, squared_duration, state
from cspr_jax.motion.limits import limits_set, scales, slack
from cspr_jax.motion.platform_kind import PlatformMotionKind
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.linear.lanes import dot, largest, smallest
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.point_mass import plane_normal
from cspr_jax.robots.statics.wrench_lanes import (
    CABLES,
    Balance,
    CableLanes,
    balance,
    cable_lanes,
    cable_rates,
    inertial_wrench,
    normalised_determinant,
)
from cspr_jax.schema.limits import Limit

if TYPE_CHECKING:
    from jaxtyping import Float

# No tension is given below this volume of three of the cables over the product of their lengths: they lie nearly in one
# plane, and the rounding of the fast balance grows with the third power of the inverse volume. It must refute nothing.
FLAT = 1e-3


def _balanced(robot: PlatformRobot, here: StateLanes, cables: CableLanes, squared: Array) -> Balance:
    def slowed(vector):
        return tuple(x / squared for x in vector)

    # The moment is of second order in time like the force: omega enters squared.
    force, moment = inertial_wrench(
        robot, slowed(here.acceleration), here.rotation, here.omega, here.angular_acceleration
    )
    return balance(cables, force, slowed(moment))


def _is_flat(cables: CableLanes, balance: Balance) -> Array:
    # Tell where three of the cables are nearly in one plane.
    a, b, c = (dot(cables.rays[k], cables.rays[k]) for k in range(0, CABLES, 2))
    return balance.volume * balance.volume < FLAT**2 * a * b * c


def _smallest_tension(rate: Array, balance: Balance) -> Array:
    # Return the smallest tension over its value at rest in P0 if all were equal.
    fraction = CABLES / (rate * balance.denominator)
    return smallest([x * fraction for x in balance.numerators])


def certain_tension(
    rate: Float[Array, "n"], regular: Float[Array, "n"], cables: CableLanes, balance: Balance
) -> Float[Array, "n"]:
    """The smallest tension, where the fast balance gives one."""
    lowest = jnp.where(balance.signed * regular > 0.0, _smallest_tension(rate, balance), -jnp.inf)
    return jnp.where(_is_flat(cables, balance), jnp.inf, lowest)


def lowest_tension(
    robot: PlatformRobot, segment: PlatformSegment, arcs: Array, instant: InstantLanes, kind: PlatformMotionKind
) -> Float[Array, "n"]:
    """The smallest tension at one instant of many segments."""
    current = state(segment, arcs, instant, kind)
    cables = cable_lanes(robot, current.position, current.rotation)
    balance = _balanced(robot, current, cables, squared_duration(segment, arcs))
    return certain_tension(segment.rate, segment.regular, cables, balance)


def moving_slacks(
    problem: Problem, segment: PlatformSegment, arcs: Array, instant: InstantLanes, kind: PlatformMotionKind
) -> list[Array]:
    """Smallest slacks of the criteria that depend on the motion, at one instant of many segments."""
    robot, limits = problem.robot, problem.limits
    current, squared = state(segment, arcs, instant, kind), squared_duration(segment, arcs)
    cables = cable_lanes(robot, current.position, current.rotation)
    balance = _balanced(robot, current, cables, squared)
    is_flat = _is_flat(cables, balance)
    values = [jnp.where(is_flat, jnp.inf, _smallest_tension(segment.rate, balance))]
    rows = _limit_rows(limits, of_motion=True)
    if not rows:
        return values
    lengths, rates, bends = cable_rates(
        cables, current.velocity, current.acceleration, current.omega, current.angular_acceleration
    )
    pace, scale = jnp.sqrt(squared), scales(CABLES, robot.mass * robot.gravity, robot.gravity / segment.rate)
    each = {
        "tension": [robot.mass * x / balance.denominator * y for x, y in zip(balance.numerators, lengths, strict=True)],
        "speed": [jnp.abs(rate) / pace for rate in rates],
        "acceleration": [jnp.abs(second_derivative) / squared for second_derivative in bends],
        "mass_centre_speed": [jnp.sqrt(dot(current.velocity, current.velocity)) / pace],
        "mass_centre_acceleration": [jnp.sqrt(dot(current.acceleration, current.acceleration)) / squared],
    }
    for row in rows:
        minimum = _least(row, limits, each[row.quantity], scale)
        values.append(jnp.where(is_flat, jnp.inf, minimum) if row.quantity == "tension" else minimum)
    return values


def still_slacks(problem: Problem, segment: PlatformSegment, here: StateLanes, cables: CableLanes) -> list[Array]:
    """Smallest slacks of the criteria that depend on the pose alone, at one instant of many segments."""
    robot, limits, z0 = problem.robot, problem.limits, problem.robot.gravity / segment.rate
    normal = plane_normal(robot)
    below = dot([normal[i] for i in range(3)], here.position) / z0
    values = [normalised_determinant(robot, cables) / segment.regular, below]
    scale = scales(CABLES, robot.mass * robot.gravity, z0)
    attached = [ray[2] + robot.base_points[k, 2] for k, ray in enumerate(cables.rays)]
    each = {
        "depth": [largest([here.position[2], *attached])],
        "length": [jnp.sqrt(dot(ray, ray)) for ray in cables.rays],
    }
    return values + [_least(row, limits, each[row.quantity], scale) for row in _limit_rows(limits, of_motion=False)]


def _limit_rows(limits: Limits, *, of_motion: bool) -> list[Limit]:
    return [row for row in limits_set(limits) if row.of_motion == of_motion]


def _least(row: Limit, limits: Limits, each: list[Array], scale) -> Array:
    # Return the smallest slack of a limit on a quantity of each cable, or on a single quantity.
    limit = getattr(limits, row.name)
    bounds = [limit[k] for k in range(len(each))] if row.per_cable else [limit]
    return smallest([slack(row, x, value, scale) for x, value in zip(bounds, each, strict=True)])


def order(limits: Limits) -> list[int]:
    """Order of the criteria of `slacks.flags` among moving slacks and still ones, one after the other."""
    moving, still = _limit_rows(limits, of_motion=True), _limit_rows(limits, of_motion=False)
    criteria = ["taut", *moving, "regular", "below", *still]
    return [criteria.index(criterion) for criterion in ("taut", "regular", "below", *limits_set(limits))]
